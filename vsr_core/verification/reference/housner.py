"""The motion of Housner's block under the cosine pulse.

Beyond alpha the comparison ends: there the equation can pull on the corner, where a block takes
off. Under the pulses here the corner is pressed by 0.29 of the weight at least until then.

References
----------
Housner (1963), Bull. Seismol. Soc. Am. 53(2), 403-417.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache, partial

import numpy as np
from scipy.integrate import solve_ivp

from vsr_core.arrays import Array
from vsr_core.motions.pulses import CosinePulse
from vsr_core.run.rocking_block import Block
from vsr_core.scene import Contact, Scene
from vsr_core.verification.reference import case
from vsr_core.verification.reference._run import largest, middles, run, whole
from vsr_core.verification.rocks import GRIPPING, box

SIZE = (1.0, 1.0, 2.0)
"""Sides of the block whose motion is followed [m]."""

AFTER = 1.0
"""Time that it is followed after the pulse [s]."""


@cache
def _scene() -> Scene:
    return Scene(box(*SIZE), Contact(GRIPPING))


def _motion(pga_g: float, pgv_pga: float, engine: str, time_step: float) -> float:
    """Largest error of the tilt before it exceeds alpha, relative to alpha."""
    pulse, block = CosinePulse.from_g(pga_g, pgv_pga), Block(0.5 * SIZE[0], 0.5 * SIZE[2])
    in_pulse, step = whole(pulse.duration, time_step)
    times = middles(in_pulse + math.ceil(AFTER / step), step)
    path = run(engine, _scene(), step, pulse.acceleration(times))
    exact = rocking(block, pulse, path.time)
    upright = np.isfinite(exact)
    return largest(path.lean[upright] - exact[upright]) / block.alpha


def rocking(block: Block, pulse: CosinePulse, times: Array) -> Array:
    """Tilt of Housner's block about +y, from rest under a pulse that lifts it at once.

    theta'' = -p^2 [sin(s alpha - theta) + (a/g) cos(s alpha - theta)], s the side it leans to, from
    impact to impact and on either side of the pulse's end; rates keep their impact ratio.
    Not for a block that comes to rest, which takes infinitely many impacts. Written apart from
    ``vsr_core.run.rocking_block``, as a check on that too.

    Parameters
    ----------
    times : ndarray, shape (n,) [s], rising from 0

    Returns
    -------
    ndarray, shape (n,) [rad]; nan once it exceeds alpha
    """
    tilt = np.full_like(times, math.nan)
    side = -math.copysign(1.0, pulse.pga)
    t, theta, rate = 0.0, 0.0, 0.0
    last = float(times[-1])
    for end in (min(pulse.duration, last), last):
        while t < end:
            leg = solve_ivp(
                partial(_equation, block, pulse.pga if t < pulse.duration else 0.0,
                        pulse.pgv_pga, side),
                (t, end), (theta, rate), "DOP853", dense_output=True,
                events=(_lands(side), _lies(side, block.alpha)), rtol=1e-11, atol=1e-13,
            )  # fmt: skip
            here = (times >= t) & (times <= leg.t[-1])
            if here.any():
                tilt[here] = leg.sol(times[here])[0]
            t, (theta, rate) = float(leg.t[-1]), map(float, leg.y[:, -1])
            if leg.t_events[1].size:
                return tilt
            if leg.t_events[0].size:
                side, theta, rate = -side, 0.0, rate * block.impact_ratio
    return tilt


def _equation(
    block: Block, pga: float, pgv_pga: float, side: float, t: float, y: Array
) -> tuple[float, float]:
    lean = side * block.alpha - float(y[0])
    push = pga / block.gravity * math.cos(t / pgv_pga)
    return float(y[1]), -(block.p**2) * (math.sin(lean) + push * math.cos(lean))


def _lands(side: float) -> Callable[[float, Array], float]:
    def event(_: float, y: Array) -> float:
        # A start from rest, at exactly zero, is no landing.
        return side * float(y[0]) + 1e-15

    event.terminal, event.direction = True, -1  # type: ignore[attr-defined]
    return event


def _lies(side: float, alpha: float) -> Callable[[float, Array], float]:
    def event(_: float, y: Array) -> float:
        return side * float(y[0]) - alpha

    event.terminal = True  # type: ignore[attr-defined]
    return event


ANSWER = "Housner's equation (1963), integrated from impact to impact."

CASES = (
    case("tilt of a block that rocks and stands", ANSWER, 0.02, _motion, 0.8, 0.15),
    case("tilt of a block that overturns after an impact", ANSWER, 0.01, _motion, 1.2, 0.15),
    case("tilt of a block that overturns at once", ANSWER, 4e-3, _motion, 1.5, 0.3, order=1.0),
)
