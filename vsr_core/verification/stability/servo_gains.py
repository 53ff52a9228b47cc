"""The servo: gains and hold periods up to the limit of its sampled loop and past it."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from vsr_core.arrays import Array
from vsr_core.motions.pulses import CosinePulse
from vsr_core.scene import Contact, Scene
from vsr_core.table.servo import PUBLISHED, Servo
from vsr_core.verification.rocks import GRIPPING, box
from vsr_core.verification.stability import ExtremeCase, Measured, sweep
from vsr_core.verification.stability._trial import boundary, followed, step_of

PULSE = CosinePulse.from_g(0.2, 0.8)
"""The paper's Fig. 7a: the block stands, and table and rock move as one."""

LOOP = (
    "rms velocity error [m/s] against the sampled loop with the rock's mass on the table; "
    "error: largest difference of velocities / PGV"
)
BOUNDARY = "first overturning PGA [g] on the driven table; Housner's; relative"


def _tracks(servo: Servo) -> Measured:
    history, expected = followed(Scene(box(1.0, 1.0, 2.0), Contact(0.6), drive=servo), PULSE)
    measured, wanted = history.measured, history.command
    error = float(np.abs(measured - expected).max()) / (PULSE.pga * PULSE.pgv_pga)
    return Measured(_rms(measured - wanted), _rms(expected - wanted), error)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _boundary(share: float, engine: str) -> Measured:
    """On a table so heavy that the rock does not move it, at a period of ``share`` of PGV/PGA."""
    ratio = 0.2
    rock, mass, period = box(1.0, 1.0, 2.0), 1e6, share * ratio
    servo = Servo(mass, mass / period, 0.0, 0.0, period)
    scene = Scene(rock, Contact(GRIPPING), drive=servo)
    return boundary(scene, ratio, step_of(rock), 0.03, engine)


def _case(name: str, parameter: str, value: float, unit: str, servo: Servo) -> ExtremeCase:
    return ExtremeCase(name, parameter, value, unit, LOOP, 0.001, partial(_tracks, servo))


def _gains(share: float) -> Servo:
    return replace(PUBLISHED, kp=share * PUBLISHED.mass / PUBLISHED.period)


CASES = (
    _case("published gains at 1 kHz", "hold period", 1e-3, "s", PUBLISHED),
    _case("published gains at 200 Hz", "hold period", 5e-3, "s", replace(PUBLISHED, period=5e-3)),
    *(
        _case(f"hold {1e3 * h:g} ms", "hold period", h, "s", replace(PUBLISHED, period=h))
        for h in (1e-4, 5e-4, 1.5e-3, 1.9e-3, 1.99e-3, 2e-3, 2.1e-3, 4e-3)
    ),
    *(
        _case(f"Kp h / M = {share:g}", "Kp h / M", share, "1", _gains(share))
        for share in (0.01, 0.1, 0.5, 1.5, 1.9, 1.99, 2.0, 2.5, 20.0)
    ),
    *(
        _case(f"Ki h^2 / M = {i:g}", "Ki h^2 / M", i, "1", replace(PUBLISHED, ki=i * 5e10))
        for i in (0.1, 1.0, 1.9, 2.1)
    ),
    *(
        _case(f"Kd / M = {d:g}", "Kd / M", d, "1", replace(_gains(0.5), kd=d * 5e4))
        for d in (0.1, 0.7, 0.8, 1.0)
    ),
    _case("published gains on 500 kg", "pedestal", 500.0, "kg", replace(PUBLISHED, mass=500.0)),
    *(
        _case(f"force limit {f:g} N", "force limit", f, "N", replace(PUBLISHED, force_limit=f))
        for f in (1e3, 5e4)
    ),
    *sweep("period {x:g} of PGV/PGA", ("hold period / PGV/PGA", "1", BOUNDARY, 0.03),
           (0.05, 0.4, 0.5, 2.0), _boundary),
)  # fmt: skip
