"""Ground as convex parts: one body where a terrain is locally convex, in place of many triangles.

A part is the hull of a patch of triangles and of the same points a little below them. It may fill
hollows of its patch, and cover ground beside it, as long as no point of its outer surface stands
out of the terrain by more than a tolerance; and every triangle of the terrain is in a part, so
that nothing of it is lost. Engines then test a rock against a few parts in place of hundreds of
triangles, and a part has no edges inside on which a rolling rock could catch.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from vsr_core.arrays import Array, Indices
from vsr_core.rock.reduction import needed
from vsr_core.rock.triangles import cross_products
from vsr_core.terrain.surface import Terrain

MOST_POINTS = 150
"""Most vertices of the patch of a part: beyond it another one is begun."""

LARGE_TIMES = 15.0
"""Facets with a side this many times the tolerance are looked at in seven points, not in one."""

CORNER_SHARE = 0.2
"""Corners of a part are left out as long as it sinks by less than this share of the tolerance."""

_SIX = np.array(
    [
        [0.5, 0.5, 0.0],
        [0.5, 0.0, 0.5],
        [0.0, 0.5, 0.5],
        [2 / 3, 1 / 6, 1 / 6],
        [1 / 6, 2 / 3, 1 / 6],
        [1 / 6, 1 / 6, 2 / 3],
    ]
)
_MANY = np.array([[i, j, 12 - i - j] for i in range(13) for j in range(13 - i)]) / 12.0
"""Barycentric coordinates of points of a large facet, besides its middle."""


def convex_parts(
    terrain: Terrain, tolerance: Callable[[Array], Array], thickness: float
) -> tuple[Array, ...]:
    """Convex parts of a terrain.

    Patches of triangles grow together pair by pair, the pair that stands out least first, while
    what they make together is a part. What stands out is sampled at seven points of each facet, and
    at many of a large one once a part is to be made: two long walls and what is flat above them
    would cover the corner where they meet.

    Parameters
    ----------
    tolerance : function from points, shape (n, 3) [m], to how far parts may stand out there [m]
    thickness : float [m], of a part below its patch: what penetrates less is pushed back outward

    Returns
    -------
    tuple of ndarray, each of shape (k, 3) [m]
        Corners of the parts.
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
        joined = np.concatenate([patches[one], patches[other]])
        if grow.stands_out(joined, _MANY) is None:
            continue
        del patches[one], patches[other]
        patches[number] = joined
        around = (neighbours.pop(one) | neighbours.pop(other)) - {one, other}
        for third in around:
            neighbours[third] = (neighbours[third] - {one, other}) | {number}
        neighbours[number] = around
        propose(number, around)
        number += 1
    return tuple(grow.body(patch) for patch in patches.values())


