"""Displacement runs from the first shake to rest in compiled code.

What such a run is, is told in ``displacement``; this is the same for the engine ``nonsmooth``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.engines import nonsmooth
from vsr_core.engines.nonsmooth import body as bodies
from vsr_core.engines.nonsmooth import ground as grounds
from vsr_core.engines.nonsmooth.body import Body, Motion, Points
from vsr_core.engines.nonsmooth.compiling import compiled
from vsr_core.engines.nonsmooth.stepping import step
from vsr_core.engines.nonsmooth.tree import MOST_POINTS, Ground, forget, ground
from vsr_core.engines.nonsmooth.world import begin, set_state
from vsr_core.motions.cosine_pulse import GroundMotion
from vsr_core.outcome import DISPLACED_SHARE, DecidedBy, Outcome, Response, StopReason
from vsr_core.run import ground_lookup, tracking, watching
from vsr_core.run.cases import Settings, TerrainCase
from vsr_core.run.compiled_runs import look, start_watch
from vsr_core.run.displacement_rules import (
    BORDER_INTERVALS,
    DROPPED_SHARE,
    LONGEST_TIME,
    LONGEST_TIMES,
    MONITORING_TIME,
    PENETRATION_SHARE,
    REST_PATH,
    REST_SHARE,
    REST_TIME,
)
from vsr_core.run.ground_lookup import Lookup
from vsr_core.run.guards import gained_too_much
from vsr_core.run.loop import LEAD
from vsr_core.run.proofs import Barrier
from vsr_core.run.sampling import samples, sampling
from vsr_core.run.tracking import Track
from vsr_core.run.trajectory import Trajectory
from vsr_core.run.watching import Rule, Watch

REST, LEFT, TIME, UNDONE = (
    int(stop)
    for stop in (StopReason.REST, StopReason.LEFT_TERRAIN, StopReason.TIME, StopReason.UNDONE)
)


class Travel(NamedTuple):
    """What a displacement run is judged by, and how it is stepped.

    Attributes
    ----------
    upward : ndarray, shape (3,), direction of the rock that is up where its tilt is zero
    floor : float [m], lowest height that the centre of mass can have
    toppled_tilt : float [rad]
    along : ndarray, shape (2,), direction of the shaking
    values : ndarray, shape (samples,) [m/s^2], acceleration of the table in each step
    first, last : int, step with which it begins, and at which it is out of time
    interval : float [s], time step
    monitored : int, steps in a monitoring interval
    follow : bool, whether to go on after toppling
    rounds, residual : of the search for impulses
    """

    upward: Array
    floor: float
    toppled_tilt: float
    along: Array
    values: Array
    first: int
    last: int
    interval: float
    monitored: int
    follow: bool
    rounds: int
    residual: float


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
    body = bodies.body(seat.rock, seat.contact)
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


@compiled
def run(
    body: Body,
    ground: Ground,
    lookup: Lookup,
    rule: Rule,
    travel: Travel,
    rock: Motion,
    points: Points,
    watch: Watch,
    track: Track,
) -> tuple[int, int, int, int]:
    """Step a rock over a terrain until it rests, leaves it, or shows no sound run.

    Parameters
    ----------
    body : Body
    ground : Ground
    lookup : Lookup
    rule : Rule
    travel : Travel
    rock : record of ``MOTION``, at the start
    points, watch, track : room; the states kept are written into ``track``

    Returns
    -------
    (int, int, int, int), outcome, what stopped the run, steps and states kept
    """
    begin(body, rock, travel.interval)
    start_watch(watch, body, rock, rule, travel.interval)
    now, given = travel.first, 0.0
    for n in range(now):
        given += travel.interval * abs(travel.values[n])
    kept = _begin_track(track, watch, rock, travel)
    push, change = np.zeros(3), np.zeros(3)
    toppled, looks = False, 0
    while now < travel.last:
        until = _next(now, travel)
        change[:] = 0.0
        for n in range(now, until):
            _step(body, ground, travel, n, rock, points, push)
            for k in range(3):
                change[k] += travel.interval * push[k]
            if n < len(travel.values):
                given += travel.interval * abs(travel.values[n])
        duration, now = (until - now) * travel.interval, until
        look(watch, body, rock, points, rule, travel.interval)
        if not _finite(watch):
            return watching.UNSTABLE, UNDONE, now - travel.first, kept
        kept = _note(track, kept, watch, rock, change, duration, now, travel, rule)
        looks += 1
        closely = looks % BORDER_INTERVALS == 0
        if not _sound(watch, rule, travel, given, toppled):
            return watching.UNSTABLE, UNDONE, now - travel.first, kept
        topples = not toppled and _topples(watch, rule, travel)
        if closely or topples:
            depth = _depth(watch, lookup, rock, points)
            if depth > rule.penetration or ground.search[0].full:
                return watching.UNSTABLE, UNDONE, now - travel.first, kept
            if depth < 0.0:
                left = watching.OVERTURNED if toppled else watching.UNSETTLED
                return left, LEFT, now - travel.first, tracking.end(track, kept)
        toppled = toppled or topples
        if toppled and not travel.follow:
            return watching.OVERTURNED, UNDONE, now - travel.first, kept
        watching.note_rest(watch, rule, now * travel.interval)
        if now >= len(travel.values) and watching.rests(watch, rule, now * travel.interval):
            side = watching.OVERTURNED if toppled else _side(watch, rule)
            return side, REST, now - travel.first, tracking.end(track, kept)
    outcome = watching.OVERTURNED if toppled else watching.UNSETTLED
    return outcome, TIME, now - travel.first, tracking.end(track, kept)


@compiled
def _next(now: int, travel: Travel) -> int:
    """Step at which the run is looked at next: evenly spaced, and at the end of the motion."""
    until = min(now + travel.monitored, travel.last)
    return min(until, len(travel.values)) if now < len(travel.values) else until


@compiled
def _step(
    body: Body, ground: Ground, travel: Travel, n: int, rock: Motion, points: Points, push: Array
) -> None:
    """One step; ``push`` is written."""
    shaken = travel.values[n] if n < len(travel.values) else 0.0
    push[0], push[1], push[2] = -shaken * travel.along[0], -shaken * travel.along[1], -GRAVITY
    interval = travel.interval
    speed = interval * (abs(push[0]) + abs(push[1]) + abs(push[2]))
    grounds.find(body, ground, rock, points, interval, speed)
    step(body, rock, points, push, interval, GRAVITY, travel.rounds, travel.residual)


@compiled
def _begin_track(track: Track, watch: Watch, rock: Motion, travel: Travel) -> int:
    """Keep the start, and where the run begins if that is later."""
    now = track[len(track) - 1]
    _write(now, watch, rock, travel, 0.0)
    now.touched = True
    track[0] = now
    if not travel.first:
        return 1
    now.time = travel.first * travel.interval
    track[1] = now
    return 2


@compiled
def _write(sample: Track, watch: Watch, rock: Motion, travel: Travel, time: float) -> None:
    sample.time = time
    sample.place[:] = watch.place
    sample.velocity[:] = watch.velocity
    sample.quaternion[:] = watch.quaternion


@compiled
def _note(
    track: Track,
    kept: int,
    watch: Watch,
    rock: Motion,
    change: Array,
    duration: float,
    now: int,
    travel: Travel,
    rule: Rule,
) -> int:
    _write(track[len(track) - 2], watch, rock, travel, now * travel.interval)
    return tracking.note(track, kept, change, duration, rule.radius)


@compiled
def _finite(watch: Watch) -> bool:
    total = 0.0
    for k in range(3):
        total += watch.place[k] + watch.rotation[2, k]
        total += watch.velocity[k] + watch.velocity[3 + k]
    return math.isfinite(total)


@compiled
def _sound(watch: Watch, rule: Rule, travel: Travel, impulse: float, toppled: bool) -> bool:
    """Note tilt, slip and energy; whether there is no energy from nowhere."""
    upright = 0.0
    for k in range(3):
        upright += watch.rotation[2, k] * travel.upward[k]
    watch.tilt = math.acos(max(-1.0, min(1.0, upright)))
    watch.peak_tilt = max(watch.peak_tilt, watch.tilt)
    if not toppled:
        watching.note_slip(watch, rule)
    watching.note_energy(watch)
    return not gained_too_much(watch.energy, watch.start[2], travel.floor, impulse, rule.radius)


@compiled
def _topples(watch: Watch, rule: Rule, travel: Travel) -> bool:
    drop = watch.start[2] - watch.place[2]
    return watch.tilt > travel.toppled_tilt or drop > DROPPED_SHARE * rule.radius


@compiled
def _depth(watch: Watch, lookup: Lookup, rock: Motion, points: Points) -> float:
    """How deep the rock is in the ground [m]: its centre, or a point that bears it; or outside."""
    deepest = ground_lookup.depth(lookup, watch.place[0], watch.place[1], watch.place[2])
    if deepest < 0.0:
        return deepest
    for at in range(rock.active):
        deepest = max(deepest, -points[points[at].active].gap)
    return deepest


@compiled
def _side(watch: Watch, rule: Rule) -> int:
    """Outcome of a rock that has not toppled."""
    far = watch.slip > DISPLACED_SHARE * rule.radius
    return watching.DISPLACED if far else watching.BALANCED
