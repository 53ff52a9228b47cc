"""Motions of a table in up to six axes: sampled ones, and cosine pulses on any axis.

The table's frame is the pedestal's: its origin is below the rock's centre of mass, and at the start
its axes are the world's. A motion takes that origin to (x, y, z) and turns the frame by

    R = Rz(yaw) Ry(pitch) Rx(roll),

roll first, about the world's axes. In the frame itself, at rate w and with the origin's absolute
acceleration a, a rock feels by ``acceleration`` what a table in translation would give it, R^T (a +
g z) - g z, and by ``w`` and its rate what ``engines`` add to that.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal, cast

import numpy as np
from numpy.typing import NDArray

from vsr_core import GRAVITY
from vsr_core.errors import Unfit
from vsr_core.motion import CosinePulse

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

Array = NDArray[np.float64]

Axis = Literal["x", "y", "z", "roll", "pitch", "yaw"]

AXES: tuple[Axis, ...] = ("x", "y", "z", "roll", "pitch", "yaw")

DEGREE = 5
"""Of the splines: the acceleration is then a cubic between samples and has a continuous slope."""

LEAST_SAMPLES = 8
"""Fewer tell nothing of an acceleration."""

UNRESTED = 0.05
"""Velocity at the ends of a sampled motion, as a share of its largest in any direction, that is
still rest."""

LOOKS = 8
"""Times at which a spline is looked at between two samples, for its peaks and integrals."""


class TableMotion(ABC):
    """Motion of a table in several axes; before and after ``[0, duration]`` it rests.

    It offers what a ``GroundMotion`` does, with several values at each time.
    """

    @property
    @abstractmethod
    def duration(self) -> float:
        """Length of the motion [s]."""

    @property
    @abstractmethod
    def shortest_time(self) -> float:
        """Time scale [s] that a time step has to resolve."""

    @property
    @abstractmethod
    def turns(self) -> bool:
        """Whether any of it is rotation."""

    @abstractmethod
    def course(self, t: Array, order: int) -> Array:
        """Derivative of ``order`` 0, 1 or 2 of x, y, z, roll, pitch and yaw at times ``t`` [s].

        Returns
        -------
        ndarray, shape (n, 6) [m, rad and seconds]
        """

    def place(self, t: Array) -> tuple[Array, Array]:
        """Where the table is: origin, shape (n, 3) [m], and rotation matrix, shape (n, 3, 3)."""
        course = self.course(t, 0)
        return course[:, :3], rotation(course[:, 3:])

    def velocity(self, t: Array) -> Array:
        """Velocity of the table's origin [m/s], shape (n, 3), world axes."""
        return self.course(t, 1)[:, :3]

    def acceleration(self, t: Array) -> Array:
        """What the table does to a rock on it, in the table's axes.

        Returns
        -------
        ndarray, shape (n, 3) or, if it turns, (n, 9)
            Acceleration [m/s^2] as of a table in translation, angular velocity [rad/s] and its
            rate [rad/s^2].
        """
        second = self.course(t, 2)
        if not self.turns:
            return second[:, :3]
        angles, rates = self.course(t, 0)[:, 3:], self.course(t, 1)[:, 3:]
        up = np.array([0.0, 0.0, GRAVITY])
        felt = np.einsum("nji,nj->ni", rotation(angles), second[:, :3] + up) - up
        return np.hstack([felt, *spin(angles, rates, second[:, 3:])])

    @cached_property
    def peak_acceleration(self) -> float:
        """Largest length of the acceleration [m/s^2]."""
        return float(self._lengths[1].max())

    @cached_property
    def peak_velocity(self) -> float:
        """Largest length of the acceleration's integral [m/s]: in translation the velocity's."""
        times = self.looks
        acceleration = self.acceleration(times)[:, :3]
        pieces = 0.5 * (acceleration[1:] + acceleration[:-1]) * np.diff(times)[:, None]
        return float(np.linalg.norm(np.cumsum(pieces, axis=0), axis=1).max())

    def remaining_impulse(self, t: float) -> float:
        """Integral of the length of the acceleration [m/s] from ``t`` [s] to the end.

        Of a motion that turns it bounds nothing, so it is infinite, unless the table rests level.
        """
        if self.turns:
            level = bool(np.allclose(self.course(np.array([self.duration]), 0)[0, 3:5], 0.0))
            return 0.0 if level and t >= self.duration else math.inf
        times, _, done = self._lengths
        return float(done[-1] - np.interp(t, times, done))

    @cached_property
    def _lengths(self) -> tuple[Array, Array, Array]:
        """Times, length of the acceleration at them and its integral so far."""
        times = self.looks
        length = np.linalg.norm(self.acceleration(times)[:, :3], axis=1)
        pieces = 0.5 * (length[1:] + length[:-1]) * np.diff(times)
        return times, length, np.concatenate([[0.0], np.cumsum(pieces)])

    @property
    @abstractmethod
    def looks(self) -> Array:
        """Times, ascending [s], close enough to see its peaks and take its integrals."""


