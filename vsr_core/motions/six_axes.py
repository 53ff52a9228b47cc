"""Motions of a table in up to six axes, and cosine pulses on any of them.

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
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.motions.cosine_pulse import CosinePulse

Axis = Literal["x", "y", "z", "roll", "pitch", "yaw"]

AXES: tuple[Axis, ...] = ("x", "y", "z", "roll", "pitch", "yaw")


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


@dataclass(frozen=True)
class AxisPulses(TableMotion):
    """Cosine pulses that begin together, each on its axis; on one axis they add.

    Attributes
    ----------
    pulses : tuple of AxisPulse, one at least
    """

    pulses: tuple[AxisPulse, ...]

    @property
    def duration(self) -> float:
        """Length of the longest [s]."""
        return max(pulse.duration for pulse in self.pulses)

    @property
    def shortest_time(self) -> float:
        """Time for one radian of the shortest [s]."""
        return min(pulse.shortest_time for pulse in self.pulses)

    @property
    def turns(self) -> bool:
        """Whether one of them is on roll, pitch or yaw."""
        return any(pulse.turns for pulse in self.pulses)

    @property
    def looks(self) -> Array:
        """Those of all of them."""
        return np.unique(np.concatenate([pulse.looks for pulse in self.pulses]))

    def course(self, t: Array, order: int) -> Array:
        """Sum of theirs."""
        return np.sum([pulse.course(t, order) for pulse in self.pulses], axis=0)

    def remaining_impulse(self, t: float) -> float:
        """Sum of theirs, which is no less than that of their sum; infinite as a rotation's is."""
        if self.turns:
            return super().remaining_impulse(t)
        return sum(pulse.remaining_impulse(t) for pulse in self.pulses)


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
