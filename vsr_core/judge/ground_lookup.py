"""Where the ground lies above a point, in compiled code."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from vsr_core.arrays import Array, Indices
from vsr_core.compiled.compiling import compiled
from vsr_core.terrain.surface import Terrain

OUTSIDE = -1.0
"""In the place of a depth: no ground is below or above."""


class Lookup(NamedTuple):
    """Triangles of a terrain by the cells of a grid in the plane.

    Attributes
    ----------
    triangles : ndarray, shape (m, 3, 3) [m]
    origin : ndarray, shape (2,) [m]
    cell : float [m]
    columns, rows : int, cells along x and y
    first : ndarray of int, shape (cells + 1,), where those of each cell begin in ``around``
    around : ndarray of int, shape (k,), triangles
    """

    triangles: Array
    origin: Array
    cell: float
    columns: int
    rows: int
    first: Indices
    around: Indices


@lru_cache(maxsize=4)
def lookup(terrain: Terrain) -> Lookup:
    """Triangles of a terrain by place."""
    grid = terrain.lookup
    return Lookup(
        np.ascontiguousarray(terrain.vertices[terrain.faces]),
        np.ascontiguousarray(grid.origin),
        grid.cell,
        *grid.shape,
        grid.first,
        grid.box,
    )


@compiled
def depth(ground: Lookup, x: float, y: float, z: float) -> float:
    """How far a point is below the ground, as ``Terrain.depth`` tells it.

    Parameters
    ----------
    x, y, z : float [m]

    Returns
    -------
    float [m], 0 above the ground; ``OUTSIDE`` beyond its border
    """
    i = math.floor((x - ground.origin[0]) / ground.cell)
    j = math.floor((y - ground.origin[1]) / ground.cell)
    if not (0 <= i < ground.columns and 0 <= j < ground.rows):
        return OUTSIDE
    cell = i * ground.rows + j
    known, nearest, buried = False, math.inf, False
    for at in range(ground.first[cell], ground.first[cell + 1]):
        height, area = _meets(ground.triangles[ground.around[at]], x, y)
        if area == 0.0:
            continue
        known = True
        if z <= height < nearest:
            nearest, buried = height, area > 0.0
    if not known:
        return OUTSIDE
    return nearest - z if buried else 0.0


@compiled
def _meets(corners: Array, x: float, y: float) -> tuple[float, float]:
    """Height at which a vertical meets a triangle, and twice its area in the plane; 0 if not."""
    total = above = 0.0
    left = right = False
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        part = (corners[i, 0] - x) * (corners[j, 1] - y) - (corners[j, 0] - x) * (corners[i, 1] - y)
        left = left or part > 0.0
        right = right or part < 0.0
        total += part
        above += part * corners[k, 2]
    if (left and right) or total == 0.0:
        return 0.0, 0.0
    return above / total, total
