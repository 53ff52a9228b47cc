"""The loop of a run: step through a motion, monitor the rock at intervals, end by rules.

Overturning and displacement are two sets of rules on it. What a rule needs to know of a run is in
``Run``, whose state changes as the run goes on.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar, cast

import numpy as np

from vsr_core import engines
from vsr_core.arrays import Array
from vsr_core.engines.interface import TurningWorld, World
from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.rock.body import Rock
from vsr_core.run import guards
from vsr_core.run.cases import Settings
from vsr_core.run.sampling import Sampling, samples
from vsr_core.scene import Scene, State

LEAD = 8
"""Samples before a push with which a run goes on after a rest, so that the engine has its contacts:
without them a block rises 7 % less."""

Ending = TypeVar("Ending", covariant=True)


@dataclass
class Run:
    """One attempt at a run, at one time step.

    Attributes
    ----------
    values : ndarray, shape (last_sample,) or (last_sample, 3 or 9), samples of the motion
    inertia : ndarray, shape (3, 3) [m^2], of the rock about its centre of mass per unit mass
    foot : ndarray, shape (3,) [m], centre of its base in its own axes
    start : State, before the first step
    upward : ndarray, shape (3,), the direction of the rock that is up where its tilt is zero
    state : State, when it was last monitored
    kinetic : float [m^2/s^2], kinetic energy per unit mass then
    sample : int, samples taken or passed over
    skipped : int, samples passed over because nothing could move the rock
    tilt, peak_tilt : float [rad], of ``upward`` against the vertical, then and largest so far
    slip : float [m], largest horizontal displacement of the base's centre so far
    """

    rock: Rock
    motion: GroundMotion
    sampled: Sampling
    monitored: int
    last_sample: int
    values: Array
    world: World
    inertia: Array
    foot: Array
    start: State
    upward: Array
    state: State
    kinetic: float = 0.0
    sample: int = 0
    skipped: int = 0
    tilt: float = 0.0
    peak_tilt: float = 0.0
    slip: float = 0.0

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
    def prescribed_impulse(self) -> float:
        """Integral of the prescribed motion's absolute acceleration so far [m/s]."""
        return self.motion.remaining_impulse(0.0) - self.motion.remaining_impulse(self.time)

    def skip(self, number: int) -> None:
        """Pass over samples that cannot move the rock."""
        self.sample += number
        self.skipped += number

    def monitor(self) -> bool:
        """Read the rock's state and kinetic energy; false if it is not finite and not taken."""
        state = self.world.state()
        if not guards.finite(state):
            return False
        self.state, self.kinetic = state, guards.kinetic_energy(self.inertia, state)
        return True

    def note_tilt(self) -> None:
        """Keep tilt and largest tilt."""
        upright = float(self.state.rotation[2] @ self.upward)
        self.tilt = math.acos(max(-1.0, min(1.0, upright)))
        self.peak_tilt = max(self.peak_tilt, self.tilt)

    def note_slip(self) -> None:
        """Keep the largest horizontal displacement of the base's centre."""
        foot, origin = (at.position + at.rotation @ self.foot for at in (self.state, self.start))
        slip = foot - origin
        self.slip = max(self.slip, math.hypot(slip[0], slip[1]))

    def next_monitoring(self) -> int:
        """Monitoring is evenly spaced, and once at the end of the motion."""
        until = min(self.sample + self.monitored, self.last_sample)
        return min(until, self.sampled.pulse_samples) if self.shaken else until

    def stepper(self) -> Callable[[Any], None]:
        """How the world takes samples of this motion."""
        if self.motion.columns == 9:
            return cast(TurningWorld, self.world).turn
        return self.world.advance if self.values.ndim == 1 else self.world.shake


class Rules(Protocol[Ending]):
    """What begins and ends runs of one kind."""

    def begin(self, run: Run) -> Ending | None:
        """Set the run to its first sample that counts; what ends it before a step, if anything."""

    def judge(self, run: Run, since: int) -> Ending | None:
        """What ends the run by what is monitored now; ``since`` is the sample monitored before."""

    def out_of_time(self, run: Run) -> Ending:
        """What a run is that nothing has ended."""


def set_up(
    scene: Scene,
    motion: GroundMotion,
    settings: Settings,
    sampled: Sampling,
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
    return Run(
        rock=scene.rock,
        motion=motion,
        sampled=sampled,
        monitored=monitored,
        last_sample=last,
        values=samples(motion, scene.drive, sampled.interval, last),
        world=world,
        inertia=guards.inertia_of(scene.rock),
        foot=np.array([0.0, 0.0, -scene.rock.height]),
        start=start,
        upward=np.array([0.0, 0.0, 1.0]),
        state=start,
    )


def enter(scene: Scene, settings: Settings, sampled: Sampling) -> World:
    """World of a scene in the engine of the settings, at the step of the sampling."""
    engine = engines.load(settings.engine)
    step = sampled.interval / sampled.substeps
    return engine.build(scene, step, sampled.substeps, settings.solver)


def complete(run: Run, rules: Rules[Ending]) -> Ending:
    """Step a run to its end by its rules.

    Parameters
    ----------
    run : Run, before its first step; changed
    """
    ending = rules.begin(run)
    values = run.values.tolist()
    while ending is None and run.sample < run.last_sample:
        since, run_on = run.sample, run.stepper()
        until = run.next_monitoring()
        run_on(values[since:until])
        run.sample = until
        ending = rules.judge(run, since)
    return rules.out_of_time(run) if ending is None else ending


def first_push(values: Array, static_limits: tuple[float, float]) -> int:
    """Number of the first sample outside the static limits; what is not a number is a push.

    Parameters
    ----------
    values : ndarray, shape (n,) [m/s^2]
    static_limits : tuple of float [m/s^2], lowest and highest that move nothing

    Examples
    --------
    >>> first_push(np.array([0.0, 0.5, -2.0]), (-1.0, 1.0))
    2
    """
    lowest, highest = static_limits
    moved = ~((lowest <= values) & (values <= highest))
    return int(np.argmax(np.append(moved, True)))
