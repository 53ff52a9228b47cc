"""Closed solids that are stacks of horizontal rings, and the curves that shape them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vsr_core.arrays import Array, Indices
from vsr_core.surrogates.ground import offset


def bezier(control: tuple[float, ...], s: Array) -> Array:
    """Bezier curve.

    Examples
    --------
    >>> bezier((0.0, 2.0, 4.0), np.array([0.0, 0.5, 1.0])).tolist()
    [0.0, 2.0, 4.0]
    """
    n = len(control) - 1
    value = np.zeros_like(s)
    for k, c in enumerate(control):
        value += c * math.comb(n, k) * s**k * (1.0 - s) ** (n - k)
    return value


def polygon_radius(angles: Array, corners: Array, margin: float = 0.0) -> Array:
    """Distance [m] from the origin to a convex polygon around it, its sides moved outward.

    Parameters
    ----------
    angles : ndarray, shape (k,) [rad], counter-clockwise from +x
    corners : ndarray, shape (n, 2) [m], counter-clockwise
    margin : float [m], by which the sides lie outside the corners

    Returns
    -------
    ndarray, shape (k,) [m]

    Examples
    --------
    >>> square = np.array([[1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]])
    >>> polygon_radius(np.array([0.0]), square, 0.5).tolist()
    [1.5]
    """
    edges = np.roll(corners, -1, axis=0) - corners
    normals = np.column_stack([edges[:, 1], -edges[:, 0]])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    offsets = np.sum(normals * corners, axis=1) + margin
    facing = normals @ np.array([np.cos(angles), np.sin(angles)])
    reciprocal: Array = np.max(facing / offsets[:, None], axis=0)
    return 1.0 / reciprocal


def closed_stack(
    rings: Array, bottom: tuple[float, float, float], top: tuple[float, float, float]
) -> tuple[Array, Indices]:
    """Close a stack of rings with a fan at each end.

    Parameters
    ----------
    rings : ndarray, shape (k, n, 3) [m], each counter-clockwise seen from above, lowest first
    bottom, top : tuple of three floats [m], the middles of the fans

    Returns
    -------
    vertices : ndarray, shape (k n + 2, 3) [m], rounded to a micrometre: the rings, bottom, top
    faces : ndarray of int64, shape (2 k n, 3), counter-clockwise seen from outside
    """
    count, size = rings.shape[:2]
    here = np.arange(size)
    after = np.roll(here, -1)
    lower = size * np.arange(count - 1)[:, None]
    upper = lower + size
    sides = np.concatenate(
        [
            np.stack(np.broadcast_arrays(lower + here, lower + after, upper + after), axis=-1),
            np.stack(np.broadcast_arrays(lower + here, upper + after, upper + here), axis=-1),
        ]
    ).reshape(-1, 3)
    last = size * (count - 1)
    apex = np.full(size, size * count)
    floor = np.column_stack([apex, after, here])
    cap = np.column_stack([apex + 1, last + here, last + after])
    vertices = np.vstack([rings.reshape(-1, 3), bottom, top])
    return np.round(vertices, 6), np.concatenate([floor, sides, cap]).astype(np.int64)


@dataclass(frozen=True, eq=False)
class SurrogateSite:
    """A rock on its terrain.

    Coordinates are in metres in the site frame: z up, the origin vertically below the rock's
    centre of mass at the height of its lowest point.

    Attributes
    ----------
    rock_vertices : ndarray, shape (n, 3) [m]
    rock_faces : ndarray of int64, shape (m, 3), a closed surface, counter-clockwise from outside
    terrain_vertices : ndarray, shape (k, 3) [m]
    terrain_faces : ndarray of int64, shape (l, 3), an open sheet, counter-clockwise from above
    contact_rim : ndarray, shape (c, 3) [m], outline of the base that the rock stands on,
        counter-clockwise seen from above, at z = 0
    clearance : float [m], by which the seat, level under the rock, lies below its base
    rock_rim : ndarray of int64, shape (r,), the lowest level ring of the rock's vertices that can
        be seen, counter-clockwise from above
    seat_rim : ndarray of int64, shape (r,), the terrain's vertices beside them, around the seat
    """

    rock_vertices: Array
    rock_faces: Indices
    terrain_vertices: Array
    terrain_faces: Indices
    contact_rim: Array
    clearance: float
    rock_rim: Indices
    seat_rim: Indices


def rim_around(base: Array, lowest: Array, distance: float) -> Array:
    """Loop around a rock's foot, ``distance`` [m] outside its base and its lowest ring seen.

    Parameters
    ----------
    base, lowest : ndarray, shape (r, 2) [m], star-shaped about the base's middle, point by point
    distance : float [m]

    Returns
    -------
    ndarray, shape (r, 2) [m]
    """
    middle = base.mean(axis=0)
    reach = [np.linalg.norm(ring - middle, axis=1) for ring in (base, lowest)]
    return offset(np.where((reach[0] > reach[1])[:, None], base, lowest), distance)


def over_origin(vertices: Array, faces: Indices) -> Array:
    """Points of a closed surface standing on z = 0, moved so that its centre of mass is over 0, 0.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3) [m]
    faces : ndarray of int, shape (m, 3), counter-clockwise seen from outside

    Returns
    -------
    ndarray, shape (n, 3) [m]
    """
    corners = vertices[faces]
    volumes = np.linalg.det(corners)
    centre = volumes @ corners.sum(axis=1) / (4.0 * volumes.sum())
    return vertices - (centre[0], centre[1], 0.0)
