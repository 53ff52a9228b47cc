"""A seam found on few faces first is that which is found among all of them."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from support.suites import slow_but

from vsr_core.rock.triangles import areas
from vsr_core.scan import coarse_first
from vsr_core.scan.coarse_first import proposed
from vsr_core.scan.proposal import Undecided, propose
from vsr_core.surrogates.field_scans import FieldScan, above_ground, scan

SOMEWHERE = np.array([100.0, -20.0, 3.0])


@pytest.fixture(autouse=True)
def few_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(coarse_first, "AT_ONCE", 5_000)


def sheet(field: FieldScan) -> trimesh.Trimesh:
    made = scan(field)
    return trimesh.Trimesh(made.vertices, made.faces, process=False)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, *(pytest.param(n, marks=pytest.mark.slow) for n in (2, 3))])
def test_same_rock_as_among_all_faces_at_once(seed: int) -> None:
    mesh = sheet(FieldScan(seed))
    assert len(mesh.faces) > 2 * coarse_first.AT_ONCE
    near = (100.0, -20.0, 3.7)
    coarse, direct = (way(mesh, near, SOMEWHERE) for way in (proposed, propose))
    area = areas(direct.vertices, direct.faces)
    apart = area[coarse.rock != direct.rock].sum() / area[direct.rock].sum()
    assert apart < 0.02


@pytest.mark.slow
def test_noise_as_large_as_the_edges_does_not_hide_the_rock() -> None:
    field = FieldScan(4, noise=0.012, edge=0.04)
    mesh = sheet(field)
    made = proposed(mesh, (0.0, 0.0, 0.7), np.zeros(3))
    points = made.vertices[made.faces[made.rock]].reshape(-1, 3)
    true = above_ground(field)[0]
    np.testing.assert_allclose(np.ptp(points, axis=0), np.ptp(true, axis=0), rtol=0.12)


@pytest.mark.parametrize("faces", slow_but([1_800], [1_800, 3_000, 6_000]))
def test_a_rock_of_a_few_coarse_edges_is_that_among_all_faces(
    monkeypatch: pytest.MonkeyPatch, faces: int
) -> None:
    """All of it is near its seam: a band of four edges would leave no rock to cut around."""
    count, radius = 110, 0.4
    axis = np.linspace(-4.0, 4.0, count)
    x, y = (place.ravel() for place in np.meshgrid(axis, axis, indexing="ij"))
    away = np.hypot(x, y)
    top = 0.3 * radius + np.sqrt(np.maximum(radius**2 - away**2, 0.0))
    at = np.arange(count**2).reshape(count, count)
    corners = at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]
    first, second, third, fourth = (corner.ravel() for corner in corners)
    triangles = np.concatenate([np.c_[first, second, third], np.c_[first, third, fourth]])
    noise = np.random.default_rng(0).normal(0.0, 0.002, len(x))
    points = np.c_[x, y, np.where(away < radius, top, 0.05 * np.sin(x) + noise)]
    mesh = trimesh.Trimesh(points, triangles, process=False)
    monkeypatch.setattr(coarse_first, "AT_ONCE", faces)
    coarse, direct = (way(mesh, None, SOMEWHERE) for way in (proposed, propose))
    np.testing.assert_array_equal(coarse.rock, direct.rock)


@pytest.mark.slow
def test_where_no_rock_is_the_candidates_are_told_among_all_faces() -> None:
    mesh = sheet(FieldScan(1))
    with pytest.raises(Undecided) as refused:
        proposed(mesh, (1.1, 1.1, 0.0), np.zeros(3))
    assert refused.value.rocks
    for rock in refused.value.rocks.values():
        assert rock.shape == (len(mesh.faces),)
        middle = mesh.triangles_center[rock].mean(axis=0)
        assert np.hypot(*middle[:2]) < 0.3
