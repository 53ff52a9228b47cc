"""What of a raw scan is refused before rock and ground are told apart, and where."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import trimesh

from vsr_core.errors import InvalidInput
from vsr_core.scan.cleaning import clean, with_area
from vsr_core.scan.cuts import Box
from vsr_core.scan.preparation import prepare_scan
from vsr_core.scan.weighing import Refused

FAR = np.array([712345.25, 3894567.4, 251.55])


def hill(cells: int = 60) -> trimesh.Trimesh:
    """A sheet of 12 m with a hill, around the origin."""
    along = np.linspace(-6.0, 6.0, cells + 1)
    x, y = (values.ravel() for values in np.meshgrid(along, along, indexing="ij"))
    corner = np.arange(len(x)).reshape(cells + 1, cells + 1)
    a, b = corner[:-1, :-1].ravel(), corner[1:, :-1].ravel()
    c, d = corner[1:, 1:].ravel(), corner[:-1, 1:].ravel()
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    height = 2.0 * np.exp(-(x**2 + y**2) / 4.0)
    return trimesh.Trimesh(np.column_stack([x, y, height]), faces, process=False)


def with_ball(radius: float, height: float = 1.2) -> trimesh.Trimesh:
    """The hill and a ball on its flank, or within it, far from the origin."""
    ball = trimesh.creation.icosphere(2, radius)
    ball.apply_translation((1.0, -2.0, height))
    both = trimesh.util.concatenate([hill(), ball])
    both.apply_translation(FAR)
    return both


def test_a_rock_beside_its_ground_is_not_dropped() -> None:
    """It is a hundredth of the surface; the hill would be taken for the rock."""
    given = with_ball(0.3)
    share = 4.0 * np.pi * 0.3**2 / given.area
    assert share < 0.01
    with pytest.raises(Refused, match=r"a closed piece 0\.6 m large") as refused:
        prepare_scan(lambda: given, None, closing="caps", density=2000.0, tell=str)
    np.testing.assert_allclose(refused.value.places[0], FAR + np.array([1.0, -2.0, 1.2]), atol=1e-6)
    assert "(712346.25, 3894565.40, 252.75)" in str(refused.value)
    assert "pedestal.mesh" in refused.value.remedy


@pytest.mark.parametrize(("radius", "height"), [(0.02, 1.2), (0.2, -0.5)])
def test_a_speck_and_a_hollow_within_are_dropped(radius: float, height: float) -> None:
    with pytest.raises(Refused) as refused:  # of the hill alone
        prepare_scan(hill, None, closing="caps", density=2000.0, tell=str)
    with pytest.raises(Refused) as beside:
        prepare_scan(
            lambda: with_ball(radius, height), None, closing="caps", density=2000.0, tell=str
        )
    assert beside.value.given == refused.value.given


@pytest.mark.parametrize("half", [0.15, 0.3])
def test_a_rock_of_faces_that_all_touch_the_seam(half: float) -> None:
    """One vertex that stands out is no rock whose sides could be told."""
    mesh = hill()
    mesh.vertices[:, 2] = 0.0
    middle = np.abs(mesh.vertices[:, :2]).max(axis=1) < 1e-9
    mesh.vertices[middle, 2] = 0.5
    cut = Box((-half, -half, 0.01), (half, half, 1.0))
    with pytest.raises(Refused, match="all of whose faces touch the seam at"):
        prepare_scan(lambda: mesh, cut, closing="caps", density=2000.0, tell=str)


@pytest.mark.parametrize("alone", [True, False])
@pytest.mark.parametrize("height", [np.inf, np.nan])
def test_a_scan_whose_faces_all_have_a_corner_that_is_not_finite(
    height: float, alone: bool
) -> None:
    around = [[np.cos(x), np.sin(x), 0.0] for x in np.linspace(0.0, 2.0 * np.pi, 9)]
    fan = trimesh.Trimesh(
        [[0.0, 0.0, height], *around], [[0, k, k + 1] for k in range(1, 9)], process=False
    )
    with pytest.raises(InvalidInput, match="without a face between three finite points"):
        clean(fan, alone=alone)


@pytest.mark.parametrize("points", [1, 2, 5])
def test_an_edge_closed_by_faces_without_area_is_closed(points: int) -> None:
    """Points on the edge of a box that one of its two faces has, and the other has not."""
    box = trimesh.creation.box((1.0, 1.0, 2.0))
    a, b, c = box.faces[0]
    share = np.linspace(0.0, 1.0, points + 2)[1:-1, None]
    vertices = np.concatenate(
        [box.vertices, (1.0 - share) * box.vertices[a] + share * box.vertices[b]]
    )
    line = [a, *range(len(box.vertices), len(vertices)), b]
    fan = [[one, other, c] for one, other in pairwise(line)]
    flat = [[a, other, one] for one, other in pairwise(line[1:])]
    faces = np.concatenate([box.faces[1:], fan, flat])
    notes: list[str] = []
    found = trimesh.Trimesh(vertices, with_area(vertices, faces, notes), process=False)
    assert notes == [f"{points} faces without area repaired, 0 of them dropped"]
    assert found.is_watertight
    assert found.volume == pytest.approx(2.0)
    assert found.area_faces.min() > 1e-3
