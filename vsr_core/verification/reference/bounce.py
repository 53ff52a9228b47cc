"""What falls flat on the pedestal rebounds to e^2 of its height."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from vsr_core import GRAVITY
from vsr_core.rock.body import Rock
from vsr_core.scene import Contact, Scene, State
from vsr_core.verification.reference import BOTH, Reference
from vsr_core.verification.reference._run import box, run, sphere, whole

HEIGHT = 1.0
"""Of the fall [m]."""


def rebound(make: Callable[[], Rock], restitution: float, engine: str, time_step: float) -> float:
    """Error of the height of the first rebound, relative to the height of the fall."""
    rock = make()
    start = State(np.array([0.0, 0.0, rock.height + HEIGHT]), np.eye(3), np.zeros(3), np.zeros(3))
    scene = Scene(rock, Contact(0.6, restitution), start=start)
    down = math.sqrt(2.0 * HEIGHT / GRAVITY)
    # Up to the top of an exact rebound and a little on, but not to the next impact.
    number, step = whole(down * (1.0 + 1.2 * max(restitution, 0.5)), time_step)
    path = run(engine, scene, step, np.zeros(number))
    height = path.position[path.time > 1.1 * down, 2] - rock.height
    return abs(float(height.max()) / HEIGHT - restitution**2)


def _case(
    name: str,
    make: Callable[[], Rock],
    restitution: float,
    tolerance: float,
    engines: tuple[str, ...],
) -> Reference:
    return Reference(
        name=f"bounce of a {name}, e = {restitution:g}",
        family="bounce",
        answer="e^2 of the height of the fall.",
        quantity=str(rebound.__doc__),
        tolerance=tolerance,
        step=1e-3,
        order=None,
        engines=engines,
        measure=partial(rebound, make, restitution),
    )


_SPHERE = partial(sphere, 0.1)

CASES = (
    _case("sphere", _SPHERE, 0.0, 0.02, BOTH),
    _case("sphere", _SPHERE, 0.5, 1e-3, ("bullet",)),
    _case("sphere", _SPHERE, 1.0, 0.01, ("bullet",)),
    _case("box on its face", partial(box, 1.0, 1.0, 0.5), 0.5, 2e-3, ("bullet",)),
)
