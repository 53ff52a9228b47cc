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


def runs(flags: Mask) -> list[tuple[int, int]]:
    """Start and length of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return [(int(a), int(b - a)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
