"""A table under a servo that drives a pedestal and the rock on it: its sampled loop is linear.

References
----------
Chen et al. (2024), Seismica 3(1): the servo and its published gains, Fig. 7a.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from vsr_core.motions.pulses import CosinePulse
from vsr_core.scene import Contact, Scene
from vsr_core.table.servo import PUBLISHED
from vsr_core.verification.reference import BULLET, case
from vsr_core.verification.rocks import box
from vsr_core.verification.tracking import push, track

PULSE = CosinePulse.from_g(0.2, 0.8)
"""That of Fig. 7a. It moves no block of alpha above 0.2 with a friction above 0.2."""


@cache
def _scene() -> Scene:
    return Scene(box(1.0, 1.0, 2.0), Contact(0.6), drive=PUBLISHED)


def _tracking(engine: str, time_step: float) -> float:
    """Root mean square error of the table's velocity, relative to PGV."""
    assert engine == "bullet"  # the one that has a driven table
    followed = track(_scene(), PULSE, min(time_step, PUBLISHED.period), after=0.0)
    error = push(followed, _scene())
    return float(np.sqrt(np.mean(error**2))) / (PULSE.pga * PULSE.pgv_pga)


LOOP = (
    "the sampled linear loop, with the rock's mass on the table's: a force held over a period "
    "changes the velocity by F h / M. Published servo at 1 kHz, whatever the step"
)

CASES = (case("servo tracking", LOOP, 1e-5, _tracking, engines=BULLET),)
