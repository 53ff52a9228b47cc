"""Small holes of a scan of rock and ground filled, before the two are told apart.

A hole across the seam would make the seam go around it, up the rock's side.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from vsr_core.arrays import Array, Indices
from vsr_core.errors import InvalidInput
from vsr_core.scan.cleaning import Cleaned, colours_of
from vsr_core.scan.topology import rims
from vsr_core.scan.whole_rock import Hole, holes_of, triangles_across, without_chords

WIDEST = 10.0
"""Width of a hole that is filled, in mean edges of its rim."""


def filled(cleaned: Cleaned) -> Cleaned:
    """The scan without its small holes; the widest rim is its border and stays.

    A hole whose rim crosses itself stays, too.
    """
    given, faces = np.array(cleaned.mesh.vertices), np.array(cleaned.mesh.faces, dtype=np.int64)
    if len(rims(faces)) < 2:
        return cleaned
    vertices, faces = without_chords(given, faces)
    holes = sorted(holes_of(vertices, faces), key=lambda hole: hole.width)[:-1]
    found = [(hole, _across(vertices, hole)) for hole in holes]
    found = [(hole, triangles) for hole, triangles in found if len(triangles)]
    if not found:
        return cleaned
    colours = colours_of(cleaned.mesh)
    if colours is not None:
        colours = colours[cKDTree(given).query(vertices)[1]]
    whole = np.concatenate([faces, *(triangles for _, triangles in found)])
    mesh = trimesh.Trimesh(vertices, whole, vertex_colors=colours, process=False)
    width = found[-1][0].width
    note = f"{len(found)} of {len(holes)} holes filled, up to {width:.2g} m wide"
    return replace(cleaned, mesh=mesh, notes=(*cleaned.notes, note))


def _across(vertices: Array, hole: Hole) -> Indices:
    """Triangles across a hole; none where it stays."""
    points = vertices[hole.rim]
    edge = np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1).mean()
    if hole.width <= WIDEST * edge:
        try:
            return triangles_across(vertices, hole.rim)
        except InvalidInput:
            pass
    return np.empty((0, 3), dtype=np.int64)
