"""Closed solids that are stacks of horizontal rings, and the curves that shape them."""

from __future__ import annotations

import math

import numpy as np

from vsr_core.arrays import Array, Indices


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
