"""How exact the numbers of a file are, and which of them are no samples of a motion."""

from __future__ import annotations

import math
import re

import numpy as np
from scipy.ndimage import maximum_filter, maximum_filter1d, uniform_filter1d

from vsr_core.arrays import Array, Mask
from vsr_core.errors import InvalidInput

_MOST = 30
"""Decimals that any number may have."""

_MARK = re.compile(r"-?((?=(\.?9){3})9+(\.9+)?|3276[78])")
"""What loggers and tables write for a sample that is missing: -999, 9999.99, -32768."""

_LONE = 5.0
"""Times what is around from which on a peak is none."""

_STILL, _HELD = 0.1, 2.5
"""Share of the largest step that is none, as that of a last digit that flickers; how much harder a
motion may stop and start than it bends elsewhere. Of 490 recorded shake-table motions none does."""

_STRAIGHT, _LINES = 0.005, 2.5
"""Share of the largest bend about it that is none; lines from which on they join the values."""

_FEWEST = 10
"""Digits from rest to peak of a record. Of 59 records, PGV/PGA was 0.85 to 1.31 times what it is of
3 digits; of 5 it was more than a tenth off of 5 records, of 12 of one."""

_STANDS, _FOR = 5, 0.05
"""Steps without a change, and their time [s], that hold a record amid shaking ..."""

_BESIDE, _AMID = 8, 8.0
"""... if so many steps before and after them are, in the median, of so many last digits. Of 490
recorded shake-table motions none is so at 25 to 200 Hz, nor rounded to 30 steps from rest to peak
or more, nor interpolated linearly from 200 to 1000 Hz."""

_RESTS, _JUMPS = 0.01, 1.5
"""Share of the peak within which a value is rest; times the steps beside from which on a step to it
or from it is a jump, if it is of twice that share."""

_OFF_REST, _OFF_ZERO, _ABRUPT = 0.05, 0.001, 0.02
"""Share of the peak beyond which a value that is held to an end is no rest, and where shaking ends
there with steps of so much of the peak."""

_JOINED = ((80, 0.3), (320, 0.8))
"""Samples about the hardest bends, and share of them that does not bend where lines join them. Of
490 recorded shake-table motions one is so at 50 Hz, and none at 100 and 200 Hz."""


def last(values: Array) -> Array:
    """Unit in the last digit written of each value: of fixed decimals, or of fixed digits.

    Values of single precision are no more exact than that.

    Examples
    --------
    >>> last(np.array([0.0, 0.25, 20.75])).tolist(), last(np.array([0.125, 20.1])).tolist()
    ([0.01, 0.01, 0.01], [0.001, 0.1])
    """
    parts = [f"{abs(value):.11e}".split("e") for value in values.tolist()]
    leading = np.array([int(power) for _, power in parts])
    written = np.array([len(number.rstrip("0").replace(".", "")) for number, _ in parts])
    decimals = np.clip(written - 1 - leading, 0, _MOST) * (values != 0.0)
    digits = np.max(leading + 1 + decimals)
    fixed = np.where(values == 0.0, 0.0, 10.0 ** (leading + 1 - digits))
    unit = np.maximum(fixed, 10.0 ** -decimals.max())
    single = np.abs(values).astype(np.float32)
    return np.maximum(unit, np.spacing(single)) if (single == np.abs(values)).all() else unit


def refuse_mark(values: Array, name: str, step: float) -> None:
    """Refuse an extreme that is all nines and far from what is beside it: it is no sample.

    Parameters
    ----------
    values : ndarray, shape (n,), as they are in the file
    name : str, what they are, or their unit
    step : float [s]

    Raises
    ------
    InvalidInput
    """
    for extreme in (float(values.max()), float(values.min())):
        start, length = runs(values == extreme)[0]
        steps = np.abs(np.diff(values[max(start - 1, 0) : start + length + 1]))
        away = float(steps[steps > 0.0].min(initial=math.inf))
        written = (f"{extreme:.12g}", f"{extreme:.6g}")  # the latter of single precision
        if away > 0.5 * abs(extreme) and (number := next(filter(_MARK.fullmatch, written), "")):
            given = f"{number} ({name}) at {start * step:.4g} s"
            rule = "no mark of a missing sample stands among the numbers"
            raise InvalidInput(given, rule, "leave out what is missing, or fill it")


def refuse_spike(values: Array, name: str, step: float) -> None:
    """Refuse a sample of an acceleration, or up to three, far beyond those beside it.

    Of 490 recorded shake-table motions no peak is 5 times as large as the 20 samples before it and
    after it but for the next, at 25 to 200 Hz.

    Raises
    ------
    InvalidInput
    """
    size = np.abs(values - np.median(values))
    beside = maximum_filter(size, footprint=np.abs(np.arange(-20, 21)) > 1, mode="constant")
    lone = np.flatnonzero((size > _LONE * beside) & (size > 0.5 * size.max()))
    if len(lone):
        at = int(lone[0])
        given = f"{values[at]:.6g} ({name}) at {at * step:.4g} s, far beyond what is beside it"
        raise InvalidInput(given, "a peak is of several samples", "leave it out, or fill it")


def refuse_lines(values: Array, name: str, times: Array) -> None:
    """Refuse positions that straight lines join: they were sampled at another rate.

    Raises
    ------
    InvalidInput
    """
    turn = np.diff(values, 2)
    bend = np.abs(turn)
    for size, least in _JOINED:
        straight, starts = np.zeros((2, len(bend)))
        for start, length in runs(bend < _STRAIGHT * maximum_filter1d(bend, size)):
            ends = turn[max(start - 1, 0)], turn[min(start + length, len(turn) - 1)]
            if ends[0] * ends[1] > 0.0:  # else it is a zero of the acceleration, or rest
                straight[start : start + length] = starts[start] = 1.0
        share, lines = (
            uniform_filter1d(found, size, mode="constant") for found in (straight, starts)
        )
        joined = (bend > 0.5 * bend.max()) & (share > least) & (lines * size > _LINES)
        if joined.any():
            at = int(joined.argmax()) + 1
            given = f"positions that straight lines join about {times[at]:.6g} s ({name})"
            rule = "they are samples of a motion, which bends between them, too"
            remedy = "give those of the first rate, or more digits, or join them by a spline"
            raise InvalidInput(given, rule, remedy)