class _Growing:
    """What patches of a terrain become as parts."""

    def __init__(
        self, terrain: Terrain, tolerance: Callable[[Array], Array], thickness: float
    ) -> None:
        self._terrain, self._tolerance, self._thickness = terrain, tolerance, thickness
        self._triangles = _Triangles(terrain.vertices[terrain.faces])
        self._areas = cross_products(terrain.vertices, terrain.faces)

    def body(self, patch: Indices) -> Array:
        """Corners of the hull of a patch's points and of the same points below it, shape (k, 3)."""
        points, outward = self._points(patch)
        corners = np.concatenate([points, points - self._thickness * outward])
        extreme = np.zeros(len(corners), dtype=bool)
        for direction in (*np.eye(3), outward, np.cross(outward, [0.6, 0.8, 0.0])):
            along = corners @ direction
            extreme[[along.argmin(), along.argmax()]] = True
        allowed = CORNER_SHARE * float(self._tolerance(points.mean(axis=0)[None])[0])
        return corners[needed(corners, allowed, extreme)]

    def stands_out(self, patch: Indices, looked_at: Array = _SIX) -> float | None:
        """How far a part would stand out of the terrain [m]; None if it must not be made."""
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
        # Facets between points of the patch face the air too where walls make a concave corner.
        outer |= (hull.simplices < len(points)).all(axis=1)
        samples = np.concatenate(
            [
                self._on_facets(corners[hull.simplices[outer]], looked_at),
                _above_hollows(points, hull.equations[outer]),
            ]
        )
        distance = self._triangles.distances(samples, patch)
        allowed = self._tolerance(samples)
        for k in np.flatnonzero(distance > allowed):
            distance[k] = self._from_all(samples[k], distance[k])
            if distance[k] > allowed[k]:
                return None
        return float(distance.max())

    def _on_facets(self, facets: Array, looked_at: Array) -> Array:
        """Points on facets, shape (k, 3, 3) [m]: their middles, of large ones others besides."""
        middles = facets.mean(axis=1)
        longest = np.linalg.norm(facets - np.roll(facets, 1, axis=1), axis=2).max(axis=1)
        large = facets[longest > LARGE_TIMES * self._tolerance(middles)]
        more = np.einsum("kb,fbx->fkx", looked_at, large).reshape(-1, 3)
        return np.concatenate([middles, more])

    def _from_all(self, point: Array, distance: float) -> float:
        """Distance [m] of a point from the terrain if that is less; 0 below it."""
        if self._terrain.depth(point):
            return 0.0
        near = self._terrain.around(float(point[0]), float(point[1]))
        if not len(near):
            return distance
        return min(distance, float(self._triangles.distances(point[None], near)[0]))

    def _points(self, patch: Indices) -> tuple[Array, Array]:
        corners = self._terrain.vertices[np.unique(self._terrain.faces[patch])]
        outward = self._areas[patch].sum(axis=0)
        length = float(np.linalg.norm(outward))
        return corners, outward / length if length > 0.0 else np.zeros(3)


def _above_hollows(points: Array, planes: Array) -> Array:
    """The points of a hull's planes, shape (k, 4), nearest to each point that lies below them."""
    below = -(points @ planes[:, :3].T + planes[:, 3])
    nearest = below.argmin(axis=1)
    depth = below[np.arange(len(points)), nearest]
    feet = points + depth[:, None] * planes[nearest, :3]
    return feet[depth > 1e-9]


class _Triangles:
    """Triangles, shape (m, 3, 3) [m], made ready for distances from many points."""

    def __init__(self, corners: Array) -> None:
        self._a = corners[:, 0]
        u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        normal = np.cross(u, v)
        square = np.maximum((normal**2).sum(axis=1), 1e-300)[:, None]
        self._s, self._t = np.cross(v, normal) / square, np.cross(normal, u) / square
        self._n = normal / np.sqrt(square)
        self._starts = corners.transpose(1, 0, 2)
        self._sides = np.roll(self._starts, -1, axis=0) - self._starts
        self._squares = np.maximum((self._sides**2).sum(axis=2), 1e-300)

    def distances(self, points: Array, among: Indices) -> Array:
        """Distance [m] of each point, shape (n, 3), from the nearest of the triangles ``among``.

        To the plane where a point projects into the triangle, else to the nearest of its sides.
        """
        a = self._a[among]

        def along(vector: Array, origin: Array) -> Array:
            return points @ vector.T - (vector * origin).sum(axis=1)

        s, t = along(self._s[among], a), along(self._t[among], a)
        inside = (s >= 0.0) & (t >= 0.0) & (s + t <= 1.0)
        least = np.where(inside, along(self._n[among], a) ** 2, np.inf)
        lengths = (points**2).sum(axis=1)[:, None]
        for start, side, square in zip(self._starts, self._sides, self._squares, strict=True):
            start, side, square = start[among], side[among], square[among]
            onto = along(side, start)
            part = np.clip(onto / square, 0.0, 1.0)
            offset = lengths - 2.0 * points @ start.T + (start**2).sum(axis=1)
            least = np.minimum(least, offset - part * (2.0 * onto - part * square))
        return np.sqrt(np.maximum(least.min(axis=1), 0.0))


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
