"""Grounds of known shape, and rocks on them, for tests of runs on a terrain."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from vsr_core.rock.body import Rock
from vsr_core.rock.solid import from_mesh
from vsr_core.run.cases import TerrainCase
from vsr_core.scene import Contact, Scene, State
from vsr_core.terrain.convex_parts import convex_parts
from vsr_core.terrain.surface import Terrain

Array = NDArray[np.float64]
Height = Callable[[Array, Array], Array]


def sheet(height: Height, half: float, cells: int) -> Terrain:
    """Ground of a given height over a square, ``half`` its width [m] to each side."""
    along = np.linspace(-half, half, cells + 1)
    return over(height, along, along)


def over(height: Height, x: Array, y: Array) -> Terrain:
    """Ground of a given height over the lattice of ``x`` and ``y`` [m], ascending."""
    places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    number = np.arange(len(places)).reshape(len(x), len(y))
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    odd = (np.add.outer(np.arange(len(x) - 1), np.arange(len(y) - 1)) % 2).astype(bool)
    one = np.where(odd[..., None], np.stack([a, b, d], -1), np.stack([a, b, c], -1))
    other = np.where(odd[..., None], np.stack([b, c, d], -1), np.stack([a, c, d], -1))
    faces = np.concatenate([one, other]).reshape(-1, 3).astype(np.int64)
    return Terrain(np.column_stack([places, height(*places.T)]), faces)


def level(half: float = 6.0, cells: int = 12) -> Terrain:
    return sheet(lambda x, y: 0.0 * x, half, cells)


def incline(angle: float, half: float = 6.0, cells: int = 12) -> Terrain:
    """Falls by ``angle`` [rad] towards +x."""
    return sheet(lambda x, y: -math.tan(angle) * x, half, cells)


def bumpy(seed: int, height: float, length: float, half: float = 4.0, cells: int = 24) -> Terrain:
    """Waves of a ``height`` [m] and all lengths down to ``length`` [m], in random directions."""
    rng = np.random.default_rng(seed)
    ways, phases = rng.uniform(0.0, 2.0 * np.pi, (2, 8))
    numbers = 2.0 * np.pi / (length * rng.uniform(1.0, 4.0, 8))

    def waves(x: Array, y: Array) -> Array:
        along = np.multiply.outer(np.cos(ways), x) + np.multiply.outer(np.sin(ways), y)
        return height / 8.0 * np.sin(numbers[:, None] * along + phases[:, None]).sum(axis=0)

    return sheet(waves, half, cells)


def extruded(profile: Array, half: float, cells: int = 6) -> Terrain:
    """Ground whose section is the line through ``profile``, x and z [m], along all of y.

    The line may turn back under itself. The ground is on its right, seen along it.
    """
    y = np.linspace(-half, half, cells + 1)
    flat = over(lambda x, y: 0.0 * x, np.arange(len(profile), dtype=float), y)
    x, z = np.asarray(profile)[flat.vertices[:, 0].astype(int)].T
    return Terrain(np.column_stack([x, flat.vertices[:, 1], z]), flat.faces)


def cliff(depth: float, edge: float = 0.6, half: float = 6.0) -> Terrain:
    """Level ground that ends at x = ``edge``, above another level ``depth`` [m] below it."""
    x = np.concatenate([np.linspace(-half, edge, 9), np.linspace(edge + 0.03, half, 9)])
    y = np.linspace(-half, half, 13)
    return over(lambda x, y: -depth * (x > edge + 0.01), x, y)


def perch(bumps: float = 0.05, half: float = 5.0, cells: int = 20) -> Terrain:
    """A small level top from which bumpy slopes go down to both sides."""

    def height(x: Array, y: Array) -> Array:
        away = np.clip((np.hypot(x, y) - 0.45) / 0.3, 0.0, 1.0)
        falls = -0.5 * np.maximum(np.abs(x) - 0.5, 0.0) - 0.1 * np.maximum(np.abs(y) - 0.5, 0.0)
        return falls + bumps * away * np.sin(3.1 * x + 0.4) * np.cos(2.3 * y - 0.2)

    return sheet(height, half, cells)


def niche(half_width: float, wall: float, half: float = 4.0, lines: int = 17) -> Terrain:
    """A level square floor with steep walls of height ``wall`` [m] on three sides, open to +x.

    Beyond its mouth the ground falls away by 30 deg.
    """
    edge = np.array([half_width, half_width + 0.03])
    x = np.unique(np.concatenate([np.linspace(-half, half, lines), -edge, edge]))
    y = np.unique(np.concatenate([np.linspace(-half, half, lines), -edge, edge]))

    def height(x: Array, y: Array) -> Array:
        aside = np.maximum(np.abs(y), -x)
        walls = wall * np.clip((aside - half_width) / 0.03, 0.0, 1.0) * (x <= half_width + 0.01)
        return walls - math.tan(math.radians(30.0)) * np.maximum(x - half_width, 0.0)

    return over(height, x, y)


def lump(seed: int = 0, corners: int = 60) -> Rock:
    """An irregular rock of about 0.5 m x 0.5 m x 0.9 m on a small flat base."""
    rng = np.random.default_rng(seed)
    way = np.sort(rng.uniform(0.0, 2.0 * np.pi, 7))
    way = way + np.linspace(0.0, 2.0 * np.pi, 7, endpoint=False)
    base = np.column_stack([0.14 * np.cos(way), 0.12 * np.sin(way), np.zeros(7)])
    belly = rng.standard_normal((corners, 3))
    belly = belly / np.linalg.norm(belly, axis=1)[:, None] * [0.26, 0.23, 0.42] + [0.02, 0.0, 0.46]
    mesh = trimesh.convex.convex_hull(np.concatenate([base, belly]))
    return from_mesh(mesh, 2110.0).rock


def in_parts(terrain: Terrain, tolerance: float, thickness: float) -> Terrain:
    """The same ground, of convex parts."""
    made = convex_parts(terrain, lambda points: np.full(len(points), tolerance), thickness)
    return Terrain(terrain.vertices, terrain.faces, made)


def moved(terrain: Terrain, matrix: Array, shift: Array | None = None) -> Terrain:
    """Ground turned, scaled or mirrored by ``matrix``, shape (3, 3), and moved by ``shift`` [m]."""
    shift = np.zeros(3) if shift is None else shift
    faces = terrain.faces if np.linalg.det(matrix) > 0.0 else terrain.faces[:, ::-1]
    made = tuple(part @ matrix.T + shift for part in terrain.parts)
    return Terrain(terrain.vertices @ matrix.T + shift, faces, made)


def turn_z(angle: float) -> Array:
    return Rotation.from_euler("z", angle).as_matrix()


def at_rest(height: float, rotation: Array | None = None) -> State:
    """A rock that stands still with its centre ``height`` [m] over the origin."""
    turn = np.eye(3) if rotation is None else rotation
    return State(np.array([0.0, 0.0, height]), turn, np.zeros(3), np.zeros(3))


def site(
    rock: Rock,
    terrain: Terrain,
    toppled_tilt: float = 1.0,
    *,
    yaw: float = 0.0,
    friction: float = 0.6,
    restitution: float = 0.0,
    start: State | None = None,
) -> TerrainCase:
    """A rock on its ground, in the same scene before and after toppling."""
    state = start or at_rest(rock.height)
    contact = Contact(friction, restitution)
    scene = Scene(rock, contact, yaw, "terrain", start=state, terrain=terrain)
    return TerrainCase(scene, scene, toppled_tilt)
