"""The stand-in for Double Rock against the published figures of the rock."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from vsr_core.surrogates.double_rock import double_rock

SIZE = np.array([1.238, 0.754, 1.5085])  # m
LOWEST = np.array([-0.654, -0.344, 0.0])  # m
VOLUME = 0.5529  # m^3
CENTRE_OF_MASS = np.array([0.0, 0.0, 0.742])  # m
# The published inertia [kg m^2] over the published mass [kg].
INERTIA = (
    np.array([[260.473, -12.88, -83.689], [-12.88, 313.424, -26.81], [-83.689, -26.81, 134.045]])
    / 1437.596
)
# Angle [deg] by which gravity has to lean towards 0, 30, ... 330 deg from body +x to tip the
# rock, measured on the published mesh at rest.
TIPPING = [5.0, 5.6, 9.1, 15.3, 16.8, 24.6, 34.0, 35.4, 26.8, 22.4, 10.8, 5.9]


@pytest.fixture(scope="module")
def rock() -> trimesh.Trimesh:
    vertices, faces = double_rock()
    return trimesh.Trimesh(vertices, faces, process=False)


def base_polygon(rock: trimesh.Trimesh) -> NDArray[np.float64]:
    """Corners (n, 2) [m], counter-clockwise, of the hull of the points the rock rests on."""
    low = rock.vertices[rock.vertices[:, 2] < 0.003, :2]
    corners: NDArray[np.float64] = low[ConvexHull(low).vertices]
    return corners


def tipping_angle(rock: trimesh.Trimesh, direction: float) -> float:
    """Lean of gravity [deg] towards ``direction`` [deg] at which it leaves the base polygon."""
    start = rock.center_mass[:2]
    towards = np.array([np.cos(np.radians(direction)), np.sin(np.radians(direction))])
    distances = []
    corners = base_polygon(rock)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        matrix = np.column_stack([towards, a - b])
        if abs(np.linalg.det(matrix)) > 1e-12:
            distance, along = np.linalg.solve(matrix, a - start)
            if distance > 0.0 and -1e-9 <= along <= 1.0 + 1e-9:
                distances.append(distance)
    assert distances, "the centre of mass is not over the base"
    return float(np.degrees(np.arctan2(min(distances), rock.center_mass[2])))


def first_tipping_angle(rock: trimesh.Trimesh, yaw: float) -> float:
    """Tipping angle [deg] under table acceleration +x, the rock turned by ``yaw`` [deg]."""
    return tipping_angle(rock, 180.0 - yaw)


def crosses_itself(loop: NDArray[np.float64]) -> bool:
    """Whether two sides of a closed polygon (n, 2) that are not neighbours cross."""

    def side(p: NDArray[np.float64], q: NDArray[np.float64]) -> NDArray[np.bool_]:
        d, e = (q - p)[:, None], loop[None] - p[:, None]
        left: NDArray[np.bool_] = d[..., 0] * e[..., 1] - d[..., 1] * e[..., 0] > 0.0
        return left

    n = len(loop)
    left = side(loop, np.roll(loop, -1, axis=0))
    splits = left != np.roll(left, -1, axis=1)
    i, j = np.indices((n, n))
    apart = ((i - j) % n > 1) & ((j - i) % n > 1)
    return bool(np.any(splits & splits.T & apart))


def test_closed_and_outward(rock: trimesh.Trimesh) -> None:
    assert rock.is_watertight
    assert rock.is_winding_consistent
    assert rock.volume > 0.0
    assert rock.body_count == 1
    assert rock.euler_number == 2
    assert rock.area_faces.min() > 0.0
    assert len(np.unique(rock.vertices, axis=0)) == len(rock.vertices)
    assert 5_000 <= len(rock.faces) <= 12_000


def test_every_cut_is_one_simple_polygon(rock: trimesh.Trimesh) -> None:
    heights = np.random.default_rng(0).uniform(0.0, SIZE[2], 60)
    for height in [1e-5, *heights, SIZE[2] - 1e-5]:
        cut = rock.section([0, 0, 1], [0, 0, height])
        assert cut is not None
        assert len(cut.discrete) == 1
        assert not crosses_itself(np.asarray(cut.discrete[0])[:-1, :2])


def test_crossing_is_seen() -> None:
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    assert not crosses_itself(square)
    assert crosses_itself(square[[0, 2, 1, 3]])


def test_size_and_place(rock: trimesh.Trimesh) -> None:
    np.testing.assert_allclose(rock.extents, SIZE, rtol=0.01)
    np.testing.assert_allclose(rock.bounds[0], LOWEST, atol=0.01 * SIZE.min())
    assert rock.bounds[0, 2] == 0.0


def test_mass_distribution(rock: trimesh.Trimesh) -> None:
    assert rock.volume == pytest.approx(VOLUME, rel=0.01)
    assert np.all(np.abs(rock.center_mass - CENTRE_OF_MASS) < 0.01 * SIZE)
    moments, axes = np.linalg.eigh(rock.moment_inertia / rock.volume)
    expected_moments, expected_axes = np.linalg.eigh(INERTIA)
    np.testing.assert_allclose(moments, expected_moments, rtol=0.03)
    aligned = np.abs(np.sum(axes * expected_axes, axis=0))
    assert np.all(aligned > np.cos(np.radians(10.0)))


def test_tips_like_the_rock(rock: trimesh.Trimesh) -> None:
    angles = [tipping_angle(rock, direction) for direction in range(0, 360, 30)]
    np.testing.assert_allclose(angles, TIPPING, atol=1.0)


def test_directions_differ(rock: trimesh.Trimesh) -> None:
    def weaker(yaw: float) -> float:
        return min(first_tipping_angle(rock, yaw), first_tipping_angle(rock, yaw + 180.0))

    assert weaker(90.0) > 2.0 * weaker(0.0)
    assert first_tipping_angle(rock, 0.0) > 5.0 * first_tipping_angle(rock, 180.0)
    assert first_tipping_angle(rock, 270.0) > 1.3 * first_tipping_angle(rock, 90.0)


def test_rests_on_the_base_polygon_alone(rock: trimesh.Trimesh) -> None:
    hull = rock.vertices[ConvexHull(rock.vertices).vertices]
    lifted = hull[hull[:, 2] > 0.0]
    corners = base_polygon(rock)
    edges = np.roll(corners, -1, axis=0) - corners
    normals = np.column_stack([edges[:, 1], -edges[:, 0]])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    outward = np.sum((lifted[:, None, :2] - corners) * normals, axis=2)
    overhang = outward.max(axis=1)
    # Nothing else touches until the rock has leant by far more than it can stand.
    lean = np.degrees(np.arctan2(lifted[:, 2], overhang)).min()
    assert lean > 1.2 * max(TIPPING)


def test_repeatable_and_rounded() -> None:
    first, second = double_rock(), double_rock()
    assert all(np.array_equal(a, b) for a, b in zip(first, second, strict=True))
    np.testing.assert_array_equal(first[0], np.round(first[0], 6))
