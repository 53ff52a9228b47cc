"""How a rock rests on a flat pedestal and tips: from face to face of its hull.

All vectors are relative to the centre of mass. ``down`` is the direction of gravity in the frame
of the rock; while the rock rests on a facet, ``down`` is that facet's outward normal.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull

from vsr_core.arrays import Array, Indices, matrix_product
from vsr_core.errors import InvalidInput
from vsr_core.rock.body import Hull

MAX_SETTLING_TURN = np.radians(15.0)
"""A scan that has to turn further than this to rest did not stand [rad]."""

TOPPLED_TILT = 1.0
"""Tilt beyond which the published set-up calls a rock toppled, |roll| + |pitch| > 1 rad (public
scripts of Chen et al.)."""

_OVERHANG = 1e-6  # of a face's distance from the centre of mass, that counts as none
_ROUNDING = 1e-9
"""What is less, of that distance or of g, is none: a rock would go to and fro over an edge."""


@dataclass(frozen=True)
class Tipping:
    """Static tipping toward each direction, from a rest pose.

    Attributes
    ----------
    direction : ndarray, shape (k,) [rad], in which the rock tips, counter-clockwise from +x
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


def settle(hull: Hull, largest: float = MAX_SETTLING_TURN) -> tuple[Array, float]:
    """Rest pose on a level plane, found by rolling from facet to facet.

    The rock starts on the facet that faces down most and rolls over the edge that its centre of
    mass overhangs, until none is overhung: a local minimum of the height of its centre.

    Parameters
    ----------
    largest : float [rad]

    Returns
    -------
    rotation : ndarray, shape (3, 3), turns the given pose into the rest pose (no yaw)
    turned : float [rad], the angle of that rotation

    Raises
    ------
    InvalidInput
        If the rock turns by more than ``largest`` [rad]: it does not stand as given.
    """
    given = np.array([0.0, 0.0, -1.0])
    facet = int(np.argmin(hull.normals[:, 2]))
    face, outlines = _outlines(hull)
    for _ in range(len(outlines)):
        outline = outlines[face[facet]]
        edge = int(np.argmin(outline.room))
        if outline.room[edge] >= -_OVERHANG * hull.offsets[facet]:
            break
        facet = int(outline.neighbour[edge])
    rotation = _rotation(hull.normals[facet], given)
    turned = float(np.arccos(np.clip(-hull.normals[facet, 2], -1.0, 1.0)))
    if turned > largest:
        raise InvalidInput(
            f"a rock that falls by {np.degrees(turned):.0f} deg before it rests",
            f"it stands as given, within {np.degrees(largest):.0f} deg, z up",
            "turn the mesh upright, or restore the base it stands on",
        )
    return rotation, turned


def rest_tilts(hull: Hull) -> Array:
    """Tilts of all poses in which a hull rests on one of its facets.

    Returns
    -------
    ndarray, shape (k,) [rad], ascending; the first is the given pose, 0
    """
    face, outlines = _outlines(hull)
    facets = np.unique(face, return_index=True)[1]
    room = np.array([outline.room.min() for outline in outlines])
    stable = facets[room >= -_ROUNDING * hull.offsets[facets]]
    return np.sort(np.arccos(np.clip(-hull.normals[stable, 2], -1.0, 1.0)))


def base_polygon(vertices: Array, tolerance: float) -> Array:
    """Outline of what lies within ``tolerance`` of the lowest vertex of a rest pose.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3) [m], relative to the centre of mass
    tolerance : float [m]

    Returns
    -------
    ndarray, shape (k, 2) [m], counter-clockwise, relative to the centre of mass

    Examples
    --------
    >>> foot, top = [[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], [[1, 0.5, 3]]
    >>> base_polygon(np.array(foot + top), 0.01).shape
    (4, 2)
    """
    low = vertices[vertices[:, 2] <= vertices[:, 2].min() + tolerance, :2]
    return low[ConvexHull(low).vertices]


def tipping(hull: Hull, direction: Array) -> Tipping:
    """Static tipping of a hull from its rest pose toward each direction.

    The pedestal is rigid and rough. Under a steady acceleration the resultant of weight and
    inertia leaves the face of rest over an edge; the rock rolls onto the next facet, where it may
    find a new rest. What the worst of these facets needs is the overturning acceleration; what
    the first needs is the uplift acceleration (Housner 1963 for a block: both b/h).

    Parameters
    ----------
    direction : ndarray, shape (k,) [rad], in which the rock tips, counter-clockwise from +x
    """
    start = int(np.argmin(hull.normals[:, 2]))
    level = np.column_stack([np.cos(direction), np.sin(direction), np.zeros(len(direction))])
    pairs = [_tip(hull, start, toward) for toward in level]
    uplift, overturning = np.array(pairs).T
    return Tipping(direction, uplift, overturning)


