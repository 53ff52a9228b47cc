"""What falls flat on the pedestal rebounds to e^2 of its height."""

from __future__ import annotations

import math

import numpy as np

from vsr_core import GRAVITY
from vsr_core.rock.body import Rock
from vsr_core.scene import Contact, Scene
from vsr_core.verification.reference import BOTH, REBOUNDS, Reference, case
from vsr_core.verification.reference._run import run, whole
from vsr_core.verification.rocks import box, sphere, upright

HEIGHT = 1.0
"""Of the fall [m]."""


def _rebound(rock: Rock, restitution: float, engine: str, time_step: float) -> float:
    """Error of the height of the first rebound, relative to the height of the fall."""
    start = upright((0.0, 0.0, rock.height + HEIGHT))
    scene = Scene(rock, Contact(0.6, restitution), start=start)
    down = math.sqrt(2.0 * HEIGHT / GRAVITY)
    # Up to the top of an exact rebound and a little on, but not to the next impact.
    number, step = whole(down * (1.0 + 1.2 * max(restitution, 0.5)), time_step)
    path = run(engine, scene, step, np.zeros(number))
    height = path.position[path.time > 1.1 * down, 2] - rock.height
    return abs(float(height.max()) / HEIGHT - restitution**2)


def _bounce(
    name: str, rock: Rock, e: float, tolerance: float, engines: tuple[str, ...] = REBOUNDS
) -> Reference:
    answer = "e^2 of the height of the fall."
    return case(f"bounce of a {name}, e = {e:g}", answer, tolerance, _rebound, rock, e,
                engines=engines)  # fmt: skip


CASES = (
    _bounce("sphere", sphere(0.1), 0.0, 0.02, BOTH),
    _bounce("sphere", sphere(0.1), 0.5, 1e-3),
    _bounce("sphere", sphere(0.1), 1.0, 0.01),
    _bounce("box on its face", box(1.0, 1.0, 0.5), 0.5, 2e-3),
)
