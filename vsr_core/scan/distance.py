"""Distances between surfaces: signed, to see what is inside what, and the largest both ways."""

from __future__ import annotations

import numpy as np
import trimesh
from trimesh.proximity import closest_point

from vsr_core.arrays import Array, Indices
from vsr_core.rock.triangles import chunks
from vsr_core.scan.topology import edges

SAMPLES = 20_000
"""Points, beside the vertices, at which a distance between surfaces is measured."""

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

    Examples
    --------
    >>> cube = trimesh.creation.box((2.0, 2.0, 2.0))
    >>> signed_distance(cube, np.array([[0.0, 0.0, 0.9], [0.0, 0.0, 1.5]]))[0].round(9).tolist()
    [-0.1, 0.5]
    """
    distance, nearest = np.empty(len(points)), np.empty((len(points), 3))
    face = np.empty(len(points), dtype=np.int64)
    for chunk in chunks(len(points), _CHUNK):
        nearest[chunk], distance[chunk], face[chunk] = closest_point(mesh, points[chunk])
    share = trimesh.triangles.points_to_barycentric(mesh.triangles[face], nearest)
    side = np.einsum("ij,ij->i", points - nearest, _pseudonormals(mesh, face, share))
    return np.where(side < 0.0, -distance, distance), nearest, face


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
    """Largest distance from either surface to the other.

    Measured at all vertices of both and at ``SAMPLES`` points spread over each by area, exactly
    to the other's faces: a lower bound, as every sampled one, that is exact where the largest
    distance is at a vertex.

    Parameters
    ----------
    one, other : trimesh.Trimesh [m]

    Returns
    -------
    float [m]

    Examples
    --------
    >>> small, large = (trimesh.creation.box((1.0, 1.0, height)) for height in (1.0, 1.5))
    >>> round(hausdorff(small, large), 6)
    0.25
    """
    return max(_farthest(one, other), _farthest(other, one))


def _farthest(one: trimesh.Trimesh, other: trimesh.Trimesh) -> float:
    """Largest distance of a point of one surface from another [m]."""
    spread = trimesh.sample.sample_surface(one, SAMPLES, seed=0)[0]
    points = np.concatenate([np.array(one.vertices)[np.unique(one.faces)], spread])
    found = (closest_point(other, points[chunk])[1] for chunk in chunks(len(points), _CHUNK))
    return max(float(distance.max()) for distance in found)
