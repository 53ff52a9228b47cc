"""A surface across a rim: triangles between its vertices, and even ones inside it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from scipy.spatial import cKDTree

from vsr_core.arrays import Array, Indices
from vsr_core.errors import InvalidInput
from vsr_core.scan.topology import border, rims, touching

_UNCROSSING = 20  # rounds of smoothing a rim along itself
_STRIP = 0.6  # width of the strip along the rim, of the spacing, that holds no inner vertex


@dataclass(frozen=True)
class Frame:
    """Coordinates u, v in a plane and h along ``up``, all in metres.

    Attributes
    ----------
    origin : ndarray, shape (3,) [m]
    axes : ndarray, shape (3, 3), rows: the unit vectors of u, v and h, right-handed
    """

    origin: Array
    axes: Array

    def into(self, points: Array) -> Array:
        """Points in these coordinates.

        Parameters
        ----------
        points : ndarray, shape (n, 3) [m]

        Returns
        -------
        ndarray, shape (n, 3) [m]
        """
        return (points - self.origin) @ self.axes.T

    def back(self, points: Array) -> Array:
        """The reverse of ``into``.

        Parameters
        ----------
        points : ndarray, shape (n, 3) [m], u, v and h

        Returns
        -------
        ndarray, shape (n, 3) [m]
        """
        return self.origin + points @ self.axes


def frame(points: Array, up: Array) -> Frame:
    """Frame about the middle of points.

    Parameters
    ----------
    points : ndarray, shape (n, 3) [m]
    up : ndarray, shape (3,), direction of h, of any length

    Examples
    --------
    >>> frame(np.eye(3), np.array([0.0, 0.0, 2.0])).axes[2].tolist()
    [0.0, 0.0, 1.0]
    """
    h = up / np.linalg.norm(up)
    u = np.cross(np.eye(3)[int(np.argmin(np.abs(h)))], h)
    u /= np.linalg.norm(u)
    return Frame(points.mean(axis=0), np.array([u, np.cross(h, u), h]))


def area_vector(loop: Array) -> Array:
    """Area vector of a closed loop of points: its normal where it runs counter-clockwise.

    Parameters
    ----------
    loop : ndarray, shape (n, 3) [m]

    Returns
    -------
    ndarray, shape (3,) [m^2]

    Examples
    --------
    >>> area_vector(np.array([[0.0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]])).tolist()
    [0.0, 0.0, 2.0]
    """
    middle = loop - loop.mean(axis=0)
    return 0.5 * np.cross(middle, np.roll(middle, -1, axis=0)).sum(axis=0)


def uncrossed(rim: Array) -> Array:
    """A rim smoothed along itself until, seen along h, it does not cross itself.

    Parameters
    ----------
    rim : ndarray, shape (n, 3) [m], u, v and h of its points

    Returns
    -------
    ndarray, shape (n, 3) [m]
        As it was, where it does not; crossing still, where that does not help.
    """
    placed = rim.copy()
    for _ in range(_UNCROSSING):
        if shapely.Polygon(placed[:, :2]).is_valid:
            break
        beside = 0.5 * (np.roll(placed, 1, axis=0) + np.roll(placed, -1, axis=0))
        placed = 0.5 * (placed + beside)
    return placed


def across(rim: Array, spacing: float) -> tuple[Array, Indices]:
    """Triangles that fill a simple polygon, every side of it the side of one triangle.

    Parameters
    ----------
    rim : ndarray, shape (n, 2) [m], counter-clockwise
    spacing : float [m], of the vertices inside; none if infinite

    Returns
    -------
    inner : ndarray, shape (k, 2) [m], vertices inside
    faces : ndarray of int, shape (m, 3), counter-clockwise; n, n + 1, ... are the inner ones

    Raises
    ------
    InvalidInput
        If the polygon crosses itself.

    Examples
    --------
    >>> inner, faces = across(np.array([[0.0, 0], [2, 0], [2, 1], [0, 1]]), np.inf)
    >>> len(inner), len(faces)
    (0, 2)
    """
    if not (polygon := shapely.Polygon(rim)).is_valid:
        raise InvalidInput(
            f"a rim of {len(rim)} edges that crosses itself, seen along its normal",
            "a rim is filled across the plane it lies in",
            "smooth or crop the scan there, or cut along a plane",
        )
    inner, even = _lattice(polygon, spacing)
    holes = [inner[loop] for loop in rims(even)]
    strip = shapely.constrained_delaunay_triangles(shapely.Polygon(rim, holes))
    corners = shapely.get_coordinates(strip).reshape(-1, 4, 2)[:, :3]
    faces = np.asarray(cKDTree(np.concatenate([rim, inner])).query(corners)[1], dtype=np.int64)
    side = corners[:, 1:] - corners[:, :1]
    clockwise = side[:, 0, 0] * side[:, 1, 1] < side[:, 0, 1] * side[:, 1, 0]
    faces[clockwise] = faces[clockwise, ::-1]
    faces = np.concatenate([faces, even + len(rim)])
    _require_border(faces, len(rim))
    return inner, faces


def _lattice(polygon: shapely.Polygon, spacing: float) -> tuple[Array, Indices]:
    """Vertices and faces of the equilateral triangles well inside a polygon."""
    none = np.empty((0, 2)), np.empty((0, 3), dtype=np.int64)
    if not np.isfinite(spacing):
        return none
    room = shapely.buffer(polygon, -_STRIP * spacing)
    if room.is_empty:
        return none
    low, high = np.array(room.bounds).reshape(2, 2)
    height = spacing * np.sqrt(0.75)
    wide, tall = np.ceil((high - low) / (spacing, height)).astype(int) + 3
    row, column = np.divmod(np.arange(wide * tall), wide)
    x = low[0] + (column - 1.0 + 0.5 * (row % 2)) * spacing
    points = np.column_stack([x, low[1] + (row - 1.0) * height])
    here = np.flatnonzero((column < wide - 1) & (row < tall - 1))
    odd = row[here] % 2
    up = np.column_stack([here, here + 1, here + wide + odd])
    down = np.column_stack([here + 1 - odd, here + wide + 1, here + wide])
    faces = np.concatenate([up, down])
    kept = shapely.contains(room, shapely.points(points))
    faces = _without_pinches(faces[kept[faces].all(axis=1)])
    used, local = np.unique(faces, return_inverse=True)
    return points[used], local


def _without_pinches(faces: Indices) -> Indices:
    """Faces less those at a vertex where their rim meets itself."""
    while len(faces):
        start = np.sort(border(faces)[:, 0])
        pinched = start[1:][start[1:] == start[:-1]]
        if len(pinched) == 0:
            break
        faces = faces[~touching(faces, pinched)]
    return faces


def _require_border(faces: Indices, rim: int) -> None:
    """Check that the border of the faces is the rim, vertices 0, 1, ... in order."""
    links = border(faces)
    along = np.column_stack([np.arange(rim), (np.arange(rim) + 1) % rim])
    if not np.array_equal(links[np.argsort(links[:, 0])], along):
        raise InvalidInput(
            f"a rim of {rim} edges that cannot be filled",
            "its points are distinct",
            "clean the scan first",
        )
