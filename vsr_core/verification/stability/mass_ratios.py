"""Mass ratios: a rock far lighter and far heavier than the table that it rides on."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import cast

import numpy as np

from vsr_core import engines
from vsr_core.engines.interface import DrivenWorld
from vsr_core.motions.cosine_pulse import CosinePulse
from vsr_core.run.cases import Settings, prepare
from vsr_core.run.input_checks import check
from vsr_core.run.sampling import samples
from vsr_core.scene import Contact, Scene
from vsr_core.table.servo import Servo, loop
from vsr_core.verification.stability import Case, Measured
from vsr_core.verification.stability._trial import GRIPPING, _barrier, box, same

PERIOD = 1e-3

PULSE = CosinePulse.from_g(0.4, 0.2)

REFERENCE = (
    "velocity [m/s] of the table after the pulse against the sampled loop with both masses; error: "
    "largest difference of velocities on the way / PGV"
)


def _rides(ratio: float, share: float, gained: str) -> Measured:
    """Squat rock that sticks to a table of 1 / ``ratio`` of its mass."""
    rock = box(2.0, 2.0, 0.5)
    table = rock.mass / ratio
    moved = table if gained == "table" else table + rock.mass
    servo = Servo(table, share * moved / PERIOD, 0.0, 0.0, PERIOD)
    scene = Scene(rock, Contact(GRIPPING), drive=servo)
    check(prepare(scene, _barrier(rock), reduce=True), Settings(PERIOD), PULSE)
    wanted = samples(PULSE, servo, PERIOD, math.ceil(PULSE.duration / PERIOD))
    world = cast(DrivenWorld, engines.load("bullet").build(scene, PERIOD, 1))
    speeds = []
    for speed in wanted.tolist():
        world.advance([speed])
        speeds.append(world.table()[1])
    expected = loop(replace(servo, mass=table + rock.mass), wanted)
    difference = float(np.abs(np.array(speeds) - expected).max())
    pgv = PULSE.pga * PULSE.pgv_pga
    end = same(speeds[-1], float(expected[-1]), pgv)
    return replace(end, error=difference / pgv)


CASES = (
    *(
        Case(f"rock / table {ratio:g}", "mass", "rock / table", ratio, "1", REFERENCE, 0.001,
             partial(_rides, ratio, 0.5, "table"))
        for ratio in (1e-6, 1e-4, 1e-2, 1.0, 10.0, 100.0)
    ),
    *(
        Case(f"rock / table {ratio:g}, gain for both", "mass", "rock / table", ratio, "1",
             REFERENCE, 0.001, partial(_rides, ratio, 1.0, "both"))
        for ratio in (1e-2, 0.5, 100.0)
    ),
)  # fmt: skip
