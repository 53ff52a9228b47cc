"""A rock and ground from two files: how far they are apart, and what parts them."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull

from vsr_core.errors import InvalidInput
from vsr_core.scan.placing import clearance, require_contact, require_ground, set_down
from vsr_core.scan.seat import out_of
from vsr_core.terrain.surface import Terrain

Array = np.ndarray

CUBE = np.array(list(product((-0.5, 0.5), repeat=3)))
TIP = np.array([[0.5, 0, 0], [-0.5, 0, 0], [0, 0.5, 0], [0, -0.5, 0], [0, 0, 0.5], [0, 0, -0.5]])
RADIUS = 0.87


def at(points: Array, height: float) -> Array:
    return points + np.array([0.0, 0.0, height])


def plane(slope: float = 0.0, half: float = 5.0, cells: int = 1) -> Terrain:
    """Ground through the origin that rises along x."""
    along = np.linspace(-half, half, cells + 1)
    x, y = (values.ravel() for values in np.meshgrid(along, along, indexing="ij"))
    corner = np.arange(len(x)).reshape(cells + 1, cells + 1)
    a, b, c, d = (
        part.ravel()
        for part in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:])
    )
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return Terrain(np.column_stack([x, y, slope * x]), faces)


def ridge() -> Terrain:
    """A roof along y, its top at z = 0."""
    points = [(0, -5, 0), (0, 5, 0), (-5, -5, -3), (-5, 5, -3), (5, -5, -3), (5, 5, -3)]
    faces = np.array([[0, 1, 2], [1, 3, 2], [0, 4, 1], [1, 4, 5]])
    return Terrain(np.array(points, dtype=float), faces)


def edge_below() -> Array:
    """A bar with an edge along x as its lowest line, z = 0."""
    section = [(0.0, 0.0), (0.4, 0.4), (-0.4, 0.4)]
    return np.array([(x, y, z) for x in (-0.7, 0.7) for y, z in section])


@pytest.mark.parametrize(
    ("corners", "terrain", "touching"),
    [(CUBE, plane(), 0.5), (TIP, plane(0.3), 0.5), (edge_below(), ridge(), 0.0)],
    ids=["face on triangles", "corner over a slope", "edge across a ridge"],
)
@pytest.mark.parametrize("gap", [0.2, 0.003, -0.02])
def test_clearance_is_the_way_down(
    corners: Array, terrain: Terrain, touching: float, gap: float
) -> None:
    """Ground is met by faces, corners and edges; a box would meet a slope by a lower corner."""
    assert clearance(terrain, at(corners, touching + gap)) == pytest.approx(gap, abs=2e-3)


def test_a_roof_above_the_rock_is_no_ground_beneath_it() -> None:
    low, roof = plane(), plane()
    vertices = np.concatenate([low.vertices, at(roof.vertices, 2.0)])
    both = Terrain(vertices, np.concatenate([low.faces, roof.faces + len(low.vertices)]))
    assert clearance(both, at(CUBE, 0.6)) == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("corners", "terrain", "height"),
    [(TIP, plane(), 0.502), (edge_below(), ridge(), 0.002)],
    ids=["corner", "edge across a ridge"],
)
def test_large_triangles_beside_a_hull_stay(
    corners: Array, terrain: Terrain, height: float
) -> None:
    """No side of either hull has all of such a triangle in front of it."""
    hull = ConvexHull(at(corners, height))
    moved = out_of(terrain, hull, np.full(len(hull.equations), 1e-4))
    np.testing.assert_array_equal(moved, terrain.vertices)


def test_a_rock_a_little_in_large_triangles_is_raised() -> None:
    laid, raised = set_down(plane(), *2 * [at(TIP, 0.49)], RADIUS)
    assert laid.moved == 0.0
    assert raised == pytest.approx(0.01, abs=3e-3)
    assert clearance(laid.ground, at(TIP, 0.49 + raised)) > 0.0


@pytest.mark.slow
def test_a_wall_that_reaches_into_a_rock_is_moved() -> None:
    """No raising by a tenth of the radius would part the two."""
    ground = plane(cells=500)
    height = np.where(ground.vertices[:, 0] > 0.475, 0.8, 0.0)  # from x = 0.46 to 0.48
    stepped = Terrain(np.column_stack([ground.vertices[:, :2], height]), ground.faces)
    corners = at(CUBE, 0.502)
    laid, raised = set_down(stepped, corners, corners, RADIUS)
    assert raised == 0.0
    assert 0.04 < laid.moved < 1.5 * 0.04
    left = laid.ground.vertices
    assert not ((np.abs(at(left, -0.502)) < 0.5 - 1e-6).all(axis=1)).any()


@pytest.mark.parametrize("cells", [1, 100])
def test_more_overlap_than_settling_may_close(cells: int) -> None:
    corners = at(CUBE, 0.4)
    with pytest.raises(InvalidInput, match="reaches into"):
        set_down(plane(cells=cells), corners, corners, RADIUS)


def test_what_floats_what_is_buried_and_what_has_no_ground() -> None:
    with pytest.raises(InvalidInput, match=r"floats 0\.2 m"):
        require_contact(plane(), at(CUBE, 0.7), RADIUS)
    with pytest.raises(InvalidInput, match=r"inside the ground, at least 0\.5 m"):
        require_contact(plane(), at(CUBE, -1.0), RADIUS)
    with pytest.raises(InvalidInput, match="50% is beyond"):
        require_ground(plane(), CUBE + np.array([5.0, 0.0, 0.5]))
    assert require_contact(plane(), at(CUBE, 0.55), RADIUS) == pytest.approx(0.05)


def test_hull_of_a_rock_on_noise_needs_no_more_than_the_noise() -> None:
    """On triangles smaller than the rock the ground gives way, and the rock keeps its place."""
    ground = plane(cells=300)
    noise = np.random.default_rng(1).normal(0.0, 0.002, len(ground.vertices))
    rough = Terrain(ground.vertices + np.outer(noise, [0, 0, 1]), ground.faces)
    ball = np.array(trimesh.creation.icosphere(2, 0.5).vertices)
    corners = at(ball, -float(ball[:, 2].min()))
    laid, _ = set_down(rough, corners, corners, 0.5)
    assert laid.moved < 4.0 * 0.002
