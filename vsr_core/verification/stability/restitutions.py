"""Restitution from nothing to one, and beyond."""

from __future__ import annotations

import math
from functools import partial

from vsr_core import GRAVITY, engines
from vsr_core.motions.cosine_pulse import CosinePulse
from vsr_core.outcome import Outcome
from vsr_core.scene import Contact, Scene
from vsr_core.verification.stability import Case, Measured
from vsr_core.verification.stability._trial import (
    WEAK,
    block_of,
    box,
    lifted,
    respond,
    same,
    step_of,
)

HEIGHT = 0.4

REBOUND = "height of the rebound / of the drop; e^2; absolute"
ENERGY = "height after many rebounds / of the drop; e^(2 n), n = 10; absolute"
FINER = "overturned, 0 or 1, at 0.7 and 1.3 times Housner's PGA; the same at a quarter of the step"


def _rebound(restitution: float, step_share: float, engine: str = "bullet") -> Measured:
    rock = box(1.0, 1.0, 0.5)
    step = step_share * step_of(rock)
    scene = Scene(rock, Contact(0.6, restitution), start=lifted(rock, HEIGHT))
    world = engines.load(engine).build(scene, step, 1)
    fall = math.sqrt(2.0 * HEIGHT / GRAVITY)
    world.advance([0.0] * math.ceil(fall * (1.0 + 0.02) / step))
    landed = float(world.state().position[2]) - rock.height < 0.1 * HEIGHT
    highest = 0.0 if landed else math.inf
    for _ in range(math.ceil(fall * (restitution + 0.1) / step)):
        world.advance([0.0])
        highest = max(highest, float(world.state().position[2]) - rock.height)
    return same(highest / HEIGHT, restitution**2, 1.0)


def _rebounds(restitution: float) -> Measured:
    """The energy after ten rebounds, as a share of the first."""
    rock = box(1.0, 1.0, 0.5)
    step = step_of(rock)
    scene = Scene(rock, Contact(0.6, restitution), start=lifted(rock, HEIGHT))
    world = engines.load("bullet").build(scene, step, 1)
    rebounds, speed = 0, 0.0
    while rebounds < 10:
        world.advance([0.0])
        before, speed = speed, float(world.state().velocity[2])
        rebounds += before < 0.0 < speed
    state = world.state()
    energy = 0.5 * float(state.velocity @ state.velocity) / GRAVITY
    height = energy + float(state.position[2]) - rock.height
    return same(height / HEIGHT, restitution**20, 1.0)


def _gains(restitution: float) -> Measured:
    rock = box(1.0, 1.0, 0.5)
    scene = Scene(rock, Contact(0.6, restitution), start=lifted(rock, HEIGHT))
    outcome = respond(scene, WEAK, step_of(rock)).outcome
    return Measured(float(outcome), -1.0, math.inf, f"{outcome.name.lower()} while it gains energy")


def _finer(restitution: float) -> Measured:
    """No closed form: a block that bounces is compared with itself."""
    rock = box(1.0, 1.0, 2.0)
    scene = Scene(rock, Contact(10.0, restitution))
    edge = 1.2 * block_of(rock).uplift
    sides = [
        [
            respond(scene, CosinePulse(share * edge, 0.25), step).outcome is Outcome.OVERTURNED
            for share in (0.7, 1.3)
        ]
        for step in (step_of(rock), 0.25 * step_of(rock))
    ]
    found, expected = (float(sum(side)) for side in sides)
    return Measured(found, expected, 0.0 if sides[0] == sides[1] else math.inf)


CASES = (
    *(
        Case(f"rebound at {e:g}", "restitution", "restitution", e, "1", REBOUND, 0.02,
             partial(_rebound, e, 1.0))
        for e in (0.0, 0.05, 0.2, 0.38, 0.6, 0.9, 1.0)
    ),
    Case("rebound at 1, a quarter of the step", "restitution", "restitution", 1.0, "1", REBOUND,
         0.02, partial(_rebound, 1.0, 0.25)),
    *(
        Case(f"ten rebounds at {e:g}", "restitution", "restitution", e, "1", ENERGY, 0.05,
             partial(_rebounds, e))
        for e in (0.9, 1.0)
    ),
    Case("rebounds that add energy", "restitution", "restitution", 1.2, "1",
         "an outcome; there must be none", 0.0, partial(_gains, 1.2)),
    *(
        Case(f"rocking at {e:g}", "restitution", "restitution", e, "1", FINER, 0.0,
             partial(_finer, e))
        for e in (0.2, 0.5, 1.0)
    ),
    Case("restitution in mujoco", "restitution", "restitution", 0.5, "1", REBOUND, 0.02,
         partial(_rebound, 0.5, 1.0, "mujoco")),
)  # fmt: skip
