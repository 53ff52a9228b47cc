"""Distances between surfaces: signed, to see what is inside what, and the largest both ways."""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from vsr_core.arrays import Array, Indices
from vsr_core.scan.topology import edges, pieces

SAMPLES = 20_000
"""Points, beside the vertices, at which a distance between surfaces is measured."""

FAR = 4.0
"""Vertices further from a surface than this many of its edges need no exact distance."""

_ON = 1e-9  # a barycentric share below this is none
_CHUNK = 10_000  # points looked up at a time, to save memory


def signed_distance(mesh: trimesh.Trimesh, points: Array) -> tuple[Array, Array, Indices]:
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
    distance, nearest = np.empty(len(points)), np.empty((len(points), 3))
    face = np.empty(len(points), dtype=np.int64)
    for chunk in _chunks(len(points)):
        found = trimesh.proximity.closest_point(mesh, points[chunk])
        nearest[chunk], distance[chunk], face[chunk] = found
    share = trimesh.triangles.points_to_barycentric(mesh.triangles[face], nearest)
    side = np.einsum("ij,ij->i", points - nearest, _pseudonormals(mesh, face, share))
    return np.where(side < 0.0, -distance, distance), nearest, face


def vertex_distance(one: trimesh.Trimesh, other: trimesh.Trimesh) -> Array:
    """Signed distance of the vertices of one surface from another [m], shape (n,).

    Exact near the other surface. Vertices further from it than ``FAR`` of its edges are on the
    side of one of those that they hang together with, and as far as the nearest vertex.
    """
    vertices, faces = np.array(other.vertices), np.array(other.faces, dtype=np.int64)
    points, links = np.array(one.vertices), np.asarray(one.edges_unique, dtype=np.int64)
    longest = np.zeros(len(vertices))
    sides = np.linalg.norm(vertices[faces] - vertices[np.roll(faces, 1, axis=1)], axis=2)
    for k in range(3):
        np.maximum.at(longest, faces[:, k], sides.max(axis=1))
    used = np.unique(faces)
    distance, vertex = cKDTree(vertices[used]).query(points)
    far = distance > FAR * longest[used[vertex]]
    piece = pieces(links[far[links].all(axis=1)], len(points))
    first = np.flatnonzero(far)[np.unique(piece[far], return_index=True)[1]]
    exact = np.union1d(np.flatnonzero(~far), first)
    near, _, _ = signed_distance(other, points[exact])
    side = np.ones(int(piece.max()) + 1)
    side[piece[first]] = np.sign(near[np.searchsorted(exact, first)])
    distance[far] *= side[piece[far]]
    distance[exact] = near
    return distance


def _chunks(count: int) -> list[slice]:
    return [slice(first, first + _CHUNK) for first in range(0, count, _CHUNK)]


def _pseudonormals(mesh: trimesh.Trimesh, face: Indices, share: Array) -> Array:
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
    spread = trimesh.sample.sample_surface(one, SAMPLES, seed=0)[0]
    used = np.unique(one.faces)
    return farthest(np.concatenate([np.array(one.vertices)[used], spread]), other)


def farthest(points: Array, mesh: trimesh.Trimesh) -> float:
    """Largest distance of points, shape (n, 3) [m], from a surface [m]."""
    return max(
        float(trimesh.proximity.closest_point(mesh, points[chunk])[1].max())
        for chunk in _chunks(len(points))
    )
