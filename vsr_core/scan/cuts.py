"""A user's cut between rock and ground: a function over the scan, positive on the rock.

The mesh is split where the function is zero, so that a cut's rim lies on the cut itself and not
on the nearest edges.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeAlias

import numpy as np
import shapely
import trimesh

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.errors import InvalidInput
from vsr_core.scan.cleaning import colours_of
from vsr_core.scan.topology import edges, ends

Point: TypeAlias = tuple[float, float, float]

_HALVINGS = 40
"""Of an edge, until its place on a prism's wall is found."""

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
        if not (np.array(self.low) < np.array(self.high)).all():
            raise InvalidInput(
                f"a box from {self.low} to {self.high}", "low is below high", "swap them"
            )
        return np.min([side.inside(mesh) for side in self.sides], axis=0)

    @property
    def sides(self) -> tuple[Plane, ...]:
        """The planes that it lies between."""
        from_low: tuple[Point, ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
        from_high: tuple[Point, ...] = ((-1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0))
        low = [Plane(self.low, normal) for normal in from_low]
        return (*low, *(Plane(self.high, normal) for normal in from_high))

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
    def sides(self) -> tuple[Plane | Polygon, ...]:
        """The walls that it lies between, if it is convex; else the prism itself."""
        polygon = shapely.geometry.polygon.orient(shapely.Polygon(self.corners))
        if not polygon.convex_hull.equals(polygon):
            return (self,)
        ends = pairwise(polygon.exterior.coords)
        return tuple(
            Plane((x, y, 0.0), (y - other_y, other_x - x, 0.0))
            for (x, y), (other_x, other_y) in ends
        )

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
    """Faces split along a cut, by a box or a convex prism along each of its sides.

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
    cut.inside(mesh)  # refuses what is no cut
    sides = cut.sides if isinstance(cut, Box | Polygon) else (cut,)
    whole, reaches = mesh, [side.inside(mesh)[mesh.faces].max(axis=1) > 0.0 for side in sides]
    rock = np.all(reaches, axis=0)
    for side in sides:
        vertices, faces, rock = _split(whole, side, rock)
        whole = trimesh.Trimesh(vertices, faces, process=False)
    return vertices, faces, rock


def _split(mesh: trimesh.Trimesh, cut: Cut, rock: Mask) -> tuple[Array, Indices, Mask]:
    """The same of a cut that is one surface, which splits none but the edges of some faces."""
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int64)
    found, value = edges(faces), np.array(cut.inside(mesh))
    own = np.logical_or.reduceat(rock[found.side // 3], found.first)
    start, end = ends(faces, found.side[found.first]).T
    crossed = own & (value[start] * value[end] < 0.0)
    share = np.zeros(len(start))
    share[crossed] = _shares(mesh, cut, value, start[crossed], end[crossed])
    value[start[crossed & (share < _NEAR_END)]] = 0.0
    value[end[crossed & (share > 1.0 - _NEAR_END)]] = 0.0
    crossed &= value[start] * value[end] < 0.0
    start, end, share = start[crossed], end[crossed], share[crossed]
    number = np.full(len(found.first), -1)
    number[crossed] = len(vertices) + np.arange(len(start))
    between = np.full(3 * len(faces), -1)
    between[found.side] = np.repeat(number, found.count)
    new = (1.0 - share)[:, None] * vertices[start] + share[:, None] * vertices[end]
    faces, origin = _split_faces(faces, between.reshape(-1, 3))
    value = np.append(value, np.zeros(len(start)))
    return np.concatenate([vertices, new]), faces, rock[origin] & (value[faces].sum(axis=1) > 0.0)


def _shares(mesh: trimesh.Trimesh, cut: Cut, value: Array, start: Indices, end: Indices) -> Array:
    """At what share of their length edges are cut.

    The distance to a prism is straight along an edge only where it is that to one wall: there the
    place is halved in on. Colours are straight between vertices.
    """
    share = value[start] / (value[start] - value[end])
    if not isinstance(cut, Polygon):
        return share
    low, high = np.zeros(len(start)), np.ones(len(start))
    for _ in range(_HALVINGS):
        share = 0.5 * (low + high)
        points = (1.0 - share)[:, None] * mesh.vertices[start] + share[:, None] * mesh.vertices[end]
        is_first = cut.inside(trimesh.Trimesh(points, process=False)) * value[start] > 0.0
        low, high = np.where(is_first, share, low), np.where(is_first, high, share)
    return share


def _split_faces(faces: Indices, between: Indices) -> tuple[Indices, Indices]:
    """Parts of faces, and of which each is; ``between`` numbers the new vertex on a side, or -1."""
    cuts = (between >= 0).sum(axis=1)
    origin = [np.flatnonzero(cuts == 0)]
    parts = [faces[origin[0]]]
    for k in range(3):
        turn = [(k + j) % 3 for j in range(3)]
        one = np.flatnonzero((cuts == 1) & (between[:, k] >= 0))
        a, b, c = faces[one][:, turn].T
        m = between[one, k]
        parts += [np.column_stack([a, m, c]), np.column_stack([m, b, c])]
        two = np.flatnonzero((cuts == 2) & (between[:, turn[2]] < 0))
        a, b, c = faces[two][:, turn].T
        m, n = between[two, k], between[two, turn[1]]
        parts += [np.column_stack(part) for part in ((m, b, n), (a, m, n), (a, n, c))]
        origin += [one, one, two, two, two]
    return np.concatenate(parts), np.concatenate(origin)
