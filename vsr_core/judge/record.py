"""The record of a run, which an engine fills whenever the rock is monitored; guards, and rest."""

from __future__ import annotations

import math
from typing import NamedTuple

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.compiled.compiling import compiled
from vsr_core.compiled.records import Matrix, Vector
from vsr_core.compiled.vectors import assign, assign_matrix
from vsr_core.judge import proofs
from vsr_core.judge.proofs import Barrier
from vsr_core.outcome import DISPLACED_SHARE, Outcome

BALANCED, OVERTURNED, DISPLACED, UNSETTLED, UNSTABLE = (
    int(outcome)
    for outcome in (
        Outcome.BALANCED,
        Outcome.OVERTURNED,
        Outcome.DISPLACED,
        Outcome.UNSETTLED,
        Outcome.UNSTABLE,
    )
)
"""Outcomes as compiled code knows them."""

GOES_ON = -1
"""In the place of an outcome: the run is not decided."""

ENERGY_SLACK = 0.02
"""Numerical excess allowed over the energy the table can give, as a share of g times radius."""


class Criteria(NamedTuple):
    """What a run is judged by.

    Attributes
    ----------
    limits : Barrier; of a rock on a terrain ``toppled_tilt`` and ``floor`` only
    upward : ndarray, shape (3,), direction of the rock that is up where its tilt is zero
    foot : float [m], height of the centre of mass above the base at rest
    rest_energy : float [m^2/s^2], kinetic energy of a rock at rest, per unit mass, at most
    rest_time : float [s], for which it has to keep to that
    creep : float [m], longest path in that time
    penetration, drift : float [m], deepest allowed, and longest path before anything moves the rock
    lean : float [rad], largest tilt of a rock that can only slide; inf where it can tip
    proves : bool, whether a run ends as soon as its outcome is proved
    whole : bool, whether an upright rock is followed to rest all the same
    follow : bool, whether a run goes on after toppling
    """

    limits: Barrier
    upward: Array
    friction: float
    rolling_friction: float
    radius: float
    foot: float
    rest_energy: float
    rest_time: float
    creep: float
    penetration: float
    drift: float
    lean: float
    proves: bool
    whole: bool
    follow: bool


class RunRecord:
    """What is known of a run.

    An engine writes the first eight fields, those of now, before the run is judged.
    """

    position: Vector  # m, of the centre of mass
    rotation: Matrix  # from the rest pose at yaw 0
    velocity: Vector  # m/s
    spin: Vector  # rad/s, angular velocity in the table's axes
    inertia: Matrix  # m^2, in the table's axes, per unit mass
    lever: Vector  # m, from the lowest corner to the centre of mass
    change: Vector  # m/s, of the velocity by weight and shaking since it was monitored last
    table_speed: float  # m/s, of a table that a servo drives

    start: Vector  # m, centre of mass at the start
    start_foot: Vector  # m, centre of the base at the start
    kinetic: float  # m^2/s^2, per unit mass
    energy: float  # m^2/s^2, kinetic plus g z
    tilt: float  # rad
    peak_tilt: float  # rad
    slip: float  # m, largest when it was monitored; on a terrain up to toppling
    peak_slip: float  # m, largest so far, likewise
    rest_since: float  # s, less than 0 while it moves
    rest_position: Vector  # m, where it has rested since then
    rest_rotation: Matrix
    middle: Vector  # m, centre of mass in the middle of the wait for rest
    intervals: int  # monitoring intervals so far
    kept: int  # states kept of its trajectory
    is_sound: bool
    topples: bool  # in this interval
    toppled: bool  # before


@compiled
def begin(record: RunRecord, criteria: Criteria) -> None:
    """Begin with the state that was written into a record."""
    record.peak_tilt = record.slip = record.peak_slip = 0.0
    record.rest_since = -1.0
    record.intervals = 0
    record.toppled = record.topples = False
    assign(record.start, record.position)
    for k in range(3):
        record.start_foot[k] = record.position[k] - criteria.foot * record.rotation[k, 2]


