"""The cosine pulse."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.motions.ground_motion import GroundMotion


@dataclass(frozen=True)
class CosinePulse(GroundMotion):
    """Single-pulse cosine displacement d(t) = A - A cos(2 pi f t), 0 <= t <= 1/f.

    With the paper's f = 1/(2 pi r) and A = a g/(4 pi^2 f^2), the acceleration is
    ``pga * cos(t / r)``: it jumps from 0 to ``pga`` at t = 0 and back to 0 at t = 1/f.

    Parameters
    ----------
    pga : float
        Peak ground acceleration a g [m/s^2]; a negative value is the mirrored pulse.
    pgv_pga : float
        Ratio r of peak velocity to peak acceleration [s].

    References
    ----------
    Chen et al. (2024), Seismica 3(1), Eqs 7-10.

    Examples
    --------
    >>> pulse = CosinePulse.from_g(0.2, 0.8)
    >>> round(pulse.duration, 3), round(pulse.peak_acceleration, 5)
    (5.027, 1.96133)
    >>> round(float(pulse.displacement(np.array([pulse.duration / 2]))[0]), 3)
    2.511
    """

    pga: float
    pgv_pga: float

    @classmethod
    def from_g(cls, pga_g: float, pgv_pga: float) -> CosinePulse:
        """Pulse from a PGA in units of standard gravity.

        Parameters
        ----------
        pga_g : float [g]
        pgv_pga : float [s]
        """
        return cls(pga_g * GRAVITY, pgv_pga)

    @property
    def duration(self) -> float:
        """Length 1/f = 2 pi r [s]."""
        return 2.0 * math.pi * self.pgv_pga

    @property
    def shortest_time(self) -> float:
        """Time for one radian of the pulse, r [s]."""
        return self.pgv_pga

    @property
    def peak_acceleration(self) -> float:
        """Absolute PGA [m/s^2]."""
        return abs(self.pga)

    def acceleration(self, t: Array) -> Array:
        """Acceleration [m/s^2] at times ``t`` [s]; zero outside the pulse."""
        inside = (t >= 0.0) & (t <= self.duration)
        return np.where(inside, self.pga * np.cos(t / self.pgv_pga), 0.0)

    def velocity(self, t: Array) -> Array:
        """Table velocity [m/s] at times ``t`` [s] (paper's Eq. 10)."""
        inside = (t >= 0.0) & (t <= self.duration)
        return np.where(inside, self.pga * self.pgv_pga * np.sin(t / self.pgv_pga), 0.0)

    def displacement(self, t: Array) -> Array:
        """Table displacement [m] at times ``t`` [s] (paper's Eq. 7)."""
        inside = (t >= 0.0) & (t <= self.duration)
        amplitude = self.pga * self.pgv_pga**2
        return np.where(inside, amplitude * (1.0 - np.cos(t / self.pgv_pga)), 0.0)

    def remaining_impulse(self, t: float) -> float:
        """Integral of |acceleration| [m/s] from ``t`` to the end; 4 PGV for the whole pulse."""
        phase = min(max(t / self.pgv_pga, 0.0), 2.0 * math.pi)
        done = _integral_abs_cos(phase)
        return self.peak_acceleration * self.pgv_pga * (4.0 - done)


def _integral_abs_cos(phase: float) -> float:
    """Integral of |cos| from 0 to ``phase`` [rad], 0 <= phase <= 2 pi."""
    if phase <= 0.5 * math.pi:
        return math.sin(phase)
    if phase <= 1.5 * math.pi:
        return 2.0 - math.sin(phase)
    return 4.0 + math.sin(phase)
