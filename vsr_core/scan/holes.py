"""Holes in the scan of a rock alone: how wide they are, and triangles across small ones."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vsr_core.arrays import Array, Indices
from vsr_core.rock.solid import LARGEST_LEVELLING
from vsr_core.rock.triangles import cross_products
from vsr_core.scan.fill import across, area_vector, frame, uncrossed
from vsr_core.scan.topology import border, edges, ends, rims

LARGEST_HOLE = 0.2
"""Width of a hole that is closed, as a share of the rock's longest side: on a sphere the surface
that triangles across it cut off holds 0.03 % of the volume."""

FOOT = 0.05
"""Share of the rock's height, from its lowest point, that the opening on which it stood reaches."""

_DOWN = math.cos(LARGEST_LEVELLING)  # of the angle from straight down of what faces down
_STEEPEST = math.radians(75.0)  # slope beyond which surfaces beside a hole hardly meet
_SLIT = 1e-6  # area of a hole over its width squared, below which its vertices lie on a line


@dataclass(frozen=True, eq=False)
class Hole:
    """A hole in the surface of a rock.

    Attributes
    ----------
    rim : ndarray of int, shape (n,), vertices in order, the surface to their left
    place : ndarray, shape (3,) [m], middle of the rim
    width : float [m], about the largest distance of two of its vertices
    beneath : bool, whether it is what the rock stood on: it faces down, reaches the foot, and is
        larger than what was seen of the base
    """

    rim: Indices
    place: Array
    width: float
    beneath: bool


def holes_of(vertices: Array, faces: Indices) -> tuple[Hole, ...]:
    """Holes of a surface that is closed elsewhere.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3) [m], z up
    faces : ndarray of int, shape (m, 3), outward

    Returns
    -------
    tuple of Hole, that with most edges first
    """
    low, high = vertices[:, 2].min(), vertices[:, 2].max()
    foot = low + FOOT * (high - low)
    sole = _sole(vertices, faces, foot)
    found = []
    for rim in rims(faces):
        points = vertices[rim]
        inward = area_vector(points)
        area = float(np.linalg.norm(inward))
        down = inward[2] >= _DOWN * area and area > sole
        beneath = bool(down and points[:, 2].min() <= foot)
        found.append(Hole(rim, points.mean(axis=0), _width(points), beneath))
    return tuple(found)


def _sole(vertices: Array, faces: Indices, foot: float) -> float:
    """Area of what was seen of a rock's base [m^2]: faces at its foot that look down."""
    low = faces[(vertices[faces, 2] <= foot).all(axis=1)]
    normal = cross_products(vertices, low)
    area = np.linalg.norm(normal, axis=1)
    return 0.5 * float(area[normal[:, 2] < -_DOWN * area].sum())


def _width(points: Array) -> float:
    """Largest distance of two of a loop's points, by going from one to the farthest in turn [m]."""
    at, width = points[0], 0.0
    for _ in range(4):
        away = np.linalg.norm(points - at, axis=1)
        at, width = points[int(np.argmax(away))], max(width, float(away.max()))
    return width


def without_slits(vertices: Array, faces: Indices) -> Indices:
    """Faces on one vertex where two of a rim without area lie at the same point.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3) [m]
    faces : ndarray of int, shape (m, 3)

    Returns
    -------
    ndarray of int, shape (m, 3)
    """
    name = np.arange(len(vertices))
    for rim in rims(faces):
        points = vertices[rim]
        if np.linalg.norm(area_vector(points)) <= _SLIT * _width(points) ** 2:
            _, first, same = np.unique(points, axis=0, return_index=True, return_inverse=True)
            name[rim] = rim[first[same.ravel()]]
    return name[faces]


