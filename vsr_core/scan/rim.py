"""Where rock and ground would meet: the seam's vertices moved onto both surfaces.

A scan rounds a hollow off by about an edge, its seam follows edges as they come, and each vertex
has its noise. But the rock's side and the ground beside the seam are known from many faces: each
vertex of the seam is moved to where the two, locally planes, meet.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from vsr_core.arrays import Array, Indices
from vsr_core.rock.triangles import areas
from vsr_core.scan.concave import smoothed_normals
from vsr_core.scan.separation import Separation
from vsr_core.scan.topology import means_beside, touching

_REACH = 2.5  # width, in edges, of the weight that faces have on the plane beside a seam
_LARGEST_MOVE = 2.0  # edges by which a vertex moves at most: further off, a plane says nothing
_FACES = 48  # nearest faces looked at on each side
_SHIFTS = 10  # rounds in which the plane beside a point settles on like faces
_ALIKE = 0.25  # width, in |difference of normals|, of the weight of faces of another plane
_MEET = 0.94  # cosine between normals beyond which planes meet nowhere in particular


def settled(separation: Separation) -> Separation:
    """The same with the vertices of the seams where rock and ground meet.

    The weights of the faces fall with distance and with the difference of their normals from the
    mean (Zheng et al. 2011), so that a corner of the rock is not averaged away. Faces at the seam
    itself count for neither side; vertices beside it are laid onto their side's plane.
    """
    vertices, faces = separation.vertices, separation.faces
    loop = np.concatenate([seam.loop for seam in separation.seams])
    sides = [faces[separation.rock], faces[~separation.rock]]
    # The side of the equilateral triangle of the mean area beside the seam.
    mean = areas(vertices, faces[touching(faces, loop)]).mean()
    edge = float(np.sqrt(4.0 / np.sqrt(3.0) * mean))
    planes = [planes_beside(vertices, side, loop, vertices[loop], edge) for side in sides]
    step = _to_both(vertices[loop], *planes[0], *planes[1], _LARGEST_MOVE * edge)
    for side in sides:
        vertices = laid(vertices, side, loop, step, edge)
    vertices[loop] += step
    length = np.linalg.norm(step, axis=1)
    return replace(
        separation,
        vertices=vertices,
        seams=tuple(replace(seam, points=vertices[seam.loop]) for seam in separation.seams),
        notes=(
            *separation.notes,
            f"seam moved to where rock and ground meet, by {1e3 * np.median(length):.1f} mm in the "
            f"median, at most {1e3 * length.max():.1f} mm",
        ),
    )


def planes_beside(
    vertices: Array, faces: Indices, loop: Indices, points: Array, edge: float
) -> tuple[Array, Array]:
    """Planes of a surface beside points.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3) [m]
    faces : ndarray of int, shape (m, 3)
    loop : ndarray of int, vertices whose faces do not count
    points : ndarray, shape (p, 3) [m]
    edge : float [m], length of the mesh's edges

    Returns
    -------
    centre : ndarray, shape (p, 3) [m], on each plane
    normal : ndarray, shape (p, 3), of unit length
    """
    faces = faces[~touching(faces, loop)]
    used, local = np.unique(faces, return_inverse=True)
    normal = smoothed_normals(vertices[used], local, 2)
    middle, area = vertices[faces].mean(axis=1), areas(vertices, faces)
    away, near = cKDTree(middle).query(points, min(_FACES, len(faces)))
    weight = area[near] * (np.exp(-0.5 * (away / (_REACH * edge)) ** 2) + 1e-12)
    own = weight
    for _ in range(_SHIFTS):
        mean = np.einsum("pk,pkj->pj", own, normal[near])
        mean /= np.linalg.norm(mean, axis=1, keepdims=True)
        unlike = np.linalg.norm(normal[near] - mean[:, None], axis=2)
        own = weight * np.exp(-0.5 * (unlike / _ALIKE) ** 2)
    centre = np.einsum("pk,pkj->pj", own, middle[near]) / own.sum(axis=1, keepdims=True)
    return centre, mean


def _to_both(points: Array, c: Array, n: Array, d: Array, m: Array, farthest: float) -> Array:
    """Shortest steps from points to the lines in which planes (c, n) and (d, m) meet, (p, 3) [m].

    0 where the planes are about parallel, or meet beyond ``farthest`` [m].
    """
    first = np.einsum("ij,ij->i", c - points, n)
    second = np.einsum("ij,ij->i", d - points, m)
    cosine = np.einsum("ij,ij->i", n, m)
    meet = np.abs(cosine) < _MEET
    square = np.where(meet, 1.0 - cosine**2, 1.0)
    along_n = np.where(meet, first - cosine * second, 0.0) / square
    along_m = np.where(meet, second - cosine * first, 0.0) / square
    step = along_n[:, None] * n + along_m[:, None] * m
    return step * (np.linalg.norm(step, axis=1, keepdims=True) <= farthest)


def laid(vertices: Array, faces: Indices, loop: Indices, step: Array, edge: float) -> Array:
    """Vertices of a surface beside a loop that moves, laid onto the surface's planes there.

    They follow the loop by half first, lest faces fold.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3) [m], with the loop not yet moved
    faces : ndarray of int, shape (m, 3), of the surface on one side of the loop
    loop : ndarray of int, shape (p,)
    step : ndarray, shape (p, 3) [m], of the loop's vertices
    edge : float [m], length of the mesh's edges

    Returns
    -------
    ndarray, shape (n, 3) [m]
    """
    moved = np.full(vertices.shape, np.nan)
    moved[loop] = step
    beside = np.setdiff1d(faces[touching(faces, loop)], loop)
    points = vertices[beside] + 0.5 * means_beside(faces, moved, beside)
    centre, normal = planes_beside(vertices, faces, loop, points, edge)
    off = np.einsum("ij,ij->i", centre - points, normal)
    off[np.abs(off) > _LARGEST_MOVE * edge] = 0.0
    vertices = vertices.copy()
    vertices[beside] = points + off[:, None] * normal
    return vertices
