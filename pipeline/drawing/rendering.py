"""What is seen of triangle meshes: a view without perspective and its depth buffer.

Plain arrays, so that a picture needs no graphics card and is the same everywhere. The view has no
perspective: a metre is as long in front as behind, and one scale bar holds for all of the picture.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import fast_simplification
import numpy as np

from vsr_core.arrays import Array, Indices, Mask

LATER = 1 << 31
"""Number of the first face of a mesh that is drawn onto another."""

_TICK = 1e-5
"""Depths are compared in whole ticks [m]."""

_FRAGMENTS = 2_000_000
"""Pixels of triangles that are drawn at once; more only need more memory."""

_EMPTY = np.iinfo(np.int64).min


@dataclass(frozen=True, eq=False)
class View:
    """Where the eye is and what its picture covers.

    Attributes
    ----------
    axes : ndarray, shape (3, 3), unit vectors to the right, up and towards the eye, as rows
    middle : ndarray, shape (3,) [m], point in the middle of the picture
    pixel : float [m], side of a pixel
    shape : (int, int), rows and columns
    """

    axes: Array
    middle: Array
    pixel: float
    shape: tuple[int, int]

    def project(self, points: Array) -> Array:
        """Column, row [pixel] from the upper left corner and depth [m] to the eye, (..., 3)."""
        # Not ``@``: on a busy machine its threads wait for each other, many times as long.
        placed = np.einsum("...j,ij->...i", points - self.middle, self.axes)
        right, up, depth = np.moveaxis(placed, -1, 0)
        rows, columns = self.shape
        return np.stack(
            [0.5 * columns + right / self.pixel, 0.5 * rows - up / self.pixel, depth], axis=-1
        )

    def points(self, pixels: Indices, depths: Array) -> Array:
        """Points, shape (n, 3) [m], in the middle of pixels (numbered row by row) at depths."""
        rows, columns = self.shape
        right = (pixels % columns + 0.5 - 0.5 * columns) * self.pixel
        up = (0.5 * rows - 0.5 - pixels // columns) * self.pixel
        placed = np.stack([right, up, depths], axis=-1)
        return np.einsum("ni,ij->nj", placed, self.axes) + self.middle


def axes_of(azimuth: float, elevation: float) -> Array:
    """Axes of a view from where the eye stands.

    Parameters
    ----------
    azimuth : float [rad], of the eye seen from the scene, counter-clockwise from +x
    elevation : float [rad], of the eye above the horizon, less than a right angle

    Returns
    -------
    ndarray, shape (3, 3), as ``View.axes``; the vertical is upright in the picture
    """
    level = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    eye = np.cos(elevation) * level + np.array([0.0, 0.0, np.sin(elevation)])
    right = np.array([-level[1], level[0], 0.0])
    return np.stack([right, np.cross(eye, right), eye])


def fitted(axes: Array, points: Array, shape: tuple[int, int], margin: float = 0.0) -> View:
    """View along ``axes`` in which all points lie within the picture less a margin.

    Parameters
    ----------
    axes : ndarray, shape (3, 3), see ``axes_of``
    points : ndarray, shape (n, 3) [m]
    shape : (int, int), rows and columns
    margin : float, share of the picture's lesser side that stays free on every side

    Returns
    -------
    View
    """
    placed = points @ axes.T
    low, high = placed.min(axis=0), placed.max(axis=0)
    free = 2.0 * margin * min(shape)
    pixel = max((high[0] - low[0]) / (shape[1] - free), (high[1] - low[1]) / (shape[0] - free))
    return View(axes, 0.5 * (low + high) @ axes, float(pixel), shape)


def drawn(view: View, vertices: Array, faces: Indices, onto: Indices | None = None) -> Indices:
    """Depth buffer of a mesh: for each pixel the depth and the face nearest to the eye.

    Faces that look away from the eye are left out.

    Parameters
    ----------
    view : View
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
    """Pixels of a buffer that show a face, shape (n,)."""
    return np.flatnonzero(buffer != _EMPTY)


def faces_of(buffer: Indices) -> Indices:
    """Faces that pixels of a buffer show, of its shape."""
    return buffer & 0xFFFFFFFF


def depths_of(buffer: Indices) -> Array:
    """Depths [m] towards the eye, of the shape of the buffer; far behind where there is nothing."""
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


def thinned(vertices: Array, faces: Indices, most: int) -> tuple[Array, Indices]:
    """Surface of about ``most`` faces at the most, as near to the given one as so few can be.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3) [m]
    faces : ndarray of int, shape (m, 3)
    most : int

    Returns
    -------
    vertices, faces : ndarray, shape (k, 3) [m] and (j, 3)
    """
    if len(faces) <= most:
        return vertices, faces
    vertices, faces = fast_simplification.simplify(vertices, faces, target_count=most)
    return vertices.astype(np.float64), faces.astype(np.int64)


def reach(path: Array, radius: float) -> Array:
    """Points, shape (6 n, 3) [m], that span a rock of a radius [m] along its path, (n, 3) [m]."""
    return np.concatenate([path + radius * side for side in (*np.eye(3), *-np.eye(3))])


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


def in_sight(view: View, buffer: Indices, points: Array) -> Mask:
    """Find the points that a mesh does not hide.

    Parameters
    ----------
    view : View
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


def round_number(value: float) -> float:
    """Largest of 1, 2 and 5 times a power of ten that is not above ``value``.

    Examples
    --------
    >>> round_number(73.0), round_number(0.021)
    (50.0, 0.02)
    """
    power = 10.0 ** math.floor(math.log10(value))
    return power * max(step for step in (1.0, 2.0, 5.0) if step * power <= value * (1.0 + 1e-9))


def contour_step(points: Array) -> float:
    """Height between two contours [m] for a picture of points, shape (n, 3) [m]."""
    return round_number(0.06 * float(np.ptp(points, axis=0).max()))
