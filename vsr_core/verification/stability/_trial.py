"""Shared by the families: runs as the program does them, and how they are compared."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numpy as np

from vsr_core import GRAVITY, engines
from vsr_core.arrays import Array
from vsr_core.engines.interface import World
from vsr_core.errors import InvalidInput
from vsr_core.judge.proofs import Barrier, barrier
from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import Outcome, Response
from vsr_core.rock.body import Rock
from vsr_core.run import rocking_block
from vsr_core.run.cases import Case, Settings, prepare
from vsr_core.run.input_checks import check, check_unshaken
from vsr_core.run.overturning import simulate
from vsr_core.run.rocking_block import Block
from vsr_core.scene import Scene, State
from vsr_core.verification.rocks import unit, upright
from vsr_core.verification.stability import Measured
from vsr_core.verification.tracking import TableHistory, standing_loop, track

BOTH = ("bullet", "mujoco", "nonsmooth")

STEP_SHARE = 0.002
"""Time step in units of sqrt(radius / g) where it is not what is varied."""

PROBES = (4.0, 2.0, 1.0, 0.5, 0.25)
"""Distances from a boundary at which outcomes are compared, in tolerances, the farthest first."""

WEAK = CosinePulse.from_g(0.001, 0.3)
"""A pulse that moves nothing."""


def block_of(rock: Rock) -> Block:
    """Housner's block that a symmetric rock is when it rocks across x."""
    low = rock.vertices[rock.vertices[:, 2] < -rock.height + 1e-9 * rock.radius]
    half, height = float(low[:, 0].max()), rock.height
    turning = float((rock.axes * rock.inertia @ rock.axes.T)[1, 1]) / rock.mass
    lever = half**2 + height**2
    return Block(half, height, inertia_ratio=(turning + lever) / lever)


def step_of(rock: Rock) -> float:
    """Time step [s] where it is not what is varied."""
    return STEP_SHARE * unit(rock)


@cache
def prepared(scene: Scene, *, reduce: bool = True) -> Case:
    """The case of a scene."""
    return prepare(scene, _barrier(scene.rock), reduce=reduce)


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
    case = prepared(scene, reduce=reduce)
    check(case, settings, motion)
    _check_unshaken(scene, settings)
    return decided(simulate(case, motion, settings))


def decided(response: Response) -> Response:
    """The response; refuses one that is without an outcome."""
    if response.outcome is Outcome.UNSTABLE:
        rule = "its guards failed at six time steps, each half the one before"
        remedy = "shorten the step, or look for what is inside the pedestal or adds energy"
        raise InvalidInput("a run that ended unstable", rule, remedy)
    if response.outcome is Outcome.UNSETTLED:
        rule = "when time was up it was neither at rest nor without the energy to change sides"
        raise InvalidInput("a run that ended unsettled", rule, "count it for neither side")
    return response


def checked_world(scene: Scene, time_step: float, engine: str = "bullet") -> World:
    """World of a scene that the program does not refuse, to be stepped by hand."""
    check(prepared(scene), Settings(time_step, engine=engine), WEAK)
    return engines.load(engine).build(scene, time_step, 1)


def followed(scene: Scene, motion: GroundMotion) -> tuple[TableHistory, Array]:
    """A driven table under a motion, and the velocity [m/s] of its loop with the rock at rest."""
    assert scene.drive is not None
    check(prepared(scene), Settings(scene.drive.period), motion)
    history = track(scene, motion, scene.drive.period, after=0.0)
    return history, standing_loop(history, scene)


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


def lifted(rock: Rock, height: float, speed: float = 0.0) -> State:
    """State upright, ``height`` [m] above the rest pose, moving down at ``speed`` [m/s]."""
    return upright((0.0, 0.0, rock.height + height), (0.0, 0.0, -speed))


@cache
def _check_unshaken(scene: Scene, settings: Settings) -> None:
    check_unshaken(prepared(scene, reduce=settings.reduce), settings, WEAK)


@cache
def _barrier(rock: Rock) -> Barrier:
    return barrier(rock)


SLIDE_STEPS = 200_000


def slip(motion: GroundMotion, friction: float, rest: float = 2.0) -> float:
    """Farthest travel [m] relative to the table, rigid-plastic: x'' = -a - mu g sgn(x'), or stuck.

    Parameters
    ----------
    friction : float, Coulomb's coefficient
    rest : float [s], time after the motion
    """
    dt = (motion.duration + rest) / SLIDE_STEPS
    grip, x, v, farthest = friction * GRAVITY, 0.0, 0.0, 0.0
    middles = (np.arange(SLIDE_STEPS, dtype=np.float64) + 0.5) * dt
    for a in motion.acceleration(middles).tolist():
        free = v - a * dt
        v = math.copysign(max(abs(free) - grip * dt, 0.0), free)
        x += v * dt
        farthest = max(farthest, abs(x))
    return farthest
