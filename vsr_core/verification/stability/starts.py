"""Starts: dropped, inside the pedestal, leaning, or already on the move."""

from __future__ import annotations

import math

from vsr_core import GRAVITY
from vsr_core.outcome import Outcome, Response
from vsr_core.scene import Contact, Scene, State
from vsr_core.verification.rocks import GRIPPING, box, leaning, upright
from vsr_core.verification.stability import Measured, sweep
from vsr_core.verification.stability._trial import BOTH, WEAK, block_of, lifted, respond, step_of

STANDS = "overturned, 0 or 1, and largest tilt [rad]; 0 and 0; in rad"
FALLS = "overturned, 0 or 1; 1 beyond alpha, 0 below"
ANY = "an outcome; a rock that is given a speed is none at rest"

ROCK = box(1.0, 1.0, 2.0)


def _started(start: State, engine: str) -> Response:
    scene = Scene(ROCK, Contact(GRIPPING), start=start)
    return respond(scene, WEAK, step_of(ROCK), engine)


def _dropped(radii: float, engine: str) -> Measured:
    """It stands in the end."""
    response = _started(lifted(ROCK, radii * ROCK.radius), engine)
    return Measured(response.peak_tilt, 0.0, response.peak_tilt + response.outcome.overturned)


def _inside(radii: float, engine: str) -> Measured:
    return _dropped(-radii, engine)


def _falls(share: float, engine: str) -> Measured:
    """Released at ``share`` of the angle at which it balances on its edge."""
    response = _started(leaning(ROCK, share * block_of(ROCK).alpha), engine)
    found, expected = float(response.outcome is Outcome.OVERTURNED), float(share > 1.0)
    return Measured(found, expected, abs(found - expected))


def _moves(speed: float, engine: str) -> Measured:
    _started(upright((0.0, 0.0, ROCK.height), (speed, 0.0, 0.0)), engine)
    return Measured(speed, 0.0, math.inf)


CASES = (
    *sweep("dropped by {x:g} radii in {engine}", ("height", "radius", STANDS, 0.02),
           (1e-4, 1e-2, 0.1, 1.0, 10.0), _dropped, BOTH),
    *sweep("{x:g} radii inside the pedestal in {engine}", ("depth", "radius", STANDS, 0.02),
           (1e-4, 1e-3, 9e-3, 1.1e-2, 0.05, 0.5), _inside, BOTH),
    *sweep("released at {x:g} alpha in {engine}", ("tilt", "alpha", FALLS, 0.0), (0.5, 0.98, 1.02),
           _falls, BOTH),
    *sweep("thrown along x", ("speed", "m/s", ANY, 0.0), (math.sqrt(GRAVITY * ROCK.radius),),
           _moves),
)  # fmt: skip
