"""A rock whose base is drawn in: its edges move in by the distance, in every direction."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from vsr_core.errors import InvalidInput
from vsr_core.rock.body import Hull, convex_hull, drawn_in
from vsr_core.rock.tipping import settle, tipping

DIRECTIONS = np.radians(np.arange(0.0, 360.0, 15.0))


def random_rock(seed: int) -> Hull:
    """A rock of 40 corners at rest on one of its faces."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(40, 3)) * [0.5, 0.4, 1.0]
    points /= np.linalg.norm(points, axis=1)[:, None] ** 0.8
    hull = convex_hull(points - points.mean(axis=0))
    return hull.turned(settle(hull, math.pi)[0])


def uplift(hull: Hull, distance: float) -> np.ndarray:
    """Acceleration [g] that lifts the first edge of the base in each direction, by its polygon."""
    low = hull.vertices[:, 2].min()
    base = hull.vertices[hull.vertices[:, 2] < low + 1e-9][:, :2]
    sides = ConvexHull(base).equations
    room = -sides[:, 2] - distance
    along = np.column_stack([np.cos(DIRECTIONS), np.sin(DIRECTIONS)]) @ sides[:, :2].T
    needed = np.where(along > 1e-9, room / np.where(along > 1e-9, along, 1.0), np.inf)
    return np.asarray(needed.min(axis=1) / -low)


def test_a_block_is_a_narrower_block() -> None:
    corners = [[x, y, z] for x in (-0.5, 0.5) for y in (-0.3, 0.3) for z in (-1.0, 1.0)]
    own = convex_hull(drawn_in(convex_hull(np.array(corners)), 0.05))
    np.testing.assert_allclose(np.abs(own.vertices), [[0.45, 0.25, 1.0]] * 8, atol=1e-12)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), share=st.floats(0.05, 0.6))
def test_every_edge_of_the_base_moves_in_by_the_distance(seed: int, share: float) -> None:
    hull = random_rock(seed)
    distance = share * float(uplift(hull, 0.0).min()) * -float(hull.vertices[:, 2].min())
    own = convex_hull(drawn_in(hull, distance))
    np.testing.assert_allclose(
        tipping(own, DIRECTIONS).uplift, uplift(hull, distance), rtol=1e-6, atol=1e-9
    )


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_nothing_comes_nearer_to_a_side_than_the_distance(seed: int) -> None:
    hull = random_rock(seed)
    room = hull.offsets - drawn_in(hull, 0.01) @ hull.normals.T
    level = np.linalg.norm(hull.normals[:, :2], axis=1)
    assert (room >= 0.01 * level - 1e-9).all()


def test_a_base_is_not_drawn_in_beyond_the_centre() -> None:
    with pytest.raises(InvalidInput, match="beyond the centre"):
        drawn_in(random_rock(1), 2.0)
