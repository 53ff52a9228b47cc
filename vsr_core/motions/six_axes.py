"""Motions of a table in up to six axes, and cosine pulses on any of them.

The table's frame is the pedestal's: its origin is below the rock's centre of mass, and at the start
its axes are the world's. A motion takes that origin to (x, y, z) and turns the frame by

    R = Rz(yaw) Ry(pitch) Rx(roll),

roll first, about the world's axes. Seen in that frame, with a the absolute acceleration of its
origin, the table acts on a rock as one in translation with R^T (a + g z) - g z would; what its
angular velocity and the rate of that add is up to ``engines``.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from scipy.integrate import cumulative_trapezoid

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.motions.pulses import CosinePulse

Axis = Literal["x", "y", "z", "roll", "pitch", "yaw"]

AXES: tuple[Axis, ...] = ("x", "y", "z", "roll", "pitch", "yaw")


class TableMotion(GroundMotion):
    """Motion of a table in several axes; before and after ``[0, duration]`` it rests."""

    @property
    def columns(self) -> int:
        """9 if it turns, else 3."""
        return 9 if self.turns else 3

    @property
    @abstractmethod
    def turns(self) -> bool:
        """Whether any of it is rotation."""

    @property
    @abstractmethod
    def fine_times(self) -> Array:
        """Times [s], ascending, close enough for its peaks and integrals."""

    @abstractmethod
    def derivative(self, t: Array, order: int) -> Array:
        """Position of the table and its derivatives.

        Parameters
        ----------
        t : ndarray, shape (n,) [s]

        Returns
        -------
        ndarray, shape (n, 6) [m, rad and seconds]
            Of x, y, z, roll, pitch and yaw.
        """

    def velocity(self, t: Array) -> Array:
        """Velocity of the table's origin [m/s], shape (n, 3), world axes."""
        return self.derivative(t, 1)[:, :3]

    def acceleration(self, t: Array) -> Array:
        """What the table does to a rock on it, in the table's axes.

        Parameters
        ----------
        t : ndarray, shape (n,) [s]

        Returns
        -------
        ndarray, shape (n, 3) or, if it turns, (n, 9)
            Acceleration [m/s^2] as of a table in translation, angular velocity [rad/s] and its
            rate [rad/s^2].
        """
        second = self.derivative(t, 2)
        if not self.turns:
            return second[:, :3]
        angles, rates = self.derivative(t, 0)[:, 3:], self.derivative(t, 1)[:, 3:]
        up = np.array([0.0, 0.0, GRAVITY])
        felt = np.einsum("nji,nj->ni", rotation(angles), second[:, :3] + up) - up
        return np.hstack([felt, *angular_velocity(angles, rates, second[:, 3:])])

    @cached_property
    def peak_acceleration(self) -> float:
        """Largest length of the acceleration [m/s^2]."""
        return float(np.linalg.norm(self._accelerations, axis=1).max())

    @cached_property
    def peak_velocity(self) -> float:
        """Largest length of the acceleration's integral [m/s]: in translation the velocity's."""
        integral = cumulative_trapezoid(self._accelerations, self.fine_times, axis=0)
        return float(np.linalg.norm(integral, axis=1).max())

    @cached_property
    def _accelerations(self) -> Array:
        """At the fine times, shape (n, 3)."""
        return self.acceleration(self.fine_times)[:, :3]


@dataclass(frozen=True)
class AxisPulse:
    """The single cosine pulse on one axis.

    Attributes
    ----------
    peak : float [m/s^2 or rad/s^2], peak acceleration; a negative one mirrors the pulse
    ratio : float [s], of peak velocity to peak acceleration
    """

    axis: Axis
    peak: float
    ratio: float

    @property
    def pulse(self) -> CosinePulse:
        """The pulse, in metres or radians."""
        return CosinePulse(self.peak, self.ratio)


@dataclass(frozen=True)
class AxisPulses(TableMotion):
    """Cosine pulses that begin together, each on its axis; on one axis they add.

    Examples
    --------
    >>> motion = AxisPulses((AxisPulse("pitch", 2.0, 0.5),))
    >>> round(float(motion.derivative(np.array([motion.duration / 2]), 0)[0, 4]), 9)
    1.0
    """

    pulses: tuple[AxisPulse, ...]

    @property
    def duration(self) -> float:
        """Length of the longest [s]."""
        return max(one.pulse.duration for one in self.pulses)

    @property
    def shortest_time(self) -> float:
        """Time for one radian of the shortest [s]."""
        return min(one.ratio for one in self.pulses)

    @property
    def turns(self) -> bool:
        """Whether one of them is on roll, pitch or yaw."""
        return any(AXES.index(one.axis) >= 3 for one in self.pulses)

    @property
    def fine_times(self) -> Array:
        """A thousand for each pulse."""
        return np.unique([np.linspace(0.0, one.pulse.duration, 1001) for one in self.pulses])

    def derivative(self, t: Array, order: int) -> Array:
        """Sum of the pulses'."""
        parts = []
        for one in self.pulses:
            pulse = one.pulse
            value = (pulse.displacement, pulse.velocity, pulse.acceleration)[order](t)
            parts.append(np.where(np.array(AXES) == one.axis, value[:, None], 0.0))
        return np.sum(parts, axis=0)


def rotation(angles: Array) -> Array:
    """Rotation matrices Rz(yaw) Ry(pitch) Rx(roll).

    Parameters
    ----------
    angles : ndarray, shape (n, 3) [rad]
        Roll, pitch and yaw.

    Returns
    -------
    ndarray, shape (n, 3, 3)

    Examples
    --------
    >>> rotation(np.array([[0.0, 0.0, 0.5 * np.pi]])).round(3)[0] @ [1.0, 0.0, 0.0]
    array([0., 1., 0.])
    """
    (cr, cp, cy), (sr, sp, sy) = np.cos(angles.T), np.sin(angles.T)
    rows = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def angular_velocity(angles: Array, rates: Array, second: Array) -> tuple[Array, Array]:
    """Angular velocity and its rate in the table's axes.

    Of roll r, pitch p and yaw y it is (r' - y' sin p, p' cos r + y' cos p sin r, -p' sin r + y' cos
    p cos r), and the rate of its components.

    Parameters
    ----------
    angles, rates, second : ndarray, shape (n, 3) [rad and seconds]
        Roll, pitch and yaw with their first and second derivatives.

    Returns
    -------
    velocity, rate : ndarray, shape (n, 3) [rad/s], [rad/s^2]
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
