"""A sphere on a table that accelerates steadily rolls as on a slope."""

from __future__ import annotations

from functools import cache

import numpy as np

from vsr_core.scene import Contact, Scene
from vsr_core.verification.reference import case
from vsr_core.verification.reference._run import run, whole
from vsr_core.verification.rocks import sphere

PUSH = 2.0
"""Acceleration of the table [m/s^2], a slope of 11.5 deg. Rolling needs a friction of 2/7 PUSH/g,
0.06."""

DURATION = 2.0
"""Time of rolling [s]."""


@cache
def _scene() -> Scene:
    return Scene(sphere(0.5), Contact(0.6), pedestal="plane")


def _rolling(engine: str, time_step: float) -> float:
    """Error of the distance on the table, relative to (5/7) PUSH t^2 / 2."""
    number, step = whole(DURATION, time_step)
    path = run(engine, _scene(), step, np.full(number, PUSH))
    return abs(float(path.position[-1, 0]) / (5.0 / 14.0 * PUSH * DURATION**2) + 1.0)


ANSWER = "(5/7) a for a uniform sphere that rolls: I / (m r^2) = 2/5"

CASES = (case("rolling sphere", ANSWER, 6e-4, _rolling, order=1.0),)
