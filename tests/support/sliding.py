"""A mass that slides on a shaken plane: what a squat block does, without any engine."""

from __future__ import annotations

import math

import numpy as np

from vsr_core import GRAVITY
from vsr_core.motions.pulses import CosinePulse


def rigid_plastic_slip(pulse: CosinePulse, friction: float) -> float:
    """Largest travel on the table of a sliding mass: x'' = -a - mu g sgn(x'), or stuck."""
    steps = 200_000
    dt = 1.3 * pulse.duration / steps + 2.0 / steps
    grip, x, v, farthest = friction * GRAVITY, 0.0, 0.0, 0.0
    for a in pulse.acceleration((np.arange(steps) + 0.5) * dt).tolist():
        free = v - a * dt
        v = math.copysign(max(abs(free) - grip * dt, 0.0), free)
        x += v * dt
        farthest = max(farthest, abs(x))
    return farthest
