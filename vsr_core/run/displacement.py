"""Displacement runs: on a terrain, from the first shake until the rock rests, with trajectories.

Everything is in the site's frame, relative to the terrain, in which the table's acceleration acts
as a body force.
"""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import cast

import numpy as np

from vsr_core import engines
from vsr_core.arrays import Array
from vsr_core.engines.interface import GroundWorld
from vsr_core.errors import InvalidInput
from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.outcome import DecidedBy, Outcome, Response, StopReason
from vsr_core.run import compiled_displacement, loop, static_limits
from vsr_core.run.cases import Settings, TerrainCase, never_starts
from vsr_core.run.displacement_rules import (
    LONGEST_TIME,
    MONITORING_TIME,
    QUIET_STEPS,
    DisplacementRules,
    along,
    rest_of,
    sampled_for,
    set_up,
)
from vsr_core.run.guards import at_halved_steps, inertia_of, kinetic_energy
from vsr_core.run.overturning import COMPILED
from vsr_core.run.sampling import first_step
from vsr_core.run.trajectory import Trajectory, joined
from vsr_core.scene import Scene, State


@dataclass(frozen=True)
class DisplacementRun:
    """Result of a displacement run.

    Attributes
    ----------
    response : Response, with ``slip`` up to toppling
    """

    response: Response
    stop: StopReason
    trajectory: Trajectory


def displace(
    case: TerrainCase, motion: GroundMotion, settings: Settings, *, follow: bool = True
) -> DisplacementRun:
    """Shake the rock and follow it until it rests.

    Never raises for physics: a run that breaks its guards at every step tried is ``UNSTABLE``.

    Parameters
    ----------
    motion : GroundMotion, along (cos yaw, -sin yaw)
    settings : Settings; ``reduce`` lets the run begin shortly before the first push, and go on in
        the lighter scene once the rock toppled
    follow : bool
        Whether to go on after toppling; without, only the outcome and the path up to there are
        wanted.

    Raises
    ------
    InvalidInput
        For a motion in several axes.
    """
    if motion.columns > 1:
        raise InvalidInput(
            "a table in several axes under a terrain",
            "a rock on a terrain is shaken in one direction",
            "take a motion along one axis, or a flat pedestal",
        )

    if never_starts(case.static_limits, motion.peak_acceleration, settings):
        return _stays(case)
    attempt = _compiled if settings.engine == COMPILED else _stepped
    return at_halved_steps(
        first_step(motion, None, settings.time_step),
        partial(attempt, case, motion, settings, follow),
        lambda found: found.response.outcome is Outcome.UNSTABLE,
    )


def _stepped(
    case: TerrainCase, motion: GroundMotion, settings: Settings, follow: bool, time_step: float
) -> DisplacementRun:
    """One attempt, in an engine whose steps are asked for one by one."""
    sampled = sampled_for(motion, time_step)
    run = set_up(case.seat, motion, settings, sampled)
    rules = DisplacementRules(case, run, settings, follow=follow)
    outcome, stop = loop.complete(run, rules)
    response = Response(outcome, DecidedBy.SIMULATION, run.peak_tilt, run.tilt, run.slip, run.steps)
    return DisplacementRun(response, stop, rules.recorder.trajectory(run))


def _compiled(
    case: TerrainCase, motion: GroundMotion, settings: Settings, follow: bool, time_step: float
) -> DisplacementRun:
    """One attempt, in compiled code."""
    shared = _place(threading.get_ident(), case)
    found = compiled_displacement.displace(case, shared, motion, settings, time_step, follow=follow)
    return DisplacementRun(*found)


@lru_cache(maxsize=16)
def _place(thread: int, case: TerrainCase) -> compiled_displacement.Place:
    """What the runs of a case share in one thread: each has its own lists of near features."""
    return compiled_displacement.place(case)


def respond(case: TerrainCase, motion: GroundMotion, settings: Settings) -> Response:
    """Outcome of one run on a terrain, without what follows when the rock has toppled.

    Parameters and errors are those of ``displace``.

    Parameters
    ----------
    motion : GroundMotion, along (cos yaw, -sin yaw)
    """
    return displace(case, motion, settings, follow=False).response


def limits_on_seat(scene: Scene, time_step: float, engine: str = "bullet") -> tuple[float, float]:
    """Range of table accelerations [m/s^2] in which a rock on its seat stays at rest.

    Parameters
    ----------
    scene : Scene, on a terrain, with the rock at rest as its start
    time_step : float [s]

    Returns
    -------
    (float, float), lowest and highest; zeros where the rock does not rest by its points of contact
    """
    world = cast(GroundWorld, engines.load(engine).build(scene, time_step, 1))
    world.advance([0.0] * QUIET_STEPS)
    centre = world.state().position
    return static_limits.on_points(*world.footing(), centre, scene.contact.friction, along(scene))


def settled(scene: Scene, time_step: float, engine: str = "bullet") -> State:
    """Where a rock comes to rest that is set on its terrain as scanned, unshaken.

    Parameters
    ----------
    scene : Scene, on a terrain; the rock's ``start`` is its pose in the scan
    time_step : float [s]

    Raises
    ------
    InvalidInput
        If it does not come to rest there, or not near where it was scanned.
    """
    assert scene.start is not None
    radius = scene.rock.radius
    world = engines.load(engine).build(scene, time_step, 1)
    rest, inertia = rest_of(radius), inertia_of(scene.rock)
    for interval in range(math.ceil(LONGEST_TIME / MONITORING_TIME)):
        world.advance([0.0] * math.ceil(MONITORING_TIME / time_step))
        state, time = world.state(), interval * MONITORING_TIME
        rest.note(time, state, kinetic_energy(inertia, state))
        if rest.reached(time, state):
            break
    else:
        raise InvalidInput(
            f"a rock that still moves after {LONGEST_TIME:g} s on its seat",
            "it stands where it was scanned",
            "look at the closing of the scan and its cut (`vsr prep`)",
        )
    shift = float(np.linalg.norm(state.position - scene.start.position))
    turn = _angle(state.rotation @ scene.start.rotation.T)
    if shift > 0.1 * radius or turn > math.radians(15.0):
        raise InvalidInput(
            f"a rock that unshaken moves by {shift:.3g} m and turns by "
            f"{math.degrees(turn):.1f} deg",
            "it stands where it was scanned, to a tenth of its radius and 15 deg",
            "look at the closing of the scan and its cut (`vsr prep`)",
        )
    return replace(state, velocity=np.zeros(3), angular_velocity=np.zeros(3))


def _stays(case: TerrainCase) -> DisplacementRun:
    """Result of a run that never starts."""
    assert case.seat.start is not None
    stands = Response(Outcome.BALANCED, DecidedBy.NO_UPLIFT_BOUND, 0.0, 0.0, 0.0, 0)
    trajectory = joined([(0.0, case.seat.start, True)])
    return DisplacementRun(stands, StopReason.REST, trajectory)


def _angle(rotation: Array) -> float:
    return math.acos(max(-1.0, min(1.0, 0.5 * (float(np.trace(rotation)) - 1.0))))
