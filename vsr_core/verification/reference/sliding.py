"""Blocks that slide and do not tip, against closed forms of Coulomb's law; a sphere that rolls.

References
----------
Newmark (1965), Geotechnique 15(2), 139-160: the rigid-plastic sliding block.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from vsr_core import GRAVITY
from vsr_core.motions.pulses import CosinePulse
from vsr_core.run.sliding_block import slide
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
