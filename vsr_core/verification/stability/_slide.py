"""A mass that slides on a shaken table: a reference for any motion, free of any physics engine."""

from __future__ import annotations

import math

import numpy as np

from vsr_core import GRAVITY
from vsr_core.motions.ground_motion import GroundMotion

STEPS = 200_000


def slip(motion: GroundMotion, friction: float, rest: float = 2.0) -> float:
    """Farthest travel [m] relative to the table, rigid-plastic: x'' = -a - mu g sgn(x'), or stuck.

    Parameters
    ----------
    friction : float, Coulomb's coefficient
    rest : float [s], time after the motion
    """
    dt = (motion.duration + rest) / STEPS
    grip, x, v, farthest = friction * GRAVITY, 0.0, 0.0, 0.0
    middles = (np.arange(STEPS, dtype=np.float64) + 0.5) * dt
    for a in motion.acceleration(middles).tolist():
        free = v - a * dt
        v = math.copysign(max(abs(free) - grip * dt, 0.0), free)
        x += v * dt
        farthest = max(farthest, abs(x))
    return farthest
