"""Time steps from coarse to fine: how far a block that is let go swings back."""

from __future__ import annotations

import math
from functools import partial

from vsr_core import engines
from vsr_core.motions.cosine_pulse import CosinePulse
from vsr_core.run.cases import Settings, prepare
from vsr_core.run.input_checks import check
from vsr_core.scene import Contact, Scene
from vsr_core.verification import rocking_block
from vsr_core.verification.stability import Case, Measured
from vsr_core.verification.stability._trial import (
    GRIPPING,
    WEAK,
    _barrier,
    block_of,
    box,
    leaning,
    respond,
    same,
    unit,
)

SWING = "first swing to the other side [rad]; Housner's impact; relative"
COARSE_MOTION = "largest tilt [rad] under a pulse far shorter than the step; the same finer; alpha"

RELEASED = (0.3, 0.5, 0.7)
"""Tilts at which the block is let go, in units of alpha; the worst counts."""


def _swing(share: float, height: float, engine: str) -> Measured:
    """At a step of ``share`` of sqrt(radius / g)."""
    rock = box(1.0, 1.0, height)
    block, step = block_of(rock), share * unit(rock)
    found = []
    for released in RELEASED:
        lean = released * block.alpha
        scene = Scene(rock, Contact(GRIPPING), start=leaning(rock, lean))
        check(prepare(scene, _barrier(rock), reduce=True), Settings(step, engine=engine), WEAK)
        expected = rocking_block.free_amplitude(block, lean, 1)
        time = 0.25 * rocking_block.free_period(block, lean) + 0.5 * rocking_block.free_period(
            block, expected
        )
        world = engines.load(engine).build(scene, step, 1)
        swing = 0.0
        for _ in range(math.ceil(time / step)):
            world.advance([0.0])
            turn = world.state().rotation
            swing = max(swing, -math.atan2(turn[0, 2], turn[2, 2]))
        found.append(same(swing, expected, expected))
    return max(found, key=lambda one: one.error)


def _short_pulse(share: float) -> Measured:
    """A step of ``share`` of PGV/PGA is refined for the motion, whatever was asked for."""
    rock, ratio = box(1.0, 1.0, 2.0), 0.02
    step = min(share * ratio, 0.006 * unit(rock))
    scene, pulse = Scene(rock, Contact(GRIPPING)), CosinePulse.from_g(3.0, ratio)
    found, finer = (respond(scene, pulse, h).peak_tilt for h in (step, 0.002 * ratio))
    return same(found, finer, block_of(rock).alpha)


SHARES = (0.1, 0.03, 0.012, 0.006, 0.004, 0.002, 0.001, 0.0003, 0.0001)

CASES = (
    *(
        Case(f"swing of 1:{s:g} at {x:g} in {engine}", "step", "step / sqrt(R/g)", x, "1", SWING,
             0.03, partial(_swing, x, s, engine))
        for engine in ("bullet", "mujoco") for s in (2.0, 10.0) for x in SHARES
    ),
    *(
        Case(f"step {x:g} of PGV/PGA", "step", "step / (PGV/PGA)", x, "1", COARSE_MOTION, 0.03,
             partial(_short_pulse, x))
        for x in (0.01, 0.1, 1.0)
    ),
)  # fmt: skip
