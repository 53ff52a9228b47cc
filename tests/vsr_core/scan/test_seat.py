"""What bears a rock that was scanned with its ground."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

from vsr_core import GRAVITY
from vsr_core.errors import InvalidInput
from vsr_core.rock import solid
from vsr_core.rock.body import Rock
from vsr_core.run import displacement, static_limits
from vsr_core.scan import seat
from vsr_core.terrain.surface import Terrain
from vsr_core.verification.stability import _field
from vsr_core.verification.stability._field import longest_step, prepared, resting, tipping_limit
from vsr_core.verification.stability.raw_scans import FIELDS

pytestmark = pytest.mark.usefixtures("few_samples")

FIELD = FIELDS["rough ground, sunk 1 cm"]

FOOT = 0.5 * np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
"""Seam of a block, shape (4, 3) [m]."""


@cache
def seated(bearing: seat.Bearing = "rim") -> tuple[Rock, seat.Seat]:
    return _field.seated(FIELD, bearing)


def turn(degrees: float) -> np.ndarray:
    """About the vertical."""
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


def test_points_that_bear_tip_as_their_polygon_says() -> None:
    """About the edge of their outline that gives way first, where friction is enough."""
    rock, laid = seated()
    centre = np.array([0.0, 0.0, rock.height])
    upward = np.tile([0.0, 0.0, 1.0], (len(laid.points), 1))
    for turn in np.radians(np.arange(0.0, 360.0, 45.0)):
        along = np.array([math.cos(turn), math.sin(turn), 0.0])
        pushed = tipping_limit(laid.points, centre, -along)  # the table goes along, the rock back
        friction = 1.3 * pushed / GRAVITY
        found = static_limits.on_points(laid.points, upward, centre, friction, along)[1]
        assert found / static_limits.SAFE_SHARE == pytest.approx(pushed, rel=0.05)


@pytest.mark.parametrize("turned", [np.diag([1.0, -1.0, 1.0]), turn(37.0), turn(180.0)])
def test_a_scan_that_is_mirrored_or_turned_bears_at_the_same_points(turned: np.ndarray) -> None:
    made, (rock, own, light) = _field.prepared(FIELD)[1], _field.lightened(FIELD)
    up = np.array([0.0, 0.0, rock.height])
    loops = [loop @ turned.T for loop in seat.seams(made.terrain, made.seat)]
    order = slice(None, None, -1 if np.linalg.det(turned) < 0.0 else 1)
    ground = Terrain(light.vertices @ turned.T, light.faces[:, order])
    corners, outer = ((body + up) @ turned.T for body in (own.vertices, rock.vertices))
    laid = seat.seat(ground, loops, corners, outer, "rim")
    expected = seated()[1].points @ turned.T
    assert len(laid.points) == len(expected)
    apart = np.linalg.norm(laid.points[:, None] - expected, axis=2)
    assert apart.min(axis=1).max() < 1e-9


def test_a_scan_that_is_finer_on_one_side_stands_as_deep() -> None:
    """Corners in edges of its hull that its neighbours already have: it is the same rock."""
    made, (rock, own, light) = _field.prepared(FIELD)[1], _field.lightened(FIELD)
    up = np.array([0.0, 0.0, rock.height])
    hull = ConvexHull(rock.vertices)
    east = np.unique(hull.simplices[rock.vertices[hull.simplices, 0].min(axis=1) > 0.0], axis=0)
    finer = np.concatenate([rock.vertices, rock.vertices[east[:, :2]].mean(axis=1)])
    loops = seat.seams(made.terrain, made.seat)
    laid = seat.seat(light, loops, own.vertices + up, finer + up, "rim")
    ground = seated()[1].ground
    np.testing.assert_allclose(laid.ground.vertices, ground.vertices, atol=1e-7)


@pytest.mark.parametrize("cells", [150, 300])
def test_ground_beside_the_seam_goes_down_however_small_its_triangles_are(cells: int) -> None:
    """Level ground around a box, whose seam is the outline of its foot."""
    own = solid.box((1.0, 1.0, 2.0), 2700.0).rock
    radius = math.sqrt(1.5)
    side = np.linspace(-1.5, 1.5, cells + 1)
    x, y = (axis.ravel() for axis in np.meshgrid(side, side))
    first = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).reshape(-1, 1)
    faces = first + np.array([[0, 1, cells + 2], [0, cells + 2, cells + 1]])[:, None]
    ground = Terrain(np.column_stack([x, y, 0.0 * x]), faces.reshape(-1, 3))
    corners = own.vertices + np.array([0.0, 0.0, own.height])
    laid = seat.seat(ground, [FOOT], corners, corners, "rim")
    depth, wide = seat.DEPTH_SHARE * radius, seat.BANK_SHARE * radius
    for share in (0.4, 0.6, 0.8, 1.5):
        (height,) = laid.ground.surfaces(0.5 + share * wide, 0.1)[0]
        assert height == pytest.approx(-depth * max(0.0, 1.0 - share), abs=0.07 * depth)


def test_a_wall_that_leans_over_the_rock_beside_the_seam_stays_out_of_it() -> None:
    """A frustum whose side stands beneath a wall 1 mm beside it."""
    x, y, z = (axis.ravel() for axis in np.meshgrid([-1.0, 1.0], [-1.0, 1.0], [0.0, 0.6]))
    body = np.column_stack([x * (0.5 - 0.75 * z), y * (0.5 - 0.75 * z), z])
    heights = np.linspace(0.0, 0.5, 20)
    along = [
        np.append(np.linspace(-1.5, 0.4, 40), 0.501 - 0.75 * heights),
        np.r_[[0.0] * 40, heights],
    ]
    rows = [np.column_stack([along[0], np.full(60, at), along[1]]) for at in np.linspace(-1, 1, 41)]
    first = (60 * np.arange(40)[:, None] + np.arange(59)).reshape(-1, 1)
    faces = first + np.array([[0, 1, 61], [0, 61, 60]])[:, None]
    scanned = Terrain(np.concatenate(rows), faces.reshape(-1, 3))
    ground = seat.seat(scanned, [FOOT], body, body, "rim").ground
    sides = ConvexHull(body).equations
    assert (ground.vertices @ sides[:, :3].T + sides[:, 3]).max(axis=1).min() > 0.0
    assert len(ground.faces) == len(scanned.faces)


def test_a_wall_whose_foot_lies_below_the_seam_stays() -> None:
    """It leans over a frustum from 2 cm beside it and 30 cm below."""
    x, y, z = (axis.ravel() for axis in np.meshgrid([-1.0, 1.0], [-1.0, 1.0], [0.0, 0.6]))
    body = np.column_stack([x * (0.5 - 0.75 * z), y * (0.5 - 0.75 * z), z])
    wall = [(0.535 - 0.05 * z, y, z) for y in (-1.0, 1.0) for z in (-0.3, -0.1, 0.1, 0.3)]
    level = [(x, y, 0.0) for y in (-1.0, 1.0) for x in (-1.5, 0.4)]
    faces = [[k, 5 + k, 4 + k] for k in range(3)] + [[k, 1 + k, 5 + k] for k in range(3)]
    scanned = Terrain(np.array(wall + level), np.array([*faces, [8, 9, 11], [8, 11, 10]]))
    normals = np.cross(*np.diff(scanned.vertices[scanned.faces[:6]], axis=1).swapaxes(0, 1))
    assert (normals[:, [0, 2]] < 0.0).all()
    assert len(seat.seat(scanned, [FOOT], body, body, "rim").ground.faces) == 8


def test_a_foot_that_overhangs_the_ground_and_is_left_with_it_bears_and_holds_nothing() -> None:
    """A block cut off 3 cm above the ground, its foot drawn in below; or folded at the seam."""
    up = np.array([0.0, 0.0, 0.03])
    rings = [FOOT * 3.0, FOOT * 0.9, FOOT + up, FOOT * 0.999 + up, FOOT * 0.5 + up]
    own = solid.box((1.0, 1.0, 2.0), 2700.0).rock
    ring, beside = np.arange(4), (np.arange(4) + 1) % 4
    bands = [
        np.concatenate(
            [
                np.column_stack([4 * k + ring, 4 * k + beside, 4 * k + 4 + beside]),
                np.column_stack([4 * k + ring, 4 * k + 4 + beside, 4 * k + 4 + ring]),
            ]
        )
        for k in range(4)
    ]
    bands[2] = bands[2][:, ::-1]  # a fold
    scanned = Terrain(np.concatenate(rings), np.concatenate([*bands, [[16, 17, 18], [16, 18, 19]]]))
    corners = own.vertices + up + np.array([0.0, 0.0, own.height])
    laid = seat.seat(scanned, [FOOT + up], corners, corners, "rim")
    kept = {tuple(face) for face in laid.ground.faces.tolist()}
    gone = {tuple(face) for face in np.concatenate(bands[1:3]).tolist()}
    assert kept == {tuple(face) for face in scanned.faces.tolist()} - gone


def test_walls_that_hold_it_are_named() -> None:
    """A block between two walls, along which friction alone might hold it, and open ground."""
    rock = solid.box((1.0, 1.0, 2.0), 2700.0).rock
    hollow = groove(0.4999, 1.5)
    held = displacement.held_toward(resting(rock, hollow), longest_step(rock), "nonsmooth")
    assert sorted(np.degrees(held).round()) == [0, 180]
    limits = displacement.limits_on_seat(resting(rock, hollow), longest_step(rock), "nonsmooth")
    assert limits == (0.0, 0.0)  # nothing is left out for that: runs are stepped
    rock, laid = seated()
    held = displacement.held_toward(resting(rock, laid.terrain), longest_step(rock), "nonsmooth")
    assert len(held) == 0


def groove(half: float, depth: float) -> Terrain:
    """A channel along y between walls that stand at -half and half."""
    x = np.array([-4.0, -half, -half, half, half, 4.0])
    z = np.array([depth, depth, 0.0, 0.0, depth, depth])
    low, high = (np.column_stack([x, np.full(6, y), z]) for y in (-4.0, 4.0))
    at = np.arange(5)
    faces = [np.column_stack([at, at + 1, at + 7]), np.column_stack([at, at + 7, at + 6])]
    return Terrain(np.concatenate([low, high]), np.concatenate(faces))


def test_so_many_points_span_the_largest_area_around_the_weight() -> None:
    _, rim = seated()
    _, three = seated(3)
    assert len(three.points) == 3
    assert len(rim.points) > 3

    def area(points: np.ndarray) -> float:
        return float(ConvexHull(points[:, :2]).volume)

    rng = np.random.default_rng(0)
    for _ in range(200):
        some = rim.points[rng.choice(len(rim.points), 3, replace=False)]
        if (ConvexHull(some[:, :2]).equations[:, 2] < 0.0).all():  # the weight is within
            assert area(some) <= area(three.points) + 1e-12


def test_all_of_the_seam_may_bear() -> None:
    rock, laid = seated("whole")
    assert len(laid.points) == 0
    assert laid.pyramids == ()
    near = np.linalg.norm(laid.terrain.vertices[:, :2], axis=1) < 0.2
    assert laid.terrain.vertices[near, 2].max() > -seat.DEPTH_SHARE * rock.radius


@pytest.mark.slow
@settings(max_examples=8, deadline=None, derandomize=True)
@given(st.integers(0, 10_000), st.floats(0.0, 0.15), st.floats(0.02, 0.2))
def test_no_triangle_of_the_ground_reaches_into_the_hull(
    seed: int, sunk: float, rough: float
) -> None:
    """By a linear program that looks for a point in both."""
    rng = np.random.default_rng(seed)
    hull = ConvexHull(rng.standard_normal((30, 3)) * [0.4, 0.3, 0.5])
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, 12), np.linspace(-1.0, 1.0, 12))
    z = hull.min_bound[2] + sunk + rough * rng.standard_normal(x.shape) * 0.3
    at = np.arange(144).reshape(12, 12)
    one, two = at[:-1, :-1].ravel(), at[:-1, 1:].ravel()
    three, four = at[1:, 1:].ravel(), at[1:, :-1].ravel()
    faces = np.concatenate(
        [np.column_stack([one, two, three]), np.column_stack([one, three, four])]
    )
    terrain = Terrain(np.column_stack([x.ravel(), y.ravel(), z.ravel()]), faces)
    moved = seat.out_of(terrain, hull, np.full(len(hull.equations), 1e-4))
    near = (moved[faces].min(axis=1) < hull.max_bound).all(axis=1)
    near &= (moved[faces].max(axis=1) > hull.min_bound).all(axis=1)
    for corners in moved[faces[near]]:
        # x = sum w_i c_i, w >= 0, sum w = 1, and n.x + d <= 0 for every side
        rows = hull.equations[:, :3] @ corners.T + hull.equations[:, 3:]
        found = linprog(
            np.zeros(3), A_ub=rows, b_ub=np.zeros(len(rows)), A_eq=[[1.0] * 3], b_eq=[1.0]
        )
        assert found.status == 2  # none


def test_a_seam_beside_the_weight_bears_nothing() -> None:
    rock, _ = seated()
    up = np.array([0.0, 0.0, rock.height])
    made = prepared(FIELD)[1]
    loops = [loop + np.array([3.0, 0.0, 0.0]) for loop in seat.seams(made.terrain, made.seat)]
    with pytest.raises(InvalidInput, match="not around the weight"):
        seat.seat(made.terrain, loops, rock.vertices + up, rock.vertices + up, "rim")
