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
from vsr_core.engines.nonsmooth.body import Body, Motion, Points
from vsr_core.engines.nonsmooth.tree import MOST_POINTS, Ground, forget, ground
from vsr_core.engines.nonsmooth.world import set_state
from vsr_core.motions.ground_motion import GroundMotion
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
from vsr_core.run.tracking import Track
from vsr_core.run.trajectory import Trajectory
from vsr_core.run.travelling import Travel, go_on, run
from vsr_core.run.watching import Rule, Watch

_Found = tuple[int, int, int, int]
"""Outcome, what stopped a run, steps, and states kept."""

_TOPPLED = int(Outcome.OVERTURNED), int(StopReason.UNDONE)


@dataclass(frozen=True, eq=False)
class Place:
    """What the runs of a case share, computed once.

    Attributes
    ----------
    lookup, surface : Lookup, of the terrain, and of what is below a rock that has toppled
    """

    body: Body
    ground: Ground
    flying: Body | None
    below: Ground | None
    lookup: Lookup
    surface: Lookup
    rule: Rule


def place(case: TerrainCase) -> Place:
    """What the runs of a case share."""
    seat, flight = case.seat, case.flight
    assert seat.terrain is not None
    assert flight.terrain is not None
    lookup = surface = ground_lookup.lookup(seat.terrain)
    body = bodies.body(seat.rock, seat.contact, on_level=False)
    flying = below = None
    if flight is not seat:
        light = flight.terrain.light or flight.terrain
        surface = ground_lookup.lookup(light)
        flying = bodies.body(flight.rock, flight.contact, on_level=False)
        below = ground(flight.rock, light)
    under = ground(seat.rock, seat.terrain)
    return Place(body, under, flying, below, lookup, surface, _rule(case))


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
    motion : GroundMotion, along (cos yaw, -sin yaw)
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
        follow and shared.flying is None,
        solver.iterations,
        solver.residual,
    )
    rock, points, watch = bodies.motion(), bodies.points(MOST_POINTS), watching.watch()
    track = tracking.room(math.ceil(last / monitored) + 1)
    set_state(rock, seat.start, seat.rock.axes)
    forget(shared.ground)
    room = rock, points, watch, track
    found = run(shared.body, shared.ground, shared.lookup, shared.rule, travel, *room)
    if follow and shared.flying is not None and found[:2] == _TOPPLED:
        found = _follow(shared, travel, room, found)
    outcome, stop, steps, kept = found
    if not follow and found[:2] == _TOPPLED:
        kept = tracking.end(track, kept)
    response = Response(
        Outcome(outcome),
        DecidedBy.SIMULATION,
        float(watch["peak_tilt"]),
        float(watch["tilt"]),
        float(watch["slip"]),
        steps,
    )
    return response, StopReason(stop), tracking.trajectory(track[:kept], seat.rock.axes)


def _follow(
    shared: Place, travel: Travel, room: tuple[Motion, Points, Watch, Track], found: _Found
) -> _Found:
    """Have a rock go on that has just toppled, as detailed as one needs that tumbles.

    It is raised so far that it does not begin in the ground.
    """
    assert shared.flying is not None
    assert shared.below is not None
    rock = room[0]
    corners = rock["place"] + shared.flying.points @ rock["rotation"].T
    deepest = max(ground_lookup.depth(shared.surface, *corner) for corner in corners)
    rock["place"][2] += max(0.0, deepest)
    rock["found"] = rock["near"] = rock["active"] = rock["kept"] = 0
    forget(shared.below)
    under = shared.flying, shared.below, shared.lookup, shared.rule
    now = travel.first + found[2]
    return go_on(*under, travel._replace(follow=True), *room, now, found[3], True)


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
