"""Time steps from coarse to fine: how far a block that is let go swings back."""

from __future__ import annotations

import math
from functools import partial

from vsr_core.motions.pulses import CosinePulse
from vsr_core.scene import Contact, Scene
from vsr_core.verification import rocking_forms
from vsr_core.verification.rocks import GRIPPING, box, leaning, unit
from vsr_core.verification.stability import Measured, sweep
from vsr_core.verification.stability._trial import BOTH, block_of, checked_world, respond, same

SWING = "first swing to the other side [rad]; Housner's impact; relative"
COARSE_MOTION = "largest tilt [rad] under a pulse far shorter than the step; the same finer; alpha"

RELEASED = (0.3, 0.5, 0.7)
"""Tilts at which the block is let go, in units of alpha; the worst counts."""

SHARES = (0.1, 0.03, 0.012, 0.006, 0.004, 0.002, 0.001, 0.0003, 0.0001)


def _swing(height: float, share: float, engine: str) -> Measured:
    """At a step of ``share`` of sqrt(radius / g)."""
    rock = box(1.0, 1.0, height)
    block, step = block_of(rock), share * unit(rock)
    found = []
    for released in RELEASED:
        lean = released * block.alpha
        scene = Scene(rock, Contact(GRIPPING), start=leaning(rock, lean))
        world = checked_world(scene, step, engine)
        expected = rocking_forms.free_amplitude(block, lean, 1)
        time = 0.25 * rocking_forms.free_period(block, lean) + 0.5 * rocking_forms.free_period(
            block, expected
        )
        swing = 0.0
        for _ in range(math.ceil(time / step)):
            world.advance([0.0])
            turn = world.state().rotation
            swing = max(swing, -math.atan2(turn[0, 2], turn[2, 2]))
        found.append(same(swing, expected, expected))
    return max(found, key=lambda one: one.error)


def _short_pulse(share: float, engine: str) -> Measured:
    """A step of ``share`` of PGV/PGA is refined for the motion, whatever was asked for."""
    rock, ratio = box(1.0, 1.0, 2.0), 0.02
    step = min(share * ratio, 0.006 * unit(rock))
    scene, pulse = Scene(rock, Contact(GRIPPING)), CosinePulse.from_g(3.0, ratio)
    found, finer = (respond(scene, pulse, h, engine).peak_tilt for h in (step, 0.002 * ratio))
    return same(found, finer, block_of(rock).alpha)


CASES = (
    *(
        case
        for slenderness in (2.0, 10.0)
        for case in sweep(f"swing of 1:{slenderness:g} at {{x:g}} in {{engine}}",
                          ("step / sqrt(R/g)", "1", SWING, 0.03), SHARES,
                          partial(_swing, slenderness), BOTH)
    ),
    *sweep("step {x:g} of PGV/PGA", ("step / (PGV/PGA)", "1", COARSE_MOTION, 0.03),
           (0.01, 0.1, 1.0), _short_pulse),
)  # fmt: skip
