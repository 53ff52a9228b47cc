"""Soft contact: springs and dashpots of growing stiffness, as discrete-element codes have them."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from vsr_core import GRAVITY, engines
from vsr_core.rock.body import Rock
from vsr_core.run import input_checks
from vsr_core.run.cases import Settings, prepare
from vsr_core.run.input_checks import check, longest_step_on_springs
from vsr_core.scene import Contact, Scene
from vsr_core.verification.stability import Case, Measured
from vsr_core.verification.stability._trial import (
    GRIPPING,
    WEAK,
    _barrier,
    boundary,
    box,
    frustum,
    lifted,
    same,
    step_of,
    unit,
)

SINK = "depth [m] at rest; m g / (4 k), four points under a face; relative"
REBOUND = "speed after / before a flat landing; spring and dashpot that do not pull; absolute"
BOUNDARY = "first overturning PGA [g] on well damped springs; Housner's; relative"

SPEED = 0.1
"""Speed of a landing in units of sqrt(g radius)."""


def springs(
    rock: Rock, stiffness: float, damping: float = 1.0, restitution: float = 0.0
) -> Contact:
    """Contact of a stiffness [N/m] and a share of the damping that is critical on four points."""
    dashpot = damping * math.sqrt(stiffness * rock.mass)
    return Contact(GRIPPING, restitution, stiffness=stiffness, damping=dashpot)


def fine(rock: Rock, contact: Contact, share: float = 0.7) -> float:
    """A ``share`` of the longest time step [s] that the program takes for those springs."""
    return share * longest_step_on_springs(contact, rock.mass)


def _check(scene: Scene, step: float, engine: str = "bullet") -> None:
    case = prepare(scene, _barrier(scene.rock), reduce=True)
    check(case, Settings(step, engine=engine), WEAK)


def sink(rock: Rock, contact: Contact, step: float, engine: str = "bullet") -> Measured:
    """Depth to which a rock sinks at rest."""
    scene = Scene(rock, contact)
    _check(scene, step, engine)
    world = engines.load(engine).build(scene, step, 1)
    world.advance([0.0] * 100)
    assert contact.stiffness is not None
    expected = rock.mass * GRAVITY / (4.0 * contact.stiffness)
    return same(rock.height - float(world.state().position[2]), expected, expected)


def _sink(
    stiffness: float, rock: Rock, engine: str = "bullet", restitution: float = 0.0
) -> Measured:
    contact = springs(rock, stiffness, 1.0, restitution)
    return sink(rock, contact, min(fine(rock, contact), step_of(rock)), engine)


def _rebound(stiffness: float, damping: float, share: float = 0.7) -> Measured:
    """Flat landing in free space, at a ``share`` of the longest step."""
    rock = box(1.0, 1.0, 2.0)
    contact, speed = springs(rock, stiffness, damping), SPEED * GRAVITY * unit(rock)
    scene = Scene(rock, contact, start=lifted(rock, 0.01 * rock.radius, speed), gravity=0.0)
    step = fine(rock, contact, share)
    _check(scene, step)
    world = engines.load("bullet").build(scene, step, 1)
    period = 2.0 * math.pi * math.sqrt(rock.mass / (4.0 * stiffness))
    world.advance([0.0] * math.ceil((0.01 * rock.radius / speed + 5.0 * period) / step))
    after = float(world.state().velocity[2]) / speed
    return same(after, input_checks.rebound(contact, rock.mass), 1.0)


def _boundary(stiffness: float, ratio: float) -> Measured:
    rock = box(1.0, 1.0, 2.0)
    contact = springs(rock, stiffness)
    return boundary(Scene(rock, contact), ratio, fine(rock, contact), 0.03)


def _small_and_soft() -> Measured:
    """The 350 kg that lean by 8 deg at rest (PHYSICS 5.6), as a box."""
    side = (350.0 / 2110.0 / 2.0) ** (1.0 / 3.0)
    rock = box(side, side, 2.0 * side)
    return sink(rock, Contact(GRIPPING, stiffness=1e6, damping=1e4), step_of(rock))


BLOCK = (1.0, 1.0, 2.0)

CASES = (
    *(
        Case(f"sinking at {k:g} N/m", "contact", "stiffness", k, "N/m", SINK, 0.03,
             partial(_sink, k, box(*BLOCK)))
        for k in 10.0 ** np.arange(3.0, 11.0)
    ),
    *(
        Case(f"landing at {k:g} N/m, damping {z:g}", "contact", "stiffness", k, "N/m", REBOUND,
             0.03, partial(_rebound, k, z))
        for k in (1e8, 1e10) for z in (0.0, 0.1, 1.0, 3.0)
    ),
    *(
        Case(f"landing at {x:g} of the longest step", "contact", "step / longest", x, "1", REBOUND,
             0.03, partial(_rebound, 1e8, 0.1, x))
        for x in (0.1, 1.0, 2.0, 20.0)
    ),
    *(
        Case(f"boundary at {k:g} N/m", "contact", "stiffness", k, "N/m", BOUNDARY, 0.03,
             partial(_boundary, k, 0.2))
        for k in (3e7, 1e8, 1e9)
    ),
    Case("350 kg on 1e6 N/m", "contact", "stiffness", 1e6, "N/m", SINK, 0.03, _small_and_soft),
    Case("springs and a restitution", "contact", "stiffness", 1e8, "N/m", SINK, 0.03,
         partial(_sink, 1e8, box(*BLOCK), restitution=0.5)),
    Case("springs under a hull", "contact", "stiffness", 1e8, "N/m", SINK, 0.03,
         partial(_sink, 1e8, frustum((1.0, 1.0), (0.6, 0.6), 2.0))),
    Case("springs in mujoco", "contact", "stiffness", 1e8, "N/m", SINK, 0.03,
         partial(_sink, 1e8, box(*BLOCK), "mujoco")),
    Case("damping below 0", "contact", "stiffness", 1e8, "N/m", SINK, 0.03,
         partial(sink, box(*BLOCK), Contact(GRIPPING, stiffness=1e8, damping=-1.0), 1e-4)),
)  # fmt: skip
