"""What of a scanned surface is doubtful and stays as it is."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from vsr_core.arrays import Array

if TYPE_CHECKING:
    import trimesh

STANDS_OUT, LEAST = 2.0, 0.05
"""How far a vertex may be from the middle of those beside it, by how far they are from there: 0.91
of three scans at most. What is less than so much of the rock's size is not told."""

FILLED = 0.5
"""Least share of its convex hull that a rock fills: three scans fill 0.92."""


def doubts(mesh: trimesh.Trimesh) -> Iterator[str]:
    """Vertices of a rock that stand out, and surfaces laid on each other, in words.

    Parameters
    ----------
    mesh : trimesh.Trimesh [m], closed
    """
    yield from spikes(mesh)
    if (filled := mesh.volume / mesh.convex_hull.volume) < FILLED:
        yield f"the rock fills {filled:.0%} of its convex hull: signs of coordinates may be lost"


def spikes(mesh: trimesh.Trimesh) -> Iterator[str]:
    """Vertices that stand out as none of a rock or of ground does, in words.

    Parameters
    ----------
    mesh : trimesh.Trimesh [m], each vertex of a face
    """
    away, around = _beside(mesh)
    least = LEAST * float(np.max(mesh.extents))
    if len(out := np.flatnonzero((away > STANDS_OUT * around) & (away > least))):
        place = ", ".join(f"{value:.3g}" for value in mesh.vertices[out[0]])
        others = f" and {len(out) - 1} more" if len(out) > 1 else ""
        yield f"the vertex at {place} m{others} stands out by {away[out].max():.3g} m"


def _beside(mesh: trimesh.Trimesh) -> tuple[Array, Array]:
    """Distance of each vertex, and of the farthest beside it, from the middle of those [m]."""
    vertices, number = np.array(mesh.vertices), len(mesh.vertices)
    own, beside = np.vstack([mesh.edges_unique, mesh.edges_unique[:, ::-1]]).T
    count = np.bincount(own, minlength=number)
    middle = np.column_stack(
        [np.bincount(own, vertices[beside, axis], number) / count for axis in range(3)]
    )
    around = np.zeros(number)
    np.maximum.at(around, own, np.linalg.norm(vertices[beside] - middle[own], axis=1))
    return np.linalg.norm(vertices - middle, axis=1), around
