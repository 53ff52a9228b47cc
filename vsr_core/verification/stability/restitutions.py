"""Restitution from nothing to one, and beyond."""

from __future__ import annotations

import math
from functools import partial

from vsr_core import GRAVITY, engines
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import Outcome
from vsr_core.scene import Contact, Scene
from vsr_core.verification.rocks import GRIPPING, box
from vsr_core.verification.stability import Measured, sweep
from vsr_core.verification.stability._trial import WEAK, block_of, lifted, respond, same, step_of

ROCK = box(1.0, 1.0, 0.5)

HEIGHT = 0.4
"""From which it drops [m]."""

REBOUND = "height of the rebound / of the drop; e^2; absolute"
ENERGY = "height after many rebounds / of the drop; e^(2 n), n = 10; absolute"
FINER = "overturned, 0 or 1, at 0.7 and 1.3 times Housner's PGA; the same at a quarter of the step"


def _dropped(restitution: float) -> Scene:
    return Scene(ROCK, Contact(0.6, restitution), start=lifted(ROCK, HEIGHT))


def _rebound(step_share: float, restitution: float, engine: str) -> Measured:
    step = step_share * step_of(ROCK)
    world = engines.load(engine).build(_dropped(restitution), step, 1)
    fall = math.sqrt(2.0 * HEIGHT / GRAVITY)
    world.advance([0.0] * math.ceil(fall * (1.0 + 0.02) / step))
    landed = float(world.state().position[2]) - ROCK.height < 0.1 * HEIGHT
    highest = 0.0 if landed else math.inf
    for _ in range(math.ceil(fall * (restitution + 0.1) / step)):
        world.advance([0.0])
        highest = max(highest, float(world.state().position[2]) - ROCK.height)
    return same(highest / HEIGHT, restitution**2, 1.0)


def _rebounds(restitution: float, engine: str) -> Measured:
    """The energy after ten rebounds, as a share of the first."""
    world = engines.load(engine).build(_dropped(restitution), step_of(ROCK), 1)
    rebounds, speed = 0, 0.0
    while rebounds < 10:
        world.advance([0.0])
        before, speed = speed, float(world.state().velocity[2])
        rebounds += before < 0.0 < speed
    state = world.state()
    energy = 0.5 * float(state.velocity @ state.velocity) / GRAVITY
    height = energy + float(state.position[2]) - ROCK.height
    return same(height / HEIGHT, restitution**20, 1.0)


def _gains(restitution: float, engine: str) -> Measured:
    outcome = respond(_dropped(restitution), WEAK, step_of(ROCK), engine).outcome
    return Measured(float(outcome), -1.0, math.inf, f"{outcome.name.lower()} while it gains energy")


def _finer(restitution: float, engine: str) -> Measured:
    """No closed form: a block that bounces is compared with itself."""
    rock = box(1.0, 1.0, 2.0)
    scene = Scene(rock, Contact(GRIPPING, restitution))
    edge = 1.2 * block_of(rock).uplift
    sides = [
        [
            respond(scene, CosinePulse(share * edge, 0.25), step, engine).outcome
            is Outcome.OVERTURNED
            for share in (0.7, 1.3)
        ]
        for step in (step_of(rock), 0.25 * step_of(rock))
    ]
    found, expected = (float(sum(side)) for side in sides)
    return Measured(found, expected, 0.0 if sides[0] == sides[1] else math.inf)


def _varied(reference: str, tolerance: float) -> tuple[str, str, str, float]:
    return "restitution", "1", reference, tolerance


CASES = (
    *sweep("rebound at {x:g}", _varied(REBOUND, 0.02), (0.0, 0.05, 0.2, 0.38, 0.6, 0.9, 1.0),
           partial(_rebound, 1.0)),
    *sweep("rebound at {x:g}, a quarter of the step", _varied(REBOUND, 0.02), (1.0,),
           partial(_rebound, 0.25)),
    *sweep("ten rebounds at {x:g}", _varied(ENERGY, 0.05), (0.9, 1.0), _rebounds),
    *sweep("rebounds that add energy", _varied("an outcome; there must be none", 0.0), (1.2,),
           _gains),
    *sweep("rocking at {x:g}", _varied(FINER, 0.0), (0.2, 0.5, 1.0), _finer),
    *sweep("restitution in {engine}", _varied(REBOUND, 0.02), (0.5,), partial(_rebound, 1.0),
           ["mujoco"]),
)  # fmt: skip
