"""What ends a run over a terrain.

All is in the site's frame, relative to the terrain. The rock may topple on its way; it has then
left its seat, and it goes on or not, as the run is asked for.
"""

from __future__ import annotations

import math

import numpy as np

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.compiled.compiling import compiled
from vsr_core.compiled.vectors import assign
from vsr_core.judge import ground_lookup, track
from vsr_core.judge.ground_lookup import Lookup
from vsr_core.judge.proofs import Barrier
from vsr_core.judge.record import (
    GOES_ON,
    OVERTURNED,
    UNSETTLED,
    UNSTABLE,
    Criteria,
    RunRecord,
    gained_too_much,
    is_finite,
    note,
    note_rest,
    rests,
    side,
)
from vsr_core.judge.track import Track
from vsr_core.outcome import StopReason
from vsr_core.rock.body import Rock
from vsr_core.scene import Contact

REST, LEFT_TERRAIN, TIME, UNDONE = (
    int(stop)
    for stop in (StopReason.REST, StopReason.LEFT_TERRAIN, StopReason.TIME, StopReason.UNDONE)
)

MONITORING_TIME = 0.0075
"""Longest time [s] from one judgement to the next."""

BORDER_INTERVALS = 8
"""Monitoring intervals from one check of where the ground is to the next."""

DROPPED_SHARE = 0.116
"""A rock has also toppled once its centre is this share of its radius lower than at the start:
0.1 m for Double Rock, as in the published set-up."""

PENETRATION_SHARE = 0.03
"""Deepest penetration allowed, as a share of the rock's radius: what a rock of 1 m falls into the
ground in a step of 2 ms at 15 m/s, before any engine sees it."""

REST_SHARE, REST_TIME, REST_PATH = 2e-5, 1.5, 2e-3
"""A rock rests if for ``REST_TIME`` sqrt(radius / g) its kinetic energy stays below ``REST_SHARE``
g radius and it moves by less than ``REST_PATH`` radius."""

TREMBLES_SHARE, STAYS_SHARE = 2e-4, 0.05
"""Kinetic energy, as a share of g radius, of a rock that only trembles when time is up: with it its
centre could climb a five-thousandth of its radius. And the way, as a share of the radius, that it
may have gone in the second half of the wait: it stands or lies where it is."""

LONGEST_TIME, LONGEST_TIMES = 20.0, 80.0
"""Longest wait after the motion: seconds, and units of sqrt(radius / g), whichever is more."""


def criteria(
    rock: Rock, contact: Contact, *, upward: Array, toppled_tilt: float, lowest: float, follow: bool
) -> Criteria:
    """What a rock on a terrain is judged by; nothing is proved of it.

    Parameters
    ----------
    upward : ndarray, shape (3,), direction of the rock that is up at the start
    lowest : float [m], height of the ground's lowest point
    """
    radius, nothing = rock.radius, np.zeros(1)
    return Criteria(
        Barrier(nothing, nothing, toppled_tilt, 0.0, 0.0, 0.0, lowest - radius),
        np.ascontiguousarray(upward),
        float(contact.friction),
        0.0,
        radius,
        rock.height,
        REST_SHARE * GRAVITY * radius,
        REST_TIME * math.sqrt(radius / GRAVITY),
        REST_PATH * radius,
        PENETRATION_SHARE * radius,
        math.inf,
        math.inf,
        proves=False,
        whole=True,
        follow=follow,
    )


def monitored(interval: float) -> int:
    """Samples from one judgement to the next.

    Parameters
    ----------
    interval : float [s], of a sample
    """
    return max(1, int(MONITORING_TIME / interval))


def longest_wait(radius: float) -> float:
    """Longest time [s] to go on after the motion.

    Parameters
    ----------
    radius : float [m], of the rock
    """
    return max(LONGEST_TIME, LONGEST_TIMES * math.sqrt(radius / GRAVITY))


