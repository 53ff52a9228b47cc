"""A displacement run in compiled code, from the first step to the last."""

from __future__ import annotations

import math
from typing import NamedTuple

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.engines.nonsmooth import ground as grounds
from vsr_core.engines.nonsmooth.body import Body, Motion, Points
from vsr_core.engines.nonsmooth.compiling import compiled
from vsr_core.engines.nonsmooth.stepping import step
from vsr_core.engines.nonsmooth.tree import Ground
from vsr_core.engines.nonsmooth.vectors import assign
from vsr_core.engines.nonsmooth.world import begin
from vsr_core.outcome import DISPLACED_SHARE, StopReason
from vsr_core.run import ground_lookup, tracking, watching
from vsr_core.run.displacement_rules import (
    BORDER_INTERVALS,
    DROPPED_SHARE,
    STAYS_SHARE,
    TREMBLES_SHARE,
)
from vsr_core.run.ground_lookup import Lookup
from vsr_core.run.guards import gained_too_much
from vsr_core.run.looking import look, start_watch
from vsr_core.run.tracking import Track
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
    follow : bool, whether to go on after toppling
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
    """Step a rock on its seat until it rests, leaves its terrain, or shows no sound run.

    Returns
    -------
    (int, int, int, int), outcome, what stopped the run, steps and states kept
    """
    begin(body, rock, travel.interval)
    start_watch(watch, body, rock, rule, travel.interval)
    kept = _begin_track(track, watch, travel)
    now = travel.first
    return go_on(body, ground, lookup, rule, travel, rock, points, watch, track, now, kept, False)


@compiled
def go_on(
    body: Body,
    ground: Ground,
    lookup: Lookup,
    rule: Rule,
    travel: Travel,
    rock: Motion,
    points: Points,
    watch: Watch,
    track: Track,
    now: int,
    kept: int,
    toppled: bool,
) -> tuple[int, int, int, int]:
    """Step a rock that is under way."""
    given, looks = 0.0, 0
    for n in range(min(now, len(travel.values))):
        given += travel.interval * abs(travel.values[n])
    while now < travel.last:
        until = _next(now, travel)
        given += _advance(body, ground, travel, now, until, rock, points, watch.change)
        duration, now = (until - now) * travel.interval, until
        look(watch, body, rock, points, rule, travel.interval)
        if not _finite(watch) or ground.search[0].full:
            return watching.UNSTABLE, UNDONE, now - travel.first, kept
        kept = _note(track, kept, watch, duration, now, travel, rule)
        if 2 * now < len(travel.values) + travel.last:
            assign(watch.middle, watch.place)
        looks += 1
        sound = _sound(watch, rule, travel, given, toppled)
        topples = not toppled and _topples(watch, rule, travel)
        depth = 0.0
        if topples or looks % BORDER_INTERVALS == 0:
            depth = _depth(watch, lookup, rock, points)
        sunk = depth > rule.penetration
        over = sunk and _at_border(watch, lookup, rule.radius)
        if not sound or (sunk and not over):
            return watching.UNSTABLE, UNDONE, now - travel.first, kept
        if depth < 0.0 or over:
            left = watching.OVERTURNED if toppled else watching.UNSETTLED
            return left, LEFT, now - travel.first, tracking.end(track, kept)
        toppled = toppled or topples
        if toppled and not travel.follow:
            return watching.OVERTURNED, UNDONE, now - travel.first, kept
        if _at_rest(watch, rule, travel, now):
            side = watching.OVERTURNED if toppled else _side(watch, rule)
            return side, REST, now - travel.first, tracking.end(track, kept)
    trembles = _trembles(watch, rule)
    outcome = _side(watch, rule) if trembles else watching.UNSETTLED
    outcome = watching.OVERTURNED if toppled else outcome
    return outcome, REST if trembles else TIME, now - travel.first, tracking.end(track, kept)


@compiled
def _next(now: int, travel: Travel) -> int:
    """Step at which the run is looked at next: evenly spaced, and at the end of the motion."""
    until = min(now + travel.monitored, travel.last)
    return min(until, len(travel.values)) if now < len(travel.values) else until


@compiled
def _at_rest(watch: Watch, rule: Rule, travel: Travel, now: int) -> bool:
    """Whether the motion is over and the rock rests."""
    time = now * travel.interval
    watching.note_rest(watch, rule, time)
    return now >= len(travel.values) and watching.rests(watch, rule, time)


@compiled
def _advance(
    body: Body,
    ground: Ground,
    travel: Travel,
    now: int,
    until: int,
    rock: Motion,
    points: Points,
    change: Array,
) -> float:
    """Step from one place in the motion to another.

    Writes the change of velocity by weight and shaking into ``change`` [m/s], and returns the
    integral of the table's absolute acceleration [m/s].
    """
    change[:] = 0.0
    given = 0.0
    for n in range(now, until):
        _step(body, ground, travel, n, rock, points)
        for k in range(3):
            change[k] += travel.interval * rock.push[k]
        if n < len(travel.values):
            given += travel.interval * abs(travel.values[n])
    return given


@compiled
def _step(body: Body, ground: Ground, travel: Travel, n: int, rock: Motion, points: Points) -> None:
    """One step."""
    push = rock.push
    shaken = travel.values[n] if n < len(travel.values) else 0.0
    push[0], push[1], push[2] = -shaken * travel.along[0], -shaken * travel.along[1], -GRAVITY
    interval = travel.interval
    speed = interval * (abs(push[0]) + abs(push[1]) + abs(push[2]))
    grounds.find(body, ground, rock, points, interval, speed)
    step(body, rock, points, push, interval, GRAVITY, travel.rounds, travel.residual)


@compiled
def _begin_track(track: Track, watch: Watch, travel: Travel) -> int:
    """Keep the start, and where the run begins if that is later."""
    now = track[len(track) - 1]
    _write(now, watch, 0.0)
    now.touched = True
    track[0] = now
    if not travel.first:
        return 1
    now.time = travel.first * travel.interval
    track[1] = now
    return 2


@compiled
def _write(sample: Track, watch: Watch, time: float) -> None:
    sample.time = time
    assign(sample.place, watch.place)
    assign(sample.velocity, watch.velocity)
    assign(sample.quaternion, watch.quaternion)


@compiled
def _note(
    track: Track,
    kept: int,
    watch: Watch,
    duration: float,
    now: int,
    travel: Travel,
    rule: Rule,
) -> int:
    _write(track[len(track) - 2], watch, now * travel.interval)
    return tracking.note(track, kept, watch.change, duration, rule.radius)


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
def _at_border(watch: Watch, lookup: Lookup, radius: float) -> bool:
    """Whether the ground ends within the rock's reach, where nothing holds it any more."""
    x, y, z = watch.place[0], watch.place[1], watch.place[2]
    for k in range(3):
        for j in range(3):
            at = x + (k - 1) * radius, y + (j - 1) * radius
            if ground_lookup.depth(lookup, at[0], at[1], z) < 0.0:
                return True
    return False


@compiled
def _trembles(watch: Watch, rule: Rule) -> bool:
    """Whether a rock that still moves stays where it was in the middle of the wait."""
    way = 0.0
    for k in range(3):
        way += (watch.place[k] - watch.middle[k]) ** 2
    stays = math.sqrt(way) < STAYS_SHARE * rule.radius
    return stays and watch.kinetic < TREMBLES_SHARE * GRAVITY * rule.radius


@compiled
def _side(watch: Watch, rule: Rule) -> int:
    """Outcome of a rock that has not toppled."""
    far = watch.slip > DISPLACED_SHARE * rule.radius
    return watching.DISPLACED if far else watching.BALANCED
