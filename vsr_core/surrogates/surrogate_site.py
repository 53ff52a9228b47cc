"""A rock and the ground it stands on, as they truly are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsr_core.arrays import Array, Indices
from vsr_core.surrogates.ground_sheet import offset


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
