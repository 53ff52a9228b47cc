"""Friction from none to a hundred."""

from __future__ import annotations

from vsr_core import GRAVITY
from vsr_core.motions.pulses import CosinePulse
from vsr_core.scene import Contact, Scene
from vsr_core.verification.rocks import box
from vsr_core.verification.stability import Measured, sweep
from vsr_core.verification.stability._trial import BOTH, boundary, respond, same, slip, step_of

PULSE = CosinePulse.from_g(0.5, 0.3)

SLIP = (
    "farthest slip [m] of a squat block; a sliding mass; relative to the table's displacement, "
    "0.88 m"
)
TILT = "largest tilt [rad] of a block that slides instead; none; in rad"
BOUNDARY = "first overturning PGA [g]; Housner's; relative"


def _slips(friction: float, engine: str) -> Measured:
    rock = box(2.0, 2.0, 0.5)
    scene = Scene(rock, Contact(friction))
    response = respond(scene, PULSE, step_of(rock), engine, reduce=False)
    reach = 2.0 * PULSE.pga * PULSE.pgv_pga**2
    return same(response.slip, slip(PULSE, friction), reach)


def _slides(friction: float, engine: str) -> Measured:
    """Friction below b/h = 0.5: the block slides before it can lift."""
    rock = box(1.0, 1.0, 2.0)
    pulse = CosinePulse(0.9 * GRAVITY, 0.3)
    response = respond(Scene(rock, Contact(friction)), pulse, step_of(rock), engine, reduce=False)
    return same(response.peak_tilt, 0.0, 1.0)


def _rocks(friction: float, engine: str) -> Measured:
    rock = box(1.0, 1.0, 2.0)
    return boundary(Scene(rock, Contact(friction)), 0.2, step_of(rock), 0.03, engine)


CASES = (
    *sweep("sliding at {x:g} in {engine}", ("friction", "1", SLIP, 0.01),
           (0.0, 0.001, 0.1, 0.3, 0.49, 0.51, 10.0), _slips, BOTH),
    *sweep("sliding before rocking at {x:g} in {engine}", ("friction", "1", TILT, 0.02),
           (0.1, 0.4, 0.48), _slides, BOTH),
    *sweep("rocking at {x:g}", ("friction", "1", BOUNDARY, 0.03), (0.75, 2.0, 100.0), _rocks),
)  # fmt: skip
