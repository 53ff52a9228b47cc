"""How the faces of a triangle mesh hang together: edges, borders, rims.

A *rim* is a closed chain of open edges, in the order in which the faces beside it run along it:
the surface lies to its left, seen from outside.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from trimesh.graph import connected_component_labels

from vsr_core.arrays import Array, Indices, Mask
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
    """Edges of faces.

    Examples
    --------
    >>> found = edges(np.array([[0, 1, 2], [2, 1, 3]]))
    >>> len(found.count), len(found.pairs), len(found.open)
    (5, 1, 4)
    """
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
    """Vertices from and to which sides run.

    Parameters
    ----------
    side : ndarray of int, shape (k,), 3 face + k (see ``Edges``)

    Returns
    -------
    ndarray of int, shape (k, 2)

    Examples
    --------
    >>> ends(np.array([[7, 8, 9]]), np.array([0, 2])).tolist()
    [[7, 8], [9, 7]]
    """
    face, corner = np.divmod(side, 3)
    return np.column_stack([faces[face, corner], faces[face, (corner + 1) % 3]])


def border(faces: Indices) -> Indices:
    """Vertices from and to which the open edges run.

    Returns
    -------
    ndarray of int, shape (k, 2)

    Examples
    --------
    >>> sorted(border(np.array([[0, 1, 2], [2, 1, 3]])).tolist())
    [[0, 1], [1, 3], [2, 0], [3, 2]]
    """
    return ends(faces, edges(faces).open)


def touching(faces: Indices, vertices: Indices) -> Mask:
    """Faces with a corner among some vertices.

    Examples
    --------
    >>> touching(np.array([[0, 1, 2], [2, 1, 3]]), np.array([0])).tolist()
    [True, False]
    """
    return np.asarray(np.isin(faces, vertices).any(axis=1))


def means_beside(faces: Indices, values: Array, vertices: Indices) -> Array:
    """Means of what is known at the neighbours of some vertices; a neighbour counts once a face.

    Parameters
    ----------
    values : ndarray, shape (n, d), of all vertices; nan where unknown
    vertices : ndarray of int, shape (k,), each with a neighbour whose value is known

    Returns
    -------
    ndarray, shape (k, d)

    Examples
    --------
    >>> height = np.array([[np.nan], [2.0], [4.0]])
    >>> means_beside(np.array([[0, 1, 2]]), height, np.array([0, 1])).tolist()
    [[3.0], [4.0]]
    """
    near = faces[touching(faces, vertices)]
    count, total = np.zeros(len(values)), np.zeros_like(values)
    for k in range(3):
        for j in (1, 2):
            one, other = near[:, k], near[:, (k + j) % 3]
            known = np.isfinite(values[other, 0])
            np.add.at(total, one[known], values[other[known]])
            np.add.at(count, one[known], 1.0)
    return total[vertices] / count[vertices, None]


def rims(faces: Indices) -> list[Indices]:
    """Open rims of faces.

    Returns
    -------
    list of ndarray of int
        The vertices of each in order, the one of most edges first.

    Raises
    ------
    InvalidInput
        If rims meet in a vertex (see ``split_fans``).
    """
    return chains(border(faces))


def chains(links: Indices) -> list[Indices]:
    """Closed chains of directed links.

    Parameters
    ----------
    links : ndarray of int, shape (k, 2)

    Returns
    -------
    list of ndarray of int
        Each vertex at most once, the longest chain first.

    Raises
    ------
    InvalidInput
        If chains meet in a vertex, or one is not closed.

    Examples
    --------
    >>> [chain.tolist() for chain in chains(np.array([[0, 5], [7, 0], [5, 7]]))]
    [[0, 5, 7]]
    """
    if len(links) == 0:
        return []
    names, ordered = np.unique(links, return_inverse=True)
    start, end = ordered.T
    after = np.full(len(names), -1)
    after[start] = end
    if len(np.unique(start)) < len(start) or len(np.unique(end)) < len(end) or (after < 0).any():
        raise InvalidInput(
            "an open rim that touches itself or stops",
            "a rim is a simple closed chain of edges",
            "clean the scan first",
        )
    ahead = np.column_stack([np.arange(len(names)), after])
    loop = connected_component_labels(ahead, len(names))
    found = []
    successor = after.tolist()
    for first in np.unique(loop, return_index=True)[1].tolist():
        chain = [first]
        while successor[chain[-1]] != first:
            chain.append(successor[chain[-1]])
        found.append(names[chain])
    return sorted(found, key=len, reverse=True)


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

    Examples
    --------
    >>> [part.tolist() for part in split_fans(np.array([[0, 1, 2], [0, 3, 4]]), 5)]
    [[[0, 1, 2], [5, 3, 4]], [0]]
    """
    rim = border(faces)
    crowded = np.flatnonzero(np.bincount(rim[:, 0], minlength=vertices) > 1)
    around = np.flatnonzero(touching(faces, crowded))
    if len(around) == 0:
        return faces, np.empty(0, dtype=np.int64)
    local = faces[around]
    fan = connected_component_labels(_corners_beside(local), 3 * len(local)).reshape(-1, 3)
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
