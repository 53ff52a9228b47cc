"""Many runs on a flat pedestal, each from first to last step without the interpreter."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vsr_core.arrays import Array, Indices
from vsr_core.compiled import records
from vsr_core.compiled.compiling import compiled
from vsr_core.compiled.vectors import assign, assign_matrix, length
from vsr_core.engines.interface import Solver
from vsr_core.engines.nonsmooth import body as bodies
from vsr_core.engines.nonsmooth import monitoring, plane
from vsr_core.engines.nonsmooth import peaks as watched
from vsr_core.engines.nonsmooth.body import Body, Point, Points, RockState, Stepping
from vsr_core.engines.nonsmooth.peaks import Peaks
from vsr_core.engines.nonsmooth.world import set_state
from vsr_core.judge import on_pedestal
from vsr_core.judge.record import GOES_ON, Criteria, RunRecord, note_peaks
from vsr_core.scene import Scene, resting


class Shaking(NamedTuple):
    """How each of n runs is shaken, in time steps.

    Attributes
    ----------
    values : ndarray, shape (samples, 3) [m/s^2] or (samples, 9)
        Acceleration in each step of all motions, and angular velocity and its rate.
    ends : ndarray of int, shape (n + 1,), where the values of each motion begin, and the last end
    intervals : ndarray, shape (n,) [s], time step
    monitored : ndarray of int, shape (n,), steps from one judgement to the next
    last : ndarray of int, shape (n,), step at which it is out of time
    limits : ndarray, shape (n, 2) [m/s^2], accelerations along x that move nothing
    """

    values: Array
    ends: Indices
    intervals: Array
    monitored: Indices
    last: Indices
    limits: Array


class Table(NamedTuple):
    """What runs have in common besides their rock.

    Attributes
    ----------
    axes : ndarray, shape (3, 3), principal axes of the rock in its rest pose, as columns
    moving : bool, whether the rock starts on the move
    gravity : float [m/s^2]
    on_ground : bool, whether there is a pedestal
    """

    axes: Array
    moving: bool
    gravity: float
    on_ground: bool
    rounds: int
    residual: float


def run_all(
    scene: Scene, criteria: Criteria, shaking: Shaking, solver: Solver
) -> tuple[Indices, Array]:
    """Do runs one after another, each from the same start.

    Returns
    -------
    decided : ndarray of int, shape (n, 3), outcome, what decided it, and steps of each run
    measured : ndarray, shape (n, 3), peak tilt, final tilt [rad] and slip [m]
    """
    rock, number = scene.rock, len(shaking.intervals)
    body = bodies.body(rock, scene.contact, on_level=True)
    start = records.room(RockState)
    set_state(start, scene.start or resting(scene), rock.axes)
    table = Table(
        np.ascontiguousarray(rock.axes),
        scene.start is not None,
        scene.gravity,
        scene.pedestal != "none",
        solver.iterations,
        solver.residual,
    )
    points = records.rows(Point, max(1, len(body.points)))
    now, record = records.room(RockState), records.room(RunRecord)
    peaks = watched.room(rock, criteria.upward)
    decided, measured = np.zeros((number, 3), dtype=np.int64), np.zeros((number, 3))
    _run_all(body, criteria, table, shaking, start, now, points, peaks, record, decided, measured)
    return decided, measured


@compiled
def _run_all(
    body: Body,
    criteria: Criteria,
    table: Table,
    shaking: Shaking,
    start: RockState,
    rock: RockState,
    points: Points,
    peaks: Peaks,
    record: RunRecord,
    decided: Indices,
    measured: Array,
) -> None:
    for n in range(len(shaking.intervals)):
        assign(rock.place, start.place)
        assign(rock.quaternion, start.quaternion)
        assign_matrix(rock.rotation, start.rotation)
        assign(rock.velocity, start.velocity)
        outcome, by, steps = _run(body, criteria, table, shaking, n, rock, points, peaks, record)
        decided[n, 0], decided[n, 1], decided[n, 2] = outcome, by, steps
        measured[n, 0], measured[n, 1] = record.peak_tilt, record.tilt
        measured[n, 2] = record.peak_slip


@compiled
def _run(
    body: Body,
    criteria: Criteria,
    table: Table,
    shaking: Shaking,
    n: int,
    rock: RockState,
    points: Points,
    peaks: Peaks,
    record: RunRecord,
) -> tuple[int, int, int]:
    """Outcome, what decided it, and steps of one run."""
    interval, last = shaking.intervals[n], shaking.last[n]
    values = shaking.values[shaking.ends[n] : shaking.ends[n + 1]]
    pulse, whole = len(values), _impulse(values, interval)
    stepping = Stepping(interval, table.gravity, table.rounds, table.residual)
    first = -1 if table.moving else _first_push(values, shaking.limits[n])
    monitoring.start(record, criteria, body, table.axes, rock, points, peaks, interval)
    outcome, by = on_pedestal.judge(record, criteria, 0.0, 0.0, math.inf, True, True)
    skipped = max(0, min(first, pulse)) if criteria.proves else 0
    now, impulse = skipped, _impulse(values[:skipped], interval)
    while outcome == GOES_ON and now < last:
        until = min(now + shaking.monitored[n], last)
        if now < pulse:
            until = min(until, pulse)
        impulse += plane.advance(
            body, rock, points, peaks, values, now, until, stepping, table.on_ground
        )
        now = until
        note_peaks(record, *watched.tilt_and_slip(peaks))
        monitoring.write(record, body, table.axes, rock, points, interval)
        remaining = max(0.0, whole - impulse)
        time, moved = now * interval, first < min(now, pulse)
        outcome, by = on_pedestal.judge(
            record, criteria, time, impulse, remaining, moved, now < pulse
        )
    if outcome == GOES_ON:
        outcome, by = on_pedestal.out_of_time(record, criteria), on_pedestal.SIMULATED
    return outcome, by, now - skipped


@compiled
def _impulse(values: Array, interval: float) -> float:
    """Integral of the absolute acceleration over samples [m/s]."""
    total = 0.0
    for n in range(len(values)):
        total += length(values[n])
    return interval * total


@compiled
def _first_push(values: Array, limits: Array) -> int:
    """Number of the first sample outside the static limits; what is not a number is a push."""
    for n in range(len(values)):
        if not limits[0] <= values[n, 0] <= limits[1]:
            return n
        for k in range(1, values.shape[1]):
            if values[n, k] != 0.0:
                return n
    return len(values)
