"""A user's cut between rock and ground: a function over the scan, positive on the rock.

The mesh is split where the function is zero, so that a cut's rim lies on the cut itself and not
on the nearest edges.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple, TypeAlias

import numpy as np
import shapely
import trimesh

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.errors import InvalidInput
from vsr_core.scan.cleaning import colours_of
from vsr_core.scan.topology import edges, ends

Point: TypeAlias = tuple[float, float, float]

_ROUNDING = 1e-12
"""Of the largest coordinate, by which what lies in a wall may seem to be beside it."""

_NEAR_END = 0.05  # a cut within this share of an edge's end passes through the vertex


@dataclass(frozen=True)
class Plane:
    """The rock is on the side of a plane to which ``normal`` points; ``point`` lies on it [m]."""

    point: Point
    normal: Point

    def inside(self, mesh: trimesh.Trimesh) -> Array:
        """Height of each vertex over the plane.

        Returns
        -------
        ndarray, shape (n,) [m]
        """
        normal = np.array(self.normal, dtype=np.float64)
        if not np.linalg.norm(normal) > 0.0:
            raise InvalidInput(
                "a plane without a normal", "it points to the rock", "give its direction"
            )
        return (mesh.vertices - np.array(self.point)) @ (normal / np.linalg.norm(normal))

    def moved(self, by: Array) -> Plane:
        """The same plane elsewhere.

        Parameters
        ----------
        by : ndarray, shape (3,) [m]
        """
        return replace(self, point=tuple(np.array(self.point) + by))


class Wall(NamedTuple):
    """A flat part of a cut: the plane that it lies in, and how far it reaches [m]."""

    plane: Plane
    low: Point
    high: Point

    def near(self, vertices: Array, faces: Indices) -> Mask:
        """Faces that it may cross: those that do not lie beyond it along an axis altogether."""
        beyond = np.hstack([vertices < self.low, vertices > self.high])
        sides = np.packbits(beyond, axis=1)[:, 0]  # one bit of each
        first, second, third = sides[faces].T
        return np.asarray(first & second & third == 0)


@dataclass(frozen=True)
class Box:
    """The rock is within a box along the axes, from ``low`` to ``high`` [m]."""

    low: Point
    high: Point

    def inside(self, mesh: trimesh.Trimesh) -> Array:
        """Distance of each vertex to the box, positive inside.

        Returns
        -------
        ndarray, shape (n,) [m]
        """
        low, high = np.array(self.low), np.array(self.high)
        if not (low < high).all():
            raise InvalidInput(
                f"a box from {self.low} to {self.high}", "low is below high", "swap them"
            )
        return np.minimum(mesh.vertices - low, high - mesh.vertices).min(axis=1)

    @property
    def walls(self) -> Iterator[Wall]:
        """Its six sides."""
        for normal in np.eye(3):
            for end in (self.low, self.high):
                low, high = (np.where(normal, end, other) for other in (self.low, self.high))
                yield Wall(Plane(end, tuple(normal)), tuple(low), tuple(high))

    def moved(self, by: Array) -> Box:
        """The same box elsewhere.

        Parameters
        ----------
        by : ndarray, shape (3,) [m]
        """
        low, high = tuple(np.array(self.low) + by), tuple(np.array(self.high) + by)
        return replace(self, low=low, high=high)


@dataclass(frozen=True)
class Polygon:
    """The rock is within a vertical prism over a polygon of x, y corners [m]."""

    corners: tuple[tuple[float, float], ...]

    def inside(self, mesh: trimesh.Trimesh) -> Array:
        """Distance of each vertex to the prism's walls, positive inside.

        Returns
        -------
        ndarray, shape (n,) [m]
        """
        polygon = shapely.Polygon(self.corners) if len(self.corners) > 2 else shapely.Polygon()
        if polygon.is_empty or not polygon.is_valid:
            raise InvalidInput(
                f"a polygon of {len(self.corners)} corners that encloses nothing or crosses itself",
                "its corners run once around the rock",
                "give them in order",
            )
        points = shapely.points(mesh.vertices[:, :2])
        away: Array = shapely.distance(polygon.exterior, points)
        return np.where(shapely.contains(polygon, points), away, -away)

    @property
    def walls(self) -> Iterator[Wall]:
        """One over each of its edges."""
        for (x, y), (other_x, other_y) in pairwise(shapely.Polygon(self.corners).exterior.coords):
            if (x, y) == (other_x, other_y):
                continue
            plane = Plane((x, y, 0.0), (y - other_y, other_x - x, 0.0))
            low, high = (min(x, other_x), min(y, other_y)), (max(x, other_x), max(y, other_y))
            yield Wall(plane, (*low, -math.inf), (*high, math.inf))

    def moved(self, by: Array) -> Polygon:
        """The same polygon elsewhere.

        Parameters
        ----------
        by : ndarray, shape (3,) [m]
        """
        return Polygon(tuple((x + by[0], y + by[1]) for x, y in self.corners))


@dataclass(frozen=True)
class Colour:
    """The rock is painted in a colour (red, green, blue, 0 to 255), within a tolerance."""

    rgb: tuple[int, int, int]
    tolerance: float

    def inside(self, mesh: trimesh.Trimesh) -> Array:
        """Tolerance less each vertex's distance from the colour.

        Returns
        -------
        ndarray, shape (n,)
        """
        colours = colours_of(mesh)
        if colours is None:
            raise InvalidInput(
                "a scan without colours of vertices",
                "a cut by colour needs them",
                "bake the texture into vertex colours, as .ply, .obj or .glb, or give another cut",
            )
        given = colours[:, :3].astype(np.float64)
        return self.tolerance - np.linalg.norm(given - np.array(self.rgb), axis=1)

    def moved(self, by: Array) -> Colour:
        """The same: a colour has no place.

        Parameters
        ----------
        by : ndarray, shape (3,) [m]
        """
        return self


Cut: TypeAlias = Plane | Box | Polygon | Colour


def split(mesh: trimesh.Trimesh, cut: Cut) -> tuple[Array, Indices, Mask]:
    """Faces split along a cut, by a box or a prism along each of its walls.

    A vertex within a twentieth of an edge of the cut counts as on it.

    Parameters
    ----------
    cut : Cut, in the mesh's coordinates

    Returns
    -------
    vertices : ndarray, shape (n, 3) [m], the mesh's own first
    faces : ndarray of int, shape (m, 3)
    rock : ndarray of bool, shape (m,), on the rock's side
    """
    value = cut.inside(mesh)  # refuses what is no cut
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int64)
    if isinstance(cut, Plane | Colour):
        vertices, faces, value = _split(vertices, faces, value, np.ones(len(faces), dtype=bool))
        return vertices, faces, value[faces].sum(axis=1) > 0.0
    least, on = _ROUNDING * np.abs(vertices).max(), np.zeros(len(vertices), dtype=bool)
    for wall in cut.walls:
        value = wall.plane.inside(trimesh.Trimesh(vertices, process=False))
        vertices, faces, value = _split(vertices, faces, value, wall.near(vertices, faces))
        on = np.append(on, np.zeros(len(vertices) - len(on), dtype=bool)) | (np.abs(value) <= least)
    counts = np.asarray(~on[faces] | on[faces].all(axis=1, keepdims=True))
    middle = (counts[..., None] * vertices[faces]).sum(axis=1) / counts.sum(axis=1, keepdims=True)
    return vertices, faces, cut.inside(trimesh.Trimesh(middle, process=False)) > least


def _split(
    vertices: Array, faces: Indices, value: Array, near: Mask
) -> tuple[Array, Indices, Array]:
    """Vertices, faces, and value of each vertex, with edges of the near faces split where it is 0.

    It is 0 of a vertex that counts as on the cut. Other faces are split where they share such an
    edge, so that none is left with a gap.
    """
    met = np.zeros(len(vertices), dtype=bool)
    met[faces[near]] = True
    beside = met[faces].sum(axis=1) > 1
    own, rest = faces[beside], faces[~beside]
    found, value = edges(own), np.array(value)
    start, end = ends(own, found.side[found.first]).T
    crossed = np.logical_or.reduceat(near[beside][found.side // 3], found.first)
    crossed &= value[start] * value[end] < 0.0
    share = np.zeros(len(start))
    np.divide(value[start], value[start] - value[end], out=share, where=crossed)
    value[start[crossed & (share < _NEAR_END)]] = 0.0
    value[end[crossed & (share > 1.0 - _NEAR_END)]] = 0.0
    crossed &= value[start] * value[end] < 0.0
    start, end, share = start[crossed], end[crossed], share[crossed]
    number = np.full(len(found.first), -1)
    number[crossed] = len(vertices) + np.arange(len(start))
    between = np.full(3 * len(own), -1)
    between[found.side] = np.repeat(number, found.count)
    new = (1.0 - share)[:, None] * vertices[start] + share[:, None] * vertices[end]
    parts = [rest, *_split_faces(own, between.reshape(-1, 3))]
    value = np.append(value, np.zeros(len(start)))
    return np.concatenate([vertices, new]), np.concatenate(parts), value


def _split_faces(faces: Indices, between: Indices) -> Iterator[Indices]:
    """Parts of faces; ``between`` numbers the new vertex on a side, or -1."""
    cuts = (between >= 0).sum(axis=1)
    yield faces[cuts == 0]
    for k in range(3):
        turn = [(k + j) % 3 for j in range(3)]
        one = np.flatnonzero((cuts == 1) & (between[:, k] >= 0))
        a, b, c = faces[one][:, turn].T
        m = between[one, k]
        yield from (np.column_stack(part) for part in ((a, m, c), (m, b, c)))
        two = np.flatnonzero((cuts == 2) & (between[:, turn[2]] < 0))
        a, b, c = faces[two][:, turn].T
        m, n = between[two, k], between[two, turn[1]]
        yield from (np.column_stack(part) for part in ((m, b, n), (a, m, n), (a, n, c)))
