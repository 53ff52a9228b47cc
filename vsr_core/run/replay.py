"""A run again, step by step: the states, energies and points of contact that its outcome came from.

The outcome is found as the study finds it. Its run is then stepped once more in the same scene, at
the same time step, with the same samples, and has to end in the same step at the same tilt. It
goes on after its outcome was decided, until the rock rests, so that one sees where that led; on a
terrain as a displacement run does, and to where that stops.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from scipy.spatial.transform import Rotation

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.compiled import records
from vsr_core.engines.interface import DrivenWorld, World
from vsr_core.errors import InvalidInput
from vsr_core.judge import on_terrain
from vsr_core.judge.record import RunRecord, note, note_rest, rests
from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.outcome import Outcome, Response
from vsr_core.run import displacement, loop, overturning
from vsr_core.run.cases import Case, Settings, TerrainCase
from vsr_core.run.displacement import respond
from vsr_core.run.loop import Run
from vsr_core.run.overturning import COMPILED, in_columns, simulate
from vsr_core.run.sampling import first_step
from vsr_core.scene import Scene, State

SAME_TILT = 1e-6
"""Largest difference [rad] of the tilt in which a run ended from that in which it ends again: what
rounding makes of an angle near zero."""


@dataclass(frozen=True, eq=False)
class Replay:
    """A run as it went, relative to the table.

    Attributes
    ----------
    time_step : float [s], of the engine
    decided : float [s], when its outcome was decided; what comes later is no part of the run
    time : ndarray, shape (n,) [s], since the start of the motion
    position : ndarray, shape (n, 3) [m], centre of mass
    quaternion : ndarray, shape (n, 4), x y z w, takes the rest pose at yaw 0 to the present one
    tilt : ndarray, shape (n,) [rad]
    kinetic : ndarray, shape (n,) [J], of the motion relative to the table
    potential : ndarray, shape (n,) [J], of the weight; zero where the rock stands at the start
    bearing : tuple of n ndarrays, shape (k, 3) [m], points on which the ground pushed the rock
    acceleration, velocity : ndarray, shape (n, 3) [m/s^2, m/s], of the table; on a terrain the
        first column is along the shaking
    """

    response: Response
    time_step: float
    decided: float
    time: Array
    position: Array
    quaternion: Array
    tilt: Array
    kinetic: Array
    potential: Array
    bearing: tuple[Array, ...]
    acceleration: Array
    velocity: Array


def replay(
    place: Case | TerrainCase,
    motion: GroundMotion,
    settings: Settings,
    *,
    spacing: float = 0.0,
    longest: float = math.inf,
) -> Replay:
    """Do a run once more and keep how it went.

    Parameters
    ----------
    spacing : float [s], longest time between two states that are kept; 0 for every sample
    longest : float [s], for which it goes on at most after its outcome is decided

    Raises
    ------
    InvalidInput
        For a run without a sound solution at any time step.
    """
    run_once = simulate if isinstance(place, Case) else respond
    response = run_once(cast(Any, place), motion, settings)
    if response.outcome is Outcome.UNSTABLE:
        rule = "a run that is played has a sound solution"
        raise InvalidInput("a run that is unstable at every time step", rule, "choose another run")
    for run, camera in _attempts(place, motion, settings, response, spacing):
        last = camera.frames[-1]
        ended = abs(last.tilt - response.final_tilt) < SAME_TILT
        if run.steps == response.steps and (ended or not run.steps):  # or stands by a proof
            decided = run.time
            _go_on(place, settings, run, camera, decided + longest)
            return _developed(run, camera.frames, response, decided)
    raise AssertionError("a run that ends otherwise when it is done once more")


@dataclass(frozen=True, eq=False)
class _Frame:
    time: float
    state: State
    tilt: float
    kinetic: float
    bearing: Array
    table: float | None


class _Camera:
    """A run's world, which keeps a frame after every few samples that it is given."""

    def __init__(self, run: Run, spacing: float, *, whole: bool) -> None:
        self.run, self.world = run, run.world
        self._record = records.room(RunRecord)
        self._write = loop.writer(self._record, run.scene.rock)
        self._spacing = spacing
        self._each = 10**9 if whole else max(1, int(spacing / run.sampled.interval + 1e-9))
        self.frames = [self._frame(0.0, run.start)]

    def __getattr__(self, name: str) -> Any:
        """What a world tells besides."""
        return getattr(self.world, name)

    def advance(self, samples: Sequence[Any]) -> None:
        self._step(self.world.advance, samples)

    def shake(self, samples: Sequence[Any]) -> None:
        self._step(self.world.shake, samples)

    def turn(self, samples: Sequence[Any]) -> None:
        self._step(cast(Any, self.world).turn, samples)

    def _step(self, run_on: Any, samples: Sequence[Any]) -> None:
        interval, last = self.run.sampled.interval, self.frames[-1]
        if self.run.time > last.time + 0.5 * interval:  # passed over: nothing moved until now
            self.frames.append(replace(last, time=self.run.time))
        for start in range(0, len(samples), self._each):
            part = samples[start : start + self._each]
            run_on(part)
            time = (self.run.sample + start + len(part)) * interval
            if len(self.frames) > 1 and time <= self.frames[-2].time + self._spacing + 1e-9:
                self.frames.pop()  # a judgement came earlier than a frame was due
            self.frames.append(self._frame(time, self.world.state()))

    def _frame(self, time: float, state: State) -> _Frame:
        driven, record = hasattr(self.world, "table"), self._record
        table = cast(DrivenWorld, self.world).table()[1] if driven else None
        self._write(state)
        note(record, self.run.criteria)
        tilt, kinetic = float(record.tilt), float(record.kinetic)
        return _Frame(time, state, tilt, kinetic, self.world.footing()[0], table)


