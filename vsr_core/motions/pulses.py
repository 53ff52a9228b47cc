"""Pulses of the table's acceleration by their PGA and PGV/PGA: cosine, sine, and Ricker's."""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass

import numpy as np

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.motions.ground_motion import GroundMotion


@dataclass(frozen=True)
class Pulse(GroundMotion):
    """A pulse along +x.

    Attributes
    ----------
    pga : float [m/s^2]
        Peak ground acceleration; a negative value is the mirrored pulse.
    pgv_pga : float [s]
        Ratio r of peak velocity to peak acceleration.
    """

    pga: float
    pgv_pga: float

    @property
    def peak_acceleration(self) -> float:
        """Absolute PGA [m/s^2]."""
        return abs(self.pga)

    @abstractmethod
    def displacement(self, t: Array) -> Array:
        """Table displacement [m] at times ``t`` [s]."""


@dataclass(frozen=True)
class CosinePulse(Pulse):
    """Single-pulse cosine displacement d(t) = A - A cos(2 pi f t), 0 <= t <= 1/f.

    With the paper's f = 1/(2 pi r) and A = a g/(4 pi^2 f^2), the acceleration is
    ``pga * cos(t / r)``: it jumps from 0 to ``pga`` at t = 0 and back to 0 at t = 1/f.

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

    @classmethod
    def from_g(cls, pga_g: float, pgv_pga: float) -> CosinePulse:
        """Pulse from a PGA [g] and PGV/PGA [s]."""
        return cls(pga_g * GRAVITY, pgv_pga)

    @property
    def duration(self) -> float:
        """Length 1/f = 2 pi r [s]."""
        return 2.0 * math.pi * self.pgv_pga

    @property
    def shortest_time(self) -> float:
        """Time for one radian of the pulse, r [s]."""
        return self.pgv_pga

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


@dataclass(frozen=True)
class SinePulse(Pulse):
    """One period of a sine, a(t) = PGA sin(w t), 0 <= t <= 2 pi / w.

    Its velocity, PGA (1 - cos(w t)) / w, is a single hump with the peak 2 PGA / w, so that
    w = 2 / r for a ratio r of PGV to PGA.

    References
    ----------
    Makris & Roussos (2000), Geotechnique 50(3), 243-262: the pulse of type A.

    Examples
    --------
    >>> pulse = SinePulse(2.0, 0.5)
    >>> round(pulse.duration, 3), round(float(pulse.velocity(np.array([pulse.duration / 2]))[0]), 9)
    (1.571, 1.0)
    """

    @property
    def duration(self) -> float:
        """Length 2 pi / w = pi r [s]."""
        return math.pi * self.pgv_pga

    @property
    def shortest_time(self) -> float:
        """Time for one radian of the pulse, r / 2 [s]."""
        return 0.5 * self.pgv_pga

    def acceleration(self, t: Array) -> Array:
        """Acceleration at given times; zero outside the pulse."""
        inside = (t >= 0.0) & (t <= self.duration)
        return np.where(inside, self.pga * np.sin(t / self.shortest_time), 0.0)

    def velocity(self, t: Array) -> Array:
        """Table velocity at given times."""
        inside = (t >= 0.0) & (t <= self.duration)
        unit = self.pga * self.shortest_time
        return np.where(inside, unit * (1.0 - np.cos(t / self.shortest_time)), 0.0)

    def displacement(self, t: Array) -> Array:
        """Table displacement at given times; afterwards the table stays where it is."""
        phase = np.clip(t, 0.0, self.duration) / self.shortest_time
        return np.asarray(self.pga * self.shortest_time**2 * (phase - np.sin(phase)))


REACH = 6.0
"""Widths s of the Gaussian on either side of the peak. Beyond are velocities below 2e-7 of the PGV
and accelerations below 1e-6 of the PGA."""


@dataclass(frozen=True)
class RickerPulse(Pulse):
    """The symmetric Ricker pulse a(t) = PGA (1 - x^2) exp(-x^2 / 2), x = (t - t0) / s.

    Its velocity, PGA s x exp(-x^2 / 2), peaks at x = -1 and 1, so that s = r sqrt(e) for a ratio r
    of PGV to PGA. The lobes on either side of the peak reach -2 exp(-3/2) = -0.446 PGA.

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

    def acceleration(self, t: Array) -> Array:
        """Acceleration at given times; zero outside the pulse."""
        x = self._place(t)
        value = self.pga * (1.0 - x**2) * np.exp(-0.5 * x**2)
        return np.where(np.abs(x) <= REACH, value, 0.0)

    def velocity(self, t: Array) -> Array:
        """Table velocity at given times."""
        x = self._place(t)
        value = self.pga * self.width * x * np.exp(-0.5 * x**2)
        return np.where(np.abs(x) <= REACH, value, 0.0)

    def displacement(self, t: Array) -> Array:
        """Table displacement at given times: away and back again."""
        x = self._place(t)
        value = -self.pga * self.width**2 * np.exp(-0.5 * x**2)
        return np.where(np.abs(x) <= REACH, value, 0.0)

    def _place(self, t: Array) -> Array:
        """Times since the peak, in widths."""
        return np.asarray(t / self.width - REACH)
