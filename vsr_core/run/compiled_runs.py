"""Many runs on a flat pedestal, each from first to last step in compiled code.

What a run is, is told in ``overturning_rules``; this is the same for the engine ``nonsmooth``,
without the interpreter between two steps and without its lock.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vsr_core import GRAVITY
from vsr_core.arrays import Array, Indices
from vsr_core.engines import nonsmooth
from vsr_core.engines.nonsmooth import body as bodies
from vsr_core.engines.nonsmooth import plane
from vsr_core.engines.nonsmooth.body import Body, Motion, Points
from vsr_core.engines.nonsmooth.compiling import compiled
from vsr_core.engines.nonsmooth.stepping import step
from vsr_core.engines.nonsmooth.turning import feel
from vsr_core.engines.nonsmooth.vectors import assign, assign_matrix
from vsr_core.engines.nonsmooth.world import begin, set_state
from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.outcome import DecidedBy, Outcome, Response
from vsr_core.run import guards, watching
from vsr_core.run.cases import Case, Settings
from vsr_core.run.looking import look, start_watch
from vsr_core.run.overturning_rules import (
    CREEP_SHARE,
    DRIFT_SHARE,
    LEAST_WAIT,
    PENETRATION_SHARE,
    REST_OF_BARRIER,
    REST_SHARE,
    REST_TIME,
    WAITING_TIMES,
)
from vsr_core.run.proofs import Barrier
from vsr_core.run.sampling import first_step, samples, sampling
from vsr_core.run.watching import Rule, Watch
from vsr_core.scene import resting

_RULES = tuple(DecidedBy)

MONITORED_STEPS = 8
"""Time steps in a monitoring interval."""


@dataclass(frozen=True)
class _Attempt:
    """Runs that are to be done at a time step: their places among all, and the step [s] of each."""

    places: tuple[int, ...]
    steps: tuple[float, ...]


def simulate(case: Case, motions: Sequence[GroundMotion], settings: Settings) -> list[Response]:
    """Outcomes of runs on a flat pedestal.

    Never raises for physics: a run that breaks its guards at every step tried is ``UNSTABLE``.

    Parameters
    ----------
    motions : sequence of GroundMotion
    """
    found: dict[int, Response] = {}
    attempt = _Attempt(
        tuple(range(len(motions))),
        tuple(first_step(motion, None, settings.time_step) for motion in motions),
    )
    for _ in range(guards.HALVINGS + 1):
        rows = _run_all(case, [motions[i] for i in attempt.places], attempt.steps, settings)
        found.update(zip(attempt.places, rows, strict=True))
        again = [
            (i, 0.5 * time_step)
            for i, time_step in zip(attempt.places, attempt.steps, strict=True)
            if found[i].outcome is Outcome.UNSTABLE
        ]
        if not again:
            break
        places, steps = zip(*again, strict=True)
        attempt = _Attempt(places, steps)
    return [found[i] for i in range(len(motions))]


def rule_of(case: Case, settings: Settings, *, turns: bool) -> Rule:
    """What the runs of a case are judged by.

    Parameters
    ----------
    turns : bool, whether the table turns, of which nothing is proved
    """
    rock, limits, contact = case.full.rock, case.limits, case.full.contact
    radius, climb = rock.radius, max(limits.edge_height - limits.upright_floor, 0.0)
    # One kind of arrays and numbers, wherever they were read, so that nothing is compiled twice.
    tilt, height, *numbers = limits
    plain = Barrier(np.array(tilt), np.array(height), *map(float, numbers))
    return Rule(
        plain,
        np.ascontiguousarray(rock.axes),
        float(contact.friction),
        float(contact.rolling_friction),
        radius,
        rock.height,
        GRAVITY * min(REST_SHARE * radius, REST_OF_BARRIER * climb),
        REST_TIME * math.sqrt(radius / GRAVITY),
        CREEP_SHARE * radius,
        PENETRATION_SHARE * radius,
        DRIFT_SHARE * radius,
        settings.reduce and not turns,
    )


def _run_all(
    case: Case, motions: Sequence[GroundMotion], steps: Sequence[float], settings: Settings
) -> list[Response]:
    """Responses of runs at given time steps [s], each the longest allowed."""
    scene, solver = case.full, settings.solver or nonsmooth.SOLVER
    wait = max(LEAST_WAIT, WAITING_TIMES * math.sqrt(scene.rock.radius / GRAVITY))
    taken = [sampling(motion, None, most, 1) for motion, most in zip(motions, steps, strict=True)]
    turns = any(motion.columns == 9 for motion in motions)
    columns = 9 if turns else 3
    values = [
        _felt(m, s.interval, s.pulse_samples, columns) for m, s in zip(motions, taken, strict=True)
    ]
    ends = np.cumsum([0, *(len(v) for v in values)])
    intervals = np.array([s.interval for s in taken])
    last = np.array([s.pulse_samples + math.ceil(wait / s.interval) for s in taken])
    limits = _limits(case, motions, settings)
    body = bodies.body(scene.rock, scene.contact, on_level=True)
    start = bodies.motion()
    set_state(start, scene.start or resting(scene), scene.rock.axes)
    decided = np.zeros((len(motions), 3), dtype=np.int64)
    measured = np.zeros((len(motions), 3))
    table = Table(
        np.concatenate(values),
        ends,
        intervals,
        last,
        limits,
        scene.start is not None,
        scene.gravity,
        scene.pedestal != "none",
        solver.iterations,
        solver.residual,
    )
    rock, points = bodies.motion(), bodies.points(max(1, len(body.points)))
    rule, watch = rule_of(case, settings, turns=turns), watching.watch()
    run_all(body, rule, table, start, rock, points, watch, decided, measured)
    return [
        Response(Outcome(o), _RULES[d], peak, tilt, slip, n)
        for (o, d, n), (peak, tilt, slip) in zip(decided.tolist(), measured.tolist(), strict=True)
    ]


def _felt(motion: GroundMotion, interval: float, number: int, columns: int) -> Array:
    """Samples of a motion: along x, y and z [m/s^2], and of a table that turns six more."""
    values = samples(motion, None, interval, number)
    whole = np.zeros((number, columns))
    if values.ndim == 1:
        whole[:, 0] = values
    else:
        whole[:, : values.shape[1]] = values
    return whole


def _limits(case: Case, motions: Sequence[GroundMotion], settings: Settings) -> Array:
    """Lowest and highest acceleration along x that move nothing, shape (n, 2) [m/s^2].

    Zeros where nothing is known: of motions along several axes, and of a rock on the move.
    """
    known = case.static_limits if settings.reduce else (0.0, 0.0)
    return np.array([known if m.columns == 1 else (0.0, 0.0) for m in motions])


class Table(NamedTuple):
    """How runs are shaken and stepped.

    Attributes
    ----------
    values : ndarray, shape (samples, 3) [m/s^2] or (samples, 9)
        Acceleration in each step of all motions, and angular velocity and its rate.
    ends : ndarray of int, shape (n + 1,), where the values of each motion begin, and the last end
    intervals : ndarray, shape (n,) [s], time step of each run
    last : ndarray of int, shape (n,), step at which it is out of time
    limits : ndarray, shape (n, 2) [m/s^2], accelerations along x that move nothing
    moving : bool, whether runs start on the move
    gravity : float [m/s^2]
    on_ground : bool, whether there is a pedestal
    """

    values: Array
    ends: Indices
    intervals: Array
    last: Indices
    limits: Array
    moving: bool
    gravity: float
    on_ground: bool
    rounds: int
    residual: float


@compiled
def run_all(
    body: Body,
    rule: Rule,
    table: Table,
    start: Motion,
    rock: Motion,
    points: Points,
    watch: Watch,
    decided: Indices,
    measured: Array,
) -> None:
    """Do runs one after another, each from the same start.

    Parameters
    ----------
    decided : ndarray of int, shape (n, 3), written: outcome, rule and steps of each run
    measured : ndarray, shape (n, 3), written: peak tilt, final tilt [rad] and slip [m]
    """
    for n in range(len(table.intervals)):
        assign(rock.place, start.place)
        assign(rock.quaternion, start.quaternion)
        assign_matrix(rock.rotation, start.rotation)
        assign(rock.velocity, start.velocity)
        begin(body, rock, table.intervals[n])
        outcome, by, steps = _run(body, rule, table, n, rock, points, watch)
        decided[n, 0], decided[n, 1], decided[n, 2] = outcome, by, steps
        measured[n, 0], measured[n, 1] = watch.peak_tilt, watch.tilt
        measured[n, 2] = watch.slip


@compiled
def _run(
    body: Body, rule: Rule, table: Table, n: int, rock: Motion, points: Points, watch: Watch
) -> tuple[int, int, int]:
    """Outcome, what decided it, and steps of one run."""
    interval, last = table.intervals[n], table.last[n]
    values = table.values[table.ends[n] : table.ends[n + 1]]
    pulse, whole = len(values), _impulse(values, interval)
    first = -1 if table.moving else _first_push(values, table.limits[n])
    start_watch(watch, body, rock, rule, interval)
    if not watching.sound(watch, rule, 0.0, 0.0, True):
        return watching.UNSTABLE, watching.SIMULATED, 0
    skipped = max(0, min(first, pulse)) if rule.proves else 0
    now, given = skipped, _impulse(values[:skipped], interval)
    while now < last:
        until = min(now + MONITORED_STEPS, last)
        if now < pulse:
            until = min(until, pulse)
        given += _advance(body, table, values, now, until, interval, rock, points)
        now = until
        look(watch, body, rock, points, rule, interval)
        time = now * interval
        if not watching.sound(watch, rule, time, given, now > first):
            return watching.UNSTABLE, watching.SIMULATED, now - skipped
        outcome, by = watching.decided(watch, rule, time, max(0.0, whole - given), now < pulse)
        if outcome != watching.GOES_ON:
            return outcome, by, now - skipped
    if watching.proved(watch, rule, 0.0):
        return watching.side(watch, rule), watching.SIMULATED, now - skipped
    return watching.UNSETTLED, watching.SIMULATED, now - skipped


@compiled
def _advance(
    body: Body,
    table: Table,
    values: Array,
    now: int,
    until: int,
    interval: float,
    rock: Motion,
    points: Points,
) -> float:
    """Step from one sample to another; beyond the last the table rests.

    Returns how much the table can have added to sqrt(2 e) [m/s].
    """
    push, given = rock.push, 0.0
    for n in range(now, until):
        push[0] = push[1] = 0.0
        push[2] = -table.gravity
        if n < len(values) and values.shape[1] == 9:
            given += feel(body, rock, values[n], interval, table.gravity)
        elif n < len(values):
            for k in range(3):
                push[k] -= values[n, k]
            given += interval * _size(values[n])
        if table.on_ground:
            speed = interval * (abs(push[0]) + abs(push[1]) + abs(push[2]))
            plane.find(body, rock, points, interval, speed)
        step(body, rock, points, push, interval, table.gravity, table.rounds, table.residual)
    return given


@compiled
def _impulse(values: Array, interval: float) -> float:
    """Integral of the absolute acceleration over samples [m/s]."""
    total = 0.0
    for n in range(len(values)):
        total += _size(values[n])
    return interval * total


@compiled
def _size(vector: Array) -> float:
    return math.sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2])


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
