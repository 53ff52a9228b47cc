"""A run in an engine whose steps are asked for one by one: to each judgement, and its record."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, TypeVar, cast

import numpy as np

from vsr_core import engines
from vsr_core.arrays import Array, matrix_product
from vsr_core.compiled import records
from vsr_core.engines.interface import DrivenWorld, GroundWorld, TurningWorld, WatchingWorld, World
from vsr_core.judge import record as run_record
from vsr_core.judge.record import Criteria, RunRecord
from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.rock.body import Rock
from vsr_core.run.cases import Settings
from vsr_core.run.sampling import Sampling, samples
from vsr_core.scene import Scene, State

HALVINGS = 5
"""A run that breaks its guards is repeated at half the step, this many times."""

LEAD = 8
"""Samples before a push with which a run goes on after a rest, so that the engine has its contacts:
without them a block rises 7 % less."""

Found = TypeVar("Found")


def at_halved_steps(
    time_step: float, attempt: Callable[[float], Found], unstable: Callable[[Found], bool]
) -> Found:
    """Result of the first attempt that keeps its guards, or of the last one.

    Parameters
    ----------
    time_step : float [s], of the first attempt
    attempt : function of a time step [s]

    Examples
    --------
    >>> at_halved_steps(1.0, lambda step: step, lambda step: step > 0.3)
    0.25
    """
    for _ in range(HALVINGS):
        found = attempt(time_step)
        if not unstable(found):
            return found
        time_step /= 2.0
    return attempt(time_step)


@dataclass
class Run:
    """One attempt at a run, at one time step.

    Attributes
    ----------
    monitored : int, samples from one judgement to the next
    values : ndarray, shape (last_sample,) or (last_sample, 3 or 9), samples of the motion
    impulses : ndarray, shape (last_sample + 1,) [m/s], integral of the table's absolute
        acceleration up to each sample
    write : callable, writes a state into the record
    start : State, before the first step
    sample : int, samples taken or passed over
    skipped : int, samples passed over because nothing could move the rock
    """

    scene: Scene
    motion: GroundMotion
    sampled: Sampling
    criteria: Criteria
    monitored: int
    last_sample: int
    values: Array
    impulses: Array
    world: World
    start: State
    record: RunRecord
    write: Callable[[State], None]
    sample: int = 0
    skipped: int = 0

    @property
    def time(self) -> float:
        """Time since the start of the motion [s]."""
        return self.sample * self.sampled.interval

    @property
    def shaken(self) -> bool:
        """Whether the motion is still under way."""
        return self.sample < self.sampled.pulse_samples

    @property
    def steps(self) -> int:
        """Time steps done."""
        return (self.sample - self.skipped) * self.sampled.substeps

    @property
    def impulse(self) -> float:
        """Integral of the table's absolute acceleration [m/s], as measured if driven or turning."""
        if self.scene.drive is not None or self.motion.columns == 9:
            return cast(DrivenWorld | TurningWorld, self.world).impulse()
        return float(self.impulses[self.sample])

    def skip(self, number: int) -> None:
        """Pass over samples that cannot move the rock."""
        self.sample += number
        self.skipped += number

    def take(self, number: int) -> None:
        """Step through so many samples."""
        advance: Callable[[Any], None] = self.world.advance
        if self.motion.columns == 9:
            advance = cast(TurningWorld, self.world).turn
        elif self.values.ndim > 1:
            advance = self.world.shake
        until = self.sample + number
        advance(self.values[self.sample : until].tolist())
        self.sample = until

    def until_judged(self) -> int:
        """Samples to the next judgement: evenly spaced, and one at the end of the motion."""
        until = min(self.sample + self.monitored, self.last_sample)
        return (min(until, self.sampled.pulse_samples) if self.shaken else until) - self.sample

    def step(self) -> None:
        """Step to the next judgement, and write the record."""
        self.take(self.until_judged())
        if hasattr(self.world, "peaks"):
            run_record.note_peaks(self.record, *cast(WatchingWorld, self.world).peaks())
        self.write(self.world.state())
        if self.scene.drive is not None:
            self.record.table_speed = cast(DrivenWorld, self.world).table()[1]


