"""A table under a servo that drives a pedestal and the rock on it: its sampled loop is linear.

References
----------
Chen et al. (2024), Seismica 3(1): the servo and its published gains, Fig. 7a.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import cast

import numpy as np

from vsr_core import engines
from vsr_core.engines.interface import DrivenWorld
from vsr_core.motions.cosine_pulse import CosinePulse
from vsr_core.run.sampling import samples, sampling
from vsr_core.scene import Contact, Scene
from vsr_core.table.servo import PUBLISHED, loop
from vsr_core.verification.reference import Reference
from vsr_core.verification.reference._run import box

PULSE = CosinePulse.from_g(0.2, 0.8)
"""That of Fig. 7a. It moves no block of alpha above 0.2 with a friction above 0.2."""


@cache
def _scene() -> Scene:
    return Scene(box(1.0, 1.0, 2.0), Contact(0.6), drive=PUBLISHED)


def tracking(engine: str, time_step: float) -> float:
    """Root mean square error of the table's velocity, relative to PGV."""
    plan = sampling(PULSE, PUBLISHED, min(time_step, PUBLISHED.period))
    wanted = samples(PULSE, PUBLISHED, plan.interval, plan.pulse_samples)
    step = plan.interval / plan.substeps
    world = engines.load(engine).build(_scene(), step, plan.substeps)
    driven = cast(DrivenWorld, world)
    got = []
    for command in wanted.tolist():
        driven.advance([command])
        got.append(driven.table()[1])
    exact = loop(replace(PUBLISHED, mass=PUBLISHED.mass + _scene().rock.mass), wanted)
    return float(np.sqrt(np.mean((np.array(got) - exact) ** 2))) / (PULSE.pga * PULSE.pgv_pga)


CASES = (
    Reference(
        name="servo tracking",
        family="table",
        answer=(
            "the sampled linear loop, with the rock's mass on the table's: a force held over a "
            "period changes the velocity by F h / M. Published servo at 1 kHz, whatever the step"
        ),
        quantity=str(tracking.__doc__),
        tolerance=1e-5,
        step=1e-3,
        order=None,
        engines=("bullet",),
        measure=tracking,
    ),
)
