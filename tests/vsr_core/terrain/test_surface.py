"""Ground under a vertical: against exact arithmetic over all triangles, and where it ends."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
import trimesh
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from support import grounds

from vsr_core.terrain.surface import Terrain

Array = NDArray[np.float64]

PROFILE = np.array([[-3.0, 0.0], [-1.0, 0.0], [0.5, 0.0], [0.0, -1.0], [1.0, -1.0], [3.0, -1.0]])
"""A step down towards +x whose wall stands back under its edge."""


@st.composite
def sheets(draw: st.DrawFn, most_shear: float = 2.0) -> Terrain:
    """Rough sheets with jittered vertices, sheared so that some fold over themselves."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    half, cells = draw(st.sampled_from([0.3, 1.0, 7.0])), draw(st.integers(1, 9))
    flat = grounds.level(half, cells)
    vertices = flat.vertices + rng.uniform(-0.3, 0.3, flat.vertices.shape) * half / cells
    vertices[:, 2] *= draw(st.sampled_from([0.0, 1.0, 6.0]))
    vertices[:, :2] += draw(st.sampled_from([0.0, 0.4, 2.0])) * most_shear / 2.0 * vertices[:, 2:]
    return Terrain(vertices + rng.uniform(-5.0, 5.0, 3), flat.faces)


def crossings(terrain: Terrain, x: float, y: float) -> list[tuple[float, bool]]:
    """Heights where the vertical meets each face, and whether it looks up; without any rounding."""
    found = []
    for face in terrain.faces:
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = (
            [Fraction(float(part)) for part in terrain.vertices[k]] for k in face
        )
        px, py = Fraction(x), Fraction(y)
        twice = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if twice == 0:
            continue
        one = ((px - ax) * (cy - ay) - (py - ay) * (cx - ax)) / twice
        other = ((bx - ax) * (py - ay) - (by - ay) * (px - ax)) / twice
        if one >= 0 and other >= 0 and one + other <= 1:
            found.append((float(az + one * (bz - az) + other * (cz - az)), twice > 0))
    return sorted(found)


def in_the_middle(terrain: Terrain, rng: np.random.Generator) -> Array:
    low, high = terrain.vertices[:, :2].min(axis=0), terrain.vertices[:, :2].max(axis=0)
    return np.asarray(rng.uniform(low - 0.1 * (high - low), high + 0.1 * (high - low)))


@pytest.mark.slow
@given(sheets(), st.integers(0, 2**32 - 1))
@settings(max_examples=80, deadline=None, derandomize=True)
def test_verticals_against_all_triangles(terrain: Terrain, seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(6):
        x, y = map(float, in_the_middle(terrain, rng))
        height, upward = terrain.surfaces(x, y)
        expected = crossings(terrain, x, y)
        np.testing.assert_allclose(height, [h for h, _ in expected], rtol=0.0, atol=1e-9)
        assert upward.tolist() == [up for _, up in expected]
        near = set(terrain.around(x, y).tolist())
        met = Terrain(terrain.vertices, terrain.faces[sorted(near)])
        assert len(crossings(met, x, y)) == len(expected)


@given(sheets(most_shear=0.0), st.integers(0, 2**32 - 1))
@settings(max_examples=80, deadline=None, derandomize=True)
def test_no_vertical_slips_through_an_edge_or_a_vertex(terrain: Terrain, seed: int) -> None:
    """Points that rounding puts on either side of the line between two triangles."""
    rng = np.random.default_rng(seed)
    edges = np.concatenate([terrain.faces[:, [i, (i + 1) % 3]] for i in range(3)])
    pair, times = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
    shared = pair[times == 2]
    assume(len(shared))
    for one, other in shared[rng.integers(len(shared), size=10)]:
        share = rng.choice([0.0, 0.5, rng.uniform()])
        place = terrain.vertices[one] + share * (terrain.vertices[other] - terrain.vertices[one])
        border = np.isin([one, other], pair[times == 1]).any()
        if border and share == 0.0:
            continue
        height, _ = terrain.surfaces(float(place[0]), float(place[1]))
        assert np.abs(height - place[2]).min(initial=np.inf) < 1e-9 * (1.0 + abs(place[2]))
        assert terrain.depth(place) is not None


def test_border_of_a_sheet() -> None:
    terrain = grounds.level(2.0, 5)
    for x, y in [(2.0, 0.3), (-2.0, 2.0), (-2.0, -2.0), (0.4, 2.0), (2.0, 2.0)]:
        assert set(terrain.surfaces(x, y)[0].tolist()) == {0.0}
        assert terrain.depth(np.array([x, y, -0.25])) == 0.25
        for away in (1.0 + 1e-9, 3.0, 1e6):
            assert terrain.depth(np.array([away * x, away * y, -1.0])) is None


def test_border_on_the_rim_of_a_cell() -> None:
    """Of the lookup: 1.0 m is the start of its 11th cell of 0.1 m, though 1.0 // 0.1 is 9."""
    strip = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.01, 0.0], [0.0, 0.01, 0.0]])
    near, far = strip * [0.5, 1.0, 1.0], strip + np.array([1.0, 0.0, 0.0])
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    terrain = Terrain(np.vstack([near, far]), faces)
    assert terrain.depth(np.array([1.0, 0.005, -1.0])) == 1.0
    assert terrain.depth(np.array([0.75, 0.005, -1.0])) is None