def set_up(
    scene: Scene,
    motion: GroundMotion,
    settings: Settings,
    sampled: Sampling,
    criteria: Criteria,
    *,
    monitored: int,
    wait: float,
    start: State | None = None,
) -> Run:
    """A run before its first step.

    Parameters
    ----------
    sampled : Sampling, of the motion at the attempt's time step
    wait : float [s], longest time to go on after the motion
    start : State, where it is known better than from the engine's world
    """
    last = sampled.pulse_samples + math.ceil(wait / sampled.interval)
    world = enter(scene, settings, sampled)
    start = start or world.state()
    values = samples(motion, scene.drive, sampled.interval, last)
    sizes = np.abs(values) if values.ndim == 1 else np.linalg.norm(values[:, :3], axis=1)
    record = records.room(RunRecord)
    run = Run(
        scene=scene,
        motion=motion,
        sampled=sampled,
        criteria=criteria,
        monitored=monitored,
        last_sample=last,
        values=values,
        impulses=sampled.interval * np.concatenate([[0.0], np.cumsum(sizes)]),
        world=world,
        start=start,
        record=record,
        write=writer(record, scene.rock),
    )
    run.write(start)
    run_record.begin(record, criteria)
    return run


def enter(scene: Scene, settings: Settings, sampled: Sampling) -> World:
    """World of a scene in the engine of the settings, at the step of the sampling."""
    engine = engines.load(settings.engine)
    step = sampled.interval / sampled.substeps
    return engine.build(scene, step, sampled.substeps, settings.solver)


def clear(world: GroundWorld, state: State) -> State:
    """Raise a rock until it is no deeper in the ground than a touch."""
    for _ in range(4):
        world.advance([0.0])
        deepest = world.contacts()[1]
        world.put(state)
        if deepest == 0.0:
            break
        above = np.array([0.0, 0.0, 1.2 * deepest])
        state = replace(state, position=state.position + above)
        world.put(state)
    return state


def inertia_of(rock: Rock) -> Array:
    """Inertia about the centre of mass per unit mass, in the rock's axes.

    Returns
    -------
    ndarray, shape (3, 3) [m^2]
    """
    return matrix_product(rock.axes * (rock.inertia / rock.mass), rock.axes.T)


def writer(record: RunRecord, rock: Rock) -> Callable[[State], None]:
    """What writes states of a rock into the record of its run."""
    inertia, vertices, is_sphere = inertia_of(rock), rock.vertices, rock.shape == "sphere"
    # Views, once: attributes of a record are slow to find.
    position, rotation, velocity = record.position, record.rotation, record.velocity
    spin, turned, lever = record.spin, record.inertia, record.lever
    lever[:] = 0.0, 0.0, rock.radius

    def write(state: State) -> None:
        turn = state.rotation
        position[:], rotation[:] = state.position, turn
        velocity[:], spin[:] = state.velocity, state.angular_velocity
        turned[:] = turn @ inertia @ turn.T
        if not is_sphere:
            lever[:] = -(turn @ vertices[(vertices @ turn[2]).argmin()])

    return write


def first_push(values: Array, static_limits: tuple[float, float]) -> int:
    """Number of the first sample outside the static limits; what is not a number is a push.

    Parameters
    ----------
    values : ndarray, shape (n,) or (n, axes) [m/s^2]; only along the first something can be borne
    static_limits : tuple of float [m/s^2], lowest and highest that move nothing

    Examples
    --------
    >>> first_push(np.array([0.0, 0.5, -2.0]), (-1.0, 1.0))
    2
    """
    lowest, highest = static_limits
    axes = values.reshape(len(values), -1)
    moved = ~((lowest <= axes[:, 0]) & (axes[:, 0] <= highest)) | (axes[:, 1:] != 0.0).any(axis=1)
    return int(np.argmax(np.append(moved, True)))
