"""Small holes of a scan of rock and ground."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from vsr_core.arrays import Array
from vsr_core.scan.cleaning import Cleaned
from vsr_core.scan.filling import WIDEST, filled
from vsr_core.scan.topology import edges, rims

SIDE = 40
EDGE = 0.1


def sheet(*missing: tuple[float, float, float]) -> Cleaned:
    """Wavy ground, coloured by its vertices' places, without discs (x, y, radius)."""
    x, y = np.meshgrid(EDGE * np.arange(SIDE), EDGE * np.arange(SIDE))
    vertices = np.column_stack([x.ravel(), y.ravel(), 0.05 * np.sin(3.0 * x.ravel())])
    at = np.arange(SIDE * SIDE).reshape(SIDE, SIDE)
    a, b, c, d = at[:-1, :-1].ravel(), at[:-1, 1:].ravel(), at[1:, 1:].ravel(), at[1:, :-1].ravel()
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    middles = vertices[faces].mean(axis=1)
    for *place, radius in missing:
        kept = np.linalg.norm(middles[:, :2] - place, axis=1) > radius
        faces, middles = faces[kept], middles[kept]
    colours = colours_at(vertices)
    mesh = trimesh.Trimesh(vertices, faces, vertex_colors=colours, process=False)
    mesh.remove_unreferenced_vertices()
    return Cleaned(mesh, np.zeros(3), ("as it came",))


def colours_at(vertices: Array) -> Array:
    red, green = (60.0 * vertices[:, :2]).T
    return np.column_stack([red, green, 0 * red, 255 + 0 * red]).astype(np.uint8)


def test_a_small_hole_is_filled_between_the_vertices_of_its_rim() -> None:
    whole, given = sheet().mesh, sheet((2.0, 2.0, 0.25))
    found = filled(given)
    faces = np.asarray(found.mesh.faces)
    assert len(rims(np.asarray(given.mesh.faces))) == 2
    assert len(rims(faces)) == 1
    assert edges(faces).count.max() == 2
    assert found.mesh.area == pytest.approx(whole.area, rel=2e-3)
    assert (found.mesh.face_normals[:, 2] > 0.5).all()
    assert found.notes[0] == "as it came"
    assert found.notes[1].startswith("1 of 1 holes filled, up to ")
    assert 0.5 < float(found.notes[1].split()[-3]) < 0.5 + 2.0 * EDGE


def test_a_wide_hole_and_the_border_stay() -> None:
    given = sheet((1.0, 1.0, 0.2), (2.8, 2.8, 0.1 + 0.5 * WIDEST * EDGE))
    left = rims(np.asarray(filled(given).mesh.faces))
    assert len(left) == 2
    assert len(left[0]) == 4 * (SIDE - 1)
    middle = filled(given).mesh.vertices[left[1]].mean(axis=0)
    assert np.linalg.norm(middle[:2] - 2.8) < EDGE


def test_vertices_keep_their_colours() -> None:
    """Also where one comes in, amid an edge across the sheet between two vertices of a rim."""
    mesh = filled(sheet((2.0, 2.0, 0.25))).mesh
    off = mesh.visual.vertex_colors.astype(int) - colours_at(mesh.vertices)
    assert np.abs(off).max() <= 60.0 * EDGE


def test_a_scan_without_holes_is_the_same() -> None:
    given = sheet()
    assert filled(given) is given
