"""Newmark's sliding block under a cosine pulse, in closed form between stops.

References
----------
Newmark (1965), Geotechnique 15(2), 139-160: the rigid-plastic sliding block.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from scipy.optimize import brentq

from vsr_core.arrays import Array
from vsr_core.motions.pulses import CosinePulse

SCAN = 500
"""Times per radian of a pulse at which the end of a slide is looked for."""


def slide(pulse: CosinePulse, resisting: float, times: Array) -> Array:
    """Displacement of a rigid-plastic block relative to its table, from rest.

    A block that slides in direction s has the relative acceleration -a(t) - s ``resisting``:
    velocity and displacement are closed forms until the velocity is zero. There it sticks until
    |a(t)| exceeds ``resisting``.

    Parameters
    ----------
    resisting : float [m/s^2], friction times gravity
    times : ndarray, shape (n,) [s]

    Returns
    -------
    ndarray, shape (n,) [m]
    """
    place = np.zeros_like(times)
    for leg, end in _legs(pulse, resisting):
        sliding = (times >= leg.t) & (times < end)
        place[sliding] = leg.place(times[sliding])
        place[times >= end] = leg.place(np.array(end))
    return place


def farthest(pulse: CosinePulse, resisting: float) -> float:
    """Largest displacement of such a block [m]: it turns, or stays, where a slide ends.

    Parameters
    ----------
    resisting : float [m/s^2], friction times gravity
    """
    ends = [abs(float(leg.place(np.array(end)))) for leg, end in _legs(pulse, resisting)]
    return max(ends, default=0.0)


def _legs(pulse: CosinePulse, resisting: float) -> Iterator[tuple[_Leg, float]]:
    """Slides, each with the time at which it ends [s]."""
    t, x = _slips(pulse, resisting, 0.0), 0.0
    while math.isfinite(t):
        # Just behind t, because a slide may end where the acceleration changes its sign.
        push = pulse.pga * math.cos(t / pulse.pgv_pga)
        leg = _Leg(pulse, t, x, -math.copysign(resisting, push))
        end = leg.end()
        yield leg, end
        x = float(leg.place(np.array(end)))
        t = _slips(pulse, resisting, end)


class _Leg:
    """A slide in one direction from rest at time ``t`` and place ``x``, resisted by ``force``."""

    def __init__(self, pulse: CosinePulse, t: float, x: float, force: float) -> None:
        self.pulse, self.t, self.x, self.force = pulse, t, x, force
        self.velocity = float(pulse.velocity(np.array(t)))
        self.displacement = float(pulse.displacement(np.array(t)))

    def speed(self, at: Array) -> Array:
        """Relative velocity [m/s] at times, any shape."""
        return self.velocity - self.pulse.velocity(at) - self.force * (at - self.t)

    def place(self, at: Array) -> Array:
        """Relative displacement [m] at times, any shape."""
        since = at - self.t
        table = self.pulse.displacement(at) - self.displacement
        return self.x + self.velocity * since - table - 0.5 * self.force * since**2

    def end(self) -> float:
        """Time at which it comes to a stop [s]."""
        step = self.pulse.pgv_pga / SCAN
        # After the pulse the table's velocity no longer feeds the slide.
        last = self.pulse.duration + abs(self.velocity / self.force)
        tried = np.arange(self.t + step, last + 2.0 * step, step)
        ahead = self.speed(tried) * self.force > 0.0
        first = int(np.argmin(ahead))

        def stops(at: float) -> float:
            return float(self.speed(np.array(at)))

        return float(brentq(stops, tried[first] - step, tried[first], xtol=1e-14))


def _slips(pulse: CosinePulse, resisting: float, t: float) -> float:
    """First time from ``t`` on at which a block at rest starts to slide [s]; inf if none."""
    if pulse.peak_acceleration <= resisting:
        return math.inf
    half = pulse.pgv_pga * math.acos(resisting / pulse.peak_acceleration)
    for peak in (0.0, 0.5 * pulse.duration, pulse.duration):
        if t < min(peak + half, pulse.duration):
            return max(t, peak - half)
    return math.inf
