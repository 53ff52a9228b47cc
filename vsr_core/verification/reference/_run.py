"""Shared by the families: scenes, a run in an engine, and what was read on the way."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from vsr_core import engines
from vsr_core.arrays import Array
from vsr_core.rock import solid
from vsr_core.rock.body import Rock
from vsr_core.scene import Scene, State

DENSITY = 2110.0
"""Density of the rocks [kg/m^3], that of chert in the paper; no answer here depends on it."""

GRIPPING = 10.0
"""Coefficient of friction with which nothing slides."""

LOOKS = 2400
"""Readings of the state in a run, at most."""


@dataclass(frozen=True)
class Path:
    """States of a rock in its table's frame, read on the way.

    Attributes
    ----------
    time : ndarray, shape (n,) [s]
    position : ndarray, shape (n, 3) [m]
    rotation : ndarray, shape (n, 3, 3)
    velocity : ndarray, shape (n, 3) [m/s]
    spin : ndarray, shape (n, 3) [rad/s], in the table's axes
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


@cache
def box(width: float, depth: float, height: float) -> Rock:
    """Box of the given sides along x, y and z [m]."""
    return solid.box((width, depth, height), DENSITY).rock


@cache
def sphere(radius: float) -> Rock:
    """Uniform sphere of a radius [m]."""
    mass = DENSITY * 4.0 / 3.0 * math.pi * radius**3
    poles = radius * np.vstack([np.eye(3), -np.eye(3)])
    return Rock("sphere", poles, mass, np.full(3, 0.4 * mass * radius**2), np.eye(3))


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
    engine : str
    scene : Scene
    time_step : float [s]
    acceleration : ndarray, shape (steps,) [m/s^2], of the table along +x, one for each step

    Returns
    -------
    Path
        Start and end included, evenly read between them as ``LOOKS`` allows.
    """
    world = engines.load(engine).build(scene, time_step, 1)
    values = acceleration.tolist()
    every = math.ceil(len(values) / LOOKS)
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


def leaning(half_width: float, half_height: float, lean: float) -> State:
    """State at rest of a block tilted about its lower edge towards +x, at x = half_width.

    Parameters
    ----------
    half_width, half_height : float [m]
    lean : float [rad], above 0
    """
    cos, sin = math.cos(lean), math.sin(lean)
    turn = np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
    corner = np.array([half_width, 0.0, -half_height])
    return State(np.array([half_width, 0.0, 0.0]) - turn @ corner, turn, np.zeros(3), np.zeros(3))


def largest(values: Array) -> float:
    """Largest length of vectors, shape (n, 3), or size of numbers, shape (n,); nan if any is."""
    sizes = np.linalg.norm(values, axis=1) if values.ndim == 2 else np.abs(values)
    return float(sizes.max())
