"""How strong shaking must be to move a rock at rest, wherever it has come to rest.

For the pose in which a rock is set on a flat pedestal see ``proofs.static_limits``.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.judge import proofs
from vsr_core.rock.body import Rock, convex_hull
from vsr_core.rock.tipping import settle
from vsr_core.scene import Contact

CONE_EDGES = 8
"""Edges of the pyramid inside each friction cone."""

_UNBOUNDED = 3  # how SciPy says that walls hold the rock against any shaking

STANDING_TURN = 3e-3
"""Largest turn [rad] of a rock at rest from the face that it stands on."""

SAFE_SHARE = 0.9
"""Share of the range that is relied on: contacts of an engine are as exact as its tolerances."""


def on_points(
    points: Array, normals: Array, centre: Array, friction: float, along: Array
) -> tuple[float, float]:
    """Range of table accelerations (lowest, highest) [m/s^2] in which a rock at rest can stay.

    Contact forces that balance weight and inertia exist, each in its friction cone, if and only if
    a linear program has a solution (here with pyramids inside the cones, so for less). They form a
    convex set, so that the accelerations with a solution are an interval. Laws of rigid bodies with
    friction may have other motions besides rest from there on (Pang & Trinkle 2000), which is why
    runs are compared with and without this; see also ``proofs.static_limits`` for level pedestals.

    Parameters
    ----------
    points, normals : ndarray, shape (k, 3) each [m] and [1], where the ground touches the rock, and
        the direction in which it pushes
    centre : ndarray, shape (3,) [m], centre of mass
    along : ndarray, shape (3,), unit vector of the shaking

    Returns
    -------
    (float, float)
        ``SAFE_SHARE`` of the interval; (0, 0) if the rock does not even stand unshaken.
    """
    if not len(points):
        return 0.0, 0.0
    turn = 2.0 * math.pi * np.arange(CONE_EDGES) / CONE_EDGES
    first = np.cross(normals, np.where(np.abs(normals[:, :1]) < 0.9, [[1.0, 0, 0]], [[0, 1.0, 0]]))
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normals, first)
    sides = np.cos(turn)[:, None] * first[:, None] + np.sin(turn)[:, None] * second[:, None]
    edges = (normals[:, None] + friction * sides).reshape(-1, 3)
    levers = np.repeat(points - centre, CONE_EDGES, axis=0)
    forces = np.column_stack([edges.T, -along])
    moments = np.column_stack([np.cross(levers, edges).T, np.zeros(3)])
    balance = np.array([0.0, 0.0, GRAVITY, 0.0, 0.0, 0.0])
    limits = [(0.0, None)] * len(edges) + [(None, None)]
    found = []
    for sign in (1.0, -1.0):
        aim = np.append(np.zeros(len(edges)), sign)
        result = linprog(aim, A_eq=np.vstack([forces, moments]), b_eq=balance, bounds=limits)
        if result.status not in (0, _UNBOUNDED):
            return 0.0, 0.0
        value = -sign * math.inf if result.status == _UNBOUNDED else float(result.x[-1])
        found.append(SAFE_SHARE * value)
    lowest, highest = found
    return (lowest, highest) if lowest < 0.0 < highest else (0.0, 0.0)


def as_it_stands(rock: Rock, contact: Contact, rotation: Array) -> tuple[float, float]:
    """Range of table accelerations (lowest, highest) [m/s^2] in which a rock at rest stays so.

    Parameters
    ----------
    rotation : ndarray, shape (3, 3), takes its rest pose to the pose in which it stands, perhaps on
        another face; the range is that of a pose equal to a thousandth and to a degree of yaw

    Returns
    -------
    (float, float)
        (0, 0) if it stands on no face in that pose.
    """
    heading = rotation @ _upright(rotation[2]).T
    yaw = round(math.degrees(math.atan2(heading[1, 0], heading[0, 0])))
    up = tuple(np.round(rotation[2], 3).tolist())
    return _standing(rock, contact, up, yaw)


def _upright(up: Array) -> Array:
    """Smallest rotation, shape (3, 3), that takes a direction of the rock, shape (3,), upward."""
    axis = np.cross(up, [0.0, 0.0, 1.0])
    sine = float(np.linalg.norm(axis))
    angle = math.atan2(sine, float(up[2]))
    return Rotation.from_rotvec(axis * (angle / sine if sine else 0.0)).as_matrix()


@lru_cache(maxsize=1024)
def _standing(
    rock: Rock, contact: Contact, up: tuple[float, float, float], degrees: int
) -> tuple[float, float]:
    """``proofs.static_limits`` of a rock standing with ``up`` upward, turned by whole degrees."""
    hull = convex_hull(rock.vertices @ _upright(np.array(up)).T)
    try:
        settled, _ = settle(hull, STANDING_TURN)
    except InvalidInput:
        return 0.0, 0.0
    standing = replace(rock, vertices=hull.turned(settled).vertices)
    return proofs.static_limits(standing, contact, math.radians(degrees))
