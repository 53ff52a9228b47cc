"""The single sine pulse of acceleration, which carries the table forward and leaves it there."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vsr_core.arrays import Array
from vsr_core.motions.ground_motion import GroundMotion


@dataclass(frozen=True)
class SinePulse(GroundMotion):
    """One period of a sine, a(t) = PGA sin(w t), 0 <= t <= 2 pi / w.

    Its velocity, PGA (1 - cos(w t)) / w, is a single hump with the peak 2 PGA / w, so that
    w = 2 / r for a ratio r of PGV to PGA.

    Parameters
    ----------
    pga : float
        Peak ground acceleration [m/s^2]; a negative value is the mirrored pulse.
    pgv_pga : float
        Ratio r of peak velocity to peak acceleration [s].

    References
    ----------
    Makris & Roussos (2000), Geotechnique 50(3), 243-262: the pulse of type A.

    Examples
    --------
    >>> pulse = SinePulse(2.0, 0.5)
    >>> round(pulse.duration, 3), round(float(pulse.velocity(np.array([pulse.duration / 2]))[0]), 9)
    (1.571, 1.0)
    """

    pga: float
    pgv_pga: float

    @property
    def duration(self) -> float:
        """Length 2 pi / w = pi r [s]."""
        return math.pi * self.pgv_pga

    @property
    def shortest_time(self) -> float:
        """Time for one radian of the pulse, r / 2 [s]."""
        return 0.5 * self.pgv_pga

    @property
    def peak_acceleration(self) -> float:
        """Absolute PGA [m/s^2]."""
        return abs(self.pga)

    def acceleration(self, t: Array) -> Array:
        """Acceleration at given times; zero outside the pulse.

        Parameters
        ----------
        t : ndarray [s]

        Returns
        -------
        ndarray [m/s^2], shape of ``t``
        """
        inside = (t >= 0.0) & (t <= self.duration)
        return np.where(inside, self.pga * np.sin(t / self.shortest_time), 0.0)

    def velocity(self, t: Array) -> Array:
        """Table velocity at given times.

        Parameters
        ----------
        t : ndarray [s]

        Returns
        -------
        ndarray [m/s], shape of ``t``
        """
        inside = (t >= 0.0) & (t <= self.duration)
        unit = self.pga * self.shortest_time
        return np.where(inside, unit * (1.0 - np.cos(t / self.shortest_time)), 0.0)

    def displacement(self, t: Array) -> Array:
        """Table displacement at given times; afterwards the table stays where it is.

        Parameters
        ----------
        t : ndarray [s]

        Returns
        -------
        ndarray [m], shape of ``t``
        """
        phase = np.clip(t, 0.0, self.duration) / self.shortest_time
        return np.asarray(self.pga * self.shortest_time**2 * (phase - np.sin(phase)))

    def remaining_impulse(self, t: float) -> float:
        """Integral of |acceleration| from a time to the end; 2 PGV for the whole pulse.

        Parameters
        ----------
        t : float [s]

        Returns
        -------
        float [m/s]
        """
        phase = min(max(t / self.shortest_time, 0.0), 2.0 * math.pi)
        done = 1.0 - math.cos(phase) if phase <= math.pi else 3.0 + math.cos(phase)
        return self.peak_acceleration * self.shortest_time * (4.0 - done)