def test_hole_in_a_sheet() -> None:
    whole = grounds.level(2.0, 8)
    centre = whole.vertices[whole.faces].mean(axis=1)[:, :2]
    terrain = Terrain(whole.vertices, whole.faces[np.abs(centre).max(axis=1) > 0.5])
    assert terrain.depth(np.array([0.1, 0.2, -1.0])) is None
    assert terrain.depth(np.array([0.6, 0.2, -1.0])) == 1.0


@pytest.mark.parametrize(
    ("point", "depth"),
    [
        ((0.25, 0.1, 0.3), 0.0),  # above the edge
        ((0.25, 0.1, -0.2), 0.2),  # in the lip
        ((0.25, 0.1, -0.5), 0.0),  # on its underside
        ((0.25, 0.1, -0.75), 0.0),  # in the air under it
        ((0.25, 0.1, -1.5), 0.5),  # under the foot
        ((-0.5, 0.1, -0.75), 0.75),
        ((0.75, 0.1, -0.75), 0.0),
        ((0.75, 0.1, -1.25), 0.25),
        ((3.5, 0.1, -1.25), None),
    ],
)
def test_depth_under_an_overhang(point: tuple[float, float, float], depth: float | None) -> None:
    terrain = grounds.extruded(PROFILE, 2.0)
    found = terrain.depth(np.array(point))
    assert found == (None if depth is None else pytest.approx(depth, abs=1e-12))


def test_surfaces_of_an_overhang() -> None:
    height, upward = grounds.extruded(PROFILE, 2.0).surfaces(0.25, 0.1)
    assert height.tolist() == pytest.approx([-1.0, -0.5, 0.0])
    assert upward.tolist() == [True, False, True]