@compiled
def monitor(
    record: RunRecord, criteria: Criteria, kept: Track, time: float, impulse: float, late: bool
) -> bool:
    """Note what the rock does; whether ``judge`` has to know how deep it is in the ground.

    Parameters
    ----------
    time : float [s]
    impulse : float [m/s], integral of the table's absolute acceleration so far
    late : bool, whether it is past the middle of the wait for rest
    """
    record.is_sound = is_finite(record)
    record.topples = False
    if not record.is_sound:
        return False
    track.note(kept, record, time, criteria.radius)
    if not late:
        assign(record.middle, record.position)
    record.intervals += 1
    note(record, criteria)
    record.is_sound = not gained_too_much(record, criteria, impulse)
    drop = record.start[2] - record.position[2]
    leans = record.tilt > criteria.limits.toppled_tilt
    record.topples = not record.toppled and (leans or drop > DROPPED_SHARE * criteria.radius)
    return record.topples or record.intervals % BORDER_INTERVALS == 0


@compiled
def judge(
    record: RunRecord, criteria: Criteria, lookup: Lookup, time: float, shaken: bool, deepest: float
) -> tuple[int, int]:
    """Outcome of a run that is decided or shows no sound run, ``GOES_ON`` else; what stopped it.

    Parameters
    ----------
    time : float [s]
    shaken : bool, whether the motion is still under way
    deepest : float [m], of the points that bear the rock, where ``monitor`` wants to know; else < 0
    """
    if not record.is_sound:
        return UNSTABLE, UNDONE
    depth = 0.0
    if deepest >= 0.0:
        place = record.position
        depth = ground_lookup.depth(lookup, place[0], place[1], place[2])
        depth = max(depth, deepest) if depth >= 0.0 else depth
        if record.topples and depth >= 0.0:  # through a hole, or beyond the border?
            foot = _foot_depth(record, lookup)
            depth = max(depth, foot) if foot >= 0.0 else foot
    sunk = depth > criteria.penetration
    over = sunk and _at_border(record, lookup, criteria.radius)
    if sunk and not over:
        return UNSTABLE, UNDONE
    if depth < 0.0 or over:
        return OVERTURNED if record.toppled else UNSETTLED, LEFT_TERRAIN
    record.toppled = record.toppled or record.topples
    if record.toppled and not criteria.follow:
        return OVERTURNED, UNDONE
    note_rest(record, criteria, time)
    if not shaken and rests(record, criteria, time):
        return side(record, criteria), REST
    return GOES_ON, UNDONE


@compiled
def out_of_time(record: RunRecord, criteria: Criteria) -> tuple[int, int]:
    """A rock that only trembles rests; another is overturned, or unsettled."""
    way = 0.0
    for k in range(3):
        way += (record.position[k] - record.middle[k]) ** 2
    trembles = record.kinetic < TREMBLES_SHARE * GRAVITY * criteria.radius
    if trembles and math.sqrt(way) < STAYS_SHARE * criteria.radius:
        return side(record, criteria), REST
    return OVERTURNED if record.toppled else UNSETTLED, TIME


@compiled
def _foot_depth(record: RunRecord, lookup: Lookup) -> float:
    """How far the rock's lowest corner is below the ground [m]; below 0 beyond the border."""
    place, lever = record.position, record.lever
    at = place[0] - lever[0], place[1] - lever[1], place[2] - lever[2]
    return ground_lookup.depth(lookup, at[0], at[1], at[2])


@compiled
def _at_border(record: RunRecord, lookup: Lookup, radius: float) -> bool:
    """Whether the ground ends within the rock's reach, where nothing holds it any more."""
    x, y, z = record.position[0], record.position[1], record.position[2]
    for k in range(3):
        for j in range(3):
            at = x + (k - 1) * radius, y + (j - 1) * radius
            if ground_lookup.depth(lookup, at[0], at[1], z) < 0.0:
                return True
    return False
