"""Times in equal steps: of records, of tables' motions, and of tests on a table."""

from __future__ import annotations

import numpy as np

from vsr_core.arrays import Array, Indices
from vsr_core.errors import InvalidInput
from vsr_core.motions import digits

UNEVEN = 0.02
"""Farthest time from an even grid, as a share of the step."""

COARSE = 0.3
"""The same where the times are written with too few digits, at most."""

MOST_GAPS = 0.1
"""Gaps, as a share of the steps: more are of another rate, with few digits."""

_ROUNDING = 1e-6


def places(times: Array) -> tuple[Indices, float]:
    """Places of ascending times on an even grid, and its step [s]; some may be left out.

    Raises
    ------
    InvalidInput
        If a time is between two places, or they may be of another rate.
    """
    elapsed, written = times - times[0], digits.last(times)
    complete = _complete(elapsed, float(written.min()))
    interval = _interval(elapsed, float(written[-1]))
    found = np.rint(elapsed / interval).astype(np.int64)
    late = np.abs(elapsed - found * interval) / interval
    allowed = np.clip(written / interval, UNEVEN, COARSE)
    fits = not ((late > allowed).any() or (np.diff(found) < 1).any())
    lost = int(found[-1]) + 1 - len(found)
    if complete and not (fits and lost):
        return np.arange(len(times)), complete
    if not fits:
        raise InvalidInput(
            f"time steps that differ: one sample is {late.max():.0%} of a step of "
            f"{1e3 * interval:.4g} ms from its place",
            f"all are equal to {UNEVEN:.0%}, or to the last digit that is written",
            "resample the record to equal steps, band-limited",
        )
    gaps = int((np.diff(found) > 1).sum())
    if lost and (complete or gaps > MOST_GAPS * len(found)):
        other = f" or {1.0 / complete:.4g} Hz with none left out" if complete else ""
        raise InvalidInput(
            f"times that are {1.0 / interval:.4g} Hz with {lost} left out{other}",
            f"one rate fits them, with gaps in at most {MOST_GAPS:.0%} of the steps",
            "write the times with more digits, or resample it to equal steps",
        )
    return found, interval


def step(times: Array) -> float:
    """The step [s] of ascending times of which none is left out.

    Raises
    ------
    InvalidInput
    """
    found, interval = places(times)
    if (lost := int(found[-1]) + 1 - len(found)) > 0:
        at = float(times[int(np.argmax(np.diff(found) > 1))])
        given = f"{lost} times left out, after {at:g} s, in steps of {1e3 * interval:.4g} ms"
        raise InvalidInput(given, "each step has its sample", "export it again, or resample it")
    return interval


def even(times: Array) -> Array:
    """Ascending times [s] in equal steps, as they were before they were rounded.

    Raises
    ------
    InvalidInput
        As of `step`.
    """
    return np.asarray(times[0] + step(times) * np.arange(len(times)))


def _complete(elapsed: Array, written: float) -> float | None:
    """Step [s] of times none of which is left out, to the digits that are ``written``.

    It is a whole number of samples a second or of tenths of a millisecond: any other may be one of
    these with some left out.
    """
    count, end = np.arange(len(elapsed)), float(elapsed[-1])
    last = len(elapsed) - 1
    for step in (1.0 / max(round(last / end), 1), round(end / last, 4)):
        off = (elapsed - count * step) / written
        if abs(off[-1]) <= 0.5 + _ROUNDING and np.ptp(off) <= 1.0 + _ROUNDING:
            return step
    return None


def _interval(elapsed: Array, written: float) -> float:
    """Step [s] of rounded times, from ever longer spans, so that none is lost count of.

    A whole number of samples a second is taken, if it agrees to the digits that are ``written``.
    """
    interval, last = float(np.median(np.diff(elapsed))), len(elapsed) - 1
    at = 1
    while at < 2 * last:
        end = float(elapsed[min(at, last)])
        if number := round(end / interval):  # else the second time is too near to the first
            interval = end / number
        at *= 2
    rate = round(1.0 / interval)
    if rate and abs(round(end / interval) / rate - end) <= written:
        return 1.0 / rate
    return interval
