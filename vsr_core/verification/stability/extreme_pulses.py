"""Motions: PGA from nothing to 3 g, PGV/PGA from 5 ms to 2 s."""

from __future__ import annotations

import math
from functools import partial

from vsr_core import GRAVITY
from vsr_core.motions.cosine_pulse import CosinePulse
from vsr_core.outcome import Outcome
from vsr_core.scene import Contact, Scene
from vsr_core.verification import rocking_block
from vsr_core.verification.stability import Case, Measured
from vsr_core.verification.stability._trial import GRIPPING, block_of, box, respond, step_of

REFERENCE = (
    "largest tilt [rad], pi / 2 if it overturned; Housner's equation, integrated; relative to "
    "alpha, and infinite on the wrong side"
)


def _peak(pga_g: float, ratio: float, engine: str = "bullet") -> Measured:
    rock = box(1.0, 1.0, 2.0)
    block = block_of(rock)
    expected = rocking_block.rocking_response(block, pga_g * GRAVITY, ratio)
    scene, pulse = Scene(rock, Contact(GRIPPING)), CosinePulse.from_g(pga_g, ratio)
    response = respond(scene, pulse, step_of(rock), engine, reduce=False)
    overturned = response.outcome is Outcome.OVERTURNED
    if overturned or expected.overturned:
        error = 0.0 if overturned is expected.overturned else math.inf
        peak = math.pi / 2.0 if overturned else response.peak_tilt
        return Measured(peak, expected.peak_angle, error)
    error = abs(response.peak_tilt - expected.peak_angle) / block.alpha
    return Measured(response.peak_tilt, expected.peak_angle, error)


CASES = (
    *(
        Case(f"PGA {a:g} g", "motion", "PGA", a, "g", REFERENCE, 0.03, partial(_peak, a, 0.2))
        for a in (0.001, 0.1, 0.45, 0.52, 0.56, 0.64, 0.68, 0.8, 1.0, 2.0, 3.0)
    ),
    *(
        Case(f"PGV/PGA {r:g} s at {a:g} g", "motion", "PGV/PGA", r, "s", REFERENCE, 0.03,
             partial(_peak, a, r))
        for r, a in ((0.005, 3.0), (0.01, 3.0), (0.02, 3.0), (0.05, 2.0), (0.1, 1.2), (0.5, 1.0),
                     (1.0, 1.0), (2.0, 0.52), (2.0, 1.0))
    ),
    *(
        Case(f"PGV/PGA {r:g} s at {a:g} g in mujoco", "motion", "PGV/PGA", r, "s", REFERENCE, 0.03,
             partial(_peak, a, r, "mujoco"))
        for r, a in ((0.005, 3.0), (0.05, 2.0), (2.0, 1.0))
    ),
)  # fmt: skip
