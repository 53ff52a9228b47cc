"""Starts: dropped, inside the pedestal, leaning, or already on the move."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np

from vsr_core import GRAVITY
from vsr_core.outcome import Outcome
from vsr_core.scene import Contact, Scene, State
from vsr_core.verification.stability import Case, Measured
from vsr_core.verification.stability._trial import (
    GRIPPING,
    WEAK,
    block_of,
    box,
    leaning,
    lifted,
    respond,
    step_of,
)

STANDS = "overturned, 0 or 1, and largest tilt [rad]; 0 and 0; in rad"
FALLS = "overturned, 0 or 1; 1 beyond alpha, 0 below"
ANY = "an outcome; a rock that is given a speed is none at rest"


def _stands(start: State, engine: str) -> Measured:
    response = respond(Scene(_ROCK, Contact(GRIPPING), start=start), WEAK, step_of(_ROCK), engine)
    return Measured(response.peak_tilt, 0.0, response.peak_tilt + response.outcome.overturned)


def _falls(share: float, engine: str) -> Measured:
    """Released at ``share`` of the angle at which it balances on its edge."""
    start = leaning(_ROCK, share * block_of(_ROCK).alpha)
    response = respond(Scene(_ROCK, Contact(GRIPPING), start=start), WEAK, step_of(_ROCK), engine)
    found, expected = float(response.outcome is Outcome.OVERTURNED), float(share > 1.0)
    return Measured(found, expected, abs(found - expected))


def _moves(speed: float, engine: str) -> Measured:
    start = replace(lifted(_ROCK, 0.0), velocity=np.array([speed, 0.0, 0.0]))
    respond(Scene(_ROCK, Contact(GRIPPING), start=start), WEAK, step_of(_ROCK), engine)
    return Measured(speed, 0.0, math.inf)


_ROCK = box(1.0, 1.0, 2.0)

_SPEED = math.sqrt(GRAVITY * _ROCK.radius)

CASES = (
    *(
        Case(f"dropped by {h:g} radii in {engine}", "start", "height", h, "radius", STANDS, 0.02,
             partial(_stands, lifted(_ROCK, h * _ROCK.radius), engine))
        for engine in ("bullet", "mujoco") for h in (1e-4, 1e-2, 0.1, 1.0, 10.0)
    ),
    *(
        Case(f"{d:g} radii inside the pedestal in {engine}", "start", "depth", d, "radius", STANDS,
             0.02, partial(_stands, lifted(_ROCK, -d * _ROCK.radius), engine))
        for engine in ("bullet", "mujoco") for d in (1e-4, 1e-3, 9e-3, 1.1e-2, 0.05, 0.5)
    ),
    *(
        Case(f"released at {s:g} alpha in {engine}", "start", "tilt", s, "alpha", FALLS, 0.0,
             partial(_falls, s, engine))
        for engine in ("bullet", "mujoco") for s in (0.5, 0.98, 1.02)
    ),
    Case("thrown along x", "start", "speed", _SPEED, "m/s", ANY, 0.0,
         partial(_moves, _SPEED, "bullet")),
)  # fmt: skip
