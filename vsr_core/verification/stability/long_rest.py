"""Rest: nothing moves a rock that nothing shakes, for a million steps or on a needle's point."""

from __future__ import annotations

import math
from functools import partial

from vsr_core import engines
from vsr_core.motions.cosine_pulse import CosinePulse
from vsr_core.outcome import Outcome
from vsr_core.rock.body import Rock
from vsr_core.run.cases import Settings, prepare
from vsr_core.run.input_checks import check
from vsr_core.run.reductions import reduce
from vsr_core.scene import Contact, Scene
from vsr_core.verification.stability import Case, Measured
from vsr_core.verification.stability._trial import (
    GRIPPING,
    WEAK,
    _barrier,
    box,
    frustum,
    respond,
    step_of,
    tilt,
    unit,
)
from vsr_core.verification.stability.soft_contact import springs

DRIFT = "way [m] of the base's centre and of the top by tilting; none; relative to the radius"
PROVED = "way [m] in a complete run of a pulse that is proved to move nothing; none; radius"


def _drift(
    rock: Rock, contact: Contact, steps: int, engine: str = "bullet", share: float | None = None
) -> Measured:
    """``steps`` at rest, of ``share`` of sqrt(radius / g)."""
    scene, _ = reduce(Scene(rock, contact))
    step = share * unit(rock) if share else step_of(rock)
    case = prepare(scene, _barrier(rock), reduce=False)
    check(case, Settings(step, engine=engine), WEAK)
    world = engines.load(engine).build(scene, step, 1)
    start, block = world.state(), [0.0] * 1000
    for _ in range(steps // len(block)):
        world.advance(block)
    end = world.state()
    way = math.hypot(*(end.position - start.position)) + tilt(end) * rock.radius
    return Measured(way, 0.0, way / rock.radius)


def _proved(rock: Rock, engine: str) -> Measured:
    """A long pulse at nine tenths of what lifts the rock, run to its end."""
    scene = Scene(rock, Contact(GRIPPING))
    still = prepare(scene, _barrier(rock), reduce=True).static_limits
    pulse = CosinePulse(0.9 * min(-still[0], still[1]), 2.0 * unit(rock))
    response = respond(scene, pulse, step_of(rock), engine, reduce=False)
    way = response.slip + response.peak_tilt * rock.radius
    wrong = response.outcome is not Outcome.BALANCED
    return Measured(way, 0.0, math.inf if wrong else way / rock.radius)


_BLOCK = box(1.0, 1.0, 2.0)
_NEEDLE = frustum((0.1, 0.1), (0.6, 0.6), 2.0)
_KNIFE = frustum((0.02, 1.0), (0.6, 1.0), 2.0)
_SQUARE = frustum((1.0, 1.0), (0.6, 0.6), 2.0)

MILLION = 1_000_000

CASES = (
    *(
        Case(f"a million steps, {name} in {engine}", "rest", "steps", float(MILLION), "1", DRIFT,
             0.01, partial(_drift, rock, contact, MILLION, engine))
        for name, rock, contact, engine in (
            ("block", _BLOCK, Contact(0.6), "bullet"),
            ("block", _BLOCK, Contact(0.6), "mujoco"),
            ("hull", _SQUARE, Contact(0.6), "bullet"),
        )
    ),
    *(
        Case(f"rest at a step of {x:g}", "rest", "step / sqrt(R/g)", x, "1", DRIFT, 0.01,
             partial(_drift, _BLOCK, Contact(0.6), 100_000, share=x))
        for x in (3e-5, 3e-4, 6e-3, 0.1)
    ),
    *(
        Case(f"knife edge at rest at a step of {x:g}", "rest", "step / sqrt(R/g)", x, "1", DRIFT,
             0.01, partial(_drift, _KNIFE, Contact(0.6), 100_000, share=x))
        for x in (3e-4, 1e-3, 6e-3)
    ),
    Case("needle at rest", "rest", "steps", 1e5, "1", DRIFT, 0.01,
         partial(_drift, _NEEDLE, Contact(0.6), 100_000)),
    *(
        Case(f"block at rest on {k:g} N/m", "rest", "stiffness", k, "N/m", DRIFT, 0.01,
             partial(_drift, _BLOCK, springs(_BLOCK, k), 100_000, share=1e-3 * (1e8 / k) ** 0.5))
        for k in (1e8, 1e10)
    ),
    *(
        Case(f"proved to stand, {name} in {engine}", "rest", "PGA / uplift", 0.9, "1", PROVED, 0.01,
             partial(_proved, rock, engine))
        for engine in ("bullet", "mujoco")
        for name, rock in (("block", _BLOCK), ("hull", _SQUARE), ("needle", _NEEDLE))
    ),
)  # fmt: skip
