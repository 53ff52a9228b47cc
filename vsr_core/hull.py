"""What of a rock can touch a flat pedestal: its hull, the face it rests on, how it tips.

All vectors are relative to the centre of mass. ``down`` is the direction of gravity in the frame
of the rock; while the rock rests on a facet, ``down`` is that facet's outward normal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vsr_core.errors import Unfit

Array = NDArray[np.float64]

MAX_SETTLING_TURN = np.radians(15.0)
"""A scan that has to turn further than this to rest did not stand [rad]."""

TOPPLED_TILT = 1.0
"""Tilt of the seed's toppling rule, |roll| + |pitch| > 1 rad (public scripts of Chen et al.)."""

_FLAT = 1e-6  # rad between facets and share of the size between points that count as one plane


@dataclass(frozen=True)
class Hull:
    """Convex hull about the centre of mass.

    Attributes
    ----------
    vertices : ndarray, shape (n, 3) [m]
    facets : ndarray of int, shape (m, 3), indices of each triangle's corners
    normals : ndarray, shape (m, 3), outward unit normals
    offsets : ndarray, shape (m,) [m], distance of each facet's plane from the centre of mass
    neighbours : ndarray of int, shape (m, 3), facet across the edge opposite corner k
    """

    vertices: Array
    facets: NDArray[np.intp]
    normals: Array
    offsets: Array
    neighbours: NDArray[np.intp]

    def turned(self, rotation: Array) -> Hull:
        """The same hull with every vector turned by ``rotation``, shape (3, 3)."""
        return Hull(
            self.vertices @ rotation.T,
            self.facets,
            self.normals @ rotation.T,
            self.offsets,
            self.neighbours,
        )

    @property
    def radius(self) -> float:
        """Largest distance of a vertex from the centre of mass [m]."""
        return float(np.linalg.norm(self.vertices, axis=1).max())


@dataclass(frozen=True)
class Tipping:
    """Static tipping toward each direction, from a rest pose.

    Attributes
    ----------
    direction : ndarray, shape (k,) [rad], counter-clockwise from +x, the way the rock tips
    uplift : ndarray, shape (k,) [g], table acceleration at which the first edge lifts
    overturning : ndarray, shape (k,) [g], steady acceleration that topples it
    """

    direction: Array
    uplift: Array
    overturning: Array

    @property
    def angle(self) -> Array:
        """Static tipping angle [rad], shape (k,): slope at which the rock topples."""
        return np.arctan(self.overturning)


def convex_hull(points: Array) -> Hull:
    """Hull of ``points``, shape (n, 3) [m], given relative to the centre of mass.

    Raises
    ------
    Unfit
        If the points span no volume, or the centre of mass lies outside their hull.
    """
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError) as error:
        raise Unfit("a flat or empty point set", "a rock has volume", "check the mesh") from error
    normals, offsets = hull.equations[:, :3], -hull.equations[:, 3]
    if offsets.min() <= 0.0:
        raise Unfit(
            "a centre of mass outside the hull", "it lies inside", "check the mesh's winding"
        )
    number = np.full(len(points), -1)
    number[hull.vertices] = np.arange(len(hull.vertices))
    return Hull(points[hull.vertices], number[hull.simplices], normals, offsets, hull.neighbors)


def settle(hull: Hull) -> tuple[Array, float]:
    """Rest pose on a level plane, found by rolling from facet to facet.

    The rock starts on the facet that faces down most and rolls over the edge that its centre of
    mass overhangs, until none is overhung: a local minimum of the height of its centre.

    Returns
    -------
    rotation : ndarray, shape (3, 3), turns the given pose into the rest pose (no yaw)
    turned : float [rad], the angle of that rotation

    Raises
    ------
    Unfit
        If the rock turns by more than ``MAX_SETTLING_TURN``: it does not stand as given.
    """
    given = np.array([0.0, 0.0, -1.0])
    facet = int(np.argmax(hull.normals @ given))
    for _ in range(len(hull.facets)):
        distance, _ = _edges(hull, facet)
        edge = int(np.argmin(distance))
        if distance[edge] >= -_FLAT * hull.offsets[facet]:
            break
        facet = int(hull.neighbours[facet, edge])
    rotation = _rotation(hull.normals[facet], given)
    turned = float(np.arccos(np.clip(hull.normals[facet] @ given, -1.0, 1.0)))
    if turned > MAX_SETTLING_TURN:
        raise Unfit(
            f"a rock that falls by {np.degrees(turned):.0f} deg before it rests",
            f"it stands as given, within {np.degrees(MAX_SETTLING_TURN):.0f} deg, z up",
            "turn the mesh upright, or restore the base it stands on",
        )
    return rotation, turned


