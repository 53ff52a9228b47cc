"""Raw scans with a known truth: a lumpy rock on rough ground, seen as one noisy sheet.

Rock and ground are the insides of functions of place. What a survey would bring is the surface of
both together, meshed evenly, so that a seam is rounded and a crevice that is narrower than the
edges is bridged; what is true of the rock is known from its function alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.surrogates.ground import rough

Inside = Callable[[Array, Array, Array], Array]
"""Of places x, y, z [m] that broadcast: about the distance to a surface [m], negative inside."""

_GROUND = 2.2  # m, from the middle of the ground to its border
_LUMPS = 14  # waves over the rock
_CLEAR = 0.1  # of an edge


@dataclass(frozen=True)
class FieldScan:
    """A rock in rough ground, and how it is scanned; lengths in metres.

    Attributes
    ----------
    seed : int, of the rock's lumps, the ground and the noise
    half_axes : tuple of three floats, of the ellipsoid that the rock is before it is cut off below
    noise : float, root mean square of the error along the normals
    roughness : float, root mean square of the ground's longest waves
    sunk : float, depth of the rock's base in the mean ground
    slope : float [degree], toward +x
    walls : int, of a niche: 0 to 3 blocks that touch the rock's side
    waist : float, by which the rock is drawn in at half its height
    pebbles : bool, whether the rock stands on three pebbles
    holes : int, patches that the scan missed
    edge : float, of the grid that the surface is sampled with
    """

    seed: int
    half_axes: tuple[float, float, float] = (0.45, 0.35, 0.8)
    noise: float = 0.002
    roughness: float = 0.01
    sunk: float = 0.006
    slope: float = 0.0
    walls: int = 0
    waist: float = 0.0
    pebbles: bool = False
    holes: int = 0
    edge: float = 0.045


@dataclass(frozen=True, eq=False)
class Scanned:
    """A scan and the rock that is in it.

    Attributes
    ----------
    vertices : ndarray, shape (n, 3) [m]
    faces : ndarray of int, shape (m, 3), counter-clockwise seen from outside
    rock_vertices, rock_faces : the whole rock without noise, four times as fine
    on_rock : ndarray, shape (3,) [m], a point inside the rock
    """

    vertices: Array
    faces: Indices
    rock_vertices: Array
    rock_faces: Indices
    on_rock: Array


def scan(field: FieldScan) -> Scanned:
    """Make the rock and its ground, and scan them.

    Examples
    --------
    >>> len(scan(FieldScan(1, edge=0.1)).vertices) > 1000
    True
    """
    random = np.random.default_rng(field.seed)
    rock, ground = _rock(field, random), _ground(field)
    top = 1.35 * field.half_axes[2]
    low = np.array([-_GROUND, -_GROUND, -_GROUND * math.tan(math.radians(field.slope)) - 0.3])
    high = np.array([_GROUND, _GROUND, max(2.0 * top, -low[2])])
    both = lambda x, y, z: np.minimum(rock(x, y, z), ground(x, y, z))  # noqa: E731
    vertices, faces = surface(both, low, high, field.edge)
    vertices, faces = _noisy(vertices, faces, field, random)
    own = surface(rock, *_around(field), 0.5 * field.edge)
    return Scanned(vertices, faces, *own, np.array([0.0, 0.0, 0.9 * field.half_axes[2]]))


def above_ground(field: FieldScan) -> tuple[Array, Indices]:
    """The rock without what of it is in the ground, which no scan shows.

    Returns
    -------
    vertices : ndarray, shape (n, 3) [m]
    faces : ndarray of int, shape (m, 3)
    """
    rock, ground = _rock(field, np.random.default_rng(field.seed)), _ground(field)
    seen = lambda x, y, z: np.maximum(rock(x, y, z), -ground(x, y, z))  # noqa: E731
    return surface(seen, *_around(field), 0.5 * field.edge)


def _around(field: FieldScan) -> tuple[Array, Array]:
    """Corners of a box around the rock [m]."""
    reach = 1.5 * max(field.half_axes)
    return np.array([-reach, -reach, -0.2]), np.array([reach, reach, 2.2 * field.half_axes[2]])


def _rock(field: FieldScan, random: np.random.Generator) -> Inside:
    """An ellipsoid with lumps, cut off below where it stands in the ground."""
    a, b, c = field.half_axes
    direction = random.standard_normal((_LUMPS, 3))
    number = random.uniform(2.0, 6.0, _LUMPS)
    direction *= (number / np.linalg.norm(direction, axis=1))[:, None]
    phase, height = random.uniform(0.0, 2.0 * math.pi, _LUMPS), 0.35 / number / math.sqrt(_LUMPS)
    bumps = random.uniform(0.0, 2.0 * math.pi, 3)
    fall = math.tan(math.radians(field.slope))

    def inside(x: Array, y: Array, z: Array) -> Array:
        u, v, w = x / a, y / b, (z - 0.75 * c) / c
        size = np.sqrt(u * u + v * v + w * w)
        reach = np.maximum(size, 1e-9)
        body = size - 1.0 + field.waist / a * np.exp(-(((z - 0.6 * c) / (0.25 * c)) ** 2))
        for way, start, high in zip(direction, phase, height, strict=True):
            body = body - high * np.cos((u * way[0] + v * way[1] + w * way[2]) / reach + start)
        base = np.cos(4.0 * u + bumps[0]) + np.cos(5.0 * v + bumps[1]) + np.cos(u - v + bumps[2])
        return np.maximum(body * min(a, b), 0.0035 * base - field.sunk - fall * x - z)

    return inside


def _ground(field: FieldScan) -> Inside:
    """Rough ground, with the walls of a niche or pebbles where the rock has them."""
    a, b, c = field.half_axes
    fall = math.tan(math.radians(field.slope))

    def inside(x: Array, y: Array, z: Array) -> Array:
        place = np.stack(np.broadcast_arrays(x, y), axis=-1)
        height = field.roughness * rough(place, 0.9, 4, field.seed) - fall * x
        if field.pebbles:
            height = height - 0.05 * np.exp(-((np.hypot(x, y) / (1.3 * a)) ** 4))
        away = (z - height) * math.cos(math.radians(field.slope))
        for k in range(field.walls):
            turn = 2.0 * math.pi * (k / 3.0 + 0.11 * field.seed)
            i, j = math.cos(turn), math.sin(turn)
            out = x * i + y * j - 1.02 * math.hypot(a * i, b * j)
            beside, above = np.abs(y * i - x * j) - 0.3, z + fall * x - 0.45 * c
            wall = np.maximum(np.maximum(-out, out - 0.5), np.maximum(beside, above))
            away = np.minimum(away, wall)
        for k in range(3 if field.pebbles else 0):
            turn = 2.0 * math.pi * (k / 3.0 + 0.07 * field.seed)
            i, j = 0.55 * a * math.cos(turn), 0.55 * b * math.sin(turn)
            up = z + fall * i + 0.05 + field.sunk
            away = np.minimum(away, np.sqrt((x - i) ** 2 + (y - j) ** 2 + up * up) - 0.05)
        return away

    return inside


def _noisy(
    vertices: Array, faces: Indices, field: FieldScan, random: np.random.Generator
) -> tuple[Array, Indices]:
    """The sheet with noise along its normals and without what the survey missed."""
    corners = vertices[faces]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal = np.zeros_like(vertices)
    for corner in faces.T:
        np.add.at(normal, corner, area)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    noisy = vertices + field.noise * random.standard_normal(len(vertices))[:, None] * normal
    middles = vertices[faces].mean(axis=1)
    kept = np.ones(len(faces), dtype=bool)
    for _ in range(field.holes):
        spot = middles[random.integers(len(middles))]
        kept &= np.linalg.norm(middles - spot, axis=1) > 2.0 * field.edge
    used, named = np.unique(faces[kept], return_inverse=True)
    return noisy[used], named.reshape(-1, 3)


def surface(
    inside: Inside, low: Array | list[float], high: Array | list[float], edge: float
) -> tuple[Array, Indices]:
    """Surface of what is inside a function, by the tetrahedra of a grid.

    Parameters
    ----------
    low, high : three floats [m], corners of the grid; a surface that leaves it is open there
    edge : float [m], of a cell; values nearer to 0 than ``_CLEAR`` of it are moved away from 0, so
        that no triangle is a sliver

    Returns
    -------
    vertices : ndarray, shape (n, 3) [m]
    faces : ndarray of int, shape (m, 3), counter-clockwise seen from outside; each side has at
        most two

    References
    ----------
    Doi & Koide (1991), IEICE Transactions E74(1), 214-224.
    """
    axes = [np.arange(a, b + edge, edge) for a, b in zip(low, high, strict=True)]
    value = np.stack([inside(np.array([[x]]), axes[1][:, None], axes[2][None]) for x in axes[0]])
    value = np.where(
        value < 0.0, np.minimum(value, -_CLEAR * edge), np.maximum(value, _CLEAR * edge)
    )
    signs = value < 0.0
    cubes = np.argwhere(_mixed(signs))
    corners = []
    for order in permutations(range(3)):
        path = np.vstack([np.zeros(3, int), np.cumsum(np.eye(3, dtype=int)[list(order)], axis=0)])
        grid = cubes[:, None] + path
        name = np.ravel_multi_index(tuple(np.moveaxis(grid, -1, 0)), value.shape)
        for which, links in _across(signs.ravel()[name]):
            corners.append(name[which][:, links])
    pairs = np.concatenate([part.reshape(-1, 3, 2) for part in corners])
    key, faces = np.unique(np.sort(pairs, axis=2).reshape(-1, 2), axis=0, return_inverse=True)
    one, other = value.ravel()[key[:, 0]], value.ravel()[key[:, 1]]
    share = (one / (one - other))[:, None]
    at = [np.stack(np.unravel_index(k, value.shape), axis=1) for k in key.T]
    vertices = np.asarray(low) + edge * ((1.0 - share) * at[0] + share * at[1])
    faces = faces.reshape(-1, 3)
    # Outward: from the end of a side that is inside to that which is not.
    first = np.where((one < 0.0)[:, None], at[1] - at[0], at[0] - at[1])
    corner = vertices[faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    inward = np.einsum("ij,ij->i", normal, first[faces].sum(axis=1)) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    return vertices, faces


def _mixed(signs: Mask) -> Mask:
    """Cells of a grid whose corners are not all on one side."""
    corners = [
        signs[tuple(slice(k, n - 1 + k) for k, n in zip(at, signs.shape, strict=True))]
        for at in product((0, 1), repeat=3)
    ]
    return np.any(corners, axis=0) & ~np.all(corners, axis=0)


def _across(signs: Mask) -> Iterator[tuple[Indices, Indices]]:
    """Triangles across tetrahedra with corners on either side, shape (n, 4).

    Each as the tetrahedra that have it, and its three corners as pairs of theirs, shape (3, 2).
    """
    for pattern in product((False, True), repeat=4):
        own = [k for k in range(4) if pattern[k]]
        rest = [k for k in range(4) if not pattern[k]]
        which = np.flatnonzero((signs == pattern).all(axis=1))
        if not own or not rest or not len(which):
            continue
        if len(own) == 2:
            (a, b), (c, d) = own, rest
            yield which, np.array([[a, c], [a, d], [b, d]])
            yield which, np.array([[a, c], [b, d], [b, c]])
        else:
            lone, others = (own[0], rest) if len(own) == 1 else (rest[0], own)
            yield which, np.array([[lone, k] for k in others])
