"""A scan's noise taken off its faces' normals, and its vertices moved to follow them.

Edges stay: a face is averaged with its neighbours the less, the more their smoothed normals
differ (bilateral filter of normals, Zheng et al. 2011, guided as in Zhang et al. 2015; vertices
after Sun et al. 2007).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vsr_core.scan.concave import smoothed_normals
from vsr_core.scan.topology import at_border

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_ALIKE = 0.35  # width, in |difference of normals|, of the weight of neighbours
_ROUNDS = 2  # of the filter
_FOLLOWING = 5  # rounds in which vertices follow the normals


def smoothed(vertices: Array, faces: Index) -> Array:
    """Vertices with less noise, shape (n, 3) [m]; those on open rims stay."""
    from scipy.sparse import csr_array

    count = len(faces)
    corners = csr_array(
        (np.ones(3 * count), faces.ravel(), np.arange(0, 3 * count + 1, 3)),
        shape=(count, len(vertices)),
    )
    beside = (corners @ corners.T).tocoo()
    one, other = beside.coords
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    vector = np.cross(b - a, c - a)
    area = np.linalg.norm(vector, axis=1)
    normal = vector / area[:, None]
    guide = smoothed_normals(vertices, faces, 1)
    for _ in range(_ROUNDS):
        unlike = np.linalg.norm(guide[one] - guide[other], axis=1)
        weight = area[other] * np.exp(-0.5 * (unlike / _ALIKE) ** 2)
        mixing = csr_array((weight, (one, other)), shape=(count, count))
        normal = mixing @ normal
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        guide = normal
    held = np.zeros(len(vertices), dtype=bool)
    held[faces[at_border(faces, len(vertices))]] = True
    around = np.maximum(np.bincount(faces.ravel(), minlength=len(vertices)), 1)[:, None]
    moved = vertices.copy()
    for _ in range(_FOLLOWING):
        middle = moved[faces].mean(axis=1)
        step = np.zeros_like(moved)
        for k in range(3):
            off = np.einsum("ij,ij->i", middle - moved[faces[:, k]], normal)
            np.add.at(step, faces[:, k], off[:, None] * normal)
        step[held] = 0.0
        moved += step / around
    return moved
