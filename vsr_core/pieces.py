"""Ground as convex pieces: one body where a terrain is locally convex, in place of many triangles.

A piece is the hull of a patch of triangles and of the same points a little below them. It may fill
hollows of its patch, and cover ground beside it, as long as no point of its outer surface stands
out of the terrain by more than a tolerance; and every triangle of the terrain is in a piece, so
that nothing of it is lost. Engines then test a rock against a few pieces in place of hundreds of
triangles, and a piece has no edges inside on which a rolling rock could catch.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from vsr_core.detail import needed
from vsr_core.terrain import Terrain

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

MOST_POINTS = 150
"""Most vertices of the patch of a piece: beyond it another one is begun."""

CORNER_SHARE = 0.2
"""Corners of a piece are left out as long as it sinks by less than this share of the tolerance."""

_BARYCENTRIC = np.array(
    [
        [1 / 3, 1 / 3, 1 / 3],
        [0.5, 0.5, 0.0],
        [0.5, 0.0, 0.5],
        [0.0, 0.5, 0.5],
        [2 / 3, 1 / 6, 1 / 6],
        [1 / 6, 2 / 3, 1 / 6],
        [1 / 6, 1 / 6, 2 / 3],
    ]
)


def pieces(
    terrain: Terrain, tolerance: Callable[[Array], Array], thickness: float
) -> tuple[Array, ...]:
    """Convex pieces of a terrain.

    Patches of triangles grow together pair by pair, the pair that stands out least first, while
    what they make together is a piece. What stands out is sampled at seven points of each facet.

    Parameters
    ----------
    terrain : Terrain
    tolerance : function from points, shape (n, 3) [m], to how far pieces may stand out there [m]
    thickness : float [m], of a piece below its patch: what penetrates less is pushed back outward

    Returns
    -------
    tuple of ndarray, each of shape (k, 3) [m]
        Corners of the pieces.
    """
    patches: dict[int, Indices] = {i: np.array([i]) for i in range(len(terrain.faces))}
    beside = _neighbours(terrain.faces)
    grow = _Growing(terrain, tolerance, thickness)
    queue: list[tuple[float, int, int]] = []

    def propose(one: int, others: Iterable[int]) -> None:
        for other in others:
            if other in patches:
                joined = np.concatenate([patches[one], patches[other]])
                stands_out = grow.stands_out(joined)
                if stands_out is not None:
                    heapq.heappush(queue, (stands_out, one, other))

    for face, others in enumerate(beside):
        propose(face, [other for other in others if other < face])
    neighbours = dict(enumerate(beside))
    number = len(patches)
    while queue:
        _, one, other = heapq.heappop(queue)
        if one not in patches or other not in patches:
            continue
        patches[number] = np.concatenate([patches.pop(one), patches.pop(other)])
        around = (neighbours.pop(one) | neighbours.pop(other)) - {one, other}
        for third in around:
            neighbours[third] = (neighbours[third] - {one, other}) | {number}
        neighbours[number] = around
        propose(number, around)
        number += 1
    return tuple(grow.body(patch) for patch in patches.values())


class _Growing:
    """What patches of a terrain become as pieces."""

    def __init__(
        self, terrain: Terrain, tolerance: Callable[[Array], Array], thickness: float
    ) -> None:
        self._terrain, self._tolerance, self._thickness = terrain, tolerance, thickness
        self._triangles = terrain.vertices[terrain.faces]
        a, b, c = (self._triangles[:, k] for k in range(3))
        self._areas = np.cross(b - a, c - a)

    def body(self, patch: Indices) -> Array:
        """Corners of the hull of a patch's points and of the same points below it, shape (k, 3)."""
        points, outward = self._points(patch)
        corners = np.concatenate([points, points - self._thickness * outward])
        extreme = np.zeros(len(corners), dtype=bool)
        for way in (*np.eye(3), outward, np.cross(outward, [0.6, 0.8, 0.0])):
            along = corners @ way
            extreme[[along.argmin(), along.argmax()]] = True
        if not _spans_volume(corners[extreme]):
            extreme[:] = True
        allowed = CORNER_SHARE * float(self._tolerance(points.mean(axis=0)[None])[0])
        return corners[needed(corners, allowed, extreme)]

    def stands_out(self, patch: Indices) -> float | None:
        """How far a piece would stand out of the terrain [m]; None if it must not be made."""
        from scipy.spatial import ConvexHull, QhullError

        points, outward = self._points(patch)
        if len(points) > MOST_POINTS or not outward.any():
            return None
        if float((self._areas[patch] @ outward).min()) <= 0.0:
            return None  # it would wrap around its own back
        corners = np.concatenate([points, points - self._thickness * outward])
        try:
            hull = ConvexHull(corners)
        except QhullError:
            return None
        outer = hull.equations[:, :3] @ outward > 0.02
        facets = corners[hull.simplices[outer]]
        samples = np.einsum("kb,fbx->fkx", _BARYCENTRIC, facets).reshape(-1, 3)
        distance = _distances(samples, self._triangles[patch])
        allowed = self._tolerance(samples)
        for k in np.flatnonzero(distance > allowed):
            distance[k] = self._from_all(samples[k], distance[k])
            if distance[k] > allowed[k]:
                return None
        return float(distance.max())

    def _from_all(self, point: Array, distance: float) -> float:
        """Distance [m] of a point from the terrain if that is less; 0 below it."""
        if self._terrain.depth(point):
            return 0.0
        near = self._terrain.around(float(point[0]), float(point[1]))
        if not len(near):
            return distance
        return min(distance, float(_distances(point[None], self._triangles[near])[0]))

    def _points(self, patch: Indices) -> tuple[Array, Array]:
        corners = self._terrain.vertices[np.unique(self._terrain.faces[patch])]
        outward = self._areas[patch].sum(axis=0)
        length = float(np.linalg.norm(outward))
        return corners, outward / length if length > 0.0 else np.zeros(3)


def _spans_volume(points: Array) -> bool:
    extent = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return len(points) > 3 and bool(extent[2] > 1e-6 * extent[0])


def _distances(points: Array, triangles: Array) -> Array:
    """Distance [m] of each point, shape (n, 3), from the nearest of triangles, shape (m, 3, 3)."""
    from trimesh.triangles import closest_point

    n, m = len(points), len(triangles)
    repeated = np.repeat(points, m, axis=0)
    nearest = closest_point(np.tile(triangles, (n, 1, 1)), repeated)
    return np.linalg.norm(repeated - nearest, axis=1).reshape(n, m).min(axis=1)


def _neighbours(faces: Indices) -> list[set[int]]:
    """Faces that share an edge with each face."""
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
    owner = np.repeat(np.arange(len(faces)), 3)
    order = np.lexsort(edges.T)
    same = (edges[order[1:]] == edges[order[:-1]]).all(axis=1)
    beside: list[set[int]] = [set() for _ in faces]
    for one, other in zip(owner[order[:-1]][same], owner[order[1:]][same], strict=True):
        beside[one].add(int(other))
        beside[other].add(int(one))
    return beside
