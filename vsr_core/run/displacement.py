"""Displacement runs: on a terrain, from the first shake until the rock rests, with trajectories.

Everything is in the site's frame, relative to the terrain, in which the table's acceleration acts
as a body force. While the rock is on its seat its base is complete; once it has toppled it goes on
in a second scene, in which it is as detailed as a tumbling rock needs.
"""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import cast

import numpy as np

from vsr_core import GRAVITY, engines
from vsr_core.arrays import Array
from vsr_core.compiled import records
from vsr_core.engines import nonsmooth
from vsr_core.engines.interface import GroundWorld
from vsr_core.engines.nonsmooth import terrain_runs
from vsr_core.engines.nonsmooth.terrain_runs import Shaking
from vsr_core.engines.nonsmooth.world import NonsmoothWorld
from vsr_core.errors import InvalidInput
from vsr_core.judge import ground_lookup, on_terrain, track
from vsr_core.judge.on_terrain import LONGEST_TIME, MONITORING_TIME
from vsr_core.judge.record import GOES_ON, UNSTABLE, Criteria, RunRecord, note, note_rest, rests
from vsr_core.judge.track import Track
from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.outcome import DecidedBy, Outcome, Response, StopReason
from vsr_core.run import loop, static_limits
from vsr_core.run.cases import Settings, TerrainCase, never_starts
from vsr_core.run.loop import LEAD, Run, at_halved_steps, first_push
from vsr_core.run.movement import Trajectory, of_track
from vsr_core.run.overturning import COMPILED
from vsr_core.run.sampling import first_step, samples, sampling
from vsr_core.scene import Scene, State, in_site

QUIET_STEPS = 100
"""Steps in which the engine finds what a rock at rest stands on."""


@dataclass(frozen=True)
class DisplacementRun:
    """Result of a displacement run.

    Attributes
    ----------
    response : Response, with ``slip`` up to toppling
    """

    response: Response
    stop: StopReason
    trajectory: Trajectory


def displace(
    case: TerrainCase, motion: GroundMotion, settings: Settings, *, follow: bool = True
) -> DisplacementRun:
    """Shake the rock and follow it until it rests.

    Never raises for physics: a run that breaks its guards at every step tried is ``UNSTABLE``.

    Parameters
    ----------
    motion : GroundMotion, along (cos yaw, -sin yaw), or in three axes turned by -yaw; nothing is
        proved of those
    settings : Settings; ``reduce`` lets the run begin shortly before the first push, and go on in
        the lighter scene once the rock toppled
    follow : bool
        Whether to go on after toppling; without, only the outcome and the path up to there are
        wanted.

    Raises
    ------
    InvalidInput
        For a motion that turns the terrain.
    """
    refuse_turns(motion)
    one_way, peak = motion.columns == 1, motion.peak_acceleration
    if one_way and never_starts(case.static_limits, peak, settings):
        return _stays(case)
    attempt = _compiled if settings.engine == COMPILED else _stepped
    return at_halved_steps(
        first_step(motion, None, settings.time_step),
        partial(attempt, case, motion, settings, follow),
        lambda found: found.response.outcome is Outcome.UNSTABLE,
    )


def refuse_turns(motion: GroundMotion) -> None:
    """Refuse a motion that turns the table: a terrain is shaken in translation."""
    if motion.columns > 3:
        given, rule = "a terrain that turns", "it is shaken along x, y and z"
        raise InvalidInput(given, rule, "leave out roll, pitch and yaw, or take a flat pedestal")


def criteria_of(case: TerrainCase, *, follow: bool) -> Criteria:
    """What a run is judged by.

    Parameters
    ----------
    follow : bool, whether it goes on after toppling
    """
    seat = case.seat
    assert seat.start is not None
    assert seat.terrain is not None
    return on_terrain.criteria(
        seat.rock,
        seat.contact,
        upward=seat.start.rotation[2],
        toppled_tilt=case.toppled_tilt,
        lowest=seat.terrain.lowest,
        follow=follow,
    )


def first_sample(values: Array, case: TerrainCase, settings: Settings) -> int:
    """Sample with which a run begins: shortly before the first push, until which nothing moves.

    Parameters
    ----------
    values : ndarray, shape (n,) or (n, 3) [m/s^2], those of the motion; where they are along
        several axes it begins at once, as limits are known of one direction
    """
    lowest, highest = case.static_limits
    if values.ndim > 1 or not (settings.reduce and lowest < 0.0 < highest):
        return 0
    return max(0, first_push(values, case.static_limits) - LEAD)


def _compiled(
    case: TerrainCase, motion: GroundMotion, settings: Settings, follow: bool, time_step: float
) -> DisplacementRun:
    """One attempt, in compiled code."""
    taken = sampling(motion, None, time_step, 1)
    values = samples(motion, None, taken.interval, taken.pulse_samples)
    wait = on_terrain.longest_wait(case.seat.rock.radius)
    shaking = Shaking(
        in_site(values, case.seat.yaw),
        taken.interval,
        on_terrain.monitored(taken.interval),
        first_sample(values, case, settings),
        taken.pulse_samples + math.ceil(wait / taken.interval),
    )
    site, solver = _site(threading.get_ident(), case), settings.solver or nonsmooth.SOLVER
    found = terrain_runs.run(site, criteria_of(case, follow=follow), shaking, solver)
    return _result(*found)


