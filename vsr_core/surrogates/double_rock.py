"""A stand-in for the scan of the Double Rock precariously balanced rock.

The solid is generated from published and measured figures of the rock; no point of a scan is in
it. It shares the rock's size, volume, mass distribution and static tipping angles,
not its surface: what is computed with it is no statement about the real rock.

These figures are, in the pose of the published mesh (z up, standing on z = 0, centre of mass over
the origin): lowest and highest x, y, z of (-0.654, -0.344, 0) and (0.584, 0.409, 1.5085) m; volume
0.5529 m^3; centre of mass at (0, 0, 0.742) m; and over the mass, about that centre, moments of
inertia of 0.18119, 0.21802 and 0.09324 m^2 and, off the diagonal of the tensor, -0.00896 (xy),
-0.05821 (xz) and -0.01865 m^2 (yz).

The solid is a stack of horizontal cross-sections along a bent axis that leans like the rock. The
lowest is the base polygon. With height it turns into a superellipse whose centre, half-widths
and direction are Bezier curves in z, with a mild relief, and it closes to a point at the top.

How the constants were found: first the eight corners of the base, by least squares on the
tipping of the rock in 36 directions (where gravity leaves the hull of the points within 4 mm of
the plane it rests on, and how far that hull reaches); then the 26 control values above it, by
bounded least squares (``scipy.optimize.least_squares``) on the bounds, volume, centre of mass
and inertia of the mesh. Small weights on the differences of
neighbouring control values chose a smooth solid among the many that fit. All were then rounded.

References
----------
Chen et al. (2024), Seismica 3(1). The mesh of the rock was published with it, in
github.com/DREAMS-lab/pbr_gazebo and github.com/ZhiangChen/virtual_shake_robot_pybullet.
"""

from __future__ import annotations

import math

import numpy as np

from vsr_core.arrays import Array, Indices
from vsr_core.surrogates.surrogate_site import bezier, closed_stack, polygon_radius

_HEIGHT = 1.5085  # m
_AROUND, _RINGS = 72, 60  # points of a ring, and rings, for which the constants were fitted

# Corners x, y of the polygon that the rock rests on [m], counter-clockwise, convex.
_BASE_POLYGON = (
    (0.075, -0.255),
    (0.055, 0.200),
    (-0.045, 0.205),
    (-0.385, 0.155),
    (-0.505, 0.035),
    (-0.480, -0.245),
    (-0.360, -0.325),
    (-0.020, -0.320),
)

# Control values of the Bezier curves in z / height, from the base to the top.
_CENTRE_X = (-0.215, -0.372, -0.106, 0.298, 0.319, -0.005)  # m; starts inside the base polygon
_CENTRE_Y = (-0.055, -0.117, -0.011, 0.076, 0.068, 0.039)  # m
_HALF_WIDTH_1 = (0.583, 0.444, 0.352, 0.400, 0.417, 0.318)  # m
_HALF_WIDTH_2 = (0.230, 0.243, 0.274, 0.316, 0.376, 0.473)  # m
_DIRECTION = (0.166, 0.006, -0.132)  # rad, of the first half-width from +x
_SQUARENESS = 3.0  # exponent of the superellipse; 2 is an ellipse
_TOP_SHARPNESS = 7.2  # larger closes later and flatter
_BASE_FRACTION = 0.3  # of the height, over which the base polygon turns into the superellipse

_RELIEF = 0.02  # amplitude of the longest wave of the surface relief, of the local radius
_RELIEF_WAVES = 24
_GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))


def _ring_angles(corners: Array) -> Array:
    """Ascending angles [rad], evenly spaced but for the nearest to each corner, moved onto it."""
    step = 2.0 * math.pi / _AROUND
    angles: Array = step * np.arange(_AROUND, dtype=np.float64)
    nearest = np.rint(corners / step).astype(int)
    angles[nearest % _AROUND] = corners - 2.0 * math.pi * (nearest // _AROUND)
    return angles


def _relief(angles: Array, s: Array) -> Array:
    """Relative change of the radius: plane waves of the unrolled surface, spread in direction."""
    relief = np.zeros(np.broadcast_shapes(angles.shape, s.shape))
    for j in range(_RELIEF_WAVES):
        waves = 3.0 + 0.5 * j  # around the rock; the height is 0.68 of the girth
        around = round(waves * math.cos(j * _GOLDEN_ANGLE))  # whole, to close around the axis
        along = 2.0 * math.pi * 0.68 * waves * math.sin(j * _GOLDEN_ANGLE)
        relief += 3.0 / waves * np.cos(around * angles + along * s + j * j)
    return _RELIEF * relief


def double_rock() -> tuple[Array, Indices]:
    """Closed surface of the stand-in for Double Rock.

    The surface cannot intersect itself. Every ring is star-shaped about its centre, with its
    points at the same ascending angles, and the rings lie at ascending heights. A horizontal cut
    between two rings meets the triangles in points at ascending angles about the point
    between the two centres, so every cut is a simple polygon; the base lies in one plane.

    Returns
    -------
    vertices : ndarray, shape (n, 3), float64
        Points [m], rounded to a micrometre; z up, the base on z = 0, the centre of mass over
        the origin.
    faces : ndarray, shape (m, 3), int64
        Indices of the corners of each triangle, counter-clockwise seen from outside.

    Examples
    --------
    >>> vertices, faces = double_rock()
    >>> vertices.shape, faces.shape
    ((4322, 3), (8640, 3))
    """
    # Heights close up towards the top, where the surface turns level.
    s = np.sin(0.5 * math.pi * np.arange(_RINGS) / _RINGS)[:, None]

    corners = np.array(_BASE_POLYGON) - (_CENTRE_X[0], _CENTRE_Y[0])
    corner_angles = np.arctan2(corners[:, 1], corners[:, 0]) % (2.0 * math.pi)
    angles = _ring_angles(corner_angles)
    turned = angles - bezier(_DIRECTION, s)
    superellipse = (
        np.abs(np.cos(turned) / bezier(_HALF_WIDTH_1, s)) ** _SQUARENESS
        + np.abs(np.sin(turned) / bezier(_HALF_WIDTH_2, s)) ** _SQUARENESS
    ) ** (-1.0 / _SQUARENESS)
    body = superellipse * np.sqrt(1.0 - s**_TOP_SHARPNESS) * (1.0 + _relief(angles, s))
    t = np.minimum(s / _BASE_FRACTION, 1.0)
    blend = t * t * (3.0 - 2.0 * t)
    radius = (1.0 - blend) * polygon_radius(angles, corners) + blend * body

    x = bezier(_CENTRE_X, s) + radius * np.cos(angles)
    y = bezier(_CENTRE_Y, s) + radius * np.sin(angles)
    z = np.broadcast_to(_HEIGHT * s, x.shape)
    bottom = (_CENTRE_X[0], _CENTRE_Y[0], 0.0)
    top = (_CENTRE_X[-1], _CENTRE_Y[-1], _HEIGHT)
    return closed_stack(np.stack([x, y, z], axis=-1), bottom, top)
