"""A user's cut lies where it is told, however long the edges are that it crosses."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
import trimesh
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from vsr_core.scan.cuts import Box, Plane, Polygon, split

CUBE = trimesh.creation.box((2.0, 2.0, 2.0))


def area(cut: Plane | Box | Polygon, mesh: trimesh.Trimesh = CUBE) -> float:
    """Of the rock; rock and ground together are the surface as it was, without gaps."""
    vertices, faces, rock = split(mesh, cut)
    whole = trimesh.Trimesh(vertices, faces, process=False)
    assert whole.is_watertight
    assert (whole.area, whole.volume) == pytest.approx((mesh.area, mesh.volume))
    return float(whole.area_faces[rock].sum())


@pytest.mark.parametrize(
    ("low", "high", "exact"),
    [
        ((-9.0, -9.0, 0.3), (9.0, 9.0, 9.0), 4.0 + 4.0 * 2.0 * 0.7),
        ((-1.1, -1.1, 0.3), (1.1, 1.1, 1.1), 4.0 + 4.0 * 2.0 * 0.7),
        ((-0.5, -0.4, 0.0), (0.5, 0.4, 9.0), 0.8),
        ((0.5, 0.5, 0.5), (9.0, 9.0, 9.0), 3.0 * 0.25),
        ((-0.1, -9.0, -9.0), (0.1, 9.0, 9.0), 0.2 * 8.0),
    ],
)
def test_a_box_cuts_where_its_sides_are(
    low: tuple[float, float, float], high: tuple[float, float, float], exact: float
) -> None:
    """Faces of a cube, whose edges are as long as its sides."""
    assert area(Box(low, high)) == pytest.approx(exact)


def test_a_box_is_the_plane_that_alone_cuts() -> None:
    one, other = area(Box((-5.0, -5.0, 0.1), (5.0, 5.0, 5.0))), area(Plane((0, 0, 0.1), (0, 0, 2)))
    assert one == pytest.approx(other, rel=1e-12)


@pytest.mark.parametrize("turn", [1, -1])
def test_a_convex_prism_cuts_where_its_walls_are(turn: int) -> None:
    """Across a cube, and over one of its corners, in either order."""
    across = ((-0.5, -9.0), (0.5, -9.0), (0.5, 9.0), (-0.5, 9.0))[::turn]
    assert area(Polygon(across)) == pytest.approx(8.0)
    corner = ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0))[::turn]
    assert area(Polygon(corner)) == pytest.approx(2.0 + 2.0 * 2.0)


@given(st.lists(st.tuples(st.floats(0.3, 1.0), st.floats(0.3, 0.95)), min_size=4, max_size=9))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_a_prism_cuts_where_its_walls_are(parts: list[tuple[float, float]]) -> None:
    """A star through the top and the bottom of a cube, but for what vertices count as on it."""
    turn, radius = np.array(parts).T
    turn = 2.0 * np.pi * np.cumsum(turn) / turn.sum()
    star = shapely.Polygon(np.column_stack([radius * np.cos(turn), radius * np.sin(turn)]))
    assume(star.is_valid and star.distance(shapely.Point(0.0, 0.0)) == 0.0)
    corners = tuple(star.exterior.coords)[:-1]
    for mesh in (CUBE.subdivide(), CUBE.subdivide().subdivide()):
        off = 0.05 * mesh.edges_unique_length.max() * star.length
        assert area(Polygon(corners), mesh) == pytest.approx(2.0 * star.area, abs=2.0 * off)


def test_a_wall_splits_no_face_beyond_its_ends() -> None:
    """But for those that share an edge with one that it crosses."""
    mesh = CUBE.subdivide().subdivide().subdivide()
    vertices, _, _ = split(mesh, Polygon(((0.1, 0.1), (0.4, 0.1), (0.1, 0.4))))
    new = vertices[len(mesh.vertices) :]
    assert len(new) > 0
    assert np.abs(new[:, :2]).max() < 0.4 + 2.0 * 0.25


@pytest.mark.parametrize("height", [0.0, 0.05, 0.1, 0.2, 0.7, 1.13])
def test_ground_in_a_wall_is_no_rock(height: float) -> None:
    """Of three numbers 0.1 the mean is more than 0.1."""
    ground = trimesh.creation.box((0.25, 0.25, 1.0)).subdivide().subdivide()
    ground.apply_translation((0.0, 0.0, height + 0.5))
    ground.vertices[ground.vertices[:, 2] < height + 0.01, 2] = height
    high = height + 9.0
    assert area(Box((-9.0, -9.0, height), (9.0, 9.0, high)), ground) == pytest.approx(1.0 + 0.0625)


@pytest.mark.parametrize(
    "corners",
    [
        ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0), (0.0, 0.0)),
        ((0.0, 0.0), (4.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)),
    ],
)
def test_a_corner_that_is_given_twice_is_one(corners: tuple[tuple[float, float], ...]) -> None:
    """As closed rings of geographic data have it."""
    assert area(Polygon(corners)) == pytest.approx(2.0 + 2.0 * 2.0)
