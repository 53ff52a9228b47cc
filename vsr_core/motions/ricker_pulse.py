"""The Ricker pulse: the second derivative of a Gaussian, as pulses near a fault resemble it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vsr_core.arrays import Array
from vsr_core.motions.ground_motion import GroundMotion

REACH = 6.0
"""Widths s of the Gaussian on either side of the peak. Beyond are velocities below 2e-7 of the PGV
and accelerations below 1e-6 of the PGA."""


@dataclass(frozen=True)
class RickerPulse(GroundMotion):
    """The symmetric Ricker pulse a(t) = PGA (1 - x^2) exp(-x^2 / 2), x = (t - t0) / s.

    Its velocity, PGA s x exp(-x^2 / 2), peaks at x = -1 and 1, so that s = r sqrt(e) for a ratio r
    of PGV to PGA. The lobes on either side of the peak reach -2 exp(-3/2) = -0.446 PGA.

    Parameters
    ----------
    pga : float
        Peak ground acceleration [m/s^2]; a negative value is the mirrored pulse.
    pgv_pga : float
        Ratio r of peak velocity to peak acceleration [s].

    References
    ----------
    Ricker (1943), Geophysics 8(1), 10-40; as an excitation of rocking blocks Vassiliou & Makris
    (2011), Bulletin of the Seismological Society of America 101(2), 596-618.

    Examples
    --------
    >>> pulse = RickerPulse(2.0, 0.5)
    >>> round(float(pulse.acceleration(np.array([pulse.duration / 2]))[0]), 9)
    2.0
    >>> round(float(pulse.velocity(np.array([pulse.duration / 2 + pulse.width]))[0]), 9)
    1.0
    """

    pga: float
    pgv_pga: float

    @property
    def width(self) -> float:
        """Standard deviation s = r sqrt(e) of the Gaussian [s]."""
        return self.pgv_pga * math.sqrt(math.e)

    @property
    def duration(self) -> float:
        """Length [s], with the peak in its middle."""
        return 2.0 * REACH * self.width

    @property
    def shortest_time(self) -> float:
        """Time for one radian of the frequency at which its spectrum peaks, s / sqrt(2) [s]."""
        return self.width / math.sqrt(2.0)

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
        x = self._place(t)
        value = self.pga * (1.0 - x**2) * np.exp(-0.5 * x**2)
        return np.where(np.abs(x) <= REACH, value, 0.0)

    def velocity(self, t: Array) -> Array:
        """Table velocity at given times.

        Parameters
        ----------
        t : ndarray [s]

        Returns
        -------
        ndarray [m/s], shape of ``t``
        """
        x = self._place(t)
        value = self.pga * self.width * x * np.exp(-0.5 * x**2)
        return np.where(np.abs(x) <= REACH, value, 0.0)

    def displacement(self, t: Array) -> Array:
        """Table displacement at given times: away and back again.

        Parameters
        ----------
        t : ndarray [s]

        Returns
        -------
        ndarray [m], shape of ``t``
        """
        x = self._place(t)
        value = -self.pga * self.width**2 * np.exp(-0.5 * x**2)
        return np.where(np.abs(x) <= REACH, value, 0.0)

    def remaining_impulse(self, t: float) -> float:
        """Integral of |acceleration| from a time to the end; 4 PGV for the whole pulse.

        It is the way that the velocity goes, up and down, between the peaks of the velocity.

        Parameters
        ----------
        t : float [s]

        Returns
        -------
        float [m/s]
        """
        x = min(max(t / self.width - REACH, -REACH), REACH)
        turns = np.array([x, *(peak for peak in (-1.0, 1.0) if peak > x), REACH])
        way = np.abs(np.diff(turns * np.exp(-0.5 * turns**2))).sum()
        return self.peak_acceleration * self.width * float(way)

    def _place(self, t: Array) -> Array:
        """Times since the peak, in widths."""
        return np.asarray(t / self.width - REACH)
