"""What the compiled engine knows of a rock, its contact, its state and its points of contact.

All is told in SI units per unit mass of the rock, in the table's axes or, where it says so, in the
rock's principal axes. Records keep what belongs together in one piece of memory, so that a step
allocates nothing and functions are handed few things.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Annotated, NamedTuple, TypeAlias

import numpy as np

from vsr_core.arrays import Array, matrix_product
from vsr_core.compiled.compiling import compiled
from vsr_core.compiled.records import Matrix, Records, Twist, Vector
from vsr_core.compiled.vectors import cross
from vsr_core.rock.body import Hull, Rock, convex_hull, corners
from vsr_core.scene import Contact


class Stepping(NamedTuple):
    """How a rock is stepped.

    Attributes
    ----------
    interval : float [s], time step
    gravity : float [m/s^2]
    rounds : int, in the search for the impulses, at most
    residual : float, error of a velocity by them, as a share of what gravity adds in a step
    """

    interval: float
    gravity: float
    rounds: int
    residual: float


class Body(NamedTuple):
    """A rock and its contact.

    Attributes
    ----------
    points : ndarray, shape (n, 3) [m], corners in principal axes of its hull, or on a terrain of
        its pieces; none of a sphere
    moments : ndarray, shape (3,) [m^2], principal moments of inertia
    flexibility : ndarray, shape (3,) [m^-2], their inverses
    radius : float [m], largest distance of a corner from the centre of mass
    returned : float, share of the energy taken by an impact that it may give back
    slow : float, approach speed of what lands slowly, by what gravity adds in a step
    """

    points: Array
    moments: Array
    flexibility: Array
    radius: float
    friction: float
    restitution: float
    returned: float
    slow: float


SLOW_ON_LEVEL, SLOW_ON_TERRAIN = 0.1, 0.7
"""``Body.slow``. A slender rock lands slowly, and its impacts are as exact as others down to
there; a rock on rough ground, which rattles on a few points, comes to rest."""


class RockState:
    """State of a rock between two steps, and room for what a step computes."""

    place: Vector  # m, of the centre of mass, in the middle of the step to come
    quaternion: Annotated[Array, (4,)]  # w x y z, takes principal axes to the table's, then too
    rotation: Matrix  # the same
    velocity: Twist  # m/s and rad/s, of the centre of mass and angular, now
    momentum: Vector  # m^2/s, angular momentum about the centre of mass, now
    before: Twist  # velocity before the step
    free: Twist  # velocity after it without the impulses to be found
    turning: Vector  # rad/s, the last three of it, before any impulse
    approach: Twist  # velocity just before the first point lands
    lost: Twist  # velocity after an impact without rebound, and
    set_aside: Annotated[Array, (2, 6)]  # ``free`` and ``velocity``, while it is looked for
    middle: Matrix  # rotation half-way along the path of the step
    inertia: Matrix  # m^2, half-way along it
    flexibility: Matrix  # m^-2, its inverse
    push: Vector  # m/s^2, gravity less the acceleration of the table, in the step
    system: Annotated[Array, (6, 6)]  # equations for the velocity, and
    right: Twist  # their right side, then their solution
    taken: float  # m^2/s^2, energy that rebounds of the next step may give back
    reserve: float  # m, path that corners may take before the near ones are found anew
    found: int  # points given by the shape of the ground
    near: int  # corners that it may reach
    active: int  # points that bear the rock in this step
    kept: int  # and in the one before
    hard: int  # steps whose impulses were not found at once
    unsolved: int  # or not at all


class Point:
    """A point at which a rock may touch in a step."""

    key: int  # by which the point is known in the next step
    lever: Vector  # m, from the centre of mass
    normal: Vector  # unit vector out of the ground
    gap: float  # m, before the step
    bend: Vector  # m, path of the point by the curvature of a turn
    rows: Annotated[Array, (3, 6)]  # its velocity, along normal and tangents, by that of the rock
    turning: Matrix  # 1/m, change of the angular velocity by an impulse
    follows: float  # ``bend`` by which it moves on, having left, or else does not leave
    base: Vector  # m/s, velocity that a contact leads to, but for ``bend``
    wanted: Vector  # m/s, velocity that it leads to
    impulse: Vector  # m/s, along normal and tangents
    given: Vector  # m/s, impulse of before a landing, which is no longer changed
    mass: Twist  # 1, change of the point's velocity by an impulse: upper triangle
    trial: Vector  # room for the search for the impulse, and
    saved: Vector  # m/s, impulse to go back to
    set_aside: Vector  # m/s, impulse, while a rebound is judged
    leaving: float  # m/s, speed at which an impact is to throw the point back
    after: float  # share of the step that is left after it
    rebound: float  # m/s, speed at which the point is to leave in the next step
    state: int  # open, grips or slides
    is_active: int
    active: int  # at place n: the n-th active point; likewise
    near: int  # the n-th near corner
    kept_key: int  # and of the n-th active one of the step before key, impulse, rebound
    kept_impulse: Vector
    kept_rebound: float
    kept_after: float  # and share of that step that was left after it landed


STRAIGHT_SHARE = 1e-5
"""Distance of a vertex from the line between two others at which it is left out, as a share of the
radius."""

Points: TypeAlias = Records[Point]


def body(rock: Rock, contact: Contact, *, on_level: bool) -> Body:
    """A rock and its contact as the engine takes them.

    Parameters
    ----------
    on_level : bool, whether the ground is level, or a terrain
    """
    moments = np.ascontiguousarray(rock.inertia / rock.mass)
    points = np.empty((0, 3))
    if rock.shape != "sphere":
        points = matrix_product(corners_of(rock), rock.axes)
    if rock.pieces and not on_level:
        points = np.concatenate(pieces_of(rock))
    return Body(
        np.ascontiguousarray(points),
        moments,
        1.0 / moments,
        rock.radius,
        contact.friction,
        contact.restitution,
        contact.restitution**2 if contact.energetic else 1.0,
        SLOW_ON_LEVEL if on_level else SLOW_ON_TERRAIN,
    )


@lru_cache(maxsize=8)
def corners_of(rock: Rock) -> Array:
    """Corners of a rock's hull, without those that lie between others.

    Returns
    -------
    ndarray, shape (n, 3) [m], in its own axes
    """
    return _corners(rock.hull, rock.radius)


@lru_cache(maxsize=8)
def pieces_of(rock: Rock) -> tuple[Array, ...]:
    """Corners of a rock's pieces, each of shape (n, 3) [m], in principal axes, likewise."""
    middles = [piece.mean(axis=0) for piece in rock.pieces]
    hulls = [convex_hull(piece - at) for piece, at in zip(rock.pieces, middles, strict=True)]
    found = [at + _corners(hull, rock.radius) for at, hull in zip(middles, hulls, strict=True)]
    return tuple(matrix_product(piece, rock.axes) for piece in found)


def _corners(hull: Hull, radius: float) -> Array:
    return hull.vertices[corners(hull, STRAIGHT_SHARE * radius)]


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
