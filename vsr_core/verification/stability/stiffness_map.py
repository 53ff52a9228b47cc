"""The map: time step against contact stiffness, from coarse to fine and from soft to rigid."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial

from vsr_core import GRAVITY
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import Outcome
from vsr_core.run import rocking_block
from vsr_core.run.input_checks import longest_step, longest_step_on_springs, softest
from vsr_core.scene import Contact, Scene
from vsr_core.verification.rocks import GRIPPING, box
from vsr_core.verification.stability import ExtremeCase, Measured
from vsr_core.verification.stability._trial import block_of, respond
from vsr_core.verification.stability.soft_contact import sink, springs

TIME_STEPS = (1.0 / 30.0, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5)
STIFFNESSES = (1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, math.inf)
"""[s] and [N/m]; a rigid contact is infinitely stiff."""

SIZE = (1.0, 1.0, 2.0)

RATIO = 0.2

TOLERANCE = 0.03

REFERENCE = (
    "depth [m] at rest, m g / (4 k), relative; and pulses 3 % below and above Housner's boundary, "
    "which the block has to survive and not to"
)


@dataclass(frozen=True)
class Limits:
    """Where the program refuses, before a run.

    Attributes
    ----------
    step : float [s], longest for the rock
    spring_steps : tuple of float [s], longest for each of the finite ``STIFFNESSES``
    stiffness : float [N/m], least
    """

    step: float
    spring_steps: tuple[float, ...]
    stiffness: float


def limits() -> Limits:
    """Limits on the map."""
    rock = box(*SIZE)
    finite = [k for k in STIFFNESSES if math.isfinite(k)]
    return Limits(
        longest_step(Scene(rock, Contact(GRIPPING)), "bullet"),
        tuple(longest_step_on_springs(springs(rock, k), rock.mass) for k in finite),
        softest(rock),
    )


def _point(time_step: float, stiffness: float) -> Measured:
    rock = box(*SIZE)
    rigid = math.isinf(stiffness)
    contact = Contact(GRIPPING) if rigid else springs(rock, stiffness)
    found = Measured(0.0, 0.0, 0.0) if rigid else sink(rock, contact, time_step)
    edge = rocking_block.first_overturning_pga(block_of(rock), RATIO, 2.0 * GRAVITY, 0.02 * GRAVITY)
    for side, expected in ((-1.0, Outcome.BALANCED), (1.0, Outcome.OVERTURNED)):
        pulse = CosinePulse(edge * (1.0 + side * TOLERANCE), RATIO)
        outcome = respond(Scene(rock, contact), pulse, time_step).outcome
        if outcome is not expected:
            note = f"{outcome.name.lower()} at {pulse.pga / GRAVITY:.3f} g"
            return replace(found, error=math.inf, note=note)
    return found


POINTS = {
    f"step {1e3 * h:.3g} ms, " + ("rigid" if math.isinf(k) else f"{k:g} N/m"): (h, k)
    for k in STIFFNESSES
    for h in TIME_STEPS
}
"""Time step [s] and stiffness [N/m] of each case."""

CASES = tuple(
    ExtremeCase(name, "time step", h, "s", REFERENCE, TOLERANCE, partial(_point, h, k))
    for name, (h, k) in POINTS.items()
)
