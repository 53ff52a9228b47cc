"""What the digits tell in which numbers are written: how exact they are, and that one is none."""

from __future__ import annotations

import math
import re

import numpy as np

from vsr_core.arrays import Array, Mask
from vsr_core.errors import InvalidInput

_MOST = 30
"""Decimals that any number may have."""

_NINES = re.compile(r"-?9{3,}\.?9*")
"""What loggers and tables write for a sample that is missing: -999, 9999.99."""


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
    in_single = bool((values == values.astype(np.float32)).all())
    return np.maximum(unit, np.abs(values) * (2.0**-24 if in_single else 0.0))


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
    for extreme in (values.max(), values.min()):
        number = f"{extreme:.6g}"
        start, length = runs(values == extreme)[0]
        steps = np.abs(np.diff(values[max(start - 1, 0) : start + length + 1]))
        if _NINES.fullmatch(number) and steps[steps > 0.0].min(initial=math.inf) > abs(extreme) / 2:
            given = f"{number} ({name}) at {start * step:.4g} s"
            rule = "no mark of a missing sample stands among the numbers"
            raise InvalidInput(given, rule, "leave out what is missing, or fill it")


def runs(flags: Mask) -> list[tuple[int, int]]:
    """Start and length of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return [(int(a), int(b - a)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
