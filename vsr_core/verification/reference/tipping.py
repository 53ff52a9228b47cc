"""Where a block starts to move: static tipping, and the switch from sliding to tipping.

A steady acceleration a of the table is a table tilted by atan(a/g): a block on it tips about its
edge when the resultant leaves the base, a = g b/h, whatever its mass.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from vsr_core import GRAVITY, engines
from vsr_core.rock.body import Rock
from vsr_core.run.boundary_search import halved
from vsr_core.scene import Contact, Scene
from vsr_core.verification.reference import REBOUNDS, case
from vsr_core.verification.reference._run import whole
from vsr_core.verification.rocks import GRIPPING, box, hull, unit

HALVINGS = 11
"""Halvings of a bracket of +-WINDOW: down to 5e-5 of the answer."""

PUSH = 1.5
"""Of a block that slides or tips, as a multiple of g b/h. It must not reach the slab's end."""

WINDOW = 0.1
"""Half of the range, as a share of the answer, in which it is sought. Errors end there."""

TIPPED = 0.2
"""Tilt at which a block has begun to tip, as a share of alpha."""

MONITOR_EVERY = 20
"""Monitoring interval, in time steps."""

PATIENCE = 8.0
"""Time in which it has to, in units of sqrt(radius / g). Tilts grow by e in each unit or so: what
exceeds the answer by 1e-3 is noticed."""

SIDES = 8
"""Of the prism's base: more corners than any engine keeps contact points."""


def _static(rock: Rock, slenderness: float, engine: str, time_step: float) -> float:
    """Error of the steady acceleration that tips a rock, relative to g b/h."""
    scene = Scene(rock, Contact(GRIPPING), pedestal="box" if rock.shape == "box" else "plane")
    answer = GRAVITY / slenderness

    def tips(push: float) -> bool | None:
        return _tips(engine, scene, time_step, push, TIPPED / slenderness)

    found = halved(tips, (1.0 - WINDOW) * answer, (1.0 + WINDOW) * answer, HALVINGS)
    return abs(found.middle / answer - 1.0) if found.decided else WINDOW


def _switch(width: float, height: float, engine: str, time_step: float) -> float:
    """Error of the friction from which on a strong steady push tips a block, relative to b/h."""
    answer = width / height

    def tips(friction: float) -> bool | None:
        scene = Scene(box(width, width, height), Contact(friction))
        return _tips(engine, scene, time_step, PUSH * GRAVITY * answer, TIPPED * answer)

    found = halved(tips, (1.0 - WINDOW) * answer, (1.0 + WINDOW) * answer, HALVINGS)
    return abs(found.middle / answer - 1.0) if found.decided else WINDOW


def _tips(engine: str, scene: Scene, time_step: float, push: float, beyond: float) -> bool | None:
    """Whether a steady push tilts the rock beyond a tilt [rad] in time; None if it diverges."""
    number, step = whole(PATIENCE * unit(scene.rock), time_step)
    world = engines.load(engine).build(scene, step, 1)
    for first in range(0, number, MONITOR_EVERY):
        world.advance([push] * min(MONITOR_EVERY, number - first))
        upright = float(world.state().rotation[2, 2])
        if math.isnan(upright):
            return None
        if upright <= math.cos(beyond):
            return True
    return False


@cache
def _prism() -> Rock:
    """Upright octagonal prism as a hull, a face across x: its inner radius is 0.5, its height 2 m.

    Built as scans are, from a mesh.
    """
    angles = 2.0 * math.pi * (np.arange(SIDES) + 0.5) / SIDES
    outer = 0.5 / math.cos(math.pi / SIDES)
    ring = outer * np.column_stack([np.cos(angles), np.sin(angles)])
    corners = np.vstack([np.column_stack([ring, np.full(SIDES, z)]) for z in (0.0, 2.0)])
    return hull(corners)


STATIC = "g b/h, from the moments about the edge"
SWITCH = (
    "tan(alpha) = b/h: a block that slides is tipped by its friction alone. Not in MuJoCo, whose "
    "contacts lift what slides fast until the block trips, at any friction and step."
)

CASES = (
    case("static tipping, box of 1 x 1 x 2 m", STATIC, 3e-3, _static, box(1.0, 1.0, 2.0), 2.0),
    case("static tipping, box of 1 x 1 x 5 m", STATIC, 4e-3, _static, box(1.0, 1.0, 5.0), 5.0),
    case("static tipping, octagonal hull", STATIC, 4e-3, _static, _prism(), 2.0),
    case("sliding or tipping, b/h = 0.5", SWITCH, 5e-3, _switch, 1.0, 2.0, engines=REBOUNDS),
    case("sliding or tipping, b/h = 0.75", SWITCH, 5e-3, _switch, 1.5, 2.0, engines=REBOUNDS),
)