@compiled
def is_finite(record: RunRecord) -> bool:
    """Whether all numbers of a state are finite."""
    total = 0.0
    for k in range(3):
        total += record.position[k] + record.velocity[k] + record.spin[k]
        for j in range(3):
            total += record.rotation[k, j]
    return math.isfinite(total)


@compiled
def note(record: RunRecord, criteria: Criteria) -> None:
    """Keep energy and tilt of now, and the largest slip."""
    velocity, spin, inertia = record.velocity, record.spin, record.inertia
    square = upright = 0.0
    for k in range(3):
        turning = 0.0
        for j in range(3):
            turning += inertia[k, j] * spin[j]
        square += velocity[k] * velocity[k] + spin[k] * turning
        upright += record.rotation[2, k] * criteria.upward[k]
    record.kinetic = 0.5 * square
    record.energy = record.kinetic + GRAVITY * record.position[2]
    record.tilt = math.acos(max(-1.0, min(1.0, upright)))
    if not record.toppled:
        x = record.position[0] - criteria.foot * record.rotation[0, 2] - record.start_foot[0]
        y = record.position[1] - criteria.foot * record.rotation[1, 2] - record.start_foot[1]
        record.slip = max(record.slip, math.sqrt(x * x + y * y))
    note_peaks(record, record.tilt, record.slip)


@compiled
def note_peaks(record: RunRecord, tilt: float, slip: float) -> None:
    """Keep the largest tilt and slip; an engine may know of larger ones than when it is monitored.

    Parameters
    ----------
    tilt : float [rad]
    slip : float [m]
    """
    record.peak_tilt = max(record.peak_tilt, tilt)
    if not record.toppled:
        record.peak_slip = max(record.peak_slip, slip)


@compiled
def gained_too_much(record: RunRecord, criteria: Criteria, impulse: float) -> bool:
    """Whether a rock has more energy than its table can have given, or one that is no number.

    Parameters
    ----------
    impulse : float [m/s], integral of the table's absolute acceleration so far
    """
    floor = GRAVITY * criteria.limits.floor
    most = proofs.reachable_energy(GRAVITY * record.start[2] - floor, impulse)
    return not record.energy - floor <= most + ENERGY_SLACK * GRAVITY * criteria.radius


@compiled
def side(record: RunRecord, criteria: Criteria) -> int:
    """Outcome by where the rock is now."""
    if record.toppled or record.tilt > criteria.limits.toppled_tilt:
        return OVERTURNED
    return DISPLACED if record.slip > DISPLACED_SHARE * criteria.radius else BALANCED


@compiled
def note_rest(record: RunRecord, criteria: Criteria, time: float) -> None:
    """Since when the rock has hardly any energy, and where; a rest is no motion with its table.

    Parameters
    ----------
    time : float [s]
    """
    if not record.kinetic + 0.5 * record.table_speed**2 < criteria.rest_energy:
        record.rest_since = -1.0
    elif record.rest_since < 0.0:
        _rest_from(record, time)


@compiled
def rests(record: RunRecord, criteria: Criteria, time: float) -> bool:
    """Whether it has stood still for a while; it is watched anew if it creeps.

    Parameters
    ----------
    time : float [s]
    """
    if record.rest_since < 0.0 or time - record.rest_since < criteria.rest_time:
        return False
    path = turn = 0.0
    for k in range(3):
        path += (record.position[k] - record.rest_position[k]) ** 2
        for j in range(3):
            turn += (record.rotation[k, j] - record.rest_rotation[k, j]) ** 2
    _rest_from(record, time)
    return math.sqrt(path) + math.sqrt(0.5 * turn) * criteria.radius <= criteria.creep


@compiled
def _rest_from(record: RunRecord, time: float) -> None:
    record.rest_since = time
    assign(record.rest_position, record.position)
    assign_matrix(record.rest_rotation, record.rotation)
