"""Blocks that slide and do not tip, against closed forms of Coulomb's law; a sphere that rolls.

References
----------
Newmark (1965), Geotechnique 15(2), 139-160: the rigid-plastic sliding block.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from scipy.optimize import brentq

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.motions.pulses import CosinePulse
from vsr_core.scene import Contact, Scene
from vsr_core.verification.reference import case
from vsr_core.verification.reference._run import largest, middles, run, whole
from vsr_core.verification.rocks import box, sphere, upright

SIZE = (1.0, 1.0, 0.5)
"""Sides of the block [m]; it could tip only at a friction of 2."""

FRICTION = 0.3

SPEED = 2.0
"""At the start of the slide to rest [m/s]."""

PULSE = CosinePulse.from_g(0.8, 0.2)
"""Under it the block slides there and back, and is still sliding when it ends."""

SCAN = 500
"""Times per radian of a pulse at which the end of a slide is looked for."""


@cache
def _scene(speed: float) -> Scene:
    start = upright((0.0, 0.0, 0.5 * SIZE[2]), (speed, 0.0, 0.0))
    return Scene(box(*SIZE), Contact(FRICTION), start=start)


def _braking(engine: str, time_step: float) -> float:
    """Error of the sliding distance, relative to v^2 / (2 mu g)."""
    number, step = whole(1.5 * SPEED / (FRICTION * GRAVITY), time_step)
    path = run(engine, _scene(SPEED), step, np.zeros(number))
    return abs(float(path.position[-1, 0]) * 2.0 * FRICTION * GRAVITY / SPEED**2 - 1.0)


def _shaken(engine: str, time_step: float) -> float:
    """Largest error of the displacement at any time, relative to the largest displacement."""
    in_pulse, step = whole(PULSE.duration, time_step)
    times = middles(in_pulse + math.ceil(0.5 / step), step)
    path = run(engine, _scene(0.0), step, PULSE.acceleration(times))
    exact = slide(PULSE, FRICTION * GRAVITY, path.time)
    return largest(path.position[:, 0] - exact) / largest(exact)


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
    t, x = _slips(pulse, resisting, 0.0), 0.0
    while math.isfinite(t):
        # Just behind t, because a slide may end where the acceleration changes its sign.
        push = pulse.pga * math.cos(t / pulse.pgv_pga)
        leg = _Leg(pulse, t, x, -math.copysign(resisting, push))
        end = leg.end()
        sliding = (times >= t) & (times < end)
        place[sliding] = leg.place(times[sliding])
        t, x = end, float(leg.place(np.array(end)))
        place[times >= t] = x
        t = _slips(pulse, resisting, t)
    return place


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


BRAKING = (
    "v^2 / (2 mu g), Coulomb. MuJoCo's contacts lift what slides fast: the block hops 2.6 mm at "
    "the start at 1 ms, 0.2 mm at a quarter of that."
)
SHAKEN = (
    "rigid-plastic sliding (Newmark 1965), in closed form between stops. In MuJoCo 0.8 % "
    "remain at 1 ms, because its friction yields for GRIP_TIME where a slide ends."
)

_SLIDES = (
    case("slide to rest", BRAKING, 2e-3, _braking, order=1.0),
    case("sliding under a cosine pulse", SHAKEN, 0.01, _shaken),
)


PUSH = 2.0
"""Acceleration of the table [m/s^2], a slope of 11.5 deg. Rolling needs a friction of 2/7 PUSH/g,
0.06."""

DURATION = 2.0
"""Time of rolling [s]."""


@cache
def _sphere() -> Scene:
    return Scene(sphere(0.5), Contact(0.6), pedestal="plane")


def _rolling(engine: str, time_step: float) -> float:
    """Error of the distance on the table, relative to (5/7) PUSH t^2 / 2."""
    number, step = whole(DURATION, time_step)
    path = run(engine, _sphere(), step, np.full(number, PUSH))
    return abs(float(path.position[-1, 0]) / (5.0 / 14.0 * PUSH * DURATION**2) + 1.0)


ROLLING = "(5/7) a for a uniform sphere that rolls: I / (m r^2) = 2/5"

CASES = (*_SLIDES, case("rolling sphere", ROLLING, 6e-4, _rolling, order=1.0))
