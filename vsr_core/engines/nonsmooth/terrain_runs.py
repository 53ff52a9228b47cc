"""Runs over a terrain, each from the first shake to rest without the interpreter."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.compiled import records
from vsr_core.compiled.compiling import compiled
from vsr_core.engines.interface import Solver
from vsr_core.engines.nonsmooth import body as bodies
from vsr_core.engines.nonsmooth import ground as grounds
from vsr_core.engines.nonsmooth import monitoring
from vsr_core.engines.nonsmooth.body import Body, Point, Points, RockState
from vsr_core.engines.nonsmooth.stepping import step
from vsr_core.engines.nonsmooth.tree import MOST_POINTS, Ground, forget, ground
from vsr_core.engines.nonsmooth.world import set_state
from vsr_core.judge import ground_lookup, on_terrain, track
from vsr_core.judge.ground_lookup import Lookup
from vsr_core.judge.record import GOES_ON, UNSTABLE, Criteria, RunRecord
from vsr_core.judge.track import Track
from vsr_core.scene import Scene


@dataclass(frozen=True, eq=False)
class Site:
    """What the runs of a rock on its terrain share, computed once.

    Attributes
    ----------
    flying, below : Body and Ground for the time after toppling, where they are others
    lookup, surface : Lookup, of the terrain, and of what is below a rock that has toppled
    """

    seat: Scene
    body: Body
    ground: Ground
    flying: Body | None
    below: Ground | None
    lookup: Lookup
    surface: Lookup


class Shaking(NamedTuple):
    """How a run is shaken and stepped.

    Attributes
    ----------
    values : ndarray, shape (samples,) [m/s^2], acceleration of the table in each step
    interval : float [s], time step
    monitored : int, steps from one judgement to the next
    first, last : int, step with which it begins, and at which it is out of time
    """

    values: Array
    interval: float
    monitored: int
    first: int
    last: int


class Table(NamedTuple):
    """What runs have in common besides their rock and ground.

    Attributes
    ----------
    axes : ndarray, shape (3, 3), principal axes of the rock in its rest pose, as columns
    along : ndarray, shape (2,), direction of the shaking
    """

    axes: Array
    along: Array
    rounds: int
    residual: float


def site(seat: Scene, flight: Scene) -> Site:
    """What the runs of a rock share, while it is on its seat and after it has toppled."""
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
    return Site(seat, body, ground(seat.rock, seat.terrain), flying, below, lookup, surface)


def run(
    site: Site, criteria: Criteria, shaking: Shaking, solver: Solver
) -> tuple[int, int, int, RunRecord, Track]:
    """Do one run.

    Returns
    -------
    (int, int, int, RunRecord, Track), outcome, what stopped it, steps, and what is known of it
    """
    start = site.seat.start
    assert start is not None
    axes = np.ascontiguousarray(site.seat.rock.axes)
    along = np.array([math.cos(site.seat.yaw), -math.sin(site.seat.yaw)])
    table = Table(axes, along, solver.iterations, solver.residual)
    rock, points = records.room(RockState), records.rows(Point, MOST_POINTS)
    record = records.room(RunRecord)
    kept = track.room(math.ceil(shaking.last / shaking.monitored) + 1)
    set_state(rock, start, axes)
    forget(site.ground)
    monitoring.start(record, criteria, site.body, axes, rock, points, shaking.interval)
    track.begin(kept, record, shaking.first * shaking.interval)
    # With another ground to go on, a rock first comes to the moment in which it topples.
    stops = criteria._replace(follow=criteria.follow and site.flying is None)
    body, under, given = site.body, site.ground, (table, shaking, rock, points, record, kept)
    outcome, stop, now = _run(body, under, site.lookup, stops, *given, shaking.first)
    if criteria.follow and record.toppled and site.flying is not None and site.below is not None:
        body, under = site.flying, site.below
        _put_on(body, under, site.surface, rock)
        record.intervals = 0
        outcome, stop, now = _run(body, under, site.lookup, criteria, *given, now)
    if outcome != UNSTABLE:
        track.end(kept, record)
    return outcome, stop, now - shaking.first, record, kept


def _put_on(body: Body, ground: Ground, surface: Lookup, rock: RockState) -> None:
    """Set a rock onto another ground, raised so far that it does not begin in it."""
    corners = rock.place + body.points @ rock.rotation.T
    deepest = max(ground_lookup.depth(surface, *corner) for corner in corners)
    rock.place[2] += max(0.0, deepest)
    rock.found = rock.near = rock.active = rock.kept = 0
    forget(ground)


@compiled
def _run(
    body: Body,
    ground: Ground,
    lookup: Lookup,
    criteria: Criteria,
    table: Table,
    shaking: Shaking,
    rock: RockState,
    points: Points,
    record: RunRecord,
    kept: Track,
    now: int,
) -> tuple[int, int, int]:
    """Step a rock until it rests, leaves its terrain, topples or shows no sound run."""
    interval, pulse = shaking.interval, len(shaking.values)
    impulse = 0.0
    for n in range(min(now, pulse)):
        impulse += interval * abs(shaking.values[n])
    while now < shaking.last:
        until = min(now + shaking.monitored, shaking.last)
        if now < pulse:
            until = min(until, pulse)
        impulse += _advance(body, ground, table, shaking, now, until, rock, points, record.change)
        now = until
        monitoring.write(record, body, table.axes, rock, points, interval)
        if ground.search[0].full:
            record.position[0] = math.nan  # a list of what touches was too short
        deepest, late = -1.0, 2 * now >= pulse + shaking.last
        if on_terrain.monitor(record, criteria, kept, now * interval, impulse, late):
            deepest = 0.0
            for at in range(rock.active):
                deepest = max(deepest, -points[points[at].active].gap)
        outcome, stop = on_terrain.judge(
            record, criteria, lookup, now * interval, now < pulse, deepest
        )
        if outcome != GOES_ON:
            return outcome, stop, now
    outcome, stop = on_terrain.out_of_time(record, criteria)
    return outcome, stop, now


@compiled
def _advance(
    body: Body,
    ground: Ground,
    table: Table,
    shaking: Shaking,
    now: int,
    until: int,
    rock: RockState,
    points: Points,
    change: Array,
) -> float:
    """Step from one place in the motion to another.

    Writes the change of velocity by weight and shaking into ``change`` [m/s], and returns the
    integral of the table's absolute acceleration [m/s].
    """
    change[:] = 0.0
    given, interval, push = 0.0, shaking.interval, rock.push
    for n in range(now, until):
        shaken = shaking.values[n] if n < len(shaking.values) else 0.0
        push[0], push[1], push[2] = -shaken * table.along[0], -shaken * table.along[1], -GRAVITY
        speed = interval * (abs(push[0]) + abs(push[1]) + abs(push[2]))
        grounds.find(body, ground, rock, points, interval, speed)
        step(body, rock, points, push, interval, GRAVITY, table.rounds, table.residual)
        for k in range(3):
            change[k] += interval * push[k]
        given += interval * abs(shaken)
    return given
