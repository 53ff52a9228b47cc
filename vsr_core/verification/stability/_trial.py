"""Shared by the families: rocks, runs as the program does them, and how they are compared."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numpy as np
from trimesh.convex import convex_hull

from vsr_core import GRAVITY
from vsr_core.errors import InvalidInput
from vsr_core.motions.cosine_pulse import CosinePulse, GroundMotion
from vsr_core.outcome import Outcome, Response
from vsr_core.rock import solid
from vsr_core.rock.body import Rock
from vsr_core.run.bounds import Barrier, barrier
from vsr_core.run.cases import Case, Settings, prepare
from vsr_core.run.input_checks import check, check_unshaken
from vsr_core.run.overturning import simulate
from vsr_core.scene import Scene, State
from vsr_core.verification import rocking_block
from vsr_core.verification.rocking_block import Block
from vsr_core.verification.stability import Measured

DENSITY = 2110.0
"""Density of the rocks [kg/m^3], that of chert in the paper."""

GRIPPING = 10.0
"""Coefficient of friction with which nothing slides."""

STEP_SHARE = 0.002
"""Time step in units of sqrt(radius / g) where it is not what is varied."""

PROBES = (4.0, 2.0, 1.0, 0.5, 0.25)
"""Distances from a boundary at which outcomes are compared, in tolerances, the farthest first."""

WEAK = CosinePulse.from_g(0.001, 0.3)
"""A pulse that moves nothing."""


@cache
def box(width: float, depth: float, height: float) -> Rock:
    """Box of the given sides along x, y and z [m]."""
    return solid.box((width, depth, height), DENSITY).rock


@cache
def frustum(base: tuple[float, float], top: tuple[float, float], height: float) -> Rock:
    """Hull with a rectangular base and top of the given sides along x and y [m]."""
    corners = [
        (0.5 * sides[0] * x, 0.5 * sides[1] * y, level)
        for sides, level in ((base, 0.0), (top, height))
        for x in (-1.0, 1.0)
        for y in (-1.0, 1.0)
    ]
    return solid.from_mesh(convex_hull(np.array(corners)), DENSITY).rock


def block_of(rock: Rock) -> Block:
    """Housner's block that a symmetric rock is when it rocks across x."""
    low = rock.vertices[rock.vertices[:, 2] < -rock.height + 1e-9 * rock.radius]
    half, height = float(low[:, 0].max()), rock.height
    turning = float((rock.axes * rock.inertia @ rock.axes.T)[1, 1]) / rock.mass
    lever = half**2 + height**2
    return Block(half, height, inertia_ratio=(turning + lever) / lever)


def unit(rock: Rock) -> float:
    """Time scale of a rock, sqrt(radius / g) [s]."""
    return math.sqrt(rock.radius / GRAVITY)


def step_of(rock: Rock) -> float:
    """Time step [s] where it is not what is varied."""
    return STEP_SHARE * unit(rock)


def respond(
    scene: Scene,
    motion: GroundMotion,
    time_step: float,
    engine: str = "bullet",
    *,
    reduce: bool = True,
) -> Response:
    """Response of a checked run.

    Raises
    ------
    InvalidInput
        If the program refuses the run, or ends it without an outcome.
    """
    settings = Settings(time_step, reduce, engine)
    case = _prepared(scene, reduce)
    check(case, settings, motion)
    _check_unshaken(scene, settings)
    return decided(simulate(case, motion, settings))


def decided(response: Response) -> Response:
    """The response; refuses one that is without an outcome."""
    if response.outcome is Outcome.UNSTABLE:
        raise InvalidInput(
            "a run that ended unstable",
            "its guards failed at six time steps, each half the one before",
            "shorten the step, or look for what is inside the pedestal or adds energy",
        )
    if response.outcome is Outcome.UNSETTLED:
        raise InvalidInput(
            "a run that ended unsettled",
            "when time was up it was neither at rest nor without the energy to change sides",
            "count it for neither side",
        )
    return response


def boundary(
    scene: Scene, pgv_pga: float, time_step: float, tolerance: float, engine: str = "bullet"
) -> Measured:
    """First overturning PGA [g] against Housner's; the error is relative to that.

    Outcomes are compared at ``PROBES`` on either side. The error is the distance from which they
    agree; infinite if they do not even at the farthest.
    """
    block = block_of(scene.rock)
    step = 0.01 * max(block.uplift, 0.1 * GRAVITY)
    expected = rocking_block.first_overturning_pga(block, pgv_pga, 4.0 * GRAVITY, step)

    def topples(pga: float) -> bool:
        response = respond(scene, CosinePulse(pga, pgv_pga), time_step, engine)
        return response.outcome is Outcome.OVERTURNED

    def should(pga: float) -> bool:
        return rocking_block.rocking_response(block, pga, pgv_pga).overturned

    errors = {side: side * _agree(topples, should, expected, side * tolerance) for side in (1, -1)}
    error = max(errors.values(), key=abs)
    return Measured(expected * (1.0 + error) / GRAVITY, expected / GRAVITY, abs(error))


def _agree(
    topples: Callable[[float], bool], should: Callable[[float], bool], pga: float, unit: float
) -> float:
    error = math.inf
    for probe in PROBES:
        tried = pga * (1.0 + probe * unit)
        if topples(tried) != should(tried):
            return error
        error = probe * abs(unit)
    return error


def same(measured: float, expected: float, scale: float, note: str = "") -> Measured:
    """Two numbers, their difference relative to ``scale``."""
    return Measured(measured, expected, abs(measured - expected) / scale, note)


def tilt(state: State) -> float:
    """Angle of the rock's axis from the vertical [rad]."""
    return math.acos(max(-1.0, min(1.0, float(state.rotation[2, 2]))))


def leaning(rock: Rock, lean: float) -> State:
    """State at rest of a box tilted by ``lean`` [rad] about its lower edge towards +x."""
    half = float(np.abs(rock.vertices[:, 0]).max())
    cos, sin = math.cos(lean), math.sin(lean)
    turn = np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
    place = np.array([half, 0.0, 0.0]) - turn @ np.array([half, 0.0, -rock.height])
    return State(place, turn, np.zeros(3), np.zeros(3))


def lifted(rock: Rock, height: float, speed: float = 0.0) -> State:
    """State upright, ``height`` [m] above the rest pose, moving down at ``speed`` [m/s]."""
    place = np.array([0.0, 0.0, rock.height + height])
    return State(place, np.eye(3), np.array([0.0, 0.0, -speed]), np.zeros(3))


@cache
def _prepared(scene: Scene, reduce: bool) -> Case:
    return prepare(scene, _barrier(scene.rock), reduce=reduce)


@cache
def _check_unshaken(scene: Scene, settings: Settings) -> None:
    check_unshaken(_prepared(scene, settings.reduce), settings, WEAK)


@cache
def _barrier(rock: Rock) -> Barrier:
    return barrier(rock)
