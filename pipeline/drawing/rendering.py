"""Triangle meshes in pictures and pages: a depth buffer without a graphics card, and packed arrays.

Plain arrays, so that a picture is the same everywhere.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Iterator
from itertools import product
from typing import Any

import fast_simplification
import numpy as np

from pipeline.drawing.view import View, axes_of, fitted, reach
from vsr_core.arrays import Array, Indices, Mask

LATER = 1 << 31
"""Number of the first face of a mesh that is drawn onto another."""

_TICK = 1e-5
"""Depths are compared in whole ticks [m]."""

_FRAGMENTS = 2_000_000
"""Pixels of triangles that are drawn at once; more only need more memory."""

_EMPTY = np.iinfo(np.int64).min


def drawn(view: View, vertices: Array, faces: Indices, onto: Indices | None = None) -> Indices:
    """Depth buffer of a mesh: for each pixel the depth and the face nearest to the eye.

    Faces that look away from the eye are left out.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3) [m]
    faces : ndarray of int, shape (m, 3), counter-clockwise from outside
    onto : ndarray, shape (pixels,), optional
        Buffer of a mesh drawn before, which stays as it is. The faces of this mesh then count
        from ``LATER``.

    Returns
    -------
    ndarray of int64, shape (pixels,), row by row; see ``seen``, ``faces_of`` and ``depths_of``
    """
    corners = view.project(vertices)[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing = np.flatnonzero(normal[:, 2] < 0.0)  # rows run downwards
    buffer = np.full(view.shape[0] * view.shape[1], _EMPTY) if onto is None else onto.copy()
    names = facing if onto is None else facing + LATER
    slope = -normal[facing, :2] / normal[facing, 2:]  # change of depth [m] a column and a row
    for pixels, triangle, depth in _fragments(corners[facing], slope, view.shape):
        key = (np.rint(depth / _TICK).astype(np.int64) << 32) + names[triangle]
        np.maximum.at(buffer, pixels, key)
    return buffer


def seen(buffer: Indices) -> Indices:
    """Pixels that show a face.

    Returns
    -------
    ndarray of int, shape (n,)
    """
    return np.flatnonzero(buffer != _EMPTY)


def faces_of(buffer: Indices) -> Indices:
    """Faces that pixels show.

    Parameters
    ----------
    buffer : ndarray of int64, as ``drawn`` gives it, or some of its pixels
    """
    return buffer & 0xFFFFFFFF


def depths_of(buffer: Indices) -> Array:
    """Depths that pixels show, towards the eye.

    Parameters
    ----------
    buffer : ndarray of int64, as ``drawn`` gives it, or some of its pixels

    Returns
    -------
    ndarray [m], of its shape; far behind where there is nothing
    """
    return (buffer >> 32).astype(np.float64) * _TICK


def _fragments(
    corners: Array, slope: Array, shape: tuple[int, int]
) -> Iterator[tuple[Indices, Indices, Array]]:
    """Pixels whose middle is in a triangle, the triangle and its depth there, a part at a time.

    Triangles are cut into rows and rows into pixels, so that no pixel is tried in vain.
    """
    rows, columns = shape
    across, down, depth = np.moveaxis(corners, -1, 0)
    top, bottom = _between(down.min(axis=1), down.max(axis=1), rows)
    triangle, row = _expanded(top, bottom)
    left, right = np.full(len(row), -np.inf), np.full(len(row), np.inf)
    for here, there in ((0, 1), (1, 2), (2, 0)):  # a side that runs downwards is on the left
        fall = (down[:, there] - down[:, here])[triangle]
        run = (across[:, there] - across[:, here])[triangle]
        with np.errstate(divide="ignore", invalid="ignore"):
            at = across[triangle, here] + (row + 0.5 - down[triangle, here]) * run / fall
        left = np.where(fall > 0.0, np.maximum(left, at), left)
        right = np.where(fall < 0.0, np.minimum(right, at), right)
    start, end = _between(left, right, columns)
    part = np.cumsum(np.maximum(end - start, 0)) // _FRAGMENTS
    for some in np.split(np.arange(len(row)), np.flatnonzero(np.diff(part)) + 1):
        which, column = _expanded(start[some], end[some])
        line, face = row[some][which], triangle[some][which]
        aside, below = column + 0.5 - across[face, 0], line + 0.5 - down[face, 0]
        height = depth[face, 0] + slope[face, 0] * aside + slope[face, 1] * below
        yield line * columns + column, face, height


def _between(low: Array, high: Array, count: int) -> tuple[Indices, Indices]:
    """First pixel whose middle lies from ``low`` to ``high``, and the one after the last."""
    ends = np.stack([np.ceil(low - 0.5), np.floor(high + 0.5)])
    start, end = np.clip(ends, 0, count).astype(np.int64)
    return start, end


def _expanded(start: Indices, end: Indices) -> tuple[Indices, Indices]:
    """All whole numbers from each start to before its end: whose they are, and they."""
    count = np.maximum(end - start, 0)
    owner = np.repeat(np.arange(len(count)), count)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(count) - count - start, count)


def in_sight(view: View, buffer: Indices, points: Array) -> Mask:
    """Find the points that a mesh does not hide.

    Parameters
    ----------
    buffer : ndarray, shape (pixels,), of the mesh, as ``drawn`` in the view
    points : ndarray, shape (n, 3) [m]

    Returns
    -------
    ndarray of bool, shape (n,), False for what lies beside the picture
    """
    column, row, depth = np.moveaxis(view.project(points), -1, 0)
    rows, columns = view.shape
    inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    pixel = np.where(inside, row.astype(np.int64) * columns + column.astype(np.int64), 0)
    visible: Mask = inside & (depth >= depths_of(buffer[pixel]))
    return visible


def thinned(vertices: Array, faces: Indices, most: int) -> tuple[Array, Indices]:
    """Surface of about ``most`` faces at the most, as near to the given one as so few can be.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3) [m]
    faces : ndarray of int, shape (m, 3)

    Returns
    -------
    vertices, faces : ndarray, shape (k, 3) [m] and (j, 3)
    """
    if len(faces) <= most:
        return vertices, faces
    vertices, faces = fast_simplification.simplify(vertices, faces, target_count=most)
    return vertices.astype(np.float64), faces.astype(np.int64)


def clearest(
    ground: tuple[Array, Indices], path: Array, radius: float, along: Array
) -> tuple[float, float]:
    """Where the eye sees most of a path over the ground, across its direction if possible.

    Parameters
    ----------
    ground : vertices (n, 3) [m] and faces (m, 3)
    path : ndarray, shape (n, 3) [m], points to see
    radius : float [m], of the rock
    along : ndarray, shape (2,), level direction that is to run to the right in the picture

    Returns
    -------
    azimuth, elevation : float [rad], see ``axes_of``
    """
    vertices, faces = thinned(*ground, 8_000)
    across = math.atan2(along[1], along[0]) - 0.5 * math.pi
    best, found = -np.inf, (across, 0.0)
    for turn, elevation in product((0, 25, -25, 180, 205, 155), (22, 32, 45)):
        place = across + math.radians(turn), math.radians(elevation)
        view = fitted(axes_of(*place), reach(path, radius), (180, 320), 0.1)
        share = float(in_sight(view, drawn(view, vertices, faces), path).mean())
        # As much hidden of the path as this is borne for the preferred side and a low eye.
        worth = share - 0.04 * (turn > 90) - 0.01 * (turn % 180 != 0) - 0.001 * elevation
        if worth > best:
            best, found = worth, place
    return found


def packed(values: Any, kind: str) -> str:
    """Numbers as text, of which a script makes a typed array.

    Parameters
    ----------
    kind : str, as NumPy names types, such as "<f4"

    Examples
    --------
    >>> packed([1.0, 2.0], "<u2")
    'AQACAA=='
    """
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode()


def packed_mesh(vertices: Array, faces: Indices) -> dict[str, str]:
    """A surface as text.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3) [m]
    faces : ndarray of int, shape (m, 3)
    """
    return {"vertices": packed(vertices, "<f4"), "faces": packed(faces, "<u4")}
