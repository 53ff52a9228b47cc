"""A surrogate site: a rounded granite boulder balanced on a dome among jointed domes.

Nothing here is measured. The boulder is a rounded, uneven body on a small flat base; the ground
is smooth domes of a few metres, parted by joints, as in weathered granite.
"""

from __future__ import annotations

import math

import numpy as np

from vsr_core.arrays import Array, Indices
from vsr_core.surrogates.ground import rise, rough, sheet, waves
from vsr_core.surrogates.surrogate_site import (
    SurrogateSite,
    bezier,
    closed_stack,
    over_origin,
    rim_around,
)

_EXTENT = (-9.0, 9.0, -8.0, 8.0)
_CLEARANCE = 0.001  # m, of the seat below the boulder's base
_SEAM = 0.03  # m, from the boulder's foot to the rim of the seat
_FINE, _COARSE = 0.045, 0.2  # m, edges at the seat and far from it

# The boulder.
_HALF_HEIGHT = 1.0  # m, of the whole body, whose lowest part is cut off by the base
_BASE = 0.36  # rad from the bottom of the body, where the base cuts it
_HALF_WIDTHS = (0.86, 0.68)  # m
_AXIS_X, _AXIS_Y = (0.0, 0.04, -0.08, -0.2), (0.0, -0.1, 0.02, 0.1)  # m, Bezier from the base up
_SQUARENESS = 2.6  # of its level cuts; 2 is an ellipse
_RINGS, _AROUND = 44, 72

# The domes: x, y, height of the crown, radius along x and y [m], turn [degree]. The first bears
# the boulder; its crown is at the seat.
_DOMES = (
    (0.3, -0.2, 0.03, 3.2, 2.5, 20.0),
    (-4.6, 2.2, 0.9, 3.4, 2.7, -35.0),
    (-3.9, -4.4, -0.7, 3.0, 3.6, 10.0),
    (4.6, 3.9, -1.1, 2.8, 3.4, 50.0),
    (5.2, -3.4, -2.3, 3.4, 2.6, -15.0),
    (0.6, 6.3, -0.9, 2.8, 2.2, 0.0),
    (1.6, -6.6, -2.4, 3.0, 2.2, 30.0),
    (8.4, 0.6, -3.0, 2.4, 2.8, 0.0),
)
_SOIL = -4.2  # m, of the ground between the domes


def site() -> SurrogateSite:
    """A boulder of about 1.9 m on jointed domes of about 6 m relief, 18 m x 16 m.

    Examples
    --------
    >>> site().rock_vertices.shape
    (3170, 3)
    """
    vertices, faces = _boulder()
    base, lowest = vertices[:_AROUND], vertices[_AROUND : 2 * _AROUND]
    rim = rim_around(base[:, :2], lowest[:, :2], _SEAM)
    terrain, triangles, loop = sheet(_EXTENT, _spacing, _ground, [], rim)
    return SurrogateSite(
        rock_vertices=vertices,
        rock_faces=faces,
        terrain_vertices=terrain,
        terrain_faces=triangles,
        contact_rim=base,
        clearance=_CLEARANCE,
        rock_rim=np.arange(_AROUND, 2 * _AROUND),
        seat_rim=loop,
    )


def _boulder() -> tuple[Array, Indices]:
    """Closed surface of the boulder, standing on z = 0 with its centre of mass over 0, 0.

    Like Double Rock's surrogate it is a stack of level rings, each star-shaped about its middle,
    and cannot intersect itself.
    """
    polar = (_BASE + (math.pi - _BASE) * np.arange(_RINGS) / _RINGS)[:, None]
    s = (polar - _BASE) / (math.pi - _BASE)
    angles = 2.0 * math.pi * np.arange(_AROUND) / _AROUND
    level = (
        np.abs(np.cos(angles) / _HALF_WIDTHS[0]) ** _SQUARENESS
        + np.abs(np.sin(angles) / _HALF_WIDTHS[1]) ** _SQUARENESS
    ) ** (-1.0 / _SQUARENESS)
    unrolled = np.stack(np.broadcast_arrays(np.cos(angles), np.sin(angles)), axis=-1)
    place = unrolled * np.sin(polar)[..., None] - np.cos(polar)[..., None] * np.array([0.6, 0.8])
    radius = level * np.sin(polar) ** 0.85 * (1.0 + 0.045 * rough(place, 1.7, 2, 6))
    x = bezier(_AXIS_X, s) + radius * np.cos(angles)
    y = bezier(_AXIS_Y, s) + radius * np.sin(angles)
    height = _HALF_HEIGHT * (math.cos(_BASE) - np.cos(polar))
    rings = np.stack([x, y, np.broadcast_to(height, x.shape)], axis=-1)
    top = (_AXIS_X[-1], _AXIS_Y[-1], _HALF_HEIGHT * (1.0 + math.cos(_BASE)))
    vertices, faces = closed_stack(rings, (_AXIS_X[0], _AXIS_Y[0], 0.0), top)
    return over_origin(vertices, faces), faces


def _ground(places: Array) -> Array:
    """Height [m] of the ground at ``places``, shape (n, 2) [m]."""
    x, y = places.T
    heights = [np.full(len(places), _SOIL) + 0.12 * rough(places, 4.0, 3, 2)]
    for middle_x, middle_y, crown, length, width, turn in _DOMES:
        cosine, sine = math.cos(math.radians(turn)), math.sin(math.radians(turn))
        u = (cosine * (x - middle_x) + sine * (y - middle_y)) / length
        v = (cosine * (y - middle_y) - sine * (x - middle_x)) / width
        across = (np.abs(u) ** 2.4 + np.abs(v) ** 2.4) ** (1.0 / 2.4)
        heights.append(crown + 0.12 * waves(places, 5.0, 3) - 2.6 * across**2.6)
    surface = np.max(heights, axis=0) - _joints(places)
    surface += 0.02 * rough(places, 1.2, 3, 8)
    away = np.hypot(x, y)
    seat = rise((away - 0.62) / 1.1)
    # About the seat the dome only falls away, so that the boulder touches the seat alone.
    near = -_CLEARANCE - 0.07 * np.maximum(away - 0.55, 0.0) ** 2
    return (1.0 - seat) * near + seat * surface


def _joints(places: Array) -> Array:
    """Depth [m] of two sets of joints, weathered to grooves."""
    depth = np.zeros(len(places))
    for turn, spacing, shift in ((62.0, 3.9, 1.5), (-24.0, 5.2, 2.0)):
        across = math.cos(math.radians(turn)) * places[:, 0]
        across += math.sin(math.radians(turn)) * places[:, 1]
        across += shift + 0.3 * waves(places, 8.0, 1)
        distance = np.abs((across / spacing + 0.5) % 1.0 - 0.5) * spacing
        depth = np.maximum(depth, 0.4 * np.exp(-((distance / 0.16) ** 2)))
    return depth


def _spacing(places: Array) -> Array:
    away = np.hypot(places[:, 0], places[:, 1])
    return np.clip(_FINE + 0.06 * (away - 0.8), _FINE, _COARSE)
