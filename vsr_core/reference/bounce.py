"""A sphere dropped on the pedestal rebounds to e^2 of its height."""

from __future__ import annotations

import math
from functools import cache, partial

import numpy as np

from vsr_core import GRAVITY
from vsr_core.reference import BOTH, Reference
from vsr_core.reference._run import run, sphere, whole
from vsr_core.scene import Contact, Scene, State

RADIUS, HEIGHT = 0.1, 1.0
"""Of the sphere, and of its fall [m]."""


@cache
def _scene(restitution: float) -> Scene:
    start = State(np.array([0.0, 0.0, RADIUS + HEIGHT]), np.eye(3), np.zeros(3), np.zeros(3))
    return Scene(sphere(RADIUS), Contact(0.6, restitution), start=start)


def rebound(restitution: float, engine: str, time_step: float) -> float:
    """Error of the height of the first rebound, relative to the height of the fall."""
    down = math.sqrt(2.0 * HEIGHT / GRAVITY)
    number, step = whole(down * (1.0 + max(restitution, 0.5) * 1.2), time_step)
    path = run(engine, _scene(restitution), step, np.zeros(number))
    height = path.position[:, 2] - RADIUS
    after = path.time > 1.1 * down
    return abs(float(height[after].max()) / HEIGHT - restitution**2)


def _case(restitution: float, tolerance: float, engines: tuple[str, ...], note: str) -> Reference:
    return Reference(
        name=f"bounce of a sphere, e = {restitution:g}",
        family="bounce",
        answer=f"e^2 of the height of the fall. {note}",
        quantity=str(rebound.__doc__),
        tolerance=tolerance,
        step=1e-3,
        order=None,
        engines=engines,
        measure=partial(rebound, restitution),
    )


_OPEN = (
    "Below some step Bullet loses the rebound: a contact within 0.02 of its units takes the "
    "approach speed away while it is still open."
)

CASES = (
    _case(0.0, 0.02, BOTH, "At any step a MuJoCo sphere rebounds to 1 or 2 % of it."),
    _case(0.5, 1e-3, ("bullet",), _OPEN),
    _case(1.0, 0.01, ("bullet",), _OPEN),
)
