"""Where a noisy surface turns inward, and the cheapest seam along such hollows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.rock.triangles import cross_products
from vsr_core.scan.topology import edges, ends

NOISE = 0.2
"""Normals are smoothed until three edges in four turn by less than this [rad]."""

HOLLOW = np.radians(20.0)
"""A surface that turns inward by less than this at an edge [rad] has no hollow there."""

_KEPT = {1: 0.17, 2: 0.12, 4: 0.08, 8: 0.05}  # of a sharp turn, by rounds of smoothing
_CHEAP = 0.02  # cost of a length along a sharp hollow, of the cost anywhere else


@dataclass(frozen=True)
class Turns:
    """How a surface turns across its inner edges.

    Attributes
    ----------
    side : ndarray of int, shape (e, 2), the two sides of each edge (see ``topology.Edges``)
    length : ndarray, shape (e,) [m]
    inward : ndarray, shape (e,) [rad], about the sharp turn there, positive in a hollow
    noise : float [rad], turn that three edges in four stay below
    """

    side: Indices
    length: Array
    inward: Array
    noise: float

    @property
    def faces(self) -> Indices:
        """The faces on either side of each edge, shape (e, 2)."""
        return self.side // 3

    @property
    def hollow(self) -> Mask:
        """Edges that turn clearly inward, shape (e,)."""
        return self.inward > max(self.noise, HOLLOW)

    @property
    def cost(self) -> Array:
        """Cost of a seam along each edge [m]: its length, less the hollower it is."""
        falling = np.exp(-np.maximum(self.inward, 0.0) / max(self.noise, 0.5 * HOLLOW))
        return self.length * (_CHEAP + (1.0 - _CHEAP) * falling)


def smoothed_normals(vertices: Array, faces: Indices, rounds: int) -> Array:
    """Unit normals of faces, averaged over all faces that share a vertex.

    Returns
    -------
    ndarray, shape (m, 3)

    Examples
    --------
    >>> smoothed_normals(np.eye(3) * [2, 2, 0], np.array([[0, 1, 2]]), 1).tolist()
    [[0.0, 0.0, 1.0]]
    """
    return next(islice(_smoothings(vertices, faces), rounds, None))


def _smoothings(vertices: Array, faces: Indices) -> Iterator[Array]:
    """Unit normals of faces, and after one more round each time."""
    vector = cross_products(vertices, faces)
    area = np.linalg.norm(vector, axis=1, keepdims=True)
    while True:
        yield _normed(vector)
        vector = _normed(_around_vertices(vector, faces, len(vertices))) * area


def _around_vertices(values: Array, faces: Indices, count: int) -> Array:
    """Sum, over the corners of each face, of the values of all faces at the corner."""
    flat = faces.ravel()
    at = [np.bincount(flat, np.repeat(values[:, k], 3), count) for k in range(3)]
    return np.column_stack([sums[faces].sum(axis=1) for sums in at])


def _normed(vector: Array) -> Array:
    return vector / np.maximum(np.linalg.norm(vector, axis=1, keepdims=True), 1e-300)


def turns(vertices: Array, faces: Indices) -> Turns:
    """Turn of a surface across its edges, smoothed as much as its noise asks for.

    The turn at an edge is the difference of the normals beside it along the line from the middle
    of one face to that of the other. Smoothing spreads it over neighbouring edges; it is scaled
    such that the deepest edge along a sharp, regular hollow keeps its turn.
    """
    side = edges(faces).pairs
    one, other = side.T // 3
    start, end = ends(faces, side[:, 0]).T
    length = np.linalg.norm(vertices[start] - vertices[end], axis=1)
    middle = vertices[faces].mean(axis=1)
    along = _normed(middle[other] - middle[one])
    for rounds, normal in enumerate(_smoothings(vertices, faces)):
        if rounds not in _KEPT:
            continue
        normal /= _KEPT[rounds]
        inward = np.einsum("ij,ij->i", normal[one] - normal[other], along)
        noise = float(np.percentile(np.abs(inward), 75.0))
        if noise <= NOISE or rounds == max(_KEPT):
            break
    return Turns(side, length, inward, noise)


def cheapest_cut(found: Turns, rock: Mask, ground: Mask) -> Mask:
    """Faces that the cheapest seam leaves with the rock (minimum cut).

    Parameters
    ----------
    rock, ground : ndarray of bool, shape (count,), faces known to be of either; disjoint

    Returns
    -------
    ndarray of bool, shape (count,)
    """
    node = np.where(rock, 0, 1)
    free = ~(rock | ground)
    node[free] = 2 + np.arange(int(free.sum()))
    one, other = node[found.faces].T
    apart = one != other
    one, other = one[apart], other[apart]
    cost = found.cost[apart]
    whole = np.maximum(np.round(cost * (1e4 / cost.max())), 1.0).astype(np.int32)
    size = 2 + int(free.sum())
    graph = coo_array(
        (np.concatenate([whole, whole]), (np.append(one, other), np.append(other, one))),
        shape=(size, size),
    ).tocsr()
    left = graph - maximum_flow(graph.astype(np.int32), 0, 1).flow
    left.data = np.maximum(left.data, 0)
    left.eliminate_zeros()
    reached = np.zeros(size, dtype=bool)
    reached[breadth_first_order(left, 0, return_predecessors=False)] = True
    return reached[node]
