"""How a rock rests on a flat pedestal and tips: from face to face of its hull.

All vectors are relative to the centre of mass. ``down`` is the direction of gravity in the frame
of the rock; while the rock rests on a facet, ``down`` is that facet's outward normal.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull

from vsr_core.arrays import Array, Indices, Mask, matrix_product
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
    faces = _faces(hull)
    face = int(np.argmin(faces.normals[:, 2]))
    came = hull.vertices[hull.facets[faces.facet[face]]].mean(axis=0)
    for _ in faces.facet:
        overhung = _overhung(faces, face)
        if not overhung.any():
            break
        face, came = _crossed(faces, came, faces.offsets[face] * faces.normals[face], overhung)
    down = faces.normals[face]
    rotation = _rotation(down, np.array([0.0, 0.0, -1.0]))
    turned = float(np.arccos(np.clip(-down[2], -1.0, 1.0)))
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
    faces = _faces(hull)
    beside = hull.neighbours[faces.facet]
    across = np.einsum("ijk,ik->ij", hull.normals[beside], faces.normals)
    room = hull.offsets[beside] / faces.offsets[:, None] - across
    held = np.flatnonzero((room >= -_OVERHANG).all(axis=1))  # few, so that few are asked of all
    stable = faces.facet[[face for face in held.tolist() if not _overhung(faces, face).any()]]
    flat = np.unique(hull.face[stable], return_index=True)[1]
    return np.sort(np.arccos(np.clip(-hull.normals[stable][flat, 2], -1.0, 1.0)))


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
    level = np.column_stack([np.cos(direction), np.sin(direction), np.zeros(len(direction))])
    pairs = [_tip(hull, toward) for toward in level]
    uplift, overturning = np.array(pairs).T
    return Tipping(direction, uplift, overturning)


class _Faces(NamedTuple):
    """Faces of a hull, which lie in different planes, by one facet of each.

    A walk asks for planes only, not which facets are neighbours: where a base is flat but for
    rounding, Qhull merges facets to some that are not convex.
    """

    facet: Indices
    normals: Array
    offsets: Array


@lru_cache(maxsize=4)
def _faces(hull: Hull) -> _Faces:
    planes = np.column_stack([hull.normals, hull.offsets])
    facet = np.unique(planes, axis=0, return_index=True)[1]
    return _Faces(facet, hull.normals[facet], hull.offsets[facet])


def _room(faces: _Faces, point: Array) -> Array:
    """Distance of a point within the hull to each plane [m], shape (faces,)."""
    return faces.offsets - matrix_product(faces.normals, point[:, None])[:, 0]


def _overhung(faces: _Faces, face: int) -> Mask:
    """Faces to which the centre of mass overhangs the edge of the one that is down."""
    foot = faces.offsets[face] * faces.normals[face]
    aside = np.linalg.norm(np.cross(faces.normals, faces.normals[face]), axis=1)
    least = np.maximum(_OVERHANG * aside, _ROUNDING) * faces.offsets[face]
    return np.asarray(_room(faces, foot) < -least)


def _crossed(faces: _Faces, came: Array, at: Array, beyond: Mask) -> tuple[int, Array]:
    """Which face, of those that ``at`` lies beyond, is met first from ``came``, and where."""
    inside = np.maximum(_room(faces, came), 0.0)
    share = np.full(len(inside), np.inf)
    np.divide(inside, inside - _room(faces, at), out=share, where=beyond)
    face = int(np.argmin(share))
    return face, came + share[face] * (at - came)


def _tip(hull: Hull, toward: Array) -> tuple[float, float]:
    """Uplift and overturning acceleration [g] toward one horizontal direction.

    The resultant meets the plane of the face that is down. As the push grows, it goes straight
    towards where it leaves the face; on one that the rock comes to and that does not hold it, it
    leaves on its way from where it came: where two edges are overhung, a guess, by which rocks on
    bumps are up to half a degree off. At one push the rock only loses energy and comes back to no
    face. At a larger one it may: a bump can turn it aside, onto a face from which the push brings
    it back.
    """
    faces = _faces(hull)
    group = hull.face[faces.facet]
    face = start = int(np.argmin(faces.normals[:, 2]))
    toward = toward - (toward * faces.normals[face]).sum() * faces.normals[face]
    came = faces.offsets[face] * faces.normals[face]
    needed, uplift, more = 0.0, np.inf, _ROUNDING
    seen = np.zeros(len(group), dtype=bool)  # at this push
    while True:
        seen[face] = True
        down, height = faces.normals[face], faces.offsets[face]
        at = height * (down + needed * toward)
        room = _room(faces, at)
        beyond = ~seen & (room < -_ROUNDING * height)
        if beyond.any():
            other, came = _crossed(faces, came, at, beyond)
        else:
            slope = height * matrix_product(faces.normals, toward[:, None])[:, 0]
            reach = np.full(len(room), np.inf)
            nearer = slope > _ROUNDING * height
            np.divide(np.maximum(room, 0.0), slope, out=reach, where=nearer)
            reach[seen] = np.maximum(reach[seen], more)
            other = int(np.argmin(reach))
            if reach[other] == more:
                more *= 2.0  # so that it ends
            came = at + reach[other] * height * toward
            if reach[other] > 0.0:
                needed += float(reach[other])
                seen[:] = False
        if group[other] != group[start]:
            uplift = min(uplift, needed)
        turn = _rotation(down, faces.normals[other])
        face, down = other, faces.normals[other]
        if np.arccos(np.clip((down * faces.normals[start]).sum(), -1.0, 1.0)) > TOPPLED_TILT:
            return uplift, needed
        toward = matrix_product(turn, toward[:, None])[:, 0]


def _rotation(a: Array, b: Array) -> Array:
    """Smallest rotation, shape (3, 3), that takes unit vector ``a`` to ``b`` (not opposite)."""
    v, c = np.cross(a, b), float((a * b).sum())
    cross = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + cross + matrix_product(cross, cross) / (1.0 + c)
