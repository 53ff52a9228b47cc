"""Rest: nothing moves a rock that nothing shakes, for a million steps or on a needle's point."""

from __future__ import annotations

import math
from functools import partial

from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import Outcome
from vsr_core.rock.body import Rock
from vsr_core.run.reductions import reduce
from vsr_core.scene import Contact, Scene
from vsr_core.verification.rocks import GRIPPING, box, frustum, unit
from vsr_core.verification.stability import ExtremeCase, Measured, sweep
from vsr_core.verification.stability._trial import (
    BOTH,
    STEP_SHARE,
    checked_world,
    prepared,
    respond,
    step_of,
    tilt,
)
from vsr_core.verification.stability.soft_contact import springs

DRIFT = "way [m] of the base's centre and of the top by tilting; none; relative to the radius"
PROVED = "way [m] in a complete run of a pulse that is proved to move nothing; none; radius"

BLOCK = box(1.0, 1.0, 2.0)
NEEDLE = frustum((0.1, 0.1), (0.6, 0.6), 2.0)
KNIFE = frustum((0.02, 1.0), (0.6, 1.0), 2.0)
SQUARE = frustum((1.0, 1.0), (0.6, 0.6), 2.0)

MILLION = 1_000_000


def _drift(rock: Rock, contact: Contact, steps: int, share: float, engine: str) -> Measured:
    """``steps`` at rest, of ``share`` of sqrt(radius / g)."""
    scene, _ = reduce(Scene(rock, contact))
    world = checked_world(scene, share * unit(rock), engine)
    start, thousand = world.state(), [0.0] * 1000
    for _ in range(steps // len(thousand)):
        world.advance(thousand)
    end = world.state()
    way = math.hypot(*(end.position - start.position)) + tilt(end) * rock.radius
    return Measured(way, 0.0, way / rock.radius)


def _rests(name: str, steps: int, rock: Rock, engine: str = "bullet") -> ExtremeCase:
    measure = partial(_drift, rock, Contact(0.6), steps, STEP_SHARE, engine)
    return ExtremeCase(name, "steps", float(steps), "1", DRIFT, 0.01, measure)


def _on_springs(stiffness: float, engine: str) -> Measured:
    share = 1e-3 * (1e8 / stiffness) ** 0.5
    return _drift(BLOCK, springs(BLOCK, stiffness), 100_000, share, engine)


def _proved(rock: Rock, pga_share: float, engine: str) -> Measured:
    """A long pulse at nine tenths of what lifts the rock, run to its end."""
    scene = Scene(rock, Contact(GRIPPING))
    lowest, highest = prepared(scene).static_limits
    pulse = CosinePulse(pga_share * min(-lowest, highest), 2.0 * unit(rock))
    response = respond(scene, pulse, step_of(rock), engine, reduce=False)
    way = response.slip + response.peak_tilt * rock.radius
    wrong = response.outcome is not Outcome.BALANCED
    return Measured(way, 0.0, math.inf if wrong else way / rock.radius)


CASES = (
    _rests("a million steps, block in bullet", MILLION, BLOCK),
    _rests("a million steps, block in mujoco", MILLION, BLOCK, "mujoco"),
    _rests("a million steps, hull in bullet", MILLION, SQUARE),
    *sweep("rest at a step of {x:g}", ("step / sqrt(R/g)", "1", DRIFT, 0.01),
           (3e-5, 3e-4, 6e-3, 0.1), partial(_drift, BLOCK, Contact(0.6), 100_000)),
    *sweep("knife edge at rest at a step of {x:g}", ("step / sqrt(R/g)", "1", DRIFT, 0.01),
           (3e-4, 1e-3, 6e-3), partial(_drift, KNIFE, Contact(0.6), 100_000)),
    _rests("needle at rest", 100_000, NEEDLE),
    *sweep("block at rest on {x:g} N/m", ("stiffness", "N/m", DRIFT, 0.01), (1e8, 1e10),
           _on_springs),
    *(
        case
        for name, rock in (("block", BLOCK), ("hull", SQUARE), ("needle", NEEDLE))
        for case in sweep(f"proved to stand, {name} in {{engine}}",
                          ("PGA / uplift", "1", PROVED, 0.01), (0.9,), partial(_proved, rock), BOTH)
    ),
)  # fmt: skip
