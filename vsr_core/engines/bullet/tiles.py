"""Groups of a terrain's triangles that know what lies beyond their borders.

Bullet finds a hull against each triangle for itself. A corner that comes to a line between two of
them can so get the normal of a side that is not there: it trips on even ground. Bullet's filter of
internal edges corrects such normals by the angle to the neighbour, which it looks for in the same
shape. So a tile ends in strips of its neighbours, as wide as the filter looks around an edge: where
the rock touches a strip, it is the strip's edge to the tile that tells the normal, too.
"""

from __future__ import annotations

import numpy as np

from vsr_core.arrays import Array, Indices
from vsr_core.engines.bullet.binding import pybullet
from vsr_core.scan.topology import edges
from vsr_core.terrain.surface import Terrain

TILE_FACES = 6
"""Most triangles of a tile."""

STRIP = 0.05
"""Width of a strip, in Bullet's length unit: half of that within which its filter takes a point for
one on an edge."""


class Tiles:
    """The triangles of a terrain in compact groups, lengths times ``scale``.

    Parameters
    ----------
    round_rock : bool, whether the rock is a sphere: its normals are right, and the filter would
        leave the points where it touches beside its centre, 3 % of a rebound at 1 ms
    """

    def __init__(self, terrain: Terrain, scale: float, *, round_rock: bool) -> None:
        faces, self._filtered = terrain.faces, not round_rock
        self._triangles = terrain.vertices[faces] * scale
        self._groups = _groups(self._triangles.mean(axis=1))
        one, other = edges(faces).pairs.T
        self._across = np.full(3 * len(faces), -1)  # the same edge as a side of its neighbour
        self._across[one], self._across[other] = other, one

    def corners(self) -> list[Array]:
        """Corners of each tile's triangles, strips apart, each of shape (n, 3)."""
        return [self._triangles[group].reshape(-1, 3) for group in self._groups]

    def shape(self, number: int, client: int) -> int:
        """Bullet's number of a tile's shape; ``client`` is that of its connection."""
        group = self._groups[number]
        triangles = self._triangles[group]
        if self._filtered:
            triangles = np.concatenate([triangles, self._strips(group)])
        corners, indices = triangles.reshape(-1, 3), np.arange(3 * len(triangles))
        return triangle_shape(corners, indices, client, filtered=self._filtered)

    def _strips(self, group: Indices) -> Array:
        """Triangles at the border of a group, in the planes of those beyond, shape (k, 3, 3)."""
        across = self._across[(3 * group[:, None] + np.arange(3)).ravel()]
        face, corner = np.divmod(across[across >= 0], 3)
        beyond = ~np.isin(face, group)
        face, corner = face[beyond], corner[beyond]
        begin, end, apex = (self._triangles[face, (corner + k) % 3] for k in range(3))
        middle = 0.5 * (begin + end)
        way = apex - middle
        share = np.minimum(1.0, STRIP / np.linalg.norm(way, axis=1, keepdims=True))
        return np.stack([begin, end, middle + share * way], axis=1)


def triangle_shape(corners: Array, indices: Indices, client: int, *, filtered: bool = True) -> int:
    """Bullet's number of the shape of a sheet of triangles.

    Parameters
    ----------
    corners : ndarray, shape (n, 3), in Bullet's length unit
    indices : ndarray of int, shape (3 m,)
    client : int, Bullet's number of the connection
    filtered : bool, whether inner edges are; of a body in a joint tree only
        (``useMaximalCoordinates=0``)
    """
    edges_filtered = pybullet.GEOM_CONCAVE_INTERNAL_EDGE if filtered else 0
    return int(
        pybullet.createCollisionShape(
            pybullet.GEOM_MESH,
            vertices=corners.tolist(),
            indices=indices.tolist(),
            flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH | edges_filtered,
            physicsClientId=client,
        )
    )


def _groups(centres: Array) -> list[Indices]:
    """Compact groups of at most ``TILE_FACES`` triangles, halved along their extent."""
    groups, whole = [np.arange(len(centres))], []
    while groups:
        group = groups.pop()
        if len(group) <= TILE_FACES:
            whole.append(group)
            continue
        extent = np.ptp(centres[group], axis=0)
        order = group[np.argsort(centres[group, int(np.argmax(extent))], kind="stable")]
        groups += [order[: len(order) // 2], order[len(order) // 2 :]]
    return whole
