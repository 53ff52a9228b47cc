"""Vertices that stand out, and rocks folded on themselves, are told."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from vsr_core.rock.doubts import doubts, spikes
from vsr_core.scan.missing_ground import holes
from vsr_core.surrogates.double_rock import double_rock

SCALES = (0.5, 0.4, 0.9)


def stone() -> trimesh.Trimesh:
    mesh = trimesh.creation.icosphere(subdivisions=3)
    points = mesh.vertices * SCALES * (1.0 + 0.08 * np.sin(3.0 * mesh.vertices[:, :1]))
    return trimesh.Trimesh(points, mesh.faces, process=False)


def crumpled() -> trimesh.Trimesh:
    """A stone with a summit of small teeth."""
    mesh = trimesh.creation.icosphere(subdivisions=5)
    at = np.linalg.norm(mesh.vertices - [0.0, 0.0, 1.0], axis=1) < 0.2
    mesh.vertices[at] *= 1.0 + 0.09 * (np.arange(at.sum())[:, None] % 2)
    return mesh


@pytest.mark.parametrize(
    "mesh",
    [
        stone(),
        trimesh.creation.box((1.0, 0.5, 3.0)),
        trimesh.creation.cylinder(0.3, 2.0),
        trimesh.creation.uv_sphere(),
        trimesh.creation.box((0.89, 0.16, 0.06)),
        trimesh.creation.extrude_triangulation(
            [[0, 0], [2, 0], [2, 1], [0, 3]], [[0, 1, 2], [0, 2, 3]], 0.2
        ),
        trimesh.Trimesh(*double_rock()),
        crumpled(),
    ],
)
def test_rocks_of_few_and_of_many_faces_are_not_doubted(mesh: trimesh.Trimesh) -> None:
    assert list(doubts(mesh)) == []


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("pair", [False, True])
def test_a_vertex_thrown_out_is_named_with_its_place(axis: int, pair: bool) -> None:
    """As by a flipped bit of an exponent; also together with one beside it."""
    mesh = stone()
    at = int(mesh.vertices[:, axis].argmax())
    out = [at, mesh.vertex_neighbors[at][0]] if pair else [at]
    mesh.vertices[out, axis] *= 2.0
    told = " ".join(doubts(mesh))
    assert any(f"{mesh.vertices[one, axis]:.3g}" in told for one in out)
    assert told.startswith("the vertex at ")
    assert (" m and 1 more stands out by " in told) == pair


@pytest.mark.parametrize("above", [-1.0, 0.0, 0.5])
def test_a_rock_that_lost_its_minus_signs_is_told(above: float) -> None:
    """All of one axis, or those of its upper part."""
    mesh = stone()
    upper = mesh.vertices[:, 2] > above
    mesh.vertices[upper, 0] = np.abs(mesh.vertices[upper, 0])
    assert any("m: signs of coordinates may be lost" in told for told in doubts(mesh))


def ground(height: float | None = None) -> trimesh.Trimesh:
    """11 x 11 cells of 1 m in steps as high as they are wide, with a vertex thrown out."""
    x, y = np.meshgrid(np.arange(12.0), np.arange(12.0), indexing="ij")
    z = np.floor(x / 3.0)
    if height is not None:
        z[5, 6] += height
    corner = np.arange(144).reshape(12, 12)
    a, b, c, d = (
        corner[i : 11 + i, j : 11 + j].ravel() for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))
    )
    faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    points = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    return trimesh.Trimesh(points, faces, process=False)


@pytest.mark.parametrize("height", [None, 5.0, -5.0])
def test_a_vertex_thrown_out_of_open_ground_is_told(height: float | None) -> None:
    told = list(spikes(ground(height)))
    assert len(told) == (height is not None)
    assert all(line.startswith("the vertex at 5, 6, ") for line in told)


@pytest.mark.parametrize(
    ("gone", "told"),
    [
        ([], []),
        ([0, 5, 60], ["the ground has a hole, up to 1 m wide"]),  # two are at its edge
        ([57, 58, 59, 100], ["the ground has 2 holes, up to 3 m wide"]),
    ],
)
def test_holes_of_ground_are_told(gone: list[int], told: list[str]) -> None:
    whole = ground()
    holed = trimesh.Trimesh(whole.vertices, np.delete(whole.faces, gone, axis=0), process=False)
    found = [line.removesuffix(", in which nothing bears a rock") for line in holes(holed)]
    assert found == told
