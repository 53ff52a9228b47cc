"""Shake tables of hardware: what they can do, and the commands that make them do it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vsr_core.arrays import Array
from vsr_core.motions.pulses import CosinePulse

LIMITS = ("acceleration", "velocity", "stroke", "payload")
"""What may bind, in the order in which it is named."""


@dataclass(frozen=True)
class Table:
    """What a table can do; a limit that is not known is infinite.

    Attributes
    ----------
    acceleration : float [m/s^2]
    velocity : float [m/s]
    stroke : float [m], travel from end to end
    payload : float [kg]
    command_rate : float [Hz], velocity commands in a second
    pulley : float [m], diameter on which the belt runs
    """

    acceleration: float
    velocity: float
    stroke: float
    payload: float
    command_rate: float
    pulley: float
    steps_per_turn: float | None

    @property
    def step_length(self) -> float | None:
        """Travel of the table for one step of its motor [m]."""
        if self.steps_per_turn is None:
            return None
        return math.pi * self.pulley / self.steps_per_turn


@dataclass(frozen=True, eq=False)
class Commands:
    """What a controller sends to a table.

    Attributes
    ----------
    time : ndarray, shape (n,) [s], when each command starts
    velocity : ndarray, shape (n,) [m/s], held until the next one
    steps : ndarray, shape (n,), int, or None
        Position of the motor at the end of each command, in steps from the start.
    """

    time: Array
    velocity: Array
    steps: NDArray[np.int64] | None


def loads(motion: CosinePulse, mass: float) -> dict[str, float]:
    """What a pulse asks of a table.

    Parameters
    ----------
    mass : float [kg], of the rock on the table

    Returns
    -------
    dict of str to float
        By limit, in the units of ``Table``; the stroke is twice the amplitude.
    """
    pga, ratio = motion.peak_acceleration, motion.pgv_pga
    return {
        "acceleration": pga,
        "velocity": pga * ratio,
        "stroke": 2.0 * pga * ratio**2,
        "payload": mass,
    }


def binding(table: Table, motion: CosinePulse, mass: float) -> str:
    """The limit that a motion goes beyond, by the largest factor if several; else empty.

    Parameters
    ----------
    mass : float [kg], of the rock on the table
    """
    shares = {name: load / getattr(table, name) for name, load in loads(motion, mass).items()}
    worst = max(LIMITS, key=lambda name: shares[name])
    return worst if shares[worst] > 1.0 + 1e-12 else ""


def largest_pga(table: Table, ratio: float) -> dict[str, float]:
    """Largest PGA within each limit of motion.

    Parameters
    ----------
    ratio : float [s], PGV/PGA

    Returns
    -------
    dict of str to float [m/s^2], by limit

    Examples
    --------
    >>> table = Table(10.0, 0.5, 0.4, 100.0, 200.0, 0.02, None)
    >>> largest_pga(table, 0.5)
    {'acceleration': 10.0, 'velocity': 1.0, 'stroke': 0.8}
    """
    return {
        "acceleration": table.acceleration,
        "velocity": table.velocity / ratio,
        "stroke": table.stroke / (2.0 * ratio**2),
    }


def commands(table: Table, motion: CosinePulse) -> Commands:
    """A pulse as velocity commands at the table's rate, and as positions of its motor.

    Each command is the mean velocity of the time for which it is held, so that the table is where
    the motion is whenever it ends, and back at its start at the last one, which stops it.

    References
    ----------
    Chen et al. (2024), Seismica 3(1), Eq. 10, and section 4.3.
    """
    number = math.ceil(motion.duration * table.command_rate - 1e-9)
    time = np.arange(number + 1, dtype=np.float64) / table.command_rate
    place = np.append(motion.displacement(time), 0.0)
    steps = None
    if table.step_length is not None:
        steps = np.rint(place[1:] / table.step_length).astype(np.int64)
    velocity = np.append(np.diff(place[:-1]) * table.command_rate, 0.0)
    return Commands(time, velocity, steps)
