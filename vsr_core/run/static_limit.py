"""How strong shaking must be to move a rock at rest on a terrain."""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import linprog

from vsr_core import GRAVITY
from vsr_core.arrays import Array

WAYS = 8
"""Edges of the pyramid inside each friction cone."""

_UNBOUNDED = 3  # how SciPy says that walls hold the rock against any shaking

SAFE_SHARE = 0.9
"""Share of the range that is relied on: contacts of an engine are as exact as its tolerances."""


def still_range(
    points: Array, normals: Array, centre: Array, friction: float, along: Array
) -> tuple[float, float]:
    """Range of table accelerations (lowest, highest) [m/s^2] in which a rock at rest can stay.

    Contact forces that balance weight and inertia exist, each in its friction cone, if and only if
    a linear program has a solution (here with pyramids inside the cones, so for less). They form a
    convex set, so that the accelerations with a solution are an interval. Laws of rigid bodies with
    friction may have other motions besides rest from there on (Pang & Trinkle 2000), which is why
    runs are compared with and without this; see also ``bounds.still_range`` for level pedestals.

    Parameters
    ----------
    points, normals : ndarray, shape (k, 3) each [m] and [1], where the ground touches the rock, and
        the way in which it pushes
    centre : ndarray, shape (3,) [m], centre of mass
    friction : float
    along : ndarray, shape (3,), unit vector of the shaking

    Returns
    -------
    (float, float)
        ``SAFE_SHARE`` of the interval; (0, 0) if the rock does not even stand unshaken.
    """
    if not len(points):
        return 0.0, 0.0
    turn = 2.0 * math.pi * np.arange(WAYS) / WAYS
    first = np.cross(normals, np.where(np.abs(normals[:, :1]) < 0.9, [[1.0, 0, 0]], [[0, 1.0, 0]]))
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normals, first)
    sides = np.cos(turn)[:, None] * first[:, None] + np.sin(turn)[:, None] * second[:, None]
    edges = (normals[:, None] + friction * sides).reshape(-1, 3)
    levers = np.repeat(points - centre, WAYS, axis=0)
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
