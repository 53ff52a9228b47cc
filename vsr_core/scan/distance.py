"""Distances between surfaces: signed, to see what is inside what, and the largest both ways."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vsr_core.scan.topology import edges

if TYPE_CHECKING:
    import trimesh

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SAMPLES = 20_000
"""Points, beside the vertices, at which a distance between surfaces is measured."""

_ON = 1e-9  # a barycentric share below this is none
_CHUNK = 20_000  # points looked up at a time, to save memory


def signed_distance(mesh: trimesh.Trimesh, points: Array) -> tuple[Array, Array, Index]:
    """Distance of points from a surface, positive on the side to which its normals point.

    The sign is that of the pseudonormal of the nearest face, edge or vertex, which is exact
    (Baerentzen & Aanaes 2005) but for points nearest to an open rim.

    Parameters
    ----------
    mesh : trimesh.Trimesh [m]
    points : ndarray, shape (n, 3) [m]

    Returns
    -------
    distance : ndarray, shape (n,) [m]
    nearest : ndarray, shape (n, 3) [m], on the surface
    face : ndarray of int, shape (n,), that it is on
    """
    import trimesh

    if len(points) == 0:
        return np.empty(0), np.empty((0, 3)), np.empty(0, dtype=np.int64)
    nearest, distance, face = trimesh.proximity.closest_point(mesh, points)
    share = trimesh.triangles.points_to_barycentric(mesh.triangles[face], nearest)
    normal = _pseudonormals(mesh, face, share)
    side = np.einsum("ij,ij->i", points - nearest, normal)
    return np.where(side < 0.0, -distance, distance), nearest, face


def _pseudonormals(mesh: trimesh.Trimesh, face: Index, share: Array) -> Array:
    """Normal of the face, edge or vertex that a point with these barycentric shares lies on."""
    faces = np.asarray(mesh.faces, dtype=np.int64)
    normal = np.array(mesh.face_normals[face])
    off = share < _ON
    side = edges(faces).pairs
    across = np.arange(3 * len(faces)) // 3
    across[side[:, 0]], across[side[:, 1]] = side[:, 1] // 3, side[:, 0] // 3
    for k in range(3):
        on_edge = off[:, k] & (off.sum(axis=1) == 1)
        opposite = 3 * face[on_edge] + (k + 1) % 3
        normal[on_edge] += mesh.face_normals[across[opposite]]
        at_vertex = ~off[:, k] & (off.sum(axis=1) == 2)
        normal[at_vertex] = mesh.vertex_normals[faces[face[at_vertex], k]]
    return normal


def hausdorff(one: trimesh.Trimesh, other: trimesh.Trimesh) -> float:
    """Largest distance from either surface to the other [m].

    Measured at all vertices of both and at ``SAMPLES`` points spread over each by area, exactly
    to the other's faces: a lower bound, as every sampled one, that is exact where the largest
    distance is at a vertex.
    """
    return max(_one_way(one, other), _one_way(other, one))


def _one_way(one: trimesh.Trimesh, other: trimesh.Trimesh) -> float:
    import trimesh

    spread = trimesh.sample.sample_surface(one, SAMPLES, seed=0)[0]
    used = np.unique(one.faces)
    return farthest(np.concatenate([np.array(one.vertices)[used], spread]), other)


def farthest(points: Array, mesh: trimesh.Trimesh) -> float:
    """Largest distance of points, shape (n, 3) [m], from a surface [m]."""
    import trimesh

    largest = 0.0
    for first in range(0, len(points), _CHUNK):
        away = trimesh.proximity.closest_point(mesh, points[first : first + _CHUNK])[1]
        largest = max(largest, float(away.max()))
    return largest