@lru_cache(maxsize=16)
def _site(thread: int, case: TerrainCase) -> terrain_runs.Site:
    """What the runs of a case share in one thread: each has its own lists of near features."""
    return terrain_runs.site(case.seat, case.flight)


def _stepped(
    case: TerrainCase, motion: GroundMotion, settings: Settings, follow: bool, time_step: float
) -> DisplacementRun:
    """One attempt, in an engine whose steps are asked for one by one."""
    run = set_up(case, motion, settings, time_step, follow=follow)
    return complete(run, case, settings)


def _result(outcome: int, stop: int, steps: int, record: RunRecord, kept: Track) -> DisplacementRun:
    measured = float(record.peak_tilt), float(record.tilt), float(record.peak_slip)
    response = Response(Outcome(outcome), DecidedBy.SIMULATION, *measured, steps)
    return DisplacementRun(response, StopReason(stop), of_track(kept, int(record.kept)))


def set_up(
    case: TerrainCase, motion: GroundMotion, settings: Settings, time_step: float, *, follow: bool
) -> Run:
    """A run before its first step.

    Parameters
    ----------
    time_step : float [s], of this attempt
    follow : bool, whether it goes on after toppling
    """
    taken = sampling(motion, None, time_step, 1)
    if settings.engine != COMPILED:
        most = sampling(motion, None, time_step, max(1, int(MONITORING_TIME / time_step))).substeps
        # Bullet finds the steps in a sample by division, and one less where that is not exact.
        taken = sampling(motion, None, time_step, 1 << (most.bit_length() - 1))
    return loop.set_up(
        case.seat,
        motion,
        settings,
        taken,
        criteria_of(case, follow=follow),
        monitored=on_terrain.monitored(taken.interval),
        wait=on_terrain.longest_wait(case.seat.rock.radius),
        start=case.seat.start,
    )


def complete(run: Run, case: TerrainCase, settings: Settings) -> DisplacementRun:
    """Step a run to its end."""
    record, follow = run.record, run.criteria.follow
    run.skip(first_sample(run.values[: run.sampled.pulse_samples], case, settings))
    kept = begin_track(run)
    # A rock first comes to the moment in which it topples, as another scene may follow.
    run.criteria = run.criteria._replace(follow=False)
    outcome, stop = step_on(run, case, kept)
    if follow and record.toppled:
        leave_seat(run, case, settings)
        outcome, stop = step_on(run, case, kept)
    if outcome != UNSTABLE:
        track.end(kept, record)
    return _result(outcome, stop, run.steps, record, kept)


def begin_track(run: Run) -> Track:
    """Room for what is kept of a run from now on."""
    kept = track.room(math.ceil(run.last_sample / run.monitored) + 1)
    track.begin(kept, run.record, run.time)
    return kept


def step_on(run: Run, case: TerrainCase, kept: Track, until: float = math.inf) -> tuple[int, int]:
    """Step a run until it is decided; its outcome, and what stopped it.

    Parameters
    ----------
    until : float [s], when it is out of time
    """
    record, criteria, pulse = run.record, run.criteria, run.sampled.pulse_samples
    assert case.seat.terrain is not None
    lookup, interval = ground_lookup.lookup(case.seat.terrain), run.sampled.interval
    while run.sample < run.last_sample and run.time < until:
        since = run.sample
        run.step()
        pushes = in_site(run.values[since : run.sample], case.seat.yaw).sum(axis=0) * interval
        record.change[:] = -pushes
        record.change[2] -= GRAVITY * (run.sample - since) * interval
        late = 2 * run.sample >= pulse + run.last_sample
        sees = on_terrain.monitor(record, criteria, kept, run.time, run.impulse, late)
        deepest = cast(GroundWorld, run.world).contacts()[1] if sees else -1.0
        outcome, stop = on_terrain.judge(record, criteria, lookup, run.time, run.shaken, deepest)
        if outcome != GOES_ON:
            return outcome, stop
    return on_terrain.out_of_time(record, criteria)


def leave_seat(run: Run, case: TerrainCase, settings: Settings) -> None:
    """Have a rock that toppled go on in its scene in flight, raised if it would start inside it."""
    run.criteria = run.criteria._replace(follow=True)
    if case.flight is case.seat:
        return
    if settings.engine == COMPILED:
        cast(NonsmoothWorld, run.world).go_on_in(case.flight)
        run.record.intervals = 0
        return
    state = run.world.state()
    world = cast(GroundWorld, loop.enter(case.flight, settings, run.sampled))
    world.put(state)
    loop.clear(world, state)
    run.world = world


def along(scene: Scene) -> Array:
    """Direction of the shaking in the site's frame.

    Returns
    -------
    ndarray, shape (3,)
    """
    return np.array([math.cos(scene.yaw), -math.sin(scene.yaw), 0.0])


