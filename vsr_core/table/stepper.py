"""A table on a toothed belt whose motor steps are timed by software: what comes of a pulse."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vsr_core.arrays import Array
from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.motions.pulses import CosinePulse


@dataclass(frozen=True)
class Stepper:
    """A motor that is sent a step by each period of a signal that software switches.

    The program waits twice in each period, and each wait lasts longer than asked for. At a
    commanded velocity v it makes v / step / (1 + overhead v / step) steps a second, so that the
    table is the slower the faster it is to be. At rest, and where it turns, its acceleration is
    the commanded one.

    Attributes
    ----------
    rate : float [Hz], velocity commands in a second
    step : float [m], travel that the program counts for a step
    overhead : float [s], by which each period is too long
    """

    rate: float
    step: float
    overhead: float


@dataclass(frozen=True)
class SteppedPulse(GroundMotion):
    """What a table with a stepper does when it is commanded a cosine pulse.

    Between two commands its velocity goes straight from one to the next.

    Attributes
    ----------
    gain : float [1], travel of the table in a step, relative to what the program counts for it
    """

    commanded: CosinePulse
    stepper: Stepper
    gain: float = 1.0

    @cached_property
    def velocities(self) -> Array:
        """Velocities at the ends of the commands [m/s], shape (n,), at rest first and last."""
        rate, step = self.stepper.rate, self.stepper.step
        number = math.ceil(rate * self.commanded.duration)
        asked = self.commanded.velocity(np.arange(number) / rate)
        made = self.gain * asked / (1.0 + self.stepper.overhead / step * np.abs(asked))
        return np.append(made, 0.0)

    @property
    def duration(self) -> float:
        """To the end of the last command [s]."""
        return (len(self.velocities) - 1) / self.stepper.rate

    @property
    def shortest_time(self) -> float:
        """Ten commands [s]: a time step then skips none."""
        return 10.0 / self.stepper.rate

    @property
    def peak_acceleration(self) -> float:
        """Largest absolute acceleration [m/s^2]."""
        return float(np.abs(self._accelerations).max())

    def acceleration(self, t: Array) -> Array:
        """Acceleration [m/s^2] at times ``t`` [s]; zero outside the motion."""
        number = np.clip(np.floor(t * self.stepper.rate), 0, len(self._accelerations) - 1)
        inside = (t >= 0.0) & (t <= self.duration)
        return np.where(inside, self._accelerations[number.astype(np.int64)], 0.0)

    def velocity(self, t: Array) -> Array:
        """Velocity [m/s] at times ``t`` [s]; zero outside the motion."""
        times = np.arange(len(self.velocities)) / self.stepper.rate
        return np.asarray(np.interp(t, times, self.velocities, 0.0, 0.0))

    @cached_property
    def _accelerations(self) -> Array:
        """Acceleration until the end of each command [m/s^2]."""
        return np.asarray(self.stepper.rate * np.diff(self.velocities))
