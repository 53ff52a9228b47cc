"""A scan with fewer triangles, as near to it as so few can be."""

from __future__ import annotations

import gc
from dataclasses import replace

import fast_simplification
import numpy as np
import trimesh
from scipy.spatial import cKDTree
from trimesh.proximity import closest_point

from vsr_core.scan.cleaning import Cleaned, clean, colours_of

MOST_FACES = 1_000_000
"""Faces of a scan that are kept; more are thinned out."""

_COMPARED = 20_000  # vertices of the scan whose distance from the thin one is measured


def thinned_out(cleaned: Cleaned, *, alone: bool = False) -> Cleaned:
    """A clean scan of at most about ``MOST_FACES``, clean again, and how far its surface moved.

    Parameters
    ----------
    alone : bool, see ``clean``
    """
    count, given = len(cleaned.mesh.faces), np.asarray(cleaned.mesh.vertices)
    if count <= MOST_FACES:
        return cleaned
    thin = fewer(cleaned.mesh, MOST_FACES, alone=alone)
    some = np.random.default_rng(0).choice(len(given), min(_COMPARED, len(given)), replace=False)
    away = closest_point(thin.mesh, given[some] - thin.offset)[1]
    note = (
        f"thinned out from {count} to {len(thin.mesh.faces)} faces, which moves the surface by "
        f"{1e3 * np.median(away):.2g} mm in the median, at most {1e3 * away.max():.2g} mm"
    )
    offset, notes = cleaned.offset + thin.offset, (*cleaned.notes, note, *thin.notes)
    return replace(thin, offset=offset, notes=notes)


def fewer(mesh: trimesh.Trimesh, most: int, *, alone: bool = False) -> Cleaned:
    """A clean scan of at most about ``most`` faces, clean again; colours are those nearest by.

    Edges collapse where the quadric error is least (Garland & Heckbert 1997, by
    fast-simplification), so flat ground gives up more of them than edges of a rock do.

    Parameters
    ----------
    mesh : trimesh.Trimesh [m], near the origin
    alone : bool, see ``clean``
    """
    gc.collect()  # a mesh of trimesh's refers to itself: one that was dropped is still there
    given = np.asarray(mesh.vertices, dtype=np.float32)
    faces = np.asarray(mesh.faces, dtype=np.int32)
    vertices, faces = fast_simplification.simplify(given, faces, target_count=most)
    colours = colours_of(mesh)
    if colours is not None:
        colours = colours[cKDTree(given).query(vertices)[1]]
    made = trimesh.Trimesh(vertices, faces, vertex_colors=colours, process=False)
    return clean(made, alone=alone)
