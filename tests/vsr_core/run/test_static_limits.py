"""Limits of rest on given points of contact, against statics done by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vsr_core import GRAVITY
from vsr_core.run.static_limits import on_points

X = np.array([1.0, 0.0, 0.0])

RELIED_ON = 0.9
"""Nine tenths of the range of an exact contact are relied on (docs/conventions.md)."""


def corners(width: float, height: float, slope: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Corners of a block's base about its centre, and normals, turned down along x by ``slope``."""
    turn = np.array(
        [
            [math.cos(slope), 0.0, math.sin(slope)],
            [0.0, 1.0, 0.0],
            [-math.sin(slope), 0.0, math.cos(slope)],
        ]
    )
    half = 0.5 * width
    points = np.array([[x, y, -0.5 * height] for x in (-half, half) for y in (-half, half)])
    return points @ turn.T, np.tile(turn @ [0.0, 0.0, 1.0], (4, 1))


@pytest.mark.parametrize(("friction", "limit"), [(0.9, 0.5), (0.3, 0.3)])
def test_a_block_rocks_or_slides_at_the_smaller_limit(friction: float, limit: float) -> None:
    points, normals = corners(1.0, 2.0)
    found = on_points(points, normals, np.zeros(3), friction, X)
    assert np.array(found) / RELIED_ON / GRAVITY == pytest.approx([-limit, limit], rel=1e-6)


@pytest.mark.parametrize("slope", [0.05, 0.2, -0.3])
def test_a_slope_adds_its_angle_to_the_tipping_angle(slope: float) -> None:
    """The resultant leaves the base where it is steeper than the corner: tan(alpha +- slope)."""
    points, normals = corners(1.0, 2.0, slope)
    alpha = math.atan(0.5)
    lowest, highest = on_points(points, normals, np.zeros(3), 5.0, X)
    # accelerating downhill (+x) presses the block uphill
    assert highest / RELIED_ON / GRAVITY == pytest.approx(math.tan(alpha + slope), rel=1e-6)
    assert lowest / RELIED_ON / GRAVITY == pytest.approx(-math.tan(alpha - slope), rel=1e-6)


def test_a_wall_holds_what_would_tip() -> None:
    points, normals = corners(1.0, 2.0)
    free = on_points(points, normals, np.zeros(3), 0.5, X)
    wall = np.vstack([points, [-0.5, 0.0, 0.5]]), np.vstack([normals, X])
    held = on_points(*wall, np.zeros(3), 0.5, X)
    assert held[1] > 5.0 * free[1]  # pushed against the wall behind it
    assert held[0] == pytest.approx(free[0], rel=1e-6)


def test_what_does_not_stand_has_no_range() -> None:
    points, normals = corners(1.0, 2.0, slope=0.6)
    assert on_points(points, normals, np.zeros(3), 5.0, X) == (0.0, 0.0)
    assert on_points(np.empty((0, 3)), np.empty((0, 3)), np.zeros(3), 0.6, X) == (0.0, 0.0)


def test_turning_everything_changes_nothing() -> None:
    points, normals = corners(0.8, 2.0, 0.1)
    angle = math.pi / 4.0  # a symmetry of the pyramid inside the cone
    turn = np.array(
        [
            [math.cos(angle), -math.sin(angle), 0.0],
            [math.sin(angle), math.cos(angle), 0.0],
            [0.0, 0.0, 1.0],
        ]
    )
    one = on_points(points, normals, np.zeros(3), 2.0, X)
    other = on_points(points @ turn.T, normals @ turn.T, np.zeros(3), 2.0, turn @ X)
    assert one == pytest.approx(other, rel=1e-6)
