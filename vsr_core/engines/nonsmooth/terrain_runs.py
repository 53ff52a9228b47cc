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
from vsr_core.compiled.vectors import length
from vsr_core.engines.interface import Solver
from vsr_core.engines.nonsmooth import body as bodies
from vsr_core.engines.nonsmooth import ground as grounds
from vsr_core.engines.nonsmooth import monitoring
from vsr_core.engines.nonsmooth import peaks as watched
from vsr_core.engines.nonsmooth.body import Body, Point, Points, RockState, Stepping
from vsr_core.engines.nonsmooth.peaks import Peaks
from vsr_core.engines.nonsmooth.tree import MOST_POINTS, Ground, forget, ground
from vsr_core.engines.nonsmooth.world import put_on, set_state
from vsr_core.judge import ground_lookup, on_terrain, track
from vsr_core.judge.ground_lookup import Lookup
from vsr_core.judge.record import GOES_ON, UNSTABLE, Criteria, RunRecord, note_peaks
from vsr_core.judge.track import Track
from vsr_core.scene import Scene


@dataclass(frozen=True, eq=False)
class Site:
    """What the runs of a rock on its terrain share, computed once.

    Attributes
    ----------
    flying, below : Body and Ground for the time after toppling, where they are others
    """

    seat: Scene
    body: Body
    ground: Ground
    flying: Body | None
    below: Ground | None
    lookup: Lookup


class Shaking(NamedTuple):
    """How a run is shaken and stepped.

    Attributes
    ----------
    values : ndarray, shape (samples, 3) [m/s^2], acceleration of the table in each step
    interval : float [s], time step
    monitored : int, steps from one judgement to the next
    first, last : int, step with which it begins, and at which it is out of time
    """

    values: Array
    interval: float
    monitored: int
    first: int
    last: int


def site(seat: Scene, flight: Scene) -> Site:
    """What the runs of a rock share, while it is on its seat and after it has toppled."""
    assert seat.terrain is not None
    lookup = ground_lookup.lookup(seat.terrain)
    body = bodies.body(seat.rock, seat.contact, on_level=False)
    flying = below = None
    if flight is not seat:
        flying = bodies.body(flight.rock, flight.contact, on_level=False)
        below = ground(flight.rock, seat.terrain)
    return Site(seat, body, ground(seat.rock, seat.terrain), flying, below, lookup)


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
    stepping = Stepping(shaking.interval, GRAVITY, solver.iterations, solver.residual)
    rock, points = records.room(RockState), records.rows(Point, MOST_POINTS)
    peaks, record = watched.room(site.seat.rock, criteria.upward), records.room(RunRecord)
    kept = track.room(math.ceil(shaking.last / shaking.monitored) + 1)
    set_state(rock, start, axes)
    forget(site.ground)
    monitoring.start(record, criteria, site.body, axes, rock, points, peaks, shaking.interval)
    track.begin(kept, record, shaking.first * shaking.interval)
    # With another ground to go on, a rock first comes to the moment in which it topples.
    stops = criteria._replace(follow=criteria.follow and site.flying is None)
    given = axes, stepping, shaking, rock, points, peaks, record, kept
    body, under = site.body, site.ground
    outcome, stop, now = _run(body, under, site.lookup, stops, *given, shaking.first)
    if criteria.follow and record.toppled and site.flying is not None and site.below is not None:
        body, under = site.flying, site.below
        put_on(body, under, site.lookup, rock)
        record.intervals = 0
        outcome, stop, now = _run(body, under, site.lookup, criteria, *given, now)
    if outcome != UNSTABLE:
        track.end(kept, record)
    return outcome, stop, now - shaking.first, record, kept


@compiled
def _run(
    body: Body,
    ground: Ground,
    lookup: Lookup,
    criteria: Criteria,
    axes: Array,
    stepping: Stepping,
    shaking: Shaking,
    rock: RockState,
    points: Points,
    peaks: Peaks,
    record: RunRecord,
    kept: Track,
    now: int,
) -> tuple[int, int, int]:
    """Step a rock until it rests, leaves its terrain, topples or shows no sound run."""
    interval, pulse = shaking.interval, len(shaking.values)
    values, change, impulse = shaking.values, record.change, 0.0
    for n in range(min(now, pulse)):
        impulse += interval * length(values[n])
    while now < shaking.last:
        until = min(now + shaking.monitored, shaking.last)
        if now < pulse:
            until = min(until, pulse)
        impulse += grounds.advance(body, ground, rock, points, peaks, values, now, until, stepping)
        note_peaks(record, *watched.tilt_and_slip(peaks))
        change[0] = change[1] = change[2] = 0.0
        for n in range(now, until):
            for k in range(3):
                change[k] -= interval * values[n, k] if n < pulse else 0.0
            change[2] -= interval * GRAVITY
        now = until
        monitoring.write(record, body, axes, rock, points, interval)
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
