"""Sliding over even ground: borders of triangles, and slabs that cannot tip."""

from __future__ import annotations

import math

import numpy as np

from vsr_core.motions.pulses import CosinePulse
from vsr_core.scene import Contact, Scene
from vsr_core.verification.reference._run import run, slope
from vsr_core.verification.rocks import box, frustum, upright
from vsr_core.verification.stability import ExtremeCase, Measured, sweep
from vsr_core.verification.stability._trial import BOTH, respond, same, step_of

FRICTION = 0.6

SLAB = box(1.2, 1.2, 0.4)
"""It could tip only at a friction of 3."""

TAPERED = frustum((1.2, 1.2), (1.0, 1.0), 0.4)

SPEED = 4.0
"""At the start of a slide over triangles [m/s]."""

HOP = "largest rise [m] of what slides at 4 m/s over level triangles; none; in m"
TILT = "largest tilt [rad] of a slab that can only slide; none; in rad"


def _hop(size: float, engine: str, *, tapered: bool = False) -> Measured:
    rock = TAPERED if tapered else SLAB
    ground = slope(0.0, (-2.0, 5.0), 2.0, size, False)
    velocity = (SPEED * math.cos(0.3), SPEED * math.sin(0.3), 0.0)
    start = upright((0.0, 0.0, rock.height), velocity)
    scene = Scene(rock, Contact(FRICTION), pedestal="terrain", start=start, terrain=ground)
    path = run(engine, scene, 2e-3, np.zeros(500))
    return same(float(path.position[:, 2].max()) - rock.height, 0.0, 1.0)


def _hop_of_a_hull(size: float, engine: str) -> Measured:
    return _hop(size, engine, tapered=True)


def _tilt(pga_g: float, engine: str) -> Measured:
    pulse = CosinePulse.from_g(pga_g, 0.6)
    response = respond(Scene(SLAB, Contact(FRICTION)), pulse, 3.0 * step_of(SLAB), engine)
    return same(response.peak_tilt, 0.0, 1.0)


CASES: tuple[ExtremeCase, ...] = (
    *sweep("box over triangles of {x:g} m in {engine}", ("triangles", "m", HOP, 1e-3),
           (0.5, 0.25), _hop, ("bullet", "nonsmooth")),
    *sweep("hull over triangles of {x:g} m in {engine}", ("triangles", "m", HOP, 1e-3),
           (0.5, 0.25), _hop_of_a_hull, ("bullet", "nonsmooth")),
    *sweep("slab at {x:g} g in {engine}", ("PGA", "g", TILT, 0.02), (1.4, 2.6), _tilt, BOTH),
)  # fmt: skip