@dataclass(frozen=True)
class AxisPulse(TableMotion):
    """The single cosine pulse on one axis.

    Attributes
    ----------
    axis : one of ``AXES``
    peak : float [m/s^2 or rad/s^2], peak acceleration; a negative one mirrors the pulse
    ratio : float [s], of peak velocity to peak acceleration

    Examples
    --------
    >>> pulse = AxisPulse("pitch", 2.0, 0.5)
    >>> round(float(pulse.course(np.array([pulse.duration / 2]), 0)[0, 4]), 9)
    1.0
    """

    axis: Axis
    peak: float
    ratio: float

    @cached_property
    def _pulse(self) -> CosinePulse:
        return CosinePulse(self.peak, self.ratio)

    @property
    def duration(self) -> float:
        """Length 2 pi times the ratio [s]."""
        return self._pulse.duration

    @property
    def shortest_time(self) -> float:
        """Time for one radian of the pulse [s]."""
        return self.ratio

    @property
    def turns(self) -> bool:
        """Whether it is on roll, pitch or yaw."""
        return AXES.index(self.axis) >= 3

    @property
    def looks(self) -> Array:
        """A thousand times."""
        return np.linspace(0.0, self.duration, 1001)

    def course(self, t: Array, order: int) -> Array:
        """Zero on the other axes."""
        pulse = self._pulse
        value = (pulse.displacement, pulse.velocity, pulse.acceleration)[order](t)
        return np.where(np.array(AXES) == self.axis, value[:, None], 0.0)

    def remaining_impulse(self, t: float) -> float:
        """As of the pulse, exactly; infinite for a rotation that is not over."""
        if self.turns:
            return super().remaining_impulse(t)
        return self._pulse.remaining_impulse(t)


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
        times = self.looks
        second, third = (np.sqrt(np.mean(self._splines[n](times) ** 2, axis=0)) for n in (2, 3))
        moves = third > 0.0
        return float(min((second[moves] / third[moves]).min(initial=math.inf), self.duration))

    @cached_property
    def turns(self) -> bool:
        """Whether any angle is not zero."""
        return bool(self.samples[:, 3:].any())

    @cached_property
    def looks(self) -> Array:
        """``LOOKS`` in each interval."""
        times = self.time - self.time[0]
        return np.interp(np.arange(LOOKS * (len(times) - 1) + 1) / LOOKS, range(len(times)), times)

    def course(self, t: Array, order: int) -> Array:
        """By the splines; at rest outside."""
        value = self._splines[order](np.clip(t, 0.0, self.duration))
        if order:
            value = np.where(((t >= 0.0) & (t <= self.duration))[:, None], value, 0.0)
        return cast(Array, value)

    def scaled(self, factor: float) -> SampledMotion:
        """All axes times ``factor``."""
        return replace(self, samples=factor * self.samples)

    @cached_property
    def _splines(self) -> list[BSpline]:
        from scipy.interpolate import make_interp_spline

        rest = [(1, np.zeros(6)), (3, np.zeros(6))]
        times = self.time - self.time[0]
        spline = make_interp_spline(times, self.samples, DEGREE, bc_type=(rest, rest))
        return [spline, *(spline.derivative(order) for order in (1, 2, 3))]


