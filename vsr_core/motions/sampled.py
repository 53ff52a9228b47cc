"""Motion of a table in six axes through samples."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.motions import even_times
from vsr_core.motions.six_axes import AXES, TableMotion

DEGREE = 5
"""Of the splines: the acceleration is then a cubic between samples and has a continuous slope."""

LEAST_SAMPLES, MOST_SAMPLES = 8, 200_000
"""Fewer do not define an acceleration; of so many, over 16 minutes at 200 a second, the splines of
six axes take 0.9 GB."""

REST = 0.05
"""Velocity at the ends of a sampled motion that still counts as rest, as a share of its largest in
any direction."""

SHORTEST_STEP, LONGEST_STEP = 1e-6, 10.0
"""Steps [s] between samples of a table's motion: none is commanded faster or more rarely."""

NEAREST, FARTHEST = 1e-9, 1e4
"""Largest distance [m] or angle [rad] from a table's zero: an encoder tells no less, and no table
goes further."""

SUBDIVISION = 8
"""Parts into which the time between two samples is divided for peaks and integrals."""


@dataclass(frozen=True, eq=False)
class SampledMotion(TableMotion):
    """Six axes through given samples, by splines of degree 5.

    The table rests before and after, so that the first derivative is zero at both ends, and the
    third too: an acceleration may begin with a jump, as a pulse's does, from a level start.

    Attributes
    ----------
    time : ndarray, shape (n,) [s], ascending
    samples : ndarray, shape (n, 6) [m, rad], x, y, z, roll, pitch, yaw
    """

    time: Array
    samples: Array

    @property
    def duration(self) -> float:
        """From the first sample to the last [s]."""
        return float(self.time[-1] - self.time[0])

    @cached_property
    def shortest_time(self) -> float:
        """Least time, among the axes, in which an acceleration changes by its own size [s]."""
        times = self.fine_times
        second, third = (np.sqrt(np.mean(self._splines[n](times) ** 2, axis=0)) for n in (2, 3))
        moves = third > 0.0
        return float(min((second[moves] / third[moves]).min(initial=math.inf), self.duration))

    @cached_property
    def turns(self) -> bool:
        """Whether any angle is not zero."""
        return bool(self.samples[:, 3:].any())

    @cached_property
    def fine_times(self) -> Array:
        """``SUBDIVISION`` in each interval."""
        times = self.time - self.time[0]
        places = np.arange(SUBDIVISION * (len(times) - 1) + 1) / SUBDIVISION
        return np.interp(places, range(len(times)), times)

    def derivative(self, t: Array, order: int) -> Array:
        """By the splines; at rest outside."""
        value = self._splines[order](np.clip(t, 0.0, self.duration))
        if order:
            value = np.where(((t >= 0.0) & (t <= self.duration))[:, None], value, 0.0)
        return cast(Array, value)

    def scaled(self, factor: float) -> SampledMotion:
        """All axes times ``factor``, but for the heading in which the table begins."""
        samples = factor * self.samples
        samples[:, 5] += (1.0 - factor) * self.samples[0, 5]
        return replace(self, samples=samples)

    @cached_property
    def _splines(self) -> list[BSpline]:
        rest = [(1, np.zeros(6)), (3, np.zeros(6))]
        times = self.time - self.time[0]
        spline = make_interp_spline(times, self.samples, DEGREE, bc_type=(rest, rest))
        return [spline, *(spline.derivative(order) for order in (1, 2, 3))]


def sampled(time: Array, samples: Array) -> SampledMotion:
    """A motion through samples, checked.

    Parameters
    ----------
    time : ndarray, shape (n,) [s]
    samples : ndarray, shape (n, 6) [m, rad]
        Of x, y, z, roll, pitch and yaw; angles may wrap at a turn.

    Raises
    ------
    InvalidInput
        For too few or too many samples, values that are not numbers, times in no equal steps,
        angles that were meant in degrees, or a table that moves at the start or the end.
    """
    if len(time) < LEAST_SAMPLES:
        raise InvalidInput(
            f"{len(time)} samples", f"{LEAST_SAMPLES} are needed at least", "sample it more closely"
        )
    if len(time) > MOST_SAMPLES:
        given, rule = f"{len(time)} samples", f"a table's motion has at most {MOST_SAMPLES}"
        raise InvalidInput(given, rule, "cut it to the shaking, or resample it")
    if not (np.isfinite(time).all() and np.isfinite(samples).all()):
        raise InvalidInput("values that are not numbers", "all must be finite", "fill its gaps")
    if (np.diff(time) <= 0.0).any():
        at = int(np.argmax(np.diff(time) <= 0.0)) + 1
        raise InvalidInput(
            f"time {time[at]:g} s in sample {at + 1}", "times ascend", "sort the samples"
        )
    _check_magnitudes(np.diff(time), samples)
    time = even_times.even(np.asarray(time, float))  # rounded ones would shake the table
    samples = np.hstack([samples[:, :3], np.unwrap(samples[:, 3:], axis=0)])
    tilt = float(np.abs(samples[:, 3:5]).max())
    if tilt > 0.5 * math.pi:
        given, rule = f"roll or pitch of {tilt:.4g} rad", "no table tilts beyond the vertical"
        raise InvalidInput(given, rule, "correct the unit, e.g. roll [degree]")
    _check_ends(time, samples)
    return SampledMotion(time, samples)


def _check_magnitudes(steps: Array, samples: Array) -> None:
    """Times and ways must be those of a table, in seconds, metres and radians."""
    if not (steps.min() >= 0.999 * SHORTEST_STEP and steps.max() <= LONGEST_STEP):
        given = f"time steps of {steps.min():.3g} to {steps.max():.3g} s"
        rule = f"they are from {SHORTEST_STEP:g} to {LONGEST_STEP:g} s"
        raise InvalidInput(given, rule, "correct the unit, e.g. time [ms]")
    travel = float(np.abs(samples).max())
    if travel > FARTHEST or 0.0 < travel < NEAREST:
        given = f"a table that moves {travel:.3g} m or rad from its zero"
        rule = f"it moves between {NEAREST:g} and {FARTHEST:g}"
        raise InvalidInput(given, rule, "correct the unit, e.g. x [mm]")


def _check_ends(time: Array, samples: Array) -> None:
    """The table must come from rest and end at rest."""
    slopes = np.gradient(samples - samples[0], time, axis=0, edge_order=2)
    largest = np.abs(slopes).reshape(-1, 2, 3).max(axis=(0, 2)).repeat(3)
    for where, slope in (("start", slopes[0]), ("end", slopes[-1])):
        moving = np.abs(slope) > REST * largest
        if moving.any():
            axis = int(np.argmax(moving))
            given = f"{AXES[axis]} moving at {slope[axis]:.3g} a second at the {where}"
            rule = "the table rests before and after the motion"
            raise InvalidInput(given, rule, "let it start and end at rest")