class _Outline(NamedTuple):
    """A face of a hull, seen from the foot of the centre of mass.

    ``room`` is the distance [m] to each edge, negative where the centre overhangs it, ``outward``
    the edge's normal in the face's plane, ``neighbour`` the facet beyond it, by which its own face
    is known.
    """

    room: Array
    outward: Array
    neighbour: Indices


@lru_cache(maxsize=4)
def _outlines(hull: Hull) -> tuple[Indices, list[_Outline]]:
    """Number of each facet's face, and outline of every face: of facets whose normals are equal.

    Such a face is convex, as Qhull merges facets until all are; those of ``hull.face`` are not
    where a base is flat but for rounding.
    """
    face = np.unique(hull.normals, axis=0, return_inverse=True)[1].reshape(-1)
    facet, corner = np.nonzero(face[hull.neighbours] != face[:, None])
    order = np.argsort(face[facet], kind="stable")  # edges of a face one after the other
    facet, corner = facet[order], corner[order]
    first = hull.vertices[hull.facets[facet, (corner + 1) % 3]]
    second = hull.vertices[hull.facets[facet, (corner + 2) % 3]]
    outward = np.cross(second - first, hull.normals[facet])
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    middle = 0.5 * (first + second)
    begin = np.searchsorted(face[facet], np.arange(face.max() + 2))
    edges = np.diff(begin)
    inside = np.repeat(np.add.reduceat(middle, begin[:-1]) / edges[:, None], edges, axis=0)
    outward *= np.sign(np.einsum("ij,ij->i", outward, middle - inside))[:, None]
    room = np.einsum("ij,ij->i", outward, first)
    beyond = hull.neighbours[facet, corner]
    return face, [
        _Outline(room[one:end], outward[one:end], beyond[one:end])
        for one, end in pairwise(begin.tolist())
    ]


def _slope(outline: _Outline, height: float, toward: Array) -> Array:
    """How far each edge comes nearer by a push of 1 g [m]."""
    return height * matrix_product(outline.outward, toward[:, None])[:, 0]


def _reach(outline: _Outline, slope: Array, height: float) -> Array:
    """Push at which the resultant comes to each edge [g], infinite where it never does."""
    reach = np.full(len(slope), np.inf)
    return np.divide(outline.room, slope, out=reach, where=slope > _ROUNDING * height)


def _border(hull: Hull, group: int) -> _Outline:
    """Outline of a base that is flat but for rounding: the edges at which other faces begin.

    Of its facets some are merged to faces that are not convex, on which a rock would go round.
    """
    face, outlines = _outlines(hull)
    own = [outlines[number] for number in np.unique(face[hull.face == group])]
    room, outward, neighbour = (np.concatenate(part) for part in zip(*own, strict=True))
    outer = hull.face[neighbour] != group
    return _Outline(room[outer], outward[outer], neighbour[outer])


def _tip(hull: Hull, facet: int, toward: Array) -> tuple[float, float]:
    """Uplift and overturning acceleration [g] toward one horizontal direction.

    At one push the rock only loses energy and comes back to no face. At a larger one it may: a bump
    can turn it aside, onto a face from which the push brings it back.
    """
    face, outlines = _outlines(hull)
    start, down = facet, hull.normals[facet]
    needed, uplift, more = 0.0, np.inf, _ROUNDING
    seen: set[int] = set()  # at this push
    gone = {facet}  # since it last went on
    while True:
        seen.add(face[facet])
        gone.add(facet)
        height, outline = hull.offsets[facet], outlines[face[facet]]
        slope = _slope(outline, height, toward)
        closed = np.array([face[other] in seen for other in outline.neighbour])
        room = np.where(closed, np.inf, outline.room - needed * slope)
        edge = int(np.argmin(room))
        if room[edge] >= -_ROUNDING * height:
            reach = _reach(outline, slope, height)
            reach[closed] = np.maximum(reach[closed], needed + more)
            edge = int(np.argmin(reach))
            goes_round = reach[edge] == needed + more
            if goes_round and len({*hull.face[[*gone]]}) == 1:  # and so on one that is flat
                outline = _border(hull, hull.face[facet])
                reach = _reach(outline, _slope(outline, height, toward), height)
                edge = int(np.argmin(reach))
            elif goes_round:
                more *= 2.0  # so that it ends
            else:
                gone.clear()
            if reach[edge] > needed:
                needed = float(reach[edge])
                seen.clear()
        facet = int(outline.neighbour[edge])
        if hull.face[facet] != hull.face[start]:
            uplift = min(uplift, needed)
        turn = _rotation(down, hull.normals[facet])
        down = hull.normals[facet]
        if np.arccos(np.clip((down * hull.normals[start]).sum(), -1.0, 1.0)) > TOPPLED_TILT:
            return uplift, needed
        toward = matrix_product(turn, toward[:, None])[:, 0]


def _rotation(a: Array, b: Array) -> Array:
    """Smallest rotation, shape (3, 3), that takes unit vector ``a`` to ``b`` (not opposite)."""
    v, c = np.cross(a, b), float((a * b).sum())
    cross = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + cross + matrix_product(cross, cross) / (1.0 + c)
