"""The seam of a large scan: proposed on few of its faces, then found among all that lie near."""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.rock.triangles import areas
from vsr_core.scan.concave import cheapest_cut, turns
from vsr_core.scan.proposal import Undecided, propose
from vsr_core.scan.separation import Separation, at_border, seams, whole
from vsr_core.scan.thinning import fewer
from vsr_core.scan.topology import touching

AT_ONCE = 60_000
"""Faces among which a seam is proposed at once; of a larger scan, so many are looked at first."""

_BAND = 4.0  # edges of the coarse scan, from its seam, within which that of all faces is sought
_CORE = 0.7  # of the way from its seam to what is deepest in the rock, beyond which all is rock


def proposed(
    mesh: trimesh.Trimesh, near: tuple[float, float, float] | None, offset: Array
) -> Separation:
    """Rock and ground of a clean scan of any size; see ``propose``.

    The cheapest cut of a large scan is sought only where its coarse one passes: elsewhere faces
    are of what the coarse faces nearest to them are of. Noise that is as large as the edges, which
    hides a hollow, is less in the coarse scan.

    Raises
    ------
    Undecided
        As ``propose`` does.
    """
    if len(mesh.faces) <= AT_ONCE:
        return propose(mesh, near, offset)
    thin = fewer(mesh, AT_ONCE)
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int64)
    middle = vertices[faces].mean(axis=1)
    nearest = _nearest(thin.mesh, middle - thin.offset)
    try:
        coarse = propose(thin.mesh, near, offset + thin.offset)
    except Undecided as error:
        rocks = {name: rock[nearest] for name, rock in error.rocks.items()}
        raise Undecided(error.given, error.rule, error.remedy, rocks) from error
    free = _beside_seam(coarse, middle - thin.offset)
    outer, rock = at_border(faces), coarse.rock[nearest]
    found = turns(vertices, faces)
    rock = cheapest_cut(found, rock & ~free & ~outer, (~rock & ~free) | outer)
    rock, notes = whole(vertices, faces, rock)
    own = (f"seam proposed on {len(coarse.faces)} faces, then found among all {len(faces)}",)
    return Separation(
        vertices,
        faces,
        rock,
        seams(vertices, faces, rock, found),
        coarse.confidence,
        (*coarse.notes, *own, *notes),
    )


def _nearest(mesh: trimesh.Trimesh, points: Array) -> Indices:
    """Faces whose middles are nearest to points."""
    return np.asarray(cKDTree(mesh.triangles.mean(axis=1)).query(points)[1])


def _beside_seam(coarse: Separation, points: Array) -> Mask:
    """Which points lie near a coarse seam: of a rock of a few edges, not all of it."""
    loops = np.concatenate([seam.points for seam in coarse.seams])
    loop = np.concatenate([seam.loop for seam in coarse.seams])
    beside = coarse.faces[touching(coarse.faces, loop)]
    edge = float(np.sqrt(4.0 / np.sqrt(3.0) * areas(coarse.vertices, beside).mean()))
    tree, rock = cKDTree(loops), coarse.vertices[coarse.faces[coarse.rock]].mean(axis=1)
    reach = min(_BAND * edge, _CORE * float(tree.query(rock)[0].max()))
    away = tree.query(points, distance_upper_bound=reach)[0]
    return np.asarray(np.isfinite(away))
