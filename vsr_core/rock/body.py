"""A rock as a rigid body in its rest pose, and its convex hull: which corners can touch a pedestal.

All vectors are relative to the centre of mass.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from vsr_core.arrays import Array, Indices, Mask, matrix_product
from vsr_core.errors import InvalidInput

STANDING = math.radians(30.0)
"""Tilt up to which a hull that was drawn in keeps its corners, but those that are lowest in less
than 0.02 rad; beyond that tilt it keeps those of a coarser hull."""

_FLAT = 1e-6  # difference of unit normals below which neighbouring facets are of one face


@dataclass(frozen=True, eq=False)
class Hull:
    """Convex hull about the centre of mass.

    Attributes
    ----------
    vertices : ndarray, shape (n, 3) [m]
    facets : ndarray of int, shape (m, 3), indices of each triangle's corners
    normals : ndarray, shape (m, 3), outward unit normals
    offsets : ndarray, shape (m,) [m], distance of each facet's plane from the centre of mass
    neighbours : ndarray of int, shape (m, 3), facet across the edge opposite corner k
    face : ndarray of int, shape (m,), number of the flat face that each facet is part of
    """

    vertices: Array
    facets: Indices
    normals: Array
    offsets: Array
    neighbours: Indices
    face: Indices

    def turned(self, rotation: Array) -> Hull:
        """The same hull with every vector turned.

        Parameters
        ----------
        rotation : ndarray, shape (3, 3)
        """
        return Hull(
            matrix_product(self.vertices, rotation.T),
            self.facets,
            matrix_product(self.normals, rotation.T),
            self.offsets,
            self.neighbours,
            self.face,
        )


def convex_hull(points: Array) -> Hull:
    """Convex hull of points about the centre of mass.

    Parameters
    ----------
    points : ndarray, shape (n, 3) [m], relative to the centre of mass

    Raises
    ------
    InvalidInput
        If the points span no volume, or the centre of mass lies outside their hull.

    Examples
    --------
    >>> from itertools import product
    >>> cube = convex_hull(np.array(list(product((-1.0, 1.0), repeat=3))))
    >>> len(cube.vertices), len(cube.facets), len(set(cube.face.tolist()))
    (8, 12, 6)
    """
    try:
        # Q12: corners a micrometre apart leave a facet wider than rounding, which is no error
        hull = ConvexHull(points, qhull_options="Qt Q12")
    except (QhullError, ValueError) as error:
        raise InvalidInput(
            "a flat or empty point set", "a rock has volume", "check the mesh"
        ) from error
    normals, offsets = hull.equations[:, :3], -hull.equations[:, 3]
    if offsets.min() <= 0.0:
        raise InvalidInput(
            "a centre of mass outside the hull", "it lies inside", "check the mesh's winding"
        )
    number = np.full(len(points), -1)
    number[hull.vertices] = np.arange(len(hull.vertices))
    face = _flat_faces(normals, hull.neighbors)
    corners, facets = points[hull.vertices], number[hull.simplices]
    return Hull(corners, facets, normals, offsets, hull.neighbors, face)


def drawn_in(hull: Hull, distance: float) -> Array:
    """Points of a hull whose sides are all drawn in towards the vertical through its centre.

    Each edge of its base moves in by the distance, at the height at which it was: the hull is what
    is left of it (its erosion) by a level disk of that radius. A corner at which many facets meet
    becomes many, of which those are kept on which the rock may stand or tip.

    Parameters
    ----------
    distance : float [m]

    Returns
    -------
    ndarray, shape (n, 3) [m]

    Raises
    ------
    InvalidInput
        If the centre of mass would lie outside.

    Examples
    --------
    >>> from itertools import product
    >>> cube = convex_hull(np.array(list(product((-1.0, 1.0), repeat=3))))
    >>> np.abs(drawn_in(cube, 0.25)).max(axis=0).round(9).tolist()
    [0.75, 0.75, 1.0]
    """
    offsets = hull.offsets - distance * np.linalg.norm(hull.normals[:, :2], axis=1)
    if offsets.min() <= 0.0:
        given = f"a base drawn in by {distance:.3g} m, to beyond the centre of mass"
        raise InvalidInput(given, "the rock stands", "reduce inset")
    planes = np.column_stack([hull.normals, -offsets])
    corners = HalfspaceIntersection(planes, np.zeros(3)).intersections
    lowest = float(corners[:, 2].min())
    on_base = np.flatnonzero(corners[:, 2] < lowest + _FLAT * abs(lowest))
    steep = math.cos(STANDING)
    directions = np.vstack([_spread(3000, -1.0, -steep), _spread(200, -1.0, 1.0)])
    parts = np.array_split(directions, 64)  # each small enough for the processor's cache
    farthest = np.concatenate([(part @ corners.T).argmax(axis=1) for part in parts])
    return np.asarray(corners[np.union1d(on_base, farthest)])


def _spread(number: int, low: float, high: float) -> Array:
    """Directions spread evenly between two heights on the unit sphere, shape (number, 3)."""
    z = low + (high - low) * (np.arange(number) + 0.5) / number
    turn = math.pi * (1.0 + math.sqrt(5.0)) * np.arange(number)  # golden angle
    level = np.sqrt(1.0 - z**2)
    return np.column_stack([level * np.cos(turn), level * np.sin(turn), z])


def touching(hull: Hull, tilt: float) -> Mask:
    """Vertices that can touch a plane while the rock is tilted by at most ``tilt``.

    Parameters
    ----------
    tilt : float [rad]

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    return contact_tilts(hull)[0] <= tilt