def _attempts(
    place: Case | TerrainCase,
    motion: GroundMotion,
    settings: Settings,
    response: Response,
    spacing: float,
) -> Iterator[tuple[Run, _Camera]]:
    """The run at each time step and in each scene that a study tries, as far as its outcome."""
    in_one_go = settings.engine == COMPILED
    if isinstance(place, TerrainCase):
        scenes = [place.seat]
    else:
        scenes = [place.full] if in_one_go else [place.scene, place.full]
    time_step = first_step(motion, scenes[0].drive, settings.time_step)
    for _ in range(loop.HALVINGS + 1):
        for scene in scenes:
            run = _set_up(place, scene, motion, settings, time_step)
            # Bullet gathers the ground of a terrain for all samples that it is given at once.
            whole = not in_one_go and scene.terrain is not None
            camera = _Camera(run, spacing, whole=whole)
            run.world = cast(World, camera)
            if response.steps:
                _complete(run, place, settings, response.steps)
            yield run, camera
        time_step /= 2.0


def _set_up(
    place: Case | TerrainCase,
    scene: Scene,
    motion: GroundMotion,
    settings: Settings,
    time_step: float,
) -> Run:
    """The run before its first step."""
    if isinstance(place, TerrainCase):
        return displacement.set_up(place, motion, settings, time_step, follow=False)
    return overturning.set_up(place, scene, motion, settings, time_step)


def _complete(run: Run, place: Case | TerrainCase, settings: Settings, steps: int) -> None:
    """Step a run to its outcome; after so many steps, if it was compiled and on a flat pedestal."""
    if isinstance(place, TerrainCase):
        displacement.complete(run, place, settings)
    elif settings.engine == COMPILED:
        run.skip(max(0, overturning.first_sample(run, place)) if run.criteria.proves else 0)
        run.take(steps)
    else:
        overturning.complete(run, place)


def _go_on(
    place: Case | TerrainCase, settings: Settings, run: Run, camera: _Camera, until: float
) -> None:
    """Step a decided run until the rock rests; on a terrain to the end of a displacement run."""
    if isinstance(place, TerrainCase) and run.steps:
        if run.record.toppled:
            run.world = camera.world
            displacement.leave_seat(run, place, settings)
            camera.world, run.world = run.world, cast(World, camera)
            displacement.step_on(run, place, displacement.begin_track(run), until)
        return
    record, rock = records.room(RunRecord), run.scene.rock
    criteria = on_terrain.criteria(
        rock,
        run.scene.contact,
        upward=run.criteria.upward,
        toppled_tilt=math.pi,
        lowest=-math.inf,
        follow=True,
    )
    record.rest_since = -1.0
    write = loop.writer(record, rock)
    while run.sample < run.last_sample and run.time < until:
        run.take(run.until_judged())
        frame = camera.frames[-1]
        write(frame.state)
        note(record, criteria)
        note_rest(record, criteria, frame.time)
        gone = not np.isfinite(frame.state.position).all()
        if gone or (not run.shaken and rests(record, criteria, frame.time)):
            break


def _developed(run: Run, frames: Sequence[_Frame], response: Response, decided: float) -> Replay:
    sound = [frame for frame in frames if np.isfinite(frame.state.position).all()]
    time = np.array([frame.time for frame in sound])
    position = np.array([frame.state.position for frame in sound])
    mass = run.scene.rock.mass
    bearing = [frame.bearing for frame in sound]
    bearing[0] = bearing[min(1, len(bearing) - 1)]  # before a step some engines know none
    velocity = in_columns(run.motion.velocity(time), 3)
    acceleration = in_columns(run.motion.acceleration(time), 3)
    if sound[0].table is not None:
        velocity[:, 0] = [frame.table for frame in sound]
        acceleration[:, 0] = np.gradient(velocity[:, 0], time)
    return Replay(
        response,
        run.sampled.interval / run.sampled.substeps,
        decided,
        time,
        position,
        Rotation.from_matrix([frame.state.rotation for frame in sound]).as_quat(),
        np.array([frame.tilt for frame in sound]),
        mass * np.array([frame.kinetic for frame in sound]),
        mass * GRAVITY * (position[:, 2] - run.start.position[2]),
        tuple(bearing),
        acceleration,
        velocity,
    )
