"""Ground and rocks under a sky and one sun, with their shadows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from trimesh import triangles
from trimesh.util import unitize

from pipeline.drawing.rendering import LATER, depths_of, drawn, faces_of, seen
from pipeline.drawing.view import View, fitted
from vsr_core.arrays import Array, Indices, Mask

Floats = NDArray[np.floating[Any]]
"""Single in pictures: half the memory."""

GROUND = np.array([0.90, 0.875, 0.82])
CONTOUR = np.float32(0.65)
"""Share of the light on a contour."""

OUTLINE = np.array([0.13, 0.11, 0.10])
SKY = np.array([0.52, 0.54, 0.58])
SUN = np.array([0.66, 0.64, 0.58])
"""Light of the sky on a level face, and of the sun on a face towards it."""

_BLOCK = 100_000  # pixels looked at together: what stays in the cache is twice as fast


@dataclass(frozen=True, eq=False)
class Backdrop:
    """Ground as the eye and the sun see it, on which rocks are painted.

    Attributes
    ----------
    picture : ndarray, shape (pixels, 3), 0 to 1, without rocks
    pixels : ndarray of int, shape (n,), of the picture that show ground
    dark : ndarray, shape (n, 3), their colours where the sun does not reach
    sun_pixels, sun_depths : ndarray, shape (n,), where the sun sees what they show, its depth [m]
    """

    view: View
    sun: View
    seen: Indices
    sunlit: Indices
    picture: Floats
    pixels: Indices
    dark: Floats
    sun_pixels: Indices
    sun_depths: Array


def backdrop(
    view: View, sun_axes: Array, ground: tuple[Array, Indices], reach: Array, contour: float
) -> Backdrop:
    """Draw the ground.

    Parameters
    ----------
    sun_axes : ndarray, shape (3, 3), see ``axes_of``
    ground : vertices (n, 3) [m] and faces (m, 3)
    reach : ndarray, shape (k, 3) [m], points between which the rocks move
    contour : float [m], height between two contours
    """
    vertices, faces = ground
    buffer = drawn(view, vertices, faces)
    pixels = seen(buffer)
    some = pixels[::37]  # in no step with the rows: from all over the picture
    lighted = np.concatenate([view.points(some, depths_of(buffer[some])), reach])
    sun = fitted(sun_axes, lighted, (max(view.shape), max(view.shape)), 0.03)
    sunlit = drawn(sun, vertices, faces)
    normal = normals(vertices, faces)
    level = np.full(buffer.size, np.iinfo(np.int64).min)
    picture = np.ones((buffer.size, 3), dtype=np.float32)
    dark = np.empty((len(pixels), 3), dtype=np.float32)
    sun_pixels, sun_depths = np.empty(len(pixels), dtype=np.int64), np.empty(len(pixels))
    for start in range(0, len(pixels), _BLOCK):
        block = slice(start, start + _BLOCK)
        shown = pixels[block]
        points = view.points(shown, depths_of(buffer[shown]))
        facing = normal[faces_of(buffer[shown])]
        sun_pixels[block], sun_depths[block] = _towards(sun, points, facing)
        lit = sun_depths[block] >= depths_of(sunlit[sun_pixels[block]])
        picture[shown] = _shaded(GROUND, facing, sun.axes[2] * lit[:, None])
        dark[block] = _shaded(GROUND, facing, np.zeros(3))
        # Half a step off, for a contour at the level of a flat pedestal would cover it.
        level[shown] = np.floor(points[:, 2] / contour + 0.5)
    line = _borders(level.reshape(view.shape)).reshape(-1)
    picture[line] *= CONTOUR
    dark[line[pixels]] *= CONTOUR
    return Backdrop(view, sun, buffer, sunlit, picture, pixels, dark, sun_pixels, sun_depths)


def painted(behind: Backdrop, poses: Array, faces: Indices, colours: Array) -> Floats:
    """Draw poses of a rock on the ground.

    Parameters
    ----------
    poses : ndarray, shape (poses, n, 3) [m], vertices of the rock
    faces : ndarray of int, shape (m, 3), of the rock
    colours : ndarray, shape (poses, 3), 0 to 1

    Returns
    -------
    ndarray, shape (rows, columns, 3), 0 to 1
    """
    view, sun = behind.view, behind.sun
    corners = poses.reshape(-1, 3)
    copies = (faces + poses.shape[1] * np.arange(len(poses))[:, None, None]).reshape(-1, 3)
    buffer = drawn(view, corners, copies, behind.seen)
    sunlit = drawn(sun, corners, copies, behind.sunlit)
    picture = behind.picture.copy()
    below = np.flatnonzero((sunlit != behind.sunlit)[behind.sun_pixels])
    shadow = below[behind.sun_depths[below] < depths_of(sunlit[behind.sun_pixels[below]])]
    picture[behind.pixels[shadow]] = behind.dark[shadow]
    pixels = np.flatnonzero(buffer != behind.seen)
    face = faces_of(buffer[pixels]) - LATER
    normal = normals(corners, copies)[face]
    points = view.points(pixels, depths_of(buffer[pixels]))
    sun_pixels, sun_depths = _towards(sun, points, normal)
    lit = sun_depths >= depths_of(sunlit[sun_pixels])
    owner = face // len(faces)
    picture[pixels] = _shaded(colours[owner], normal, sun.axes[2] * lit[:, None])
    label = np.full(view.shape, -1).reshape(-1)
    label[pixels] = owner
    picture[_borders(label.reshape(view.shape)).reshape(-1)] = OUTLINE
    return picture.reshape(*view.shape, 3)


def _towards(sun: View, points: Array, normal: Array) -> tuple[Indices, Array]:
    """Pixels in which the sun looks for points of surfaces, and their depths there [m].

    The points are moved off their surface by what a pixel errs: no face shades itself.
    """
    column, row, depth = np.moveaxis(sun.project(points + 2.0 * sun.pixel * normal), -1, 0)
    rows, columns = sun.shape
    row = np.clip(row.astype(np.int64), 0, rows - 1)
    return row * columns + np.clip(column.astype(np.int64), 0, columns - 1), depth


def _shaded(colour: Array, normal: Array, sun: Array) -> Array:
    """Colours under sky and sun, (n, 3), from their own; the sun's direction is zero in shadow."""
    sky = 0.65 + 0.35 * normal[:, 2:]
    direct = np.clip((normal * sun).sum(axis=1, keepdims=True), 0.0, 1.0)
    return np.clip(colour * (sky * SKY + direct * SUN), 0.0, 1.0)


