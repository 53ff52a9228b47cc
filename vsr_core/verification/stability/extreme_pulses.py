"""Motions: PGA from nothing to 3 g, PGV/PGA from 5 ms to 2 s."""

from __future__ import annotations

import math
from functools import partial

from vsr_core import GRAVITY
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import Outcome
from vsr_core.run import rocking_block
from vsr_core.scene import Contact, Scene
from vsr_core.verification.rocks import GRIPPING, box
from vsr_core.verification.stability import ExtremeCase, Measured, sweep
from vsr_core.verification.stability._trial import block_of, respond, step_of

REFERENCE = (
    "largest tilt [rad], pi / 2 if it overturned; Housner's equation, integrated; relative to "
    "alpha, and infinite on the wrong side"
)


def _peak(ratio: float, pga_g: float, engine: str) -> Measured:
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


def _pulse(ratio: float, pga_g: float, engine: str = "bullet") -> ExtremeCase:
    name = f"PGV/PGA {ratio:g} s at {pga_g:g} g" + (f" in {engine}" if engine != "bullet" else "")
    measure = partial(_peak, ratio, pga_g, engine)
    return ExtremeCase(name, "PGV/PGA", ratio, "s", REFERENCE, 0.03, measure)


CASES = (
    *sweep("PGA {x:g} g", ("PGA", "g", REFERENCE, 0.03),
           (0.001, 0.1, 0.45, 0.52, 0.56, 0.64, 0.68, 0.8, 1.0, 2.0, 3.0), partial(_peak, 0.2)),
    _pulse(0.005, 3.0),
    _pulse(0.01, 3.0),
    _pulse(0.02, 3.0),
    _pulse(0.05, 2.0),
    _pulse(0.1, 1.2),
    _pulse(0.5, 1.0),
    _pulse(1.0, 1.0),
    _pulse(2.0, 0.52),
    _pulse(2.0, 1.0),
    _pulse(0.005, 3.0, "mujoco"),
    _pulse(0.05, 2.0, "mujoco"),
    _pulse(2.0, 1.0, "mujoco"),
)  # fmt: skip