def base_polygon(vertices: Array, tolerance: float) -> Array:
    """Outline of what lies within ``tolerance`` [m] of the lowest vertex of a rest pose.

    Returns
    -------
    ndarray, shape (k, 2) [m], counter-clockwise, relative to the centre of mass
    """
    from scipy.spatial import ConvexHull

    low = vertices[vertices[:, 2] <= vertices[:, 2].min() + tolerance, :2]
    return low[ConvexHull(low).vertices]


def tipping(hull: Hull, direction: Array) -> Tipping:
    """Static tipping of a hull in its rest pose toward each ``direction``, shape (k,) [rad].

    The pedestal is rigid and rough. Under a steady acceleration the resultant of weight and
    inertia leaves the face of rest over an edge; the rock rolls onto the next facet, where it may
    find a new rest. What the worst of these facets needs is the overturning acceleration; what
    the first needs is the uplift acceleration (Housner 1963 for a block: both b/h).
    """
    start = int(np.argmin(hull.normals[:, 2]))
    pairs = [_tip(hull, start, np.array([np.cos(d), np.sin(d), 0.0])) for d in direction]
    uplift, overturning = np.array(pairs).T
    return Tipping(direction, uplift, overturning)


def touching(hull: Hull, tilt: float) -> NDArray[np.bool_]:
    """Vertices that can touch a plane while the rock is tilted by at most ``tilt`` [rad].

    A vertex touches for the directions of ``down`` between the normals of its facets, so every
    vertex of a facet whose normal comes within ``tilt`` of straight down is kept, with a margin
    of the widest angle between neighbouring facets there (an arc may enter the cap though
    neither of its ends does).

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    facing = np.arccos(np.clip(-hull.normals[:, 2], -1.0, 1.0))
    cosine = np.einsum("ij,ikj->ik", hull.normals, hull.normals[hull.neighbours])
    widest = np.arccos(np.clip(cosine, -1.0, 1.0)).max(axis=1)
    keep = np.zeros(len(hull.vertices), dtype=bool)
    keep[hull.facets[facing - widest <= tilt].ravel()] = True
    return keep


def _edges(hull: Hull, facet: int) -> tuple[Array, Array]:
    """Of a facet's three edges: distance from the foot of the centre of mass, outward normal.

    Edge k lies opposite corner k; the distance is negative where the centre overhangs it.
    """
    corner = hull.vertices[hull.facets[facet]]
    first, second = corner[[1, 2, 0]], corner[[2, 0, 1]]
    outward = np.cross(second - first, hull.normals[facet])
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    outward *= np.sign(np.einsum("ij,ij->i", outward, first - corner))[:, None]
    return np.einsum("ij,ij->i", outward, first), outward


def _tip(hull: Hull, facet: int, toward: Array) -> tuple[float, float]:
    """Uplift and overturning acceleration [g] toward one horizontal direction."""
    needed, uplift = 0.0, np.inf
    down = hull.normals[facet]
    start = down
    for _ in range(4 * len(hull.facets)):
        distance, outward = _edges(hull, facet)
        height, slope = hull.offsets[facet], outward @ toward
        room = distance - needed * height * slope
        edge = int(np.argmin(room))
        if room[edge] >= 0.0:
            with np.errstate(divide="ignore"):
                reach = np.where(slope > 0.0, distance / (height * slope), np.inf)
            edge = int(np.argmin(reach))
            needed = max(needed, float(reach[edge]))
        facet = int(hull.neighbours[facet, edge])
        turn = _rotation(down, hull.normals[facet])
        down = hull.normals[facet]
        tilt = np.arccos(np.clip(down @ start, -1.0, 1.0))
        if tilt > _FLAT:
            uplift = min(uplift, needed)
        if tilt > TOPPLED_TILT:
            break
        toward = turn @ toward
    return uplift, needed


def _rotation(a: Array, b: Array) -> Array:
    """Smallest rotation, shape (3, 3), that takes unit vector ``a`` to ``b`` (not opposite)."""
    v, c = np.cross(a, b), float(a @ b)
    cross = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + cross + cross @ cross / (1.0 + c)