def normals(vertices: Array, faces: Indices) -> Array:
    """Unit normals of faces.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3)
    faces : ndarray of int, shape (m, 3), counter-clockwise from outside

    Returns
    -------
    ndarray, shape (m, 3), zero for a face without area

    Examples
    --------
    >>> normals(np.array([[0.0, 0, 0], [0, 2, 0], [0, 0, 2]]), np.array([[0, 1, 2]])) == [1, 0, 0]
    array([[ True,  True,  True]])
    """
    normal: Array = unitize(triangles.cross(vertices[faces]))
    return normal


def _borders(labels: Indices) -> Mask:
    """Pixels whose label differs from the one to the right or below, shape (rows, columns)."""
    found = np.zeros(labels.shape, dtype=bool)
    found[:, :-1] |= labels[:, 1:] != labels[:, :-1]
    found[:-1] |= labels[1:] != labels[:-1]
    return found


def smaller(picture: Floats, factor: int) -> Floats:
    """Merge squares of pixels, for smooth edges.

    Parameters
    ----------
    picture : ndarray, shape (rows, columns, 3)
    factor : int, side of a square, a divisor of rows and columns

    Returns
    -------
    ndarray, shape (rows / factor, columns / factor, 3), means of the squares

    Examples
    --------
    >>> smaller(np.array([[0.0, 1.0], [2.0, 3.0]])[..., None], 2).tolist()
    [[[1.5]]]
    """
    parts = [picture[i::factor, j::factor] for i in range(factor) for j in range(factor)]
    total: Floats = np.add.reduce(parts)  # several times as fast as a mean over two axes
    return total / np.float32(factor**2)
