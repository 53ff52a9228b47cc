"""What of a terrain can touch: corners, edges and faces, computed once.

An edge or a vertex of the terrain touches only where it stands out: on even ground and in hollows
corners of the rock touch faces, and nothing else does. Triangles in one plane are one face, so that
it does not matter how even ground is cut into triangles.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.compiled.records import Vector, layout
from vsr_core.compiled.vectors import sharpest
from vsr_core.rock.triangles import areas, cross_products
from vsr_core.terrain.surface import Terrain

FLAT = 1e-6
"""Sine of the angle between faces below which they are in one plane."""


class Face:
    """A triangle of the terrain, or a flat face of a rock."""

    normal: Vector  # outward unit vector
    offset: float  # m, its product with any point of the face
    first: int  # of the sides of a triangle, and
    count: int  # their number
    flat: int  # number of the plane face that it is part of


class Side:
    """Side of a triangle.

    What is in front of the face, or a little behind it, and nearer to it than to others, is on the
    inward side of all.
    """

    inward: Vector  # unit vector; at a convex edge normal to the bisector of the faces
    limit: float  # m, its product with points of the edge
    hollow: float  # 1 at a concave edge, beyond which a face goes on inside the ground


class Edge:
    """A convex edge."""

    start: Vector  # m
    along: Vector  # unit vector
    length: float  # m
    left: Vector  # unit vectors normal to the edge, in its two faces
    right: Vector
    face: int  # one of its two faces
    line: int  # number of the straight edge that it is part of


class Vertex:
    """A convex vertex of the terrain."""

    place: Vector  # m
    face: int  # one of those that meet there
    first: int  # of the edges that meet there, and
    count: int  # their number


Columns: TypeAlias = NDArray[np.void]
"""Array of records of one of these kinds."""


class Features(NamedTuple):
    """Faces, sides, convex edges and vertices of a surface.

    Attributes
    ----------
    faces, sides, edges, vertices : arrays of ``Face``, ``Side``, ``Edge``, ``Vertex``
    arms : ndarray, shape (n, 3), unit vectors from vertices along the edges that meet there
    triangles : ndarray, shape (m, 3, 3) [m], corners of those faces that are triangles
    """

    faces: Columns
    sides: Columns
    edges: Columns
    vertices: Columns
    arms: Array
    triangles: Array


def of_terrain(terrain: Terrain) -> Features:
    """Triangles, convex edges and convex vertices of a terrain."""
    corners, triangles = terrain.vertices, terrain.faces
    size = areas(corners, triangles)
    triangles = triangles[size > 1e-9 * np.median(size)]
    normals = unit(cross_products(corners, triangles))
    begin, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    start, along, length = lines(corners[begin], corners[end])
    own = np.repeat(np.arange(len(triangles)), 3)
    within = np.cross(normals[own], along)
    twin = _twins(begin, end, len(corners))
    inner = twin >= 0
    other = own[twin]
    rise = np.where(inner, (within[twin] * normals[own]).sum(axis=1), 0.0)
    convex, hollow = inner & (rise < -FLAT), inner & (rise > FLAT)
    level = inner & ~convex & ~hollow
    flat = _joined(own[level], other[level], len(triangles))
    sides = np.zeros(len(begin), layout(Side))
    sides["inward"] = within
    sides["inward"][convex] = unit(normals[own[convex]] - normals[other[convex]])
    sides["limit"] = (sides["inward"] * start).sum(axis=1)
    sides["hollow"] = hollow
    faces = np.zeros(len(triangles), layout(Face))
    faces["normal"], faces["first"] = normals, 3 * np.arange(len(triangles))
    faces["offset"] = (normals * corners[triangles[:, 0]]).sum(axis=1)
    faces["count"], faces["flat"] = 3, flat
    once = convex & (np.arange(len(begin)) < twin)
    edges = np.zeros(int(once.sum()), layout(Edge))
    edges["start"], edges["along"], edges["length"] = start[once], along[once], length[once]
    edges["left"], edges["right"] = within[once], within[twin[once]]
    edges["face"] = own[once]
    pairs = np.sort(np.column_stack([flat[own[once]], flat[other[once]]]), axis=1)
    edges["line"] = np.unique(pairs, axis=0, return_inverse=True)[1].ravel()
    upward = np.zeros_like(corners)
    np.add.at(upward, triangles, normals[:, None])
    vertices, arms = _peaks(corners, upward, begin, along, inner, convex)
    return Features(faces, sides, edges, vertices, arms, corners[triangles])


def _peaks(
    corners: Array, upward: Array, begin: Indices, along: Array, inner: Mask, convex: Mask
) -> tuple[Columns, Array]:
    """Convex vertices within a sheet, and the unit vectors along their edges."""
    meeting = np.bincount(begin, minlength=len(corners))
    whole = np.bincount(begin, weights=inner, minlength=len(corners)) == meeting
    ridges = np.bincount(begin, weights=convex, minlength=len(corners))
    chosen = whole & (ridges >= 3)
    held = chosen[begin]
    order = np.argsort(begin[held], kind="stable")
    arms = np.ascontiguousarray(along[held][order])
    vertices = np.zeros(int(chosen.sum()), layout(Vertex))
    vertices["place"], vertices["count"] = corners[chosen], meeting[chosen]
    vertices["face"] = (
        np.flatnonzero(held)[order][np.cumsum(meeting[chosen]) - meeting[chosen]] // 3
    )
    vertices["first"] = np.cumsum(vertices["count"]) - vertices["count"]
    stands_out = np.zeros(len(vertices), dtype=bool)
    ends = np.cumsum(vertices["count"])
    for number, (vertex, (x, y, z)) in enumerate(zip(ends, upward[chosen].tolist(), strict=True)):
        first = vertex - vertices["count"][number]
        stands_out[number] = sharpest(arms[first:vertex], x, y, z) < -FLAT
    return vertices[stands_out], arms


def _twins(begin: Indices, end: Indices, size: int) -> Indices:
    """Number of the same side as seen from the neighbouring triangle; -1 where there is not one."""
    forth, back = begin * size + end, end * size + begin
    names, first, count = np.unique(forth, return_index=True, return_counts=True)
    at = np.minimum(np.searchsorted(names, back), len(names) - 1)
    single = (names[at] == back) & (count[at] == 1)
    single &= count[np.searchsorted(names, forth)] == 1
    return np.where(single, first[at], -1)


def _joined(one: Indices, other: Indices, size: int) -> Indices:
    links = coo_array((np.ones(len(one)), (one, other)), shape=(size, size))
    return np.asarray(connected_components(links, directed=False)[1])


def lines(start: Array, end: Array) -> tuple[Array, Array, Array]:
    """Where lines begin, their unit vectors and lengths.

    Parameters
    ----------
    start, end : ndarray, shape (n, 3) [m]
    """
    length = np.linalg.norm(end - start, axis=1)
    return start, (end - start) / length[:, None], length


def unit(vectors: Array) -> Array:
    """Vectors of length 1.

    Parameters
    ----------
    vectors : ndarray, shape (n, 3)

    Returns
    -------
    ndarray, shape (n, 3)
    """
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]