def corners(hull: Hull, tolerance: float) -> Mask:
    """Vertices without which the hull would change; the others lie on lines between their like.

    Whatever force acts between two corners, forces at these do the same.

    Parameters
    ----------
    tolerance : float [m], distance of a vertex from such a line

    Returns
    -------
    ndarray of bool, shape (n,)

    Examples
    --------
    >>> from itertools import product
    >>> cube = np.array(list(product((-1.0, 1.0), repeat=3)))
    >>> int(corners(convex_hull(np.vstack([cube, [[1.0, 0.2, 1.0]]])), 1e-6).sum())
    8
    """
    rings: list[set[int]] = [set() for _ in hull.vertices]
    for facet in hull.facets.tolist():
        for corner in facet:
            rings[corner].update(facet)
    kept = np.ones(len(hull.vertices), dtype=bool)
    for vertex, ring in enumerate(rings):
        ring.discard(vertex)
        others = np.array(sorted(ring), dtype=np.int64)  # none, of a corner that is met twice
        to = hull.vertices[others] - hull.vertices[vertex]
        length = np.linalg.norm(to, axis=1)
        one, other = np.triu_indices(len(others), 1)
        opposite = (to[one] * to[other]).sum(axis=1) < 0.0
        off = np.linalg.norm(np.cross(to[one], to[other]), axis=1)
        near = opposite & (off <= tolerance * np.linalg.norm(to[one] - to[other], axis=1))
        if not near.any() or not length.all():
            continue
        at = int(np.argmax(near))
        kept[vertex] = False
        ends = int(others[one[at]]), int(others[other[at]])
        for end, far in (ends, ends[::-1]):
            rings[end].add(far)
        for neighbour in ring:
            rings[neighbour].discard(vertex)
    return kept


def contact_tilts(hull: Hull) -> tuple[Array, Array]:
    """Least and greatest tilt at which each vertex can touch a plane.

    A vertex touches for the directions of ``down`` between the normals of its facets. The range
    of their tilts is widened by the widest angle between neighbouring facets there, because an
    arc between two normals may pass a tilt that neither has; it encloses the true one. That of the
    lowest vertices holds 0, and of the highest pi, which lie amid their normals.

    Returns
    -------
    least, greatest : ndarray, shape (n,) [rad]
    """
    facing = np.arccos(np.clip(-hull.normals[:, 2], -1.0, 1.0))
    cosine = np.einsum("ij,ikj->ik", hull.normals, hull.normals[hull.neighbours])
    widest = np.arccos(np.clip(cosine, -1.0, 1.0)).max(axis=1)
    least = np.full(len(hull.vertices), np.inf)
    greatest = np.full(len(hull.vertices), -np.inf)
    for corner in hull.facets.T:
        np.minimum.at(least, corner, facing - widest)
        np.maximum.at(greatest, corner, facing + widest)
    height = hull.vertices[:, 2]
    least[height == height.min()] = 0.0
    greatest[height == height.max()] = math.pi
    return least, greatest


def _flat_faces(normals: Array, neighbours: Indices) -> Indices:
    """Number of the flat face of each facet: neighbours with the same normal are one face."""
    facet, corner = np.nonzero(
        np.linalg.norm(normals[neighbours] - normals[:, None], axis=2) < _FLAT
    )
    pairs = (np.ones(len(facet)), (facet, neighbours[facet, corner]))
    size = (len(normals), len(normals))
    return np.asarray(connected_components(coo_array(pairs, shape=size), directed=False)[1])


@dataclass(frozen=True, eq=False)
class Rock:
    """A rigid rock in its rest pose: origin at the centre of mass, z up, yaw 0.

    Attributes
    ----------
    vertices : ndarray, shape (n, 3) [m], corners of its convex hull; six poles of a sphere
    pieces : tuple of ndarray, each of shape (k, 3) [m]
        Corners of convex pieces that together are its contact on a terrain, where its hull would
        touch and the rock does not; none where its hull is. On level ground that is exact.
    mass : float [kg]
    inertia : ndarray, shape (3,) [kg m^2], principal moments
    axes : ndarray, shape (3, 3), principal axes as columns, right-handed
    """

    shape: Literal["box", "hull", "sphere"]
    vertices: Array
    mass: float
    inertia: Array
    axes: Array
    pieces: tuple[Array, ...] = ()

    @cached_property
    def radius(self) -> float:
        """Largest distance of a vertex from the centre of mass [m]."""
        return float(np.linalg.norm(self.vertices, axis=1).max())

    @cached_property
    def height(self) -> float:
        """Height of the centre of mass above the pedestal at rest [m]."""
        return float(-self.vertices[:, 2].min())

    @cached_property
    def hull(self) -> Hull:
        """Its convex hull."""
        return convex_hull(self.vertices)
