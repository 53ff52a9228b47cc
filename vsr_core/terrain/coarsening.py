"""A terrain with fewer triangles, as far as its error stays small."""

from __future__ import annotations

from collections.abc import Callable

import fast_simplification
import numpy as np
import trimesh
from trimesh.proximity import closest_point
from trimesh.sample import sample_surface

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.terrain.surface import Terrain

KEPT_SHARES = (0.7, 0.5, 0.35, 0.25, 0.18, 0.12, 0.08, 0.05)
"""Shares of the triangles that are tried, one after the other."""

WITHIN = 0.99
"""Share of the terrain that has to stay within its tolerance."""

_SAMPLES = 4000


def coarser(
    terrain: Terrain, tolerance: Callable[[Array], Array], kept: Mask | None = None
) -> Terrain:
    """The terrain with as few triangles as keep ``WITHIN`` of it within its tolerance.

    Edges collapse where the quadric error is least (Garland & Heckbert 1997, by
    fast-simplification). Distances are measured both ways at random points, the same every time.

    Parameters
    ----------
    tolerance : function from points, shape (n, 3) [m], to the distance allowed there [m]
    kept : ndarray of bool, shape (f,), triangles that stay as they are

    Returns
    -------
    Terrain
        The given one where no coarser one stays within its tolerance.
    """
    best = terrain
    if kept is not None and kept.all():
        return best
    whole = trimesh.Trimesh(terrain.vertices, terrain.faces, process=False)
    for share in KEPT_SHARES:
        light = _simplified(terrain, share, kept)
        mesh = trimesh.Trimesh(light.vertices, light.faces, process=False)
        points, distance = _apart(whole, mesh)
        if np.mean(distance <= tolerance(points)) < WITHIN:
            break
        best = light
    return best


def _simplified(terrain: Terrain, share: float, kept: Mask | None) -> Terrain:
    """A share of the triangles, and all of those that are kept."""
    left = terrain.faces if kept is None else terrain.faces[~kept]
    used, faces = np.unique(left, return_inverse=True)
    # Single precision is enough near the origin, where a site's frame has its rock.
    vertices, faces = fast_simplification.simplify(
        np.ascontiguousarray(terrain.vertices[used], dtype=np.float32),
        np.ascontiguousarray(faces.reshape(-1, 3), dtype=np.int32),
        target_reduction=1.0 - share,
        preserve_border=kept is not None,  # or there would be gaps
    )
    light = Terrain(vertices.astype(np.float64), faces.astype(np.int64))
    return light if kept is None else _joined(terrain, terrain.faces[kept], light)


def _joined(terrain: Terrain, own: Indices, other: Terrain) -> Terrain:
    """Some triangles of a terrain, and others that share corners with them in single precision."""
    used, faces = np.unique(own, return_inverse=True)
    vertices = np.concatenate([terrain.vertices[used], other.vertices])
    faces = np.concatenate([faces.reshape(-1, 3), other.faces + len(used)])
    _, first, place = np.unique(
        vertices.astype(np.float32), axis=0, return_index=True, return_inverse=True
    )
    return Terrain(vertices[first], place.reshape(-1)[faces])


def _apart(one: object, other: object) -> tuple[Array, Array]:
    """Points on both of two meshes, shape (n, 3) [m], and their distance from the other [m]."""
    points, distances = [], []
    for this, that in ((one, other), (other, one)):
        sample = np.asarray(sample_surface(this, _SAMPLES, seed=1)[0])
        points.append(sample)
        distances.append(closest_point(that, sample)[1])
    return np.concatenate(points), np.concatenate(distances)
