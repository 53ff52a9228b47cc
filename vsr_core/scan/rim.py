"""Where rock and ground would meet: the seam's vertices moved onto both surfaces.

A scan rounds a hollow off by about an edge, its seam follows edges as they come, and each vertex
has its noise. But the rock's side and the ground beside the seam are known from many faces: each
vertex of the seam is moved to where the two, locally planes, meet.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.scan.cleaning import areas
from vsr_core.scan.concave import mean_edge, smoothed_normals
from vsr_core.scan.separation import Separation

REACH = 2.5
"""Width, in edges, of the weight that faces have on the plane beside a seam."""

LARGEST_MOVE = 2.0
"""A vertex moves by at most this many edges: further off, a plane says nothing."""

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
    edge = mean_edge(vertices, faces[_touching(faces, loop, len(vertices))])
    planes = [planes_beside(vertices, side, loop, vertices[loop], edge) for side in sides]
    way = to_both(vertices[loop], *planes[0], *planes[1], LARGEST_MOVE * edge)
    for side in sides:
        vertices = laid(vertices, side, loop, way, edge)
    vertices[loop] += way
    length = np.linalg.norm(way, axis=1)
    return replace(
        separation,
        vertices=vertices,
        settled=True,
        seams=tuple(replace(seam, points=vertices[seam.loop]) for seam in separation.seams),
        notes=(
            *separation.notes,
            f"seam moved to where rock and ground meet, by {1e3 * np.median(length):.1f} mm in the "
            f"median, at most {1e3 * length.max():.1f} mm",
        ),
    )


def _touching(faces: Indices, loop: Indices, count: int) -> Mask:
    """Faces with a corner on a loop, shape (m,)."""
    on_loop = np.zeros(count, dtype=bool)
    on_loop[loop] = True
    return np.asarray(on_loop[faces].any(axis=1))


def planes_beside(
    vertices: Array, faces: Indices, loop: Indices, points: Array, edge: float
) -> tuple[Array, Array]:
    """Centre and unit normal of the plane of a surface beside points, shape (p, 3) each.

    Faces with a corner on ``loop`` do not count; ``edge`` [m] is the length of the mesh's edges.
    """
    faces = faces[~_touching(faces, loop, len(vertices))]
    used, local = np.unique(faces, return_inverse=True)
    local = local.reshape(-1, 3)
    normal = smoothed_normals(vertices[used], local, 2)
    middle, area = vertices[faces].mean(axis=1), areas(vertices, faces)
    away, near = cKDTree(middle).query(points, min(_FACES, len(faces)))
    weight = area[near] * (np.exp(-0.5 * (away / (REACH * edge)) ** 2) + 1e-12)
    own = weight
    for _ in range(_SHIFTS):
        mean = np.einsum("pk,pkj->pj", own, normal[near])
        mean /= np.linalg.norm(mean, axis=1, keepdims=True)
        unlike = np.linalg.norm(normal[near] - mean[:, None], axis=2)
        own = weight * np.exp(-0.5 * (unlike / _ALIKE) ** 2)
    centre = np.einsum("pk,pkj->pj", own, middle[near]) / own.sum(axis=1, keepdims=True)
    return centre, mean


def to_both(
    points: Array, c: Array, n: Array, d: Array, m: Array, farthest: float = np.inf
) -> Array:
    """Shortest way from each point to the line in which planes (c, n) and (d, m) meet.

    Parameters
    ----------
    points, c, n, d, m : ndarray, shape (p, 3), points, points of the planes and unit normals
    farthest : float [m], beyond which a point stays where it is

    Returns
    -------
    ndarray, shape (p, 3); 0 where the planes are about parallel
    """
    first = np.einsum("ij,ij->i", c - points, n)
    second = np.einsum("ij,ij->i", d - points, m)
    cosine = np.einsum("ij,ij->i", n, m)
    meet = np.abs(cosine) < _MEET
    square = np.where(meet, 1.0 - cosine**2, 1.0)
    along_n = np.where(meet, first - cosine * second, 0.0) / square
    along_m = np.where(meet, second - cosine * first, 0.0) / square
    way = along_n[:, None] * n + along_m[:, None] * m
    return way * (np.linalg.norm(way, axis=1, keepdims=True) <= farthest)


def laid(vertices: Array, faces: Indices, loop: Indices, way: Array, edge: float) -> Array:
    """Vertices of a surface beside a loop that moves, laid onto the surface's planes there.

    They follow the loop by half first, lest faces fold.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3) [m], with the loop not yet moved
    faces : ndarray of int, shape (m, 3), of the surface on one side of the loop
    loop : ndarray of int, shape (p,)
    way : ndarray, shape (p, 3) [m], of the loop's vertices
    edge : float [m], length of the mesh's edges
    """
    moved = np.full(vertices.shape, np.nan)
    moved[loop] = way
    near = faces[_touching(faces, loop, len(vertices))]
    count, total = np.zeros(len(vertices)), np.zeros_like(vertices)
    for k in range(3):
        for j in (1, 2):
            one, other = near[:, k], near[:, (k + j) % 3]
            given = np.isfinite(moved[other, 0])
            np.add.at(total, one[given], moved[other[given]])
            np.add.at(count, one[given], 1.0)
    beside = np.setdiff1d(near, loop)
    points = vertices[beside] + 0.5 * total[beside] / count[beside, None]
    centre, normal = planes_beside(vertices, faces, loop, points, edge)
    off = np.einsum("ij,ij->i", centre - points, normal)
    off[np.abs(off) > LARGEST_MOVE * edge] = 0.0
    vertices = vertices.copy()
    vertices[beside] = points + off[:, None] * normal
    return vertices
