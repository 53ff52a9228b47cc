"""What the search for impulses asks of a point of contact."""

from __future__ import annotations

import math

from vsr_core.arrays import Array
from vsr_core.compiled.compiling import compiled
from vsr_core.compiled.vectors import cross
from vsr_core.engines.nonsmooth.body import Point

OPEN, GRIPS, SLIDES = 0, 1, 2
"""States of a point."""


@compiled
def excess(point: Point, k: int, velocity: Array) -> float:
    """Velocity of a point less the one wanted, along the normal or a tangent.

    Parameters
    ----------
    k : int, 0 along the normal, 1 and 2 along the tangents
    velocity : ndarray, shape (6,) [m/s] and [rad/s]

    Returns
    -------
    float [m/s]
    """
    rows = point.rows
    return (
        rows[k, 0] * velocity[0]
        + rows[k, 1] * velocity[1]
        + rows[k, 2] * velocity[2]
        + rows[k, 3] * velocity[3]
        + rows[k, 4] * velocity[4]
        + rows[k, 5] * velocity[5]
        - point.wanted[k]
    )


@compiled
def add_impulse(point: Point, share: float, velocity: Array) -> None:
    """Add to a velocity what a share of the impulse of a point does.

    Parameters
    ----------
    velocity : ndarray, shape (6,) [m/s] and [rad/s]
    """
    for k in range(3):
        p = share * point.impulse[k]
        for j in range(3):
            velocity[j] += p * point.rows[k, j]
            velocity[3 + j] += p * point.turning[k, j]


@compiled
def tangents(normal: Array, rows: Array) -> None:
    """Write a normal and two tangents into ``rows``; level ground has x and y.

    Parameters
    ----------
    normal : ndarray, shape (3,), unit vector
    rows : ndarray, shape (3, 6)
    """
    x, y, z = normal[0], normal[1], normal[2]
    rows[0, 0], rows[0, 1], rows[0, 2] = x, y, z
    if abs(x) < 0.9:
        size = math.sqrt(y * y + z * z)
        a, b, c = size, -x * y / size, -x * z / size
    else:
        size = math.sqrt(x * x + z * z)
        a, b, c = -x * y / size, size, -y * z / size
    rows[1, 0], rows[1, 1], rows[1, 2] = a, b, c
    rows[2, 0], rows[2, 1], rows[2, 2] = cross(x, y, z, a, b, c)
