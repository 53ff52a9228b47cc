"""Displacement runs from the first shake to rest in compiled code.

What such a run is, is told in ``displacement``; this is the same for the engine ``nonsmooth``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.engines import nonsmooth
from vsr_core.engines.nonsmooth import body as bodies
from vsr_core.engines.nonsmooth.body import Body
from vsr_core.engines.nonsmooth.tree import MOST_POINTS, Ground, forget, ground
from vsr_core.engines.nonsmooth.world import set_state
from vsr_core.motions.cosine_pulse import GroundMotion
from vsr_core.outcome import DecidedBy, Outcome, Response, StopReason
from vsr_core.run import ground_lookup, tracking, watching
from vsr_core.run.cases import Settings, TerrainCase
from vsr_core.run.displacement_rules import (
    LONGEST_TIME,
    LONGEST_TIMES,
    MONITORING_TIME,
    PENETRATION_SHARE,
    REST_PATH,
    REST_SHARE,
    REST_TIME,
)
from vsr_core.run.ground_lookup import Lookup
from vsr_core.run.loop import LEAD
from vsr_core.run.proofs import Barrier
from vsr_core.run.sampling import samples, sampling
from vsr_core.run.trajectory import Trajectory
from vsr_core.run.travelling import Travel, run
from vsr_core.run.watching import Rule


@dataclass(frozen=True, eq=False)
class Place:
    """What the runs of a case share, computed once.

    Attributes
    ----------
    body : Body
    ground : Ground
    lookup : Lookup
    rule : Rule
    """

    body: Body
    ground: Ground
    lookup: Lookup
    rule: Rule


def place(case: TerrainCase) -> Place:
    """What the runs of a case share.

    Parameters
    ----------
    case : TerrainCase

    Returns
    -------
    Place, for one thread
    """
    seat = case.seat
    assert seat.terrain is not None
    lookup = ground_lookup.lookup(seat.terrain)
    body = bodies.body(seat.rock, seat.contact, on_level=False)
    return Place(body, ground(seat.rock, seat.terrain), lookup, _rule(case))


def displace(
    case: TerrainCase,
    shared: Place,
    motion: GroundMotion,
    settings: Settings,
    time_step: float,
    *,
    follow: bool,
) -> tuple[Response, StopReason, Trajectory]:
    """One attempt at a displacement run, at one time step.

    Parameters
    ----------
    case : TerrainCase
    shared : Place, of the case
    motion : GroundMotion, along (cos yaw, -sin yaw)
    settings : Settings
    time_step : float [s], the largest allowed
    follow : bool, whether to go on after toppling

    Returns
    -------
    (Response, StopReason, Trajectory)
    """
    seat, solver = case.seat, settings.solver or nonsmooth.SOLVER
    assert seat.start is not None
    assert seat.terrain is not None
    radius = seat.rock.radius
    taken = sampling(motion, None, time_step, 1)
    values = samples(motion, None, taken.interval, taken.pulse_samples)
    wait = max(LONGEST_TIME, LONGEST_TIMES * math.sqrt(radius / GRAVITY))
    last = taken.pulse_samples + math.ceil(wait / taken.interval)
    monitored = max(1, int(MONITORING_TIME / taken.interval))
    travel = Travel(
        np.ascontiguousarray(seat.start.rotation[2]),
        seat.terrain.lowest - radius,
        case.toppled_tilt,
        np.array([math.cos(seat.yaw), -math.sin(seat.yaw)]),
        values,
        _first(case, values, settings),
        last,
        taken.interval,
        monitored,
        follow,
        solver.iterations,
        solver.residual,
    )
    rock, points, watch = bodies.motion(), bodies.points(MOST_POINTS), watching.watch()
    track = tracking.room(math.ceil(last / monitored) + 1)
    set_state(rock, seat.start, seat.rock.axes)
    forget(shared.ground)
    outcome, stop, steps, kept = run(
        shared.body, shared.ground, shared.lookup, shared.rule, travel, rock, points, watch, track
    )
    response = Response(
        Outcome(outcome),
        DecidedBy.SIMULATION,
        float(watch["peak_tilt"]),
        float(watch["tilt"]),
        float(watch["slip"]),
        steps,
    )
    return response, StopReason(stop), tracking.trajectory(track[:kept], seat.rock.axes)


def _first(case: TerrainCase, values: Array, settings: Settings) -> int:
    """Step with which a run begins: shortly before the first push, until which nothing moves."""
    lowest, highest = case.static_limits
    if not (settings.reduce and lowest < 0.0 < highest):
        return 0
    moved = ~((lowest <= values) & (values <= highest))
    return max(0, int(np.argmax(np.append(moved, True))) - LEAD)


def _rule(case: TerrainCase) -> Rule:
    """What rest is, and the guards; nothing is proved of a rock on a terrain."""
    rock, radius = case.seat.rock, case.seat.rock.radius
    nothing = np.zeros(1)
    return Rule(
        Barrier(nothing, nothing, case.toppled_tilt, 0.0, 0.0, 0.0, 0.0),
        np.ascontiguousarray(rock.axes),
        case.seat.contact.friction,
        0.0,
        radius,
        rock.height,
        REST_SHARE * GRAVITY * radius,
        REST_TIME * math.sqrt(radius / GRAVITY),
        REST_PATH * radius,
        PENETRATION_SHARE * radius,
        math.inf,
        False,
    )
