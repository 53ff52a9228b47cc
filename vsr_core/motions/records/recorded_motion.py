"""A recorded motion as a run takes it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.motions.records.measures import cav_increments
from vsr_core.motions.records.trace import Trace


@dataclass(frozen=True, eq=False)
class RecordedMotion(GroundMotion):
    """Motion whose acceleration is straight between samples; the table rests before and after.

    Velocity and displacement are the exact integrals. Two motions are the same only if they are one
    object.
    """

    trace: Trace

    @classmethod
    def scaled(cls, trace: Trace, pga: float) -> RecordedMotion:
        """The motion scaled to another PGA; its velocity and displacement grow with it.

        Parameters
        ----------
        pga : float [g]
        """
        factor = pga * GRAVITY / float(np.abs(trace.acceleration).max())
        return cls(Trace(factor * trace.acceleration, trace.interval))

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return self.trace.duration

    @property
    def shortest_time(self) -> float:
        """Ten samples [s]: a time step then skips none."""
        return 10.0 * self.trace.interval

    @property
    def peak_acceleration(self) -> float:
        """Largest absolute acceleration [m/s^2]."""
        return float(np.abs(self.trace.acceleration).max())

    def acceleration(self, t: Array) -> Array:
        """Acceleration [m/s^2] at times ``t`` [s]; zero outside the record."""
        k, s, slope = self._place(t)
        return np.where(self._inside(t), self.trace.acceleration[k] + slope * s, 0.0)

    def velocity(self, t: Array) -> Array:
        """Velocity [m/s] at times ``t`` [s]; zero outside the record."""
        k, s, slope = self._place(t)
        a, v = self.trace.acceleration[k], self.trace.velocity[k]
        return np.where(self._inside(t), v + s * (a + 0.5 * slope * s), 0.0)

    def displacement(self, t: Array) -> Array:
        """Displacement [m] at times ``t`` [s]; afterwards the table stays where it is."""
        k, s, slope = self._place(np.clip(t, 0.0, self.duration))
        a, v, d = (
            part[k]
            for part in (self.trace.acceleration, self.trace.velocity, self.trace.displacement)
        )
        return np.asarray(d + s * (v + s * (a / 2.0 + slope * s / 6.0)))

    def remaining_impulse(self, t: float) -> float:
        """Integral of |acceleration| [m/s] from ``t`` [s] to the end."""
        if t <= 0.0:
            return float(self._left[0])
        h = self.trace.interval
        k = int(t / h)
        if k >= len(self._left) - 1:
            return 0.0
        a, b = float(self.trace.acceleration[k]), float(self.trace.acceleration[k + 1])
        here = a + (b - a) * (t / h - k)
        rest = h * (k + 1) - t
        if here * b >= 0.0:
            piece = 0.5 * rest * (abs(here) + abs(b))
        else:  # two triangles
            piece = 0.5 * rest * (here**2 + b**2) / (abs(here) + abs(b))
        return piece + float(self._left[k + 1])

    @cached_property
    def _left(self) -> Array:
        """Integral of |acceleration| from each sample to the end."""
        return np.concatenate([[0.0], np.cumsum(cav_increments(self.trace)[::-1])])[::-1]

    def _inside(self, t: Array) -> np.ndarray:
        return (t >= 0.0) & (t <= self.duration)

    def _place(self, t: Array) -> tuple[np.ndarray, Array, Array]:
        """Interval that holds each time, the time since its start, and its slope."""
        h, a = self.trace.interval, self.trace.acceleration
        k = np.clip(np.floor(t / h).astype(np.int64), 0, len(a) - 2)
        return k, t - h * k, (a[k + 1] - a[k]) / h
