"""What the samples of an acceleration may have lost: their order, signs or exponents."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vsr_core.arrays import Array

_SHORT, _OTHER_SIDE, _TURNS = 100, 0.05, 0.01
"""Samples below which nothing is told; times as far as to one side that shaking goes to the other,
at least; and share of its steps in which it turns."""

_JUMPY = 1.7
"""Second differences of an acceleration as multiples of its peak that are told: a sine's is, of
fewer than 4.2 samples a period. Of 19 records at 50 to 200 Hz it is 1.13 at most, and of 490
recorded shake-table motions 1.65 at 200 Hz."""

_IN_A_LINE, _LINES_AT_LEAST, _SEAMS = range(3, 13), 50, 2.0
"""Samples of a line in files of records, lines from which on their order shows, and how many times
as far a record may step from one to the next as within. Of 19 records at 50 to 200 Hz it is 1.25 at
most, of those with their lines shuffled or reversed 2.3 at least; of 490 recorded shake-table
motions 1.44 at 200 Hz, and above 2 of 4 at 100 Hz."""

_REPEATED = 20
"""Samples in a row that no shaking has a second time: of 490 recorded shake-table motions none."""


def doubts(values: Array, name: str) -> Iterator[str]:
    """What an acceleration may have lost that no shaking lacks, in words.

    Of 490 recorded shake-table motions each goes at least 0.25 times as far to one side of zero as
    to the other, and turns in a fifth of its steps; of 19 records in a thirtieth.

    Parameters
    ----------
    values : ndarray, shape (n,), in the unit of the file
    """
    values = values[np.isfinite(values)]
    if len(values) < _SHORT or not np.ptp(values):
        return
    steps, begin = np.diff(values), float(np.median(values[: max(1, len(values) // 100)]))
    size, peak = np.abs(values[values != 0.0]), float(np.abs(values - begin).max())
    less, more = sorted((abs(values.max()), abs(values.min())))
    one_side = values.min() * values.max() >= 0.0 or less < _OTHER_SIDE * more
    turns = np.count_nonzero(np.diff(np.sign(steps[steps != 0.0]))) / len(steps)
    leap = np.abs(steps[(values[1:] != 0.0) & (values[:-1] != 0.0)]).max(initial=0.0)
    there_and_back = np.abs(np.diff(steps)).max() / peak
    seams, number = max(_seams(steps), default=(0.0, 0))
    if not turns or (turns < _TURNS and leap > 0.5 * peak):
        yield f"{name} hardly turns: its samples may be sorted"
    elif one_side and np.abs(values).min() < _OTHER_SIDE * more:
        yield f"{name} is on one side of zero and reaches it: minus signs may be lost"
    elif not one_side and size.max() < 10.0 * size.min() and len(np.unique(size)) > _SHORT:
        yield f"{name} has numbers of one power of ten alone: their exponents may be lost"
    elif there_and_back > _JUMPY:
        yield (
            f"{name} jumps to and fro by {there_and_back:.2g} times its peak: numbers may be out "
            "of order, or have lost exponents or minus signs"
        )
    elif seams > _SEAMS:
        yield (
            f"{name} steps {seams:.2g} times as far after each {number} samples as between them: "
            "lines of its file may be out of order"
        )
    if again := _again(values, peak):
        yield f"{name} has {again} samples a second time: lines of its file may stand there twice"


def _seams(steps: Array) -> Iterator[tuple[float, int]]:
    """How much farther a record steps from a line to the next than within, by samples of a line."""
    for number in _IN_A_LINE:
        if len(steps) >= _LINES_AT_LEAST * number:
            lines = np.abs(steps[: len(steps) // number * number]).reshape(-1, number)
            mean = lines.mean(axis=0)
            yield float(mean.max() / max(np.median(mean), 1e-300)), number


def _again(values: Array, peak: float) -> int:
    """Samples of shaking that follow each other as others did before, to the last digit.

    None of a motion that repeats itself throughout, as a wave without an end.
    """
    parts = np.lib.stride_tricks.sliding_window_view(values, _REPEATED)
    shaken = np.flatnonzero(np.ptp(parts, axis=1) > _OTHER_SIDE * peak)
    ranks = np.unique(values, return_inverse=True)[1].astype(np.uint64)
    odd = np.random.default_rng(0).integers(1 << 63, size=_REPEATED, dtype=np.uint64) * 2 + 1
    marks = sum(ranks[at : at + len(parts)] * number for at, number in enumerate(odd))
    _, first = np.unique(marks[shaken], return_index=True)
    again = len(shaken) - len(first)
    return again + _REPEATED - 1 if 0 < again < 0.5 * len(shaken) else 0
