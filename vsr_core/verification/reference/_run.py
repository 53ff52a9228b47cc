"""Shared by the families: a run in an engine, what was read meanwhile, and slopes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np

from vsr_core import GRAVITY, engines
from vsr_core.arrays import Array, Indices
from vsr_core.rock.body import Rock
from vsr_core.scene import Contact, Scene, State
from vsr_core.terrain.convex_parts import convex_parts
from vsr_core.terrain.surface import Terrain

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


TOLERANCE, THICKNESS = 1e-4, 0.05
"""Of convex parts [m]: how far they may stand out, and how thick they are."""


def axes(angle: float) -> Array:
    """Axes of a slope down +x as columns, shape (3, 3): downhill, across, normal."""
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])


@cache
def slope(angle: float, ends: tuple[float, float], half: float, cell: float, cut: bool) -> Terrain:
    """Even slope down +x through the origin.

    Parameters
    ----------
    angle : float [rad]
    ends : tuple of float [m], along it, the origin at 0
    half : float [m], width to each side
    cell : float [m], of its squares, two triangles each
    cut : bool, whether each square is a convex part; else its triangles are the ground
    """
    along = np.linspace(*ends, max(1, round((ends[1] - ends[0]) / cell)) + 1)
    across = np.linspace(-half, half, max(1, round(2.0 * half / cell)) + 1)
    turn = axes(angle)
    vertices, faces = sheet(along, np.zeros(len(along)), across)
    if not cut:
        return Terrain(vertices @ turn.T, faces)
    held: list[Array] = []
    for x in pairwise(along):
        for y in pairwise(across):
            square = Terrain(*sheet(np.array(x), np.zeros(2), np.array(y)))
            held += [part @ turn.T for part in in_parts(square)]
    return Terrain(vertices @ turn.T, faces, tuple(held))


def sheet(x: Array, z: Array, across: Array) -> tuple[Array, Indices]:
    """Vertices [m] and triangles of a profile (x, z), both shape (n,), drawn out along y."""
    width = len(across)
    vertices = np.column_stack([np.repeat(x, width), np.tile(across, len(x)), np.repeat(z, width)])
    a = (width * np.arange(len(x) - 1)[:, None] + np.arange(width - 1)).ravel()
    b, c, d = a + width, a + width + 1, a + 1
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return vertices, faces.astype(np.int64)


def in_parts(terrain: Terrain, tolerance: float = TOLERANCE) -> tuple[Array, ...]:
    """Convex parts of a terrain that stand for it to ``tolerance`` [m]."""
    return convex_parts(terrain, lambda points: np.full(len(points), tolerance), THICKNESS)


def scene(
    rock: Rock,
    contact: Contact,
    ground: Terrain,
    angle: float,
    start: State,
    gravity: float = GRAVITY,
) -> Scene:
    """Scene on a slope; ``start`` is told in the slope's axes."""
    turn = axes(angle)
    told = (start.position, start.rotation, start.velocity, start.angular_velocity)
    placed = State(*(turn @ part for part in told))
    return Scene(rock, contact, pedestal="terrain", start=placed, terrain=ground, gravity=gravity)


def seen(path: Path, angle: float) -> Path:
    """A path in the slope's axes."""
    turn = axes(angle)
    return Path(
        path.time,
        path.position @ turn,
        turn.T @ path.rotation,
        path.velocity @ turn,
        path.angular_velocity @ turn,
    )
