"""What bears a rock that was scanned with its ground."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

from vsr_core import GRAVITY
from vsr_core.engines import nonsmooth
from vsr_core.errors import InvalidInput
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import Outcome
from vsr_core.rock import reduction, solid
from vsr_core.rock.body import Rock
from vsr_core.run import displacement, static_limits
from vsr_core.run.cases import Settings, TerrainCase
from vsr_core.scan import seat
from vsr_core.scan.preparation import Prepared
from vsr_core.surrogates.field_scans import FieldScan, Scanned
from vsr_core.terrain.surface import Terrain
from vsr_core.verification.stability import _field
from vsr_core.verification.stability._field import longest_step, prepared, resting, tipping_limit

FIELDS = {
    "smooth and clean": FieldScan(21, noise=0.0, roughness=0.003),
    "noise of 5 mm": FieldScan(22, noise=0.005),
    "rough ground, sunk 1 cm": FieldScan(23, roughness=0.03, sunk=0.01, edge=0.06),
    "sunk 3 cm": FieldScan(24, sunk=0.03),
    "slope of 15 deg": FieldScan(25, slope=15.0, sunk=0.02),
    "slope of 25 deg": FieldScan(26, slope=25.0, sunk=0.02),
    "a niche of three walls": FieldScan(27, walls=3, sunk=0.01),
    "a waist": FieldScan(28, waist=0.12, sunk=0.01),
    "three pebbles": FieldScan(29, pebbles=True),
    "holes in the scan": FieldScan(30, holes=4),
    "squat": FieldScan(31, half_axes=(0.5, 0.45, 0.35)),
    "small and fine": FieldScan(32, half_axes=(0.3, 0.25, 0.5), edge=0.03),
}
QUICK = ("rough ground, sunk 1 cm",)
"""The others are of the slow suite."""

EACH = pytest.mark.parametrize(
    "name",
    [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in FIELDS],
)


@cache
def scanned(name: str) -> tuple[Scanned, Prepared]:
    return prepared(FIELDS[name])


@cache
def seated(name: str, bearing: seat.Bearing = "rim") -> tuple[Rock, seat.Seat]:
    return _field.seated(FIELDS[name], bearing)


@EACH
def test_the_scan_gives_the_true_rock(name: str) -> None:
    raw, made = scanned(name)
    true = trimesh.Trimesh(raw.rock_vertices, raw.rock_faces)
    assert made.rock.volume == pytest.approx(true.volume, rel=0.03)
    size = float(np.ptp(true.vertices, axis=0).max())
    off = made.rock.center_mass + made.origin - true.center_mass
    assert np.linalg.norm(off) < 0.012 * size


@EACH
def test_it_rests_as_it_was_scanned(name: str) -> None:
    """To a millimetre and a fifth of a degree; and what rests gains no energy."""
    rock, laid = seated(name)
    scene = resting(rock, laid.terrain)
    state = displacement.settled(scene, longest_step(rock), "nonsmooth")
    assert np.linalg.norm(state.position - [0.0, 0.0, rock.height]) < 1e-3
    assert math.acos(min(1.0, 0.5 * (np.trace(state.rotation) - 1.0))) < math.radians(0.2)
    world = nonsmooth.build(replace(scene, start=state), longest_step(rock), 1)
    for _ in range(20):
        world.advance([0.0] * 10)
        now = world.state()
        assert np.linalg.norm(now.velocity) < 1e-3 * math.sqrt(GRAVITY * rock.radius)
    assert np.linalg.norm(now.position - state.position) < 1e-4


@EACH
def test_each_run_has_a_verdict(name: str) -> None:
    rock, laid = seated(name)
    step = longest_step(rock)
    scene = resting(rock, laid.terrain)
    scene = replace(scene, start=displacement.settled(scene, step, "nonsmooth"))
    still = displacement.limits_on_seat(scene, step, "nonsmooth")
    case = TerrainCase(scene, replace(scene, rock=reduction.in_flight(rock)), 1.2, still)
    for pga in (0.2, 0.6, 1.0, 1.6):
        for ratio in (0.1, 0.4):
            motion = CosinePulse.from_g(pga, ratio)
            run = displacement.displace(case, motion, Settings(0.3 * step, engine="nonsmooth"))
            assert run.response.outcome in (Outcome.BALANCED, Outcome.DISPLACED, Outcome.OVERTURNED)


@EACH
def test_points_that_bear_tip_as_their_polygon_says(name: str) -> None:
    """About the edge of their outline that gives way first, where friction is enough."""
    rock, laid = seated(name)
    centre = np.array([0.0, 0.0, rock.height])
    upward = np.tile([0.0, 0.0, 1.0], (len(laid.points), 1))
    for turn in np.radians(np.arange(0.0, 360.0, 45.0)):
        along = np.array([math.cos(turn), math.sin(turn), 0.0])
        pushed = tipping_limit(laid.points, centre, -along)  # the table goes along, the rock back
        friction = 1.3 * pushed / GRAVITY
        found = static_limits.on_points(laid.points, upward, centre, friction, along)[1]
        assert found / static_limits.SAFE_SHARE == pytest.approx(pushed, rel=0.05)


def test_walls_that_hold_it_are_named() -> None:
    """A block between two walls, which may squeeze it as hard as they like, and open ground."""
    rock = solid.box((1.0, 1.0, 2.0), 2700.0).rock
    hollow = groove(0.4999, 1.5)
    held = displacement.held_toward(resting(rock, hollow), longest_step(rock), "nonsmooth")
    assert sorted(np.degrees(held).round()) == list(range(0, 360, 30))
    limits = displacement.limits_on_seat(resting(rock, hollow), longest_step(rock), "nonsmooth")
    assert limits == (0.0, 0.0)  # nothing is left out for that: runs are stepped
    rock, laid = seated("rough ground, sunk 1 cm")
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
    _, rim = seated("rough ground, sunk 1 cm")
    _, three = seated("rough ground, sunk 1 cm", 3)
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
    rock, laid = seated("rough ground, sunk 1 cm", "whole")
    assert len(laid.points) == 0
    assert laid.pyramids == ()
    near = np.linalg.norm(laid.terrain.vertices[:, :2], axis=1) < 0.2
    assert laid.terrain.vertices[near, 2].max() > -seat.DEPTH_SHARE * rock.radius


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
    rock, _ = seated("rough ground, sunk 1 cm")
    up = np.array([0.0, 0.0, rock.height])
    made = scanned("rough ground, sunk 1 cm")[1]
    loops = [loop + np.array([3.0, 0.0, 0.0]) for loop in seat.seams(made.terrain, made.seat)]
    with pytest.raises(InvalidInput, match="not around the weight"):
        seat.seat(made.terrain, loops, rock.vertices + up, rock.vertices + up, "rim")
