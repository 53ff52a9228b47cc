"""How well a servo makes a table follow a motion, with a rock on it that pushes back."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from vsr_core import engines
from vsr_core.arrays import Array
from vsr_core.engines.interface import DrivenWorld
from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.motions.records.trace import Trace
from vsr_core.run.sampling import samples, sampling
from vsr_core.scene import Scene
from vsr_core.table.servo import loop

ENGINE = "bullet"
"""The one that has a driven table."""

RECOVERED = 0.1
"""Share of the peak of a disturbance below which the table has recovered."""

SHAKEN = 0.01
"""Share of the PGV: a table is shaken from the first velocity above it to the last."""

WAVES = tuple(float(f) for f in np.geomspace(0.6, 8.0, 24))
"""Frequencies of the short waves in a made motion [Hz]."""

LONGER, PERIODS, SYNTHETIC_STEP = 1.3, 18.0, 0.005
"""Its long wave in units of the ratio asked for, its length in the same, and its sampling [s]."""


@dataclass(frozen=True, eq=False)
class TableHistory:
    """A driven table, with its rock, at the end of each control period.

    Attributes
    ----------
    time : ndarray, shape (n,) [s]
    wanted : ndarray, shape (n,) [m/s], velocity of the motion
    command : ndarray, shape (n,) [m/s], what the servo was told in that period
    measured : ndarray, shape (n,) [m/s], velocity of the table
    force : ndarray, shape (n,) [N], of the servo
    tilt : ndarray, shape (n,) [rad], of the rock
    height : ndarray, shape (n,) [m], of its centre of mass above the table
    """

    time: Array
    wanted: Array
    command: Array
    measured: Array
    force: Array
    tilt: Array
    height: Array

    @property
    def error(self) -> Array:
        """Velocity measured less wanted, shape (n,) [m/s]."""
        return self.measured - self.wanted


@dataclass(frozen=True)
class Errors:
    """Errors of a table's velocity.

    Attributes
    ----------
    rms, largest : float [m/s], while the table is ``shaken``
    first : float [m/s]
        At the end of the first control period: what becomes of a jump of the acceleration at t = 0.
    first_share : float
        Mean acceleration of the table in that period, as a share of the motion's.
    """

    rms: float
    largest: float
    first: float
    first_share: float


@dataclass(frozen=True)
class Disturbance:
    """The rock's push on the table.

    Attributes
    ----------
    time : float [s], when it is largest
    peak : float [m/s], change of the table's velocity by it
    recovery : float [s], from then until it is down to ``RECOVERED`` of that
    """

    time: float
    peak: float
    recovery: float


def track(scene: Scene, motion: GroundMotion, time_step: float, after: float) -> TableHistory:
    """Drive a table through a motion and for ``after`` [s] more.

    Parameters
    ----------
    time_step : float [s], the largest allowed
    after : float [s]
    """
    drive = scene.drive
    assert drive is not None
    plan = sampling(motion, drive, time_step)
    number = plan.pulse_samples + math.ceil(after / plan.interval)
    step = plan.interval / plan.substeps
    world = cast(DrivenWorld, engines.load(ENGINE).build(scene, step, plan.substeps))
    commands = samples(motion, drive, plan.interval, number)
    read = np.array(list(_read(world, commands)))
    time = plan.interval * np.arange(1, number + 1, dtype=np.float64)
    wanted, (speed, force, tilt, height) = motion.velocity(time), read.T
    return TableHistory(time, wanted, commands, speed, force, tilt, height)


def errors(followed: TableHistory) -> Errors:
    """Errors while the table is shaken."""
    error = followed.error[shaken(followed.wanted)]
    return Errors(
        float(np.sqrt(np.mean(error**2))),
        float(np.abs(error).max()),
        float(followed.error[0]),
        float(followed.measured[0] / followed.wanted[0]),
    )


def shaken(velocity: Array) -> slice:
    """The samples in which a motion shakes a table: zeros around it, and filtered ones, do not.

    Parameters
    ----------
    velocity : ndarray, shape (n,), of the motion, not zero throughout

    Examples
    --------
    >>> shaken(np.array([0.0, 1e-4, 1.0, 0.0, -0.5, 0.0]))
    slice(2, 5, None)
    """
    speed = np.abs(velocity)
    strong = np.flatnonzero(speed > SHAKEN * speed.max())
    return slice(int(strong[0]), int(strong[-1]) + 1)


def standing_loop(followed: TableHistory, scene: Scene) -> Array:
    """Velocity of the sampled loop with the rock at rest on the table.

    Returns
    -------
    ndarray, shape (n,) [m/s]
    """
    assert scene.drive is not None
    standing = replace(scene.drive, mass=scene.drive.mass + scene.rock.mass)
    return loop(standing, followed.command)


def push(followed: TableHistory, scene: Scene) -> Array:
    """What the rock's moving does to the table's velocity.

    Returns
    -------
    ndarray, shape (n,) [m/s]
        The velocity measured less that of the ``standing_loop``.
    """
    return followed.measured - standing_loop(followed, scene)


def disturbance(time: Array, pushed: Array) -> Disturbance:
    """The largest push; ``time`` [s] and ``pushed`` [m/s], from ``push``, have shape (n,).

    Parameters
    ----------
    time : ndarray, shape (n,) [s]
    pushed : ndarray, shape (n,) [m/s], change of the table's velocity by the rock
    """
    size = np.abs(pushed)
    at = int(np.argmax(size))
    again = at + int(np.argmax(np.append(size[at:], 0.0) <= RECOVERED * size[at]))
    end = float(time[min(again, len(time) - 1)])
    return Disturbance(float(time[at]), float(size[at]), end - float(time[at]))


def synthetic(ratio: float) -> Trace:
    """A made motion that looks recorded, with a PGV/PGA [s]: a long wave under shorter ones.

    Velocities of both swell and fade as sin^2; the waves of ``WAVES`` have equal accelerations and
    phases by the golden section. Their share is what gives the ratio. Its size means nothing.

    Parameters
    ----------
    ratio : float [s], its PGV/PGA
    """
    time = np.arange(0.0, PERIODS * ratio, SYNTHETIC_STEP)
    swell = np.sin(np.pi * time / time[-1]) ** 2
    base = swell * np.sin(time / (LONGER * ratio))
    phases = 2.0 * np.pi * (np.arange(len(WAVES)) * 0.6180339887 % 1.0)
    waves = np.sin(2.0 * np.pi * np.outer(time, WAVES) + phases) / np.array(WAVES)
    rough = swell * waves.sum(axis=1)
    low, high = 0.0, float(np.abs(base).max() / np.abs(rough).max())
    for _ in range(60):
        share = 0.5 * (low + high)
        velocity = base + share * rough
        acceleration = np.gradient(velocity, SYNTHETIC_STEP)
        if np.abs(velocity).max() > ratio * np.abs(acceleration).max():
            low = share
        else:
            high = share
    return Trace(acceleration, SYNTHETIC_STEP)


def _read(world: DrivenWorld, commands: Array) -> Iterator[tuple[float, ...]]:
    """Velocity of the table, force of the servo, tilt and height of the rock."""
    for command in commands.tolist():
        world.advance([command])
        state = world.state()
        tilt = math.acos(max(-1.0, min(1.0, float(state.rotation[2, 2]))))
        yield world.table()[1], world.force(), tilt, float(state.position[2])