def test_depth_is_inside_a_solid_that_the_sheet_closes() -> None:
    """Solid angle of a folded sheet and of the deep box under it, seen from the point."""
    rough = grounds.bumpy(3, 1.2, 1.5, half=6.0, cells=32)
    sheared = np.array([[1.0, 0.0, 3.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    level = 4.0 - np.abs(rough.vertices[:, :2]).max(axis=1)
    rough.vertices[:, 2] *= np.clip(level, 0.0, 1.0)  # where the walls of the box begin
    terrain = grounds.moved(rough, sheared)
    box = trimesh.creation.box(bounds=[[-6.0, -6.0, -9.0], [6.0, 6.0, 0.0]])
    walls = box.triangles[box.face_normals[:, 2] < 0.5]
    closed = np.concatenate([terrain.vertices[terrain.faces], walls])
    rng = np.random.default_rng(0)
    points = rng.uniform([-2.8, -2.8, -1.0], [2.8, 2.8, 1.0], (400, 3))
    inside = np.array([winding(closed, point) for point in points])
    assert np.abs(inside - np.round(inside)).max() < 1e-6
    depths = [terrain.depth(point) for point in points]
    assert [bool(d) for d in depths] == (inside > 0.5).tolist()
    folded = sum(len(terrain.surfaces(*map(float, p[:2]))[0]) > 1 for p in points)
    assert folded > 20
    assert 50 < np.count_nonzero(inside > 0.5) < 350
    for point, depth in zip(points, depths, strict=True):
        if depth:  # out of the ground just above, still in it just below
            up = np.array([0.0, 0.0, depth])
            assert winding(closed, point + up * (1.0 + 1e-6)) == pytest.approx(0.0, abs=1e-3)
            assert winding(closed, point + up * (1.0 - 1e-6)) == pytest.approx(1.0, abs=1e-3)


def winding(triangles: Array, point: Array) -> float:
    """How often a closed surface winds around a point (Van Oosterom & Strackee 1983)."""
    a, b, c = np.moveaxis(triangles - point, 1, 0)
    la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("ij,ij->i", u, v) for u, v in ((a, b), (b, c), (c, a)))
    below = la * lb * lc + ab * lc + bc * la + ca * lb
    return float(np.arctan2(volume, below).sum() / (2.0 * np.pi))


@given(sheets(), st.integers(0, 2**32 - 1))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_order_of_faces_and_corners_and_the_origin_do_not_matter(
    terrain: Terrain, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    x, y = map(float, in_the_middle(terrain, rng))
    height, upward = terrain.surfaces(x, y)
    faces = rng.permutation(terrain.faces)
    rolled = np.array([np.roll(face, rng.integers(3)) for face in faces])
    shift = np.array([64.0, -32.0, 16.0])
    for other, there in [
        (Terrain(terrain.vertices, rolled), np.zeros(3)),
        (Terrain(terrain.vertices + shift, terrain.faces), shift),
    ]:
        again, looks = other.surfaces(x + there[0], y + there[1])
        np.testing.assert_allclose(again - there[2], height, rtol=0.0, atol=1e-7)
        assert looks.tolist() == upward.tolist()
    below = float(height[0] - 0.3) if len(height) else 0.0
    point = np.array([x, y, below])
    moved = Terrain(terrain.vertices + shift, terrain.faces).depth(point + shift)
    depth = terrain.depth(point)
    assert (moved is None) == (depth is None)
    if depth is not None:
        assert moved == pytest.approx(depth, abs=1e-7)


def test_triangles_of_very_different_sizes() -> None:
    """One of 20 m among many of centimetres: the cells of the lookup fit neither."""
    fine = grounds.bumpy(1, 0.1, 0.3, half=0.5, cells=20)
    large = np.array([[0.5, -9.0, 0.0], [20.0, 0.0, -3.0], [0.5, 9.0, 0.0]])
    faces = np.vstack([fine.faces, [[len(fine.vertices) + k for k in range(3)]]])
    terrain = Terrain(np.vstack([fine.vertices, large]), faces)
    rng = np.random.default_rng(0)
    for _ in range(20):
        u, v = np.sort(rng.uniform(size=2))
        place = large.T @ [u, v - u, 1.0 - v]
        assert terrain.depth(place - [0.0, 0.0, 0.25]) == pytest.approx(0.25)
        x, y = rng.uniform(-0.49, 0.49, 2)
        expected = [h for h, _ in crossings(fine, float(x), float(y))]
        np.testing.assert_allclose(terrain.surfaces(float(x), float(y))[0], expected, atol=1e-12)


def test_lowest_point() -> None:
    terrain = grounds.extruded(PROFILE, 2.0)
    assert terrain.lowest == -1.0
    assert replace(terrain, vertices=terrain.vertices - [0.0, 0.0, 2.5]).lowest == -3.5


def test_a_vertical_wall_is_not_met() -> None:
    """Only the ground above and below it is."""
    wall = np.array([[-2.0, 0.0], [0.3, 0.0], [0.3, -1.0], [2.0, -1.0]])
    terrain = grounds.extruded(wall, 1.0)
    assert set(terrain.surfaces(0.3, 0.1)[0].tolist()) == {-1.0, 0.0}
    assert terrain.surfaces(0.31, 0.1)[0].tolist() == [-1.0]
