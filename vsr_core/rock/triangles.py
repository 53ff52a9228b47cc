"""Triangles of a surface: their areas, the cells of a grid they reach into, which of them cross."""

from __future__ import annotations

import numpy as np

from vsr_core.arrays import Array, Indices, Mask

_CHUNK = 1 << 18  # faces handled at a time where that saves memory
_ROUNDING = 64.0 * np.finfo(np.float64).eps


def cross_products(vertices: Array, faces: Indices) -> Array:
    """Vector product of two sides of each face: its normal, twice its area long.

    Returns
    -------
    ndarray, shape (m, 3) [m^2]

    Examples
    --------
    >>> cross_products(np.eye(3), np.array([[0, 1, 2]])).tolist()
    [[1.0, 1.0, 1.0]]
    """
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def areas(vertices: Array, faces: Indices) -> Array:
    """Area of each face.

    Returns
    -------
    ndarray, shape (m,) [m^2]

    Examples
    --------
    >>> areas(2.0 * np.eye(3) * [1, 1, 0], np.array([[0, 1, 2]])).tolist()
    [2.0]
    """
    area = np.empty(len(faces))
    for chunk in chunks(len(faces)):
        area[chunk] = 0.5 * np.linalg.norm(cross_products(vertices, faces[chunk]), axis=1)
    return area


def chunks(count: int, size: int = _CHUNK) -> list[slice]:
    """Slices of many elements, to be handled one after the other where that saves memory.

    Examples
    --------
    >>> chunks(5, 3)
    [slice(0, 3, None), slice(3, 6, None)]
    """
    return [slice(first, first + size) for first in range(0, count, size)]


def of_no_face(number: int, faces: Indices) -> list[str]:
    """How many of so many vertices no face has, in words, as where faces were lost.

    Examples
    --------
    >>> of_no_face(4, np.array([[0, 1, 2]])), of_no_face(3, np.array([[0, 1, 2]]))
    (['1 of 4 vertices, which no face has, left out'], [])
    """
    alone = number - np.count_nonzero(np.bincount(faces.ravel(), minlength=number))
    return [f"{alone} of {number} vertices, which no face has, left out"] if alone else []


def cells_of_boxes(first: Indices, last: Indices) -> tuple[Indices, Indices]:
    """Cells of a regular grid that boxes reach into.

    Parameters
    ----------
    first, last : ndarray of int, shape (n, d), each box's cells with the least and greatest place

    Returns
    -------
    box : ndarray of int, shape (k,), ascending
    cell : ndarray of int, shape (k, d), place of a cell that this box reaches into

    Examples
    --------
    >>> box, cell = cells_of_boxes(np.array([[0, 0], [5, 5]]), np.array([[0, 1], [5, 5]]))
    >>> box.tolist(), cell.tolist()
    ([0, 0, 1], [[0, 0], [0, 1], [5, 5]])
    """
    spans = last - first + 1
    count = spans.prod(axis=1)
    box = np.repeat(np.arange(len(first)), count)
    rest = np.arange(len(box)) - np.repeat(np.cumsum(count) - count, count)
    cell = first[box]
    for axis in reversed(range(first.shape[1])):
        rest, within = np.divmod(rest, spans[box, axis])
        cell[:, axis] += within
    return box, cell


def self_intersections(vertices: Array, faces: Indices) -> Indices:
    """Pairs of faces that cross each other and share no vertex.

    Two triangles in general position cross if and only if an edge of one pierces the other
    (Moeller 1997). Candidates come from a uniform grid over the bounding boxes.

    Returns
    -------
    ndarray of int, shape (k, 2)
    """
    corners = vertices[faces]
    low, high = corners.min(axis=1), corners.max(axis=1)
    pairs = _overlapping(low, high)
    shared = (faces[pairs[:, 0], :, None] == faces[pairs[:, 1], None, :]).any(axis=(1, 2))
    pairs = pairs[~shared]
    crossing = np.zeros(len(pairs), dtype=bool)
    for one, other in ((0, 1), (1, 0)):
        edged, pierced = corners[pairs[:, one]], corners[pairs[:, other]]
        for k in range(3):
            crossing |= _pierces(edged[:, k], edged[:, (k + 1) % 3], pierced)
    return pairs[crossing]


def _overlapping(low: Array, high: Array) -> Indices:
    """Unique index pairs of boxes that overlap, found by the cells of a grid that they share."""
    size = 2.0 * float(np.median((high - low).max(axis=1)))
    first, last = (np.floor(end / size).astype(np.int64) for end in (low, high))
    box, cell = cells_of_boxes(first, last)
    order = np.lexsort(cell.T[::-1])  # boxes of one cell one after the other
    box, cell = box[order], cell[order]
    number = np.cumsum((np.diff(cell, axis=0, prepend=cell[:1]) != 0).any(axis=1))
    pairs = [np.empty(0, dtype=np.int64)]
    for ahead in range(1, int(np.bincount(number).max())):
        same = number[ahead:] == number[:-ahead]
        one, other = box[:-ahead][same], box[ahead:][same]
        apart = (low[one] > high[other]) | (low[other] > high[one])
        one, other = np.sort([one, other], axis=0)[:, ~apart.any(axis=1)]
        pairs.append(one * len(low) + other)
    return np.column_stack(np.divmod(np.unique(np.concatenate(pairs)), len(low)))


def _pierces(start: Array, end: Array, triangle: Array) -> Mask:
    """Whether segments pass strictly through the inside of triangles, pair by pair.

    An end within the rounding of the triangle's plane is in it: triangles of one plane do not
    cross.
    """
    a, b, c = triangle[:, 0], triangle[:, 1], triangle[:, 2]
    far = np.abs(np.stack([b - a, c - a, start - a, end - a])).max(axis=(0, 2))
    at = np.abs(np.stack([a, b, c, start, end])).max(axis=(0, 2))
    rounding = _ROUNDING * far**2 * np.maximum(far, at)

    def volume(a: Array, b: Array, c: Array, d: Array) -> Array:
        return np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a)

    one, other = volume(a, b, c, start), volume(a, b, c, end)
    across = (one * other < 0.0) & (np.minimum(np.abs(one), np.abs(other)) > rounding)
    sides = np.sign([volume(start, end, a, b), volume(start, end, b, c), volume(start, end, c, a)])
    return across & (np.abs(sides.sum(axis=0)) == 3)