def sampled(time: Array, samples: Array) -> SampledMotion:
    """A motion through samples, checked.

    Parameters
    ----------
    time : ndarray, shape (n,) [s]
    samples : ndarray, shape (n, 6) [m, rad], x, y, z, roll, pitch, yaw

    Raises
    ------
    Unfit
        For too few samples, values that are not numbers, times that do not ascend, angles that
        were meant in degrees, or a table that moves at the start or the end.
    """
    if len(time) < LEAST_SAMPLES:
        raise Unfit(
            f"{len(time)} samples", f"{LEAST_SAMPLES} are needed at least", "sample it more closely"
        )
    if not (np.isfinite(time).all() and np.isfinite(samples).all()):
        raise Unfit("values that are not numbers", "all must be finite", "fill its gaps")
    if (np.diff(time) <= 0.0).any():
        at = int(np.argmax(np.diff(time) <= 0.0)) + 1
        raise Unfit(f"time {time[at]:g} s in sample {at + 1}", "times ascend", "sort the samples")
    samples = np.hstack([samples[:, :3], np.unwrap(samples[:, 3:], axis=0)])
    tilt = float(np.abs(samples[:, 3:5]).max())
    if tilt > 2.0 * math.pi:
        raise Unfit(
            f"roll or pitch of {tilt:.4g} rad",
            "no table tilts by more than a turn",
            "name the unit, e.g. roll [degree]",
        )
    _check_ends(time, samples)
    return SampledMotion(np.asarray(time, float), samples)


def _check_ends(time: Array, samples: Array) -> None:
    """The table must come from rest and end at rest."""
    slopes = np.gradient(samples - samples[0], time, axis=0, edge_order=2)
    largest = np.abs(slopes).reshape(-1, 2, 3).max(axis=(0, 2)).repeat(3)
    for where, slope in (("start", slopes[0]), ("end", slopes[-1])):
        moving = np.abs(slope) > UNRESTED * largest
        if moving.any():
            axis = int(np.argmax(moving))
            raise Unfit(
                f"{AXES[axis]} moving at {slope[axis]:.3g} a second at the {where}",
                "the table rests before and after the motion",
                "let it start and end at rest",
            )


def rotation(angles: Array) -> Array:
    """Rotation matrices Rz(yaw) Ry(pitch) Rx(roll), shape (n, 3, 3), of angles, shape (n, 3)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(angles.T), np.sin(angles.T)
    rows = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def spin(angles: Array, rates: Array, second: Array) -> tuple[Array, Array]:
    """Angular velocity [rad/s] and its rate [rad/s^2] in the table's axes, shape (n, 3) each.

    Of roll r, pitch p and yaw y it is (r' - y' sin p, p' cos r + y' cos p sin r, -p' sin r + y' cos
    p cos r), and the rate of its components.
    """
    (cr, cp, _), (sr, sp, _) = np.cos(angles.T), np.sin(angles.T)
    (r1, p1, y1), (r2, p2, y2) = rates.T, second.T
    velocity = np.array([r1 - y1 * sp, p1 * cr + y1 * cp * sr, -p1 * sr + y1 * cp * cr])
    rate = np.array(
        [
            r2 - y2 * sp - y1 * p1 * cp,
            p2 * cr - p1 * r1 * sr + y2 * cp * sr - y1 * p1 * sp * sr + y1 * r1 * cp * cr,
            -p2 * sr - p1 * r1 * cr + y2 * cp * cr - y1 * p1 * sp * cr - y1 * r1 * cp * sr,
        ]
    )
    return velocity.T, rate.T
