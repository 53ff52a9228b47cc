"""What the samples of an acceleration may have lost: their order, signs or exponents.

Rules are such as none of 19 earthquakes at 50 to 200 Hz (PEER) breaks, and few of 490 recorded
shake-table motions at 200 Hz do: what breaks one is told, not refused.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vsr_core.arrays import Array
from vsr_core.motions.digits import last, runs

_SHORT = 100
"""Samples below which nothing is told."""

_WEAK, _STRONG = 0.05, 0.2
"""Shares of the peak to which a motion comes back, and beyond which it goes."""


class _Motion(NamedTuple):
    """Samples, their steps, where they begin, and how far they go from there."""

    values: Array
    steps: Array
    begin: float
    peak: float


def doubts(values: Array, name: str) -> Iterator[str]:
    """What an acceleration has that shaking has not, in words.

    Parameters
    ----------
    values : ndarray, shape (n,), in the unit of the file
    """
    values = values[np.isfinite(values)]
    if len(values) < _SHORT or not np.ptp(values):
        return
    begin = float(np.median(values[: max(1, len(values) // 100)]))
    motion = _Motion(values, np.diff(values), begin, float(np.abs(values - begin).max()))
    rules = (
        _sorted,
        _unsigned,
        _of_one_power,
        _jumpy,
        _to_one_side,
        _alone,
        _in_other_lines,
        _straight,
    )
    if said := next(filter(None, (rule(motion) for rule in rules)), ""):
        yield f"{name} {said}"
    least = float(np.abs(motion.steps[motion.steps != 0.0]).min())
    if again := repeated(values, _REPEATED, max(_FAR * motion.peak, _DIGITS * least)):
        yield f"{name} has {again} samples a second time: lines of its file may stand there twice"


_TURNS, _LEAP = 0.01, 0.5
"""Share of its steps in which shaking turns, at least, unless it is smooth: a fifth of 490 motions,
a thirtieth of 19 earthquakes; and the step, by the peak, that is none of a smooth motion."""


def _sorted(motion: _Motion) -> str:
    values, steps = motion.values, motion.steps
    turns = np.count_nonzero(np.diff(np.sign(steps[steps != 0.0]))) / len(steps)
    leap = np.abs(steps[(values[1:] != 0.0) & (values[:-1] != 0.0)]).max(initial=0.0)
    told = not turns or (turns < _TURNS and leap > _LEAP * motion.peak)
    return "hardly turns: its samples may be sorted" if told else ""


def _on_one_side(motion: _Motion) -> bool:
    """Whether it is on one side of zero: 490 motions go 0.25 times as far to the other or more."""
    low, high = float(motion.values.min()), float(motion.values.max())
    less, more = sorted((abs(low), abs(high)))
    return low * high >= 0.0 or less < _WEAK * more


_AT_REST = 0.02
"""Share of its samples, at least, in which shaking is weak; about an offset it is so there, not at
zero."""


def _unsigned(motion: _Motion) -> str:
    size = np.abs(motion.values)
    told = _on_one_side(motion) and np.quantile(size, _AT_REST) < _WEAK * size.max()
    return "is on one side of zero and reaches it: minus signs may be lost" if told else ""


def _of_one_power(motion: _Motion) -> str:
    size = np.abs(motion.values[motion.values != 0.0])
    told = size.max() < 10.0 * size.min() and len(np.unique(size)) > _SHORT
    if not told or _on_one_side(motion):
        return ""
    return "has numbers of one power of ten alone: their exponents may be lost"


_SHAKES = 7
"""How often in a row a motion goes out and comes back on one side, without a sample on the other:
3 times in 19 earthquakes, more often than this in 5 of 490 motions."""


def _to_one_side(motion: _Motion) -> str:
    has_offset = abs(motion.begin) > _WEAK * motion.peak  # as of an instrument
    moving = motion.values - motion.begin if has_offset else motion.values
    moving = moving[moving != 0.0]
    stretch = np.concatenate([[0], np.cumsum(np.diff(np.sign(moving)) != 0.0)])
    strong = np.abs(moving) > _STRONG * motion.peak
    told = strong | (np.abs(moving) < _WEAK * motion.peak)
    strong, stretch = strong[told], stretch[told]
    begins = strong & np.concatenate([[True], ~strong[:-1] | (np.diff(stretch) != 0)])
    shakes = int(np.bincount(stretch[begins]).max(initial=0))
    said = f"shakes {shakes} times in a row to one side alone: minus signs may be lost"
    return said if shakes > _SHAKES else ""


_BESIDE, _AROUND, _ALONE = 8, 40, 4.0
"""Samples beside a peak that are of it, samples before and after those, and how many times as large
as these a peak may be: 1.9 times in 19 earthquakes, beyond this in 3 of 490 motions."""


def _alone(motion: _Motion) -> str:
    size = np.abs(motion.values - motion.begin)
    at = int(size.argmax())
    before = size[max(at - _AROUND, 0) : max(at - _BESIDE, 0)]
    after = size[at + _BESIDE + 1 :][:_AROUND]
    around = max(before.max(initial=0.0), after.max(initial=0.0))
    if size[at] <= _ALONE * around or not around:
        return ""
    return f"peaks {size[at] / around:.2g} times as high as before and after: exponents may be lost"


_JUMPY = 1.7
"""Second differences as multiples of the peak: a sine's are of fewer than 4.2 samples a period.
They are 1.13 in 19 earthquakes, 1.65 in 490 motions."""


def _jumpy(motion: _Motion) -> str:
    jump = np.abs(np.diff(motion.steps)).max() / motion.peak
    if jump <= _JUMPY:
        return ""
    said = (
        f"jumps to and fro by {jump:.2g} times its peak: numbers may be out of order, or have lost"
    )
    return f"{said} exponents or minus signs"


_IN_A_LINE, _LINES, _SEAMS = range(3, 13), 50, 2.0
"""Samples of a line in files of records, lines from which on their order shows, and how many times
as far a motion may step from one to the next as within: 1.25 times in 19 earthquakes, 2.3 with
their lines shuffled or reversed, 1.44 in 490 motions."""


def _in_other_lines(motion: _Motion) -> str:
    found = []
    for number in _IN_A_LINE:
        if len(motion.steps) >= _LINES * number:
            whole = motion.steps[: len(motion.steps) // number * number]
            mean = np.abs(whole.reshape(-1, number)).mean(axis=0)
            found.append((float(mean.max() / max(np.median(mean), 1e-300)), number))
    most, number = max(found, default=(0.0, 0))
    if most <= _SEAMS:
        return ""
    said = f"steps {most:.2g} times as far after each {number} samples as between them"
    return f"{said}: lines of its file may be out of order"


_LINE, _ROUNDING, _EXACT = 20, 2.0, 2e-5
"""Samples that no shaking has on a straight line over a twentieth of its peak, how many last digits
they may be off it, and the share of the peak above which these are too coarse to tell."""


def _straight(motion: _Motion) -> str:
    values, steps = motion.values, motion.steps
    off = _ROUNDING * float(last(values[:: max(1, len(values) // 200)]).max())
    if off > _EXACT * motion.peak:
        return ""
    for start, length in runs(np.abs(np.diff(steps)) <= off):
        far = abs(values[start + length + 1] - values[start])
        if length + 2 >= _LINE and far > _WEAK * motion.peak:
            return f"goes straight for {length + 2} samples: a gap may have been filled"
    return ""


_REPEATED, _FAR, _DIGITS = 10, 0.01, 200.0
"""Samples in a row, over so much of the peak and so many last digits, that stand there once."""


def repeated(values: Array, number: int, far: float) -> int:
    """Values that follow each other, to the last digit, as others did before.

    Parameters
    ----------
    number : int, how many in a row
    far : float, over which range they go at least
    """
    parts = np.lib.stride_tricks.sliding_window_view(values, number)
    sought = np.flatnonzero(np.ptp(parts, axis=1) > far)
    ranks = np.unique(values, return_inverse=True)[1].astype(np.uint64)
    odd = np.random.default_rng(0).integers(1 << 63, size=number, dtype=np.uint64) * 2 + 1
    marks = sum(ranks[at : at + len(parts)] * one for at, one in enumerate(odd))
    again = len(sought) - len(np.unique(marks[sought]))
    return again + number - 1 if again else 0
