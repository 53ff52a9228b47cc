"""Mass ratios: a rock far lighter and far heavier than the table that it rides on."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from vsr_core.motions.pulses import CosinePulse
from vsr_core.scene import Contact, Scene
from vsr_core.table.servo import Servo
from vsr_core.verification.rocks import GRIPPING, box
from vsr_core.verification.stability import Measured, sweep
from vsr_core.verification.stability._trial import followed, same

PERIOD = 1e-3

PULSE = CosinePulse.from_g(0.4, 0.2)

REFERENCE = (
    "velocity [m/s] of the table after the pulse against the sampled loop with both masses; error: "
    "largest difference of velocities on the way / PGV"
)


def _rides(share: float, gained: str, ratio: float, engine: str) -> Measured:
    """Squat rock that sticks to a table of 1 / ``ratio`` of its mass."""
    rock = box(2.0, 2.0, 0.5)
    table = rock.mass / ratio
    moved = table if gained == "table" else table + rock.mass
    servo = Servo(table, share * moved / PERIOD, 0.0, 0.0, PERIOD)
    history, expected = followed(Scene(rock, Contact(GRIPPING), drive=servo), PULSE)
    pgv = PULSE.pga * PULSE.pgv_pga
    difference = float(np.abs(history.measured - expected).max())
    end = same(float(history.measured[-1]), float(expected[-1]), pgv)
    return replace(end, error=difference / pgv)


VARIED = ("rock / table", "1", REFERENCE, 0.001)

CASES = (
    *sweep("rock / table {x:g}", VARIED, (1e-6, 1e-4, 1e-2, 1.0, 10.0, 100.0),
           partial(_rides, 0.5, "table")),
    *sweep("rock / table {x:g}, gain for both", VARIED, (1e-2, 0.5, 100.0),
           partial(_rides, 1.0, "both")),
)  # fmt: skip