def refuse_held(values: Array, name: str, times: Array) -> None:
    """Refuse positions that stop so abruptly, for three samples or more, as they bend nowhere else.

    So does a way that was cut off at the end of a range, or one whose logger stood still. From rest
    a pulse begins as hard as it bends later, not harder.

    Raises
    ------
    InvalidInput
    """
    size, corners = np.abs(np.diff(values, 2)), np.zeros(len(values), dtype=bool)
    steps = np.abs(np.diff(values))
    for start, length in runs(steps <= _STILL * steps.max()):
        if length > 1:
            corners[[max(start - 1, 0), start]] = True
            corners[[start + length, min(start + length + 1, len(values) - 1)]] = True
    held, others = size * corners[1:-1], size * ~corners[1:-1]
    if held.max(initial=0.0) > _HELD * others.max(initial=0.0):
        at = int(held.argmax()) + 1
        given = (
            f"positions that stand still from or to {times[at]:.6g} s ({name} {values[at]:.10g})"
        )
        rule = f"they bend there {_HELD:g} times as much as elsewhere at most"
        raise InvalidInput(given, rule, "leave out what is cut off or held there, or fill it")


def refuse_coarse(values: Array, name: str) -> None:
    """Refuse a record of few digits: its samples are the same step times whole numbers.

    Raises
    ------
    InvalidInput
    """
    steps = np.abs(np.diff(values))
    least = steps[steps > 0.0].min()
    most = float(np.abs(values - np.median(values)).max() / least)
    if round(most, 3) < _FEWEST and np.count_nonzero(steps) > 2 * _FEWEST:  # else made of pushes
        whole = (values - values[0]) / least
        if np.abs(whole - np.rint(whole)).max() < 0.01:
            given = f"samples ({name}) in steps of {least:.4g}, {most:.3g} from rest to peak"
            rule = f"they are {_FEWEST} or more, or rounding changes PGV/PGA by up to a third"
            raise InvalidInput(given, rule, "write them with more digits")


def refuse_still(values: Array, name: str, step: float) -> None:
    """Refuse samples that stay the same amid shaking: the last is held, or zeros fill a gap.

    By rounding they do where shaking is slow. At rest they may, as between pulses, which come to it
    by a step like their others or, as a cosine, from a peak.

    Raises
    ------
    InvalidInput
    """
    steps = np.abs(np.diff(values))
    least, middle = steps[steps > 0.0].min(), np.median(values)
    rests = np.array([0.0, middle, values[0], values[-1]])
    near = _RESTS * np.abs(values - middle).max()
    for start, length in runs(steps == 0.0):
        end = start + length
        if length < _STANDS or length * step < 0.999 * _FOR:
            continue
        if not (start > _BESIDE and end < len(steps) - _BESIDE):
            if _held_at_an_end(values, start, end, least):
                given = f"{length + 1} samples in a row of {values[start]:.6g} ({name}) at an end"
                rule = "the last or first of the shaking is held there"
                raise InvalidInput(given, rule, "cut them off")
            continue
        beside = values[start - 1 - _BESIDE : start], values[end + 1 : end + 2 + _BESIDE][::-1]
        pace = min(np.median(np.abs(np.diff(side))) for side in beside)
        if pace < _AMID * least or pace < _AMID * last(np.concatenate(beside)).max():
            continue
        if np.abs(values[start] - rests).min() > near or _jumps(values[start], beside, 2.0 * near):
            given = f"{length + 1} samples in a row of {values[start]:.6g} ({name}) from "
            given += f"{start * step:.4g} s on, amid shaking"
            rule = "an instrument does not stand still while it is shaken"
            raise InvalidInput(given, rule, "they fill a gap: cut the record before or after it")


def _held_at_an_end(values: Array, start: int, end: int, least: float) -> bool:
    """Whether samples that stay the same up to an end are of the shaking, and no rest."""
    backwards = start <= _BESIDE
    if backwards:
        values, start, end = values[::-1], len(values) - 1 - end, len(values) - 1 - start
    beside = values[max(start - _BESIDE, 0) : start + 1]
    if end < len(values) - 1 - _BESIDE or len(beside) <= _BESIDE:
        return False
    begin = np.median(values[: max(1, start // 50)])
    away = min(abs(values[end]), abs(values[end] - begin))
    pace = np.median(np.abs(np.diff(beside)))
    peak, shaken = np.abs(values - begin).max(), pace > _AMID * least
    off_rest = away > (_OFF_REST if pace < _ABRUPT * peak else _OFF_ZERO) * peak
    return bool(off_rest and shaken)


def _jumps(rest: float, beside: tuple[Array, Array], least: float) -> bool:
    """Whether samples, towards a rest, end with a step to it like no other, but not at a peak."""
    sizes = [np.abs(side - rest) for side in beside]
    jumps = any(
        size[-1] > max(_JUMPS * np.abs(np.diff(side)).max(), least)
        for size, side in zip(sizes, beside, strict=True)
    )
    return jumps and not all(size[-1] == size.max() for size in sizes)


def runs(flags: Mask) -> list[tuple[int, int]]:
    """Start and length of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return [(int(a), int(b - a)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
