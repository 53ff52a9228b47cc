"""Acceleration, velocity and displacement that are one motion.

The acceleration is the straight line between its samples; velocity and displacement are its exact
integrals from rest. Whatever is done to a motion is done to the samples of its acceleration, so
that the three never part.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vsr_core.arrays import Array


@dataclass(frozen=True, eq=False)
class Trace:
    """A motion by the samples of its acceleration, at rest before the first.

    Attributes
    ----------
    acceleration : ndarray, shape (n,) [m/s^2]
    interval : float [s]
    """

    acceleration: Array
    interval: float

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return self.interval * (len(self.acceleration) - 1)

    @cached_property
    def times(self) -> Array:
        """Times of the samples [s], shape (n,)."""
        return self.interval * np.arange(len(self.acceleration), dtype=np.float64)

    @cached_property
    def velocity(self) -> Array:
        """Velocity at the samples [m/s], shape (n,)."""
        a = self.acceleration
        return _summed(0.5 * self.interval * (a[:-1] + a[1:]))

    @cached_property
    def displacement(self) -> Array:
        """Displacement at the samples [m], shape (n,)."""
        a, h = self.acceleration, self.interval
        return _summed(h * self.velocity[:-1] + h**2 * (2.0 * a[:-1] + a[1:]) / 6.0)


def _summed(steps: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(steps)])
