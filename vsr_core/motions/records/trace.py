"""A motion by the samples of its acceleration: its integrals, intensity measures, and its run.

The acceleration is the straight line between its samples; velocity and displacement are its exact
integrals from rest. Whatever is done to a motion is done to the samples of its acceleration, so
that the three never part.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.motions.ground_motion import GroundMotion


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


DAMPING = 0.05
"""Damping of the oscillators, as a share of the critical."""

PARTS, FEWEST = 64, 8
"""Times at least, in a period and from one sample to the next, at which an oscillator is looked at:
the largest is then too small by 0.12 % of itself and of the PGA at most."""

SIGNIFICANT = (0.05, 0.95)
"""Shares of the Arias intensity between which the significant duration lies."""


@dataclass(frozen=True)
class Measures:
    """Intensity measures of a motion.

    Attributes
    ----------
    pga : float [m/s^2], and ``pgv`` [m/s], ``pgd`` [m]: largest absolute values, at any time
    pgv_pga : float [s]
    sa_1hz, sa_2hz : float [m/s^2], pseudo-spectral acceleration at 5 % damping
    arias : float [m/s], pi / (2 g) times the integral of the squared acceleration
    cav : float [m/s], integral of the absolute acceleration
    significant_duration : float [s], from 5 to 95 % of the Arias intensity
    """

    pga: float
    pgv: float
    pgd: float
    pgv_pga: float
    sa_1hz: float
    sa_2hz: float
    arias: float
    cav: float
    significant_duration: float


def measures(trace: Trace) -> Measures:
    """Intensity measures of a motion that is not zero throughout.

    References
    ----------
    Arias, A. (1970), in Seismic Design for Nuclear Power Plants, MIT Press: Arias intensity.
    """
    slopes = np.diff(trace.acceleration) / trace.interval
    line = scipy.interpolate.PPoly([slopes, trace.acceleration[:-1]], trace.times)
    pga, pgv, pgd = (_peak(one) for one in (line, line.antiderivative(), line.antiderivative(2)))
    energy = _squared(trace)
    sa_1hz, sa_2hz = spectrum(trace, np.array([1.0, 2.0]))
    starts, ends = (_reached(energy, trace.interval, share) for share in SIGNIFICANT)
    return Measures(
        pga=pga,
        pgv=pgv,
        pgd=pgd,
        pgv_pga=pgv / pga,
        sa_1hz=float(sa_1hz),
        sa_2hz=float(sa_2hz),
        arias=0.5 * math.pi / GRAVITY * float(energy.sum()),
        cav=float(cav_increments(trace).sum()),
        significant_duration=ends - starts,
    )


def _peak(curve: scipy.interpolate.PPoly) -> float:
    """Largest absolute value of a polynomial by intervals, at their ends or between."""
    flat = curve.derivative().roots(discontinuity=False, extrapolate=False)
    at = np.concatenate([curve.x, flat[np.isfinite(flat)]])  # NaN where it is zero for long
    return float(np.abs(curve(at)).max())


def spectrum(trace: Trace, frequencies: Array, damping: float = DAMPING) -> Array:
    """Pseudo-spectral acceleration: squared angular frequency times the largest displacement.

    Exact for an acceleration that is straight between its samples, which then stops; the largest
    of the relative displacement at ``PARTS`` times a period or more, and ``FEWEST`` from one sample
    to the next, one more period included.

    Parameters
    ----------
    frequencies : ndarray, shape (n,) [Hz]
        Of the oscillators.

    Returns
    -------
    ndarray, shape (n,) [m/s^2]

    References
    ----------
    Nigam, N. C. & Jennings, P. C. (1969), BSSA 59(2), 909-922.
    """
    found = [_largest(trace, 2.0 * math.pi * float(f), damping) for f in frequencies]
    return np.array(found)


def cav_increments(trace: Trace) -> Array:
    """Integral of the absolute acceleration over each interval; they add up to the CAV.

    Returns
    -------
    ndarray, shape (n - 1,) [m/s]

    Examples
    --------
    >>> cav_increments(Trace(np.array([0.0, 1.0, -1.0]), 0.5))
    array([0.25, 0.25])
    """
    a, b = trace.acceleration[:-1], trace.acceleration[1:]
    total = np.abs(a) + np.abs(b)
    crosses = a * b < 0.0
    # two triangles where the line crosses zero, one trapezium where it does not
    squares = np.divide(a**2 + b**2, total, out=total.copy(), where=crosses)
    return 0.5 * trace.interval * squares


def _squared(trace: Trace) -> Array:
    """Integral of the squared acceleration over each interval, shape (n - 1,)."""
    a, b = trace.acceleration[:-1], trace.acceleration[1:]
    return trace.interval / 3.0 * (a**2 + a * b + b**2)


def _reached(steps: Array, interval: float, share: float) -> float:
    """Time [s] at which a sum of ``steps`` reaches a share of its whole."""
    so_far = np.concatenate([[0.0], np.cumsum(steps)])
    return float(np.interp(share * so_far[-1], so_far, interval * np.arange(len(so_far))))


def _largest(trace: Trace, w: float, damping: float) -> float:
    h = trace.interval
    system = np.zeros((4, 4))
    system[0, 1] = system[2, 3] = 1.0
    system[1, :3] = -(w**2), -2.0 * damping * w, -1.0
    moved = scipy.linalg.expm(system * h)
    step, held, rising = moved[:2, :2], moved[:2, 2], moved[:2, 3]
    tail = np.zeros(math.ceil(2.0 * math.pi / (w * h)))
    starts = np.concatenate([trace.acceleration[:-1], tail])
    slopes = np.concatenate([np.diff(trace.acceleration) / h, tail])
    push = np.outer(held, starts) + np.outer(rising, slopes)
    # x[k + 1] = step x[k] + push[k] from rest, as filters of second order for its two parts
    below = [1.0, -float(np.trace(step)), float(np.linalg.det(step))]
    state = np.zeros((4, len(starts) + 1))
    for own, other in ((0, 1), (1, 0)):
        state[own] = _filtered([0.0, 1.0, -step[other, other]], below, push[own])
        state[own] += _filtered([0.0, 0.0, step[own, other]], below, push[other])
    state[2:, :-1] = starts, slopes
    parts = max(math.ceil(PARTS * w * h / (2.0 * math.pi)), FEWEST)
    part, row, largest = scipy.linalg.expm(system * h / parts), np.array([1.0, 0.0, 0.0, 0.0]), 0.0
    for _ in range(parts):
        largest = max(largest, float(np.abs(row @ state).max()))
        row = row @ part
    return w**2 * largest


def _filtered(above: list[float], below: list[float], push: Array) -> Array:
    return np.asarray(scipy.signal.lfilter(above, below, np.append(push, 0.0)))


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

    def _inside(self, t: Array) -> np.ndarray:
        return (t >= 0.0) & (t <= self.duration)

    def _place(self, t: Array) -> tuple[np.ndarray, Array, Array]:
        """Interval that holds each time, the time since its start, and its slope."""
        h, a = self.trace.interval, self.trace.acceleration
        k = np.clip(np.floor(t / h).astype(np.int64), 0, len(a) - 2)
        return k, t - h * k, (a[k + 1] - a[k]) / h
