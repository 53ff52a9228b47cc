"""How the faces of a triangle mesh hang together: edges, pieces, rims. Arrays only, no loops.

A *rim* is a closed chain of open edges, in the order in which the faces beside it run along it:
the surface lies to its left, seen from outside.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from vsr_core.arrays import Indices, Mask
from vsr_core.errors import InvalidInput


@dataclass(frozen=True)
class Edges:
    """The sides of all faces, equal ones beside each other.

    Attributes
    ----------
    side : ndarray of int, shape (3 m,), number of a side: 3 face + k, from corner k to k + 1
    first : ndarray of int, shape (e,), where in ``side`` each edge begins
    count : ndarray of int, shape (e,), its number of sides
    """

    side: Indices
    first: Indices
    count: Indices

    @property
    def pairs(self) -> Indices:
        """Sides of the edges that join two faces, shape (k, 2)."""
        inner = self.first[self.count == 2]
        return np.column_stack([self.side[inner], self.side[inner + 1]])

    @property
    def open(self) -> Indices:
        """Sides of the edges that only one face has, shape (k,)."""
        return self.side[self.first[self.count == 1]]


def edges(faces: Indices) -> Edges:
    """Edges of faces, shape (m, 3)."""
    key = np.empty(faces.shape, dtype=np.int64)
    for k in range(3):
        one, other = faces[:, k], faces[:, (k + 1) % 3]
        np.minimum(one, other, out=key[:, k])
        key[:, k] *= int(faces.max(initial=0)) + 1
        key[:, k] += np.maximum(one, other)
    flat = key.reshape(-1)
    side = np.argsort(flat)
    flat = flat[side]
    first = np.flatnonzero(np.concatenate([[len(flat) > 0], flat[1:] != flat[:-1]]))
    return Edges(side, first, np.diff(first, append=len(flat)))


def ends(faces: Indices, side: Indices) -> Indices:
    """Vertices from and to which sides run, shape (k, 2)."""
    face, corner = np.divmod(side, 3)
    return np.column_stack([faces[face, corner], faces[face, (corner + 1) % 3]])


def pieces(pairs: Indices, count: int) -> Indices:
    """Number of the connected piece that each of ``count`` things is in, linked by ``pairs``."""
    links = coo_array(
        (np.ones(len(pairs), dtype=np.int8), (pairs[:, 0], pairs[:, 1])), shape=(count, count)
    )
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.int64)


def rims(faces: Indices) -> list[Indices]:
    """Open rims of faces, each the vertices in order, the one of most edges first.

    Raises
    ------
    InvalidInput
        If rims meet in a vertex (see ``split_fans``).
    """
    return chains(ends(faces, edges(faces).open))


def chains(links: Indices) -> list[Indices]:
    """Closed chains of directed links, shape (k, 2); each vertex at most once, longest first.

    Raises
    ------
    InvalidInput
        If chains meet in a vertex, or one is not closed.
    """
    if len(links) == 0:
        return []
    names, ordered = np.unique(links, return_inverse=True)
    start, end = ordered.reshape(-1, 2).T
    after = np.full(len(names), -1)
    after[start] = end
    if len(np.unique(start)) < len(start) or len(np.unique(end)) < len(end) or (after < 0).any():
        raise InvalidInput(
            "an open rim that touches itself or stops",
            "a rim is a simple closed chain of edges",
            "clean the scan first",
        )
    loop = pieces(np.column_stack([np.arange(len(names)), after]), len(names))
    found = []
    successor = after.tolist()
    for first in np.unique(loop, return_index=True)[1].tolist():
        chain = [first]
        while successor[chain[-1]] != first:
            chain.append(successor[chain[-1]])
        found.append(names[chain])
    return sorted(found, key=len, reverse=True)


def at_border(faces: Indices, vertices: int) -> Mask:
    """Faces with a vertex on an open edge, shape (m,)."""
    border = np.zeros(vertices, dtype=bool)
    border[ends(faces, edges(faces).open).ravel()] = True
    return np.asarray(border[faces].any(axis=1))


def split_fans(faces: Indices, vertices: int) -> tuple[Indices, Indices]:
    """Give each fan of faces that meet in one vertex only a vertex of its own.

    Parameters
    ----------
    faces : ndarray of int, shape (m, 3), no edge with more than two faces
    vertices : int, how many there are

    Returns
    -------
    faces : ndarray of int, shape (m, 3)
    copied : ndarray of int, shape (c,), the vertices of which ``vertices``, ``vertices`` + 1, ...
        are copies
    """
    rim = ends(faces, edges(faces).open)
    crowded = np.flatnonzero(np.bincount(rim[:, 0], minlength=vertices) > 1)
    around = np.flatnonzero(np.isin(faces, crowded).any(axis=1))
    if len(around) == 0:
        return faces, np.empty(0, dtype=np.int64)
    local = faces[around]
    fan = pieces(_corners_beside(local), 3 * len(local)).reshape(-1, 3)
    corner = np.isin(local, crowded)
    known = np.unique(np.column_stack([local[corner], fan[corner]]), axis=0)
    again = np.concatenate([[False], known[1:, 0] == known[:-1, 0]])
    name = known[:, 0].copy()
    name[again] = vertices + np.arange(int(again.sum()))
    order = np.argsort(known[:, 1])
    place = order[np.searchsorted(known[order, 1], fan[corner])]
    local[corner] = name[place]
    faces = faces.copy()
    faces[around] = local
    return faces, known[again, 0]


def _corners_beside(faces: Indices) -> Indices:
    """Pairs of corners, 3 face + k, that an edge between two faces joins at one vertex."""
    one, other = edges(faces).pairs.T
    same = ends(faces, one)[:, 0] == ends(faces, other)[:, 0]

    def next_(side: Indices) -> Indices:
        return side - side % 3 + (side + 1) % 3

    start = np.where(same, other, next_(other))
    end = np.where(same, next_(other), other)
    return np.concatenate([np.column_stack([one, start]), np.column_stack([next_(one), end])])
