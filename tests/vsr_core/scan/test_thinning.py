"""Scans of too many faces are thinned out, and what that changes is told truly."""

from __future__ import annotations

import re

import numpy as np
import pytest
import trimesh

from vsr_core.scan import thinning
from vsr_core.scan.cleaning import clean, colours_of
from vsr_core.scan.thinning import thinned_out


@pytest.fixture(autouse=True)
def few_faces(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(thinning, "MOST_FACES", 1_000)


def plane(count: int = 60) -> trimesh.Trimesh:
    side = np.linspace(0.0, 3.0, count)
    x, y = np.meshgrid(side, side)
    vertices = np.column_stack([x.ravel(), y.ravel(), 0.1 * x.ravel() + 0.2 * y.ravel()])
    at = np.arange(count**2).reshape(count, count)
    a, b, c, d = (part.ravel() for part in (at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]))
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return trimesh.Trimesh(vertices, faces, process=False)


def test_a_plane_stays_that_plane() -> None:
    mesh = plane()
    made = thinned_out(clean(mesh))
    assert len(made.mesh.faces) < 0.5 * len(mesh.faces)
    points = np.array(made.mesh.vertices) + made.offset
    np.testing.assert_allclose(points @ [0.1, 0.2, -1.0], 0.0, atol=1e-6)
    assert made.mesh.area == pytest.approx(mesh.area, rel=0.02)  # its border gives way a little


def test_what_the_surface_moved_bounds_what_the_volume_changed() -> None:
    ball = trimesh.creation.icosphere(5, 0.5)
    made = thinned_out(clean(ball, alone=True), alone=True)
    assert made.mesh.is_watertight
    found = re.search(r"at most ([0-9.e-]+) mm", " ".join(made.notes))
    assert found is not None
    moved = 1e-3 * float(found[1])
    # A chord of a face with that many on a ball stands off by about area / (4 R).
    assert 0.2 < moved / (ball.area / 1_000 / (4 * 0.5)) < 5.0
    assert abs(made.mesh.volume - ball.volume) <= moved * ball.area


def test_colours_go_with_the_surface() -> None:
    mesh = plane()
    colours = np.where(mesh.vertices[:, :1] < 1.5, [[255, 0, 0, 255]], [[0, 0, 255, 255]])
    mesh.visual.vertex_colors = colours.astype(np.uint8)
    made = thinned_out(clean(mesh))
    found, x = colours_of(made.mesh), np.array(made.mesh.vertices)[:, 0] + made.offset[0]
    assert found is not None
    clear = np.abs(x - 1.5) > 0.1
    assert ((found[clear, 0] == 255) == (x[clear] < 1.5)).all()


def test_few_faces_stay_as_they_are() -> None:
    given = clean(plane(20))
    assert thinned_out(given) is given
