"""What of a scanned surface is doubtful and stays as it is."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import trimesh

STANDS_OUT, LEAST = 2.0, 0.05
"""How far a vertex may be from the median of those beside it, by how far half of them are from
there; and the share of the surface's size below which that is not told. A corner of a box is as
far, and of 32,000 vertices of three scans three are farther, by less than that share."""

POINTED = np.radians(240.0)
"""Sum of the angles of faces about such a vertex at most; about a corner of a box it is 270 deg."""

SHARP, FOLDED = np.radians(135.0), 0.2
"""Angle between faces that lie back to back; and the length of such edges by the size of a rock:
0.09 of three scans at most."""


def doubts(mesh: trimesh.Trimesh) -> Iterator[str]:
    """Vertices of a rock that stand out, and faces laid on each other, in words.

    Parameters
    ----------
    mesh : trimesh.Trimesh [m], closed
    """
    yield from spikes(mesh)
    one, other = mesh.vertices[mesh.face_adjacency_edges[mesh.face_adjacency_angles > SHARP].T]
    length = float(np.linalg.norm(other - one, axis=1).sum())
    apart = np.ptp(one, axis=0).max() if len(one) else 0.0  # a crumpled summit is in one place
    if min(length, apart) > FOLDED * np.max(mesh.extents):
        yield f"faces lie back to back along {length:.2g} m: signs of coordinates may be lost"


def spikes(mesh: trimesh.Trimesh) -> Iterator[str]:
    """Vertices that stand out as none of a rock or of ground does, in words.

    Parameters
    ----------
    mesh : trimesh.Trimesh [m], each vertex of a face
    """
    vertices, number = np.array(mesh.vertices), len(mesh.vertices)
    own, beside = np.vstack([mesh.edges_unique, mesh.edges_unique[:, ::-1]]).T
    beside = beside[np.argsort(own, kind="stable")]
    ends = np.cumsum(np.bincount(own, minlength=number))
    middle = np.add.reduceat(vertices[beside], np.append(0, ends[:-1]))
    middle /= np.diff(ends, prepend=0)[:, None]
    least, out = LEAST * float(np.max(mesh.extents)), []
    angles = np.bincount(mesh.faces.ravel(), mesh.face_angles.ravel(), number)
    far = np.linalg.norm(vertices - middle, axis=1) > least
    for at in np.flatnonzero(far & (angles < POINTED)):
        around = vertices[beside[ends[at - 1] if at else 0 : ends[at]]]
        centre = np.median(around, axis=0)
        away = float(np.linalg.norm(vertices[at] - centre))
        if away > max(STANDS_OUT * np.median(np.linalg.norm(around - centre, axis=1)), least):
            out.append((away, at))
    if out:
        most, at = max(out)
        place = ", ".join(f"{value:.3g}" for value in vertices[at])
        others = f" and {len(out) - 1} more" if len(out) > 1 else ""
        yield f"the vertex at {place} m{others} stands out by {most:.3g} m"
