"""Gaps that a scan left in its surface, filled so that only its outer border is open."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vsr_core.errors import Unfit
from vsr_core.scan.clean import colours_of
from vsr_core.scan.fill import across, area_vector, frame
from vsr_core.scan.topology import edges, ends, rims

if TYPE_CHECKING:
    import trimesh

Array = NDArray[np.float64]
Index = NDArray[np.int64]


def filled(mesh: trimesh.Trimesh) -> tuple[trimesh.Trimesh, tuple[str, ...]]:
    """A clean scan with every rim but the longest filled, and what was.

    A gap is filled across the plane of its rim; one that is too crooked for that by a fan about
    its middle.
    """
    import trimesh

    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int64)
    loops = sorted(rims(faces), key=lambda loop: _length(vertices[loop]))[:-1]
    if not loops:
        return mesh, ()
    links = np.sort(ends(faces, np.arange(3 * len(faces))), axis=1)
    known = set(map(tuple, links[np.isin(links, np.concatenate(loops)).all(axis=1)].tolist()))
    fills: list[Index] = []
    middles: list[Index] = []
    area = 0.0
    for loop in loops:
        area += float(np.linalg.norm(area_vector(vertices[loop])))
        fill = _across(vertices, loop, known)
        if fill is None:
            middle = np.full(len(loop), len(vertices) + len(middles))
            middles.append(loop)
            fill = np.column_stack([np.roll(loop, -1), loop, middle])
        fills.append(fill)
    colours = colours_of(mesh)
    if colours is not None:
        colours = np.concatenate([colours, *[colours[loop[:1]] for loop in middles]])
    vertices = np.concatenate([vertices, *[vertices[loop].mean(axis=0)[None] for loop in middles]])
    whole = trimesh.Trimesh(
        vertices, np.concatenate([faces, *fills]), vertex_colors=colours, process=False
    )
    longest = _length(vertices[loops[-1]])
    return whole, (
        f"{len(loops)} gaps of the scan filled ({area:.2g} m2, the longest {longest:.2g} m round): "
        "what was not seen there is made up",
    )


def _length(loop: Array) -> float:
    return float(np.linalg.norm(loop - np.roll(loop, 1, axis=0), axis=1).sum())


def _across(vertices: Array, loop: Index, known: set[tuple[int, int]]) -> Index | None:
    """Faces across the plane of a rim; none if it crosses itself or an edge is there already."""
    up = area_vector(vertices[loop])
    if not np.linalg.norm(up) > 0.0:
        return None
    try:
        triangles = across(frame(vertices[loop], up).into(vertices[loop])[:, :2])[1]
    except Unfit:
        return None
    faces = loop[triangles][:, ::-1]
    inner = np.sort(ends(faces, edges(faces).pairs[:, 0]), axis=1)
    return None if known & set(map(tuple, inner.tolist())) else faces
