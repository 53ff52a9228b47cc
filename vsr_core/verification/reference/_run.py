"""Shared by the families: a run in an engine, and what was read meanwhile."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vsr_core import engines
from vsr_core.arrays import Array
from vsr_core.scene import Scene

READINGS = 2400
"""Readings of the state in a run, at most."""


@dataclass(frozen=True)
class Path:
    """States of a rock in its table's frame, read during a run.

    Attributes
    ----------
    time : ndarray, shape (n,) [s]
    position : ndarray, shape (n, 3) [m]
    rotation : ndarray, shape (n, 3, 3)
    velocity : ndarray, shape (n, 3) [m/s]
    angular_velocity : ndarray, shape (n, 3) [rad/s], in the table's axes
    """

    time: Array
    position: Array
    rotation: Array
    velocity: Array
    angular_velocity: Array

    @property
    def lean(self) -> Array:
        """Tilt about +y [rad], shape (n,): positive for a block that leans towards +x."""
        return np.arctan2(self.rotation[:, 0, 2], self.rotation[:, 2, 2])


def whole(duration: float, time_step: float) -> tuple[int, float]:
    """Steps that fill a duration [s] exactly, none longer than ``time_step``, and their length."""
    number = max(1, math.ceil(duration / time_step - 1e-9))
    return number, duration / number


def middles(number: int, step: float) -> Array:
    """Times in the middle of steps [s], shape (number,)."""
    return step * (np.arange(number, dtype=np.float64) + 0.5)


def run(engine: str, scene: Scene, time_step: float, acceleration: Array) -> Path:
    """Run a scene and read its path.

    Parameters
    ----------
    time_step : float [s]
    acceleration : ndarray, shape (steps,) [m/s^2], of the table along +x, one for each step

    Returns
    -------
    Path
        Start and end included, evenly read between them as ``READINGS`` allows.
    """
    world = engines.load(engine).build(scene, time_step, 1)
    values = acceleration.tolist()
    every = math.ceil(len(values) / READINGS)
    states, ends = [world.state()], [0]
    for first in range(0, len(values), every):
        world.advance(values[first : first + every])
        states.append(world.state())
        ends.append(min(first + every, len(values)))
    return Path(
        time_step * np.array(ends, dtype=np.float64),
        np.array([state.position for state in states]),
        np.array([state.rotation for state in states]),
        np.array([state.velocity for state in states]),
        np.array([state.angular_velocity for state in states]),
    )


def largest(values: Array) -> float:
    """Largest length of vectors, shape (n, 3), or size of numbers, shape (n,); nan if any is."""
    sizes = np.linalg.norm(values, axis=1) if values.ndim == 2 else np.abs(values)
    return float(sizes.max())