def respond(case: TerrainCase, motion: GroundMotion, settings: Settings) -> Response:
    """As ``displace``, without what follows when the rock has toppled."""
    return displace(case, motion, settings, follow=False).response


def limits_on_seat(scene: Scene, time_step: float, engine: str = "bullet") -> tuple[float, float]:
    """Range of table accelerations [m/s^2] in which a rock on its seat stays at rest.

    Parameters
    ----------
    scene : Scene, on a terrain, with the rock at rest as its start
    time_step : float [s]

    Returns
    -------
    (float, float)
        Lowest and highest; zeros where the rock does not rest by its points of contact, and where
        walls hold it either way: that is for runs to show.
    """
    footing = _footing(scene, time_step, engine)
    limits = static_limits.on_points(*footing, scene.contact.friction, along(scene))
    return limits if np.isfinite(limits).all() else (0.0, 0.0)


def held_toward(scene: Scene, time_step: float, engine: str = "bullet") -> Array:
    """Directions in which walls hold a rock on its seat against any steady shaking.

    They do so without friction: points that friction wedges may hold it, and need not.

    Returns
    -------
    ndarray, shape (k,) [rad], counter-clockwise from +x, of twelve, toward which the rock would go
    """
    footing = _footing(scene, time_step, engine)
    turns = np.radians(np.arange(0.0, 180.0, 30.0))
    ways = np.column_stack([np.cos(turns), np.sin(turns), np.zeros(len(turns))])
    limits = np.array([static_limits.on_points(*footing, 0.0, way) for way in ways])
    # a table that goes one way leaves the rock behind, the other way
    return np.concatenate([turns[np.isinf(limits[:, 0])], math.pi + turns[np.isinf(limits[:, 1])]])


def _footing(scene: Scene, time_step: float, engine: str) -> tuple[Array, Array, Array]:
    """Where the ground touches a rock at rest, the normals there, and its centre of mass."""
    world = cast(GroundWorld, engines.load(engine).build(scene, time_step, 1))
    world.advance([0.0] * QUIET_STEPS)
    return *world.footing(), world.state().position


def at_rest(scene: Scene, time_step: float, engine: str = "bullet") -> State:
    """Where a rock comes to rest that is let go on a terrain, unshaken.

    Parameters
    ----------
    scene : Scene, on a terrain; the rock's ``start`` is where it is let go
    time_step : float [s]

    Raises
    ------
    InvalidInput
        If it does not come to rest.
    """
    assert scene.start is not None
    world = engines.load(engine).build(scene, time_step, 1)
    record = records.room(RunRecord)
    write = loop.writer(record, scene.rock)
    criteria = on_terrain.criteria(
        scene.rock,
        scene.contact,
        upward=scene.start.rotation[2],
        toppled_tilt=math.pi,
        lowest=-math.inf,
        follow=True,
    )
    record.rest_since = -1.0
    for interval in range(math.ceil(LONGEST_TIME / MONITORING_TIME)):
        world.advance([0.0] * math.ceil(MONITORING_TIME / time_step))
        state, time = world.state(), interval * MONITORING_TIME
        write(state)
        note(record, criteria)
        note_rest(record, criteria, time)
        if rests(record, criteria, time):
            return replace(state, velocity=np.zeros(3), angular_velocity=np.zeros(3))
    given = f"a rock that still moves after {LONGEST_TIME:g} s on its seat"
    rule = "it stands where it was scanned"
    raise InvalidInput(given, rule, "look at the closing of the scan and its cut (`vsr prep`)")


def settled(scene: Scene, time_step: float, engine: str = "bullet") -> State:
    """Where a rock comes to rest that is set on its terrain as scanned, unshaken.

    Parameters
    ----------
    scene : Scene, on a terrain; the rock's ``start`` is its pose in the scan
    time_step : float [s]

    Raises
    ------
    InvalidInput
        If it does not come to rest there, or not near where it was scanned.
    """
    assert scene.start is not None
    state = at_rest(scene, time_step, engine)
    radius = scene.rock.radius
    shift = float(np.linalg.norm(state.position - scene.start.position))
    turn = _angle(state.rotation @ scene.start.rotation.T)
    if shift > 0.1 * radius or turn > math.radians(15.0):
        raise InvalidInput(
            f"a rock that unshaken moves by {shift:.3g} m and turns by "
            f"{math.degrees(turn):.1f} deg",
            "it stands where it was scanned, to a tenth of its radius and 15 deg",
            "look at the closing of the scan and its cut (`vsr prep`)",
        )
    return state


def _stays(case: TerrainCase) -> DisplacementRun:
    """Result of a run that never starts."""
    assert case.seat.start is not None
    stands = Response(Outcome.BALANCED, DecidedBy.NO_UPLIFT_BOUND, 0.0, 0.0, 0.0, 0)
    record, kept = records.room(RunRecord), track.room(1)
    loop.writer(record, case.seat.rock)(case.seat.start)
    track.begin(kept, record, 0.0)
    return DisplacementRun(stands, StopReason.REST, of_track(kept, 1))


def _angle(rotation: Array) -> float:
    return math.acos(max(-1.0, min(1.0, 0.5 * (float(np.trace(rotation)) - 1.0))))
