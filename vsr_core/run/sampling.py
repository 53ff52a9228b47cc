"""How a run samples its motion: the hold of a sample, the steps in it, and its values."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vsr_core.arrays import Array
from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.table.servo import Servo

MOST_SUBSTEPS = 8
"""Time steps under one sample of the motion, at most: calls to an engine cost as much as steps."""

SAMPLING_SHARE = 0.1
"""Longest hold of a sample, as a share of the motion's shortest time. A pulse held from mid to
mid of steps of 0.1 rad is off by 0.1^2 / 24 = 0.04 %."""


@dataclass(frozen=True)
class Sampling:
    """Samples of a motion, and the steps of an engine in them.

    Attributes
    ----------
    interval : float [s], for which a sample is held
    pulse_samples : int, samples until the motion is over
    """

    interval: float
    substeps: int
    pulse_samples: int


def first_step(motion: GroundMotion, drive: Servo | None, time_step: float) -> float:
    """Step [s] to begin with: ``time_step``, or as fine as the motion or the drive needs it.

    Parameters
    ----------
    time_step : float [s], the largest allowed

    Returns
    -------
    float [s]
    """
    longest = SAMPLING_SHARE * motion.shortest_time if drive is None else drive.period
    return min(time_step, longest)


def sampling(
    motion: GroundMotion, drive: Servo | None, time_step: float, most: int = MOST_SUBSTEPS
) -> Sampling:
    """Samples in steps of at most ``time_step`` [s], without a drive at most ``most`` of them each.

    A whole number of them fills the motion. A drive takes one per control period instead, and a
    whole number of steps fills that.

    Parameters
    ----------
    time_step : float [s], the largest allowed
    most : int, steps under one sample without a drive
    """
    if drive is not None:
        substeps = _times(time_step, drive.period)
        return Sampling(drive.period, substeps, _times(drive.period, motion.duration))
    held = int(SAMPLING_SHARE * motion.shortest_time / time_step)
    substeps = max(1, min(most, held))
    samples = math.ceil(motion.duration / (time_step * substeps))
    return Sampling(motion.duration / samples, substeps, samples)


def samples(motion: GroundMotion, drive: Servo | None, interval: float, number: int) -> Array:
    """Acceleration [m/s^2] at the middle of each hold; of a drive, its commands [m/s].

    A servo with Kp h / M = 1 takes all of an error away within a control period h, in a ramp, and
    keeps to a command that is held for T until the next. It is on time in the mean if the command
    is the velocity (T + h) / 2 after its start. Without a hold, T = h, that is the one at the end
    of the period, and the jump of a pulse's acceleration comes with the first one.

    Parameters
    ----------
    interval : float [s], for which a sample is held

    Returns
    -------
    ndarray, shape (number,); (number, 3) or (number, 9) of a table that moves in several axes
    """
    if drive is not None:
        starts = np.arange(math.ceil(number / drive.hold), dtype=np.float64) * drive.command_period
        middle = 0.5 * (drive.command_period + drive.period)
        return np.repeat(motion.velocity(starts + middle), drive.hold)[:number]
    starts = np.arange(number, dtype=np.float64) * interval
    return motion.acceleration(starts + 0.5 * interval)


def _times(part: float, whole: float) -> int:
    """How many of ``part`` fill ``whole``, not one more for a rounding error."""
    return math.ceil(whole / part - 1e-9)