def without_chords(vertices: Array, faces: Indices) -> tuple[Array, Indices]:
    """The same surface with a vertex in the middle of each edge between two vertices of rims.

    Such an edge would be an edge of a surface across the hole as well.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3) [m]
    faces : ndarray of int, shape (m, 3)

    Returns
    -------
    vertices : ndarray, shape (k, 3) [m], the given ones first
    faces : ndarray of int, shape (l, 3)

    Examples
    --------
    >>> square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    >>> points, faces = without_chords(square, np.array([[0, 1, 2], [0, 2, 3]]))
    >>> points[4:].tolist(), len(faces)
    ([[0.5, 0.5, 0.0]], 4)
    """
    while True:
        pairs = edges(faces).pairs
        open_ = np.unique(border(faces))
        pairs = pairs[np.isin(ends(faces, pairs[:, 0]), open_).all(axis=1)]
        if not len(pairs):
            return vertices, faces
        seen: set[int] = set()
        chosen = []  # no two of one face, which would be split in two ways
        for pair in pairs.tolist():
            both = {side // 3 for side in pair}
            if not both & seen:
                seen |= both
                chosen.append(pair)
        side = np.array(chosen)
        middle = len(vertices) + np.arange(len(side))
        start, end = ends(faces, side[:, 0]).T
        vertices = np.concatenate([vertices, 0.5 * (vertices[start] + vertices[end])])
        halves = []
        for column in side.T:
            face, corner = np.divmod(column, 3)
            one, other = ends(faces, column).T
            apex = faces[face, (corner + 2) % 3]
            halves += [np.column_stack([one, middle, apex]), np.column_stack([middle, other, apex])]
        keep = np.ones(len(faces), dtype=bool)
        keep[side.ravel() // 3] = False
        faces = np.concatenate([faces[keep], *halves])


def triangles_across(vertices: Array, rim: Indices) -> Indices:
    """Faces that fill a hole between the vertices of its rim, which stay where they are.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3) [m]
    rim : ndarray of int, shape (k,), see ``Hole``

    Returns
    -------
    ndarray of int, shape (k - 2, 3), outward

    Raises
    ------
    InvalidInput
        If the rim crosses itself, seen along its normal, however it is smoothed.

    Examples
    --------
    >>> triangles_across(np.eye(3), np.array([0, 1, 2])).tolist()
    [[0, 2, 1]]
    """
    points = vertices[rim]
    inward = area_vector(points)
    if np.linalg.norm(inward) <= _SLIT * _width(points) ** 2:
        fan = [np.full(len(rim) - 2, rim[0]), rim[2:], rim[1:-1]]
        return np.column_stack(fan)
    level = uncrossed(frame(points, inward).into(points))
    return rim[across(level[:, :2], np.inf)[1]][:, ::-1]


@dataclass(frozen=True)
class Bulge:
    """What surfaces that go straight on from the rim of a hole would add to flat triangles.

    Attributes
    ----------
    volume : float [m^3], negative where it would take away
    top : ndarray, shape (3,) [m], its highest point
    """

    volume: float
    top: Array


def bulge(vertices: Array, faces: Indices, hole: Hole) -> Bulge:
    """The cone over a hole's area that leaves its rim at the slope of the faces beside.

    A round surface stays within it: the cap of a sphere that leaves the rim at a small slope has
    three quarters of its volume.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3) [m]
    faces : ndarray of int, shape (m, 3), outward, with the hole open
    """
    points = vertices[hole.rim]
    inward = area_vector(points)
    area = float(np.linalg.norm(inward))
    outward = -inward / max(area, np.finfo(float).tiny)
    radius = math.sqrt(area / math.pi)
    slope = np.clip(_slope(vertices, faces, hole.rim, outward), -_STEEPEST, _STEEPEST)
    height = radius * math.tan(slope)
    return Bulge(area * height / 3.0, hole.place + height * outward)


def _slope(vertices: Array, faces: Indices, rim: Indices, outward: Array) -> float:
    """Mean angle, over the length of a rim, by which the surface beside it falls away [rad]."""
    beside = faces[edges(faces).open // 3]
    links = border(faces)
    own = np.isin(links[:, 0], rim)
    beside, links = beside[own], links[own]
    normal = cross_products(vertices, beside)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    along = vertices[links[:, 1]] - vertices[links[:, 0]]
    length = np.linalg.norm(along, axis=1)
    into = np.cross(normal, along / length[:, None])  # within the face, away from the hole
    fall = np.arcsin(np.clip(-into @ outward, -1.0, 1.0))
    return float(fall @ length / length.sum())
