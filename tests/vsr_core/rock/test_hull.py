"""Rest, contact and static tipping of hulls against geometry worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, reject, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation
from support.suites import slow_but

from vsr_core.errors import InvalidInput
from vsr_core.rock import tipping as tipping_of
from vsr_core.rock.body import Hull, contact_tilts, convex_hull, touching
from vsr_core.rock.tipping import MAX_SETTLING_TURN, base_polygon, rest_tilts, settle, tipping

Array = NDArray[np.float64]
ALL_ROUND = np.radians(np.arange(0.0, 360.0, 1.0))
HALF = st.floats(0.05, 5.0)
SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)


def random_rock(seed: int, count: int = 30) -> Hull:
    """Random convex rock at rest: the face nearest to the centre is down, which always rests."""
    rng = np.random.default_rng(seed)
    points = rng.standard_normal((count, 3)) * rng.uniform(0.3, 1.5, 3)
    points -= points[ConvexHull(points).vertices].mean(axis=0)
    hull = convex_hull(points)
    nearest = hull.normals[np.argmin(hull.offsets)]
    return hull.turned(Rotation.align_vectors([[0, 0, -1]], [nearest])[0].as_matrix())


def to_the_edge(outline: Array, direction: Array) -> Array:
    """Distance from the origin to a convex outline in each direction, by its half-planes."""
    planes = ConvexHull(outline).equations  # n x + offset <= 0 inside
    directions = np.column_stack([np.cos(direction), np.sin(direction)])
    with np.errstate(divide="ignore"):
        reach = -planes[:, 2] / (directions @ planes[:, :2].T)
    return np.where(reach > 0.0, reach, np.inf).min(axis=1)


@pytest.mark.slow
@given(HALF, HALF, HALF)
@settings(max_examples=60, deadline=None, derandomize=True)
def test_box_tips_where_its_weight_passes_the_edge(bx: float, by: float, h: float) -> None:
    tips = tipping(convex_hull(SIGNS * (bx, by, h)), ALL_ROUND)
    with np.errstate(divide="ignore"):
        expected = np.minimum(bx / abs(np.cos(ALL_ROUND)), by / abs(np.sin(ALL_ROUND))) / h
    np.testing.assert_allclose(tips.uplift, expected, rtol=1e-9)
    np.testing.assert_allclose(tips.overturning, expected, rtol=1e-9)
    assert tips.angle[0] == pytest.approx(math.atan2(bx, h))
    assert tips.angle[90] == pytest.approx(math.atan2(by, h))


@pytest.mark.parametrize("corners", [3, 5, 6, 12])
def test_regular_prism(corners: int) -> None:
    radius, h = 0.7, 1.1
    around = 2.0 * math.pi * np.arange(corners) / corners
    ring = radius * np.column_stack([np.cos(around), np.sin(around)])
    points = np.vstack([np.column_stack([ring, np.full(corners, z)]) for z in (-h, h)])
    tips = tipping(convex_hull(points), ALL_ROUND)
    apothem = radius * math.cos(math.pi / corners)
    facing = np.cos(ALL_ROUND[:, None] - around - math.pi / corners).max(axis=1)
    np.testing.assert_allclose(tips.uplift, apothem / facing / h, rtol=1e-9)
    np.testing.assert_allclose(tips.overturning, tips.uplift, rtol=1e-9)


@pytest.mark.slow
@given(st.integers(0, 10**6))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_random_rock_lifts_where_its_weight_passes_the_base(seed: int) -> None:
    hull = random_rock(seed)
    low = hull.vertices[:, 2].min()
    base = base_polygon(hull.vertices, 1e-9)
    tips = tipping(hull, ALL_ROUND)
    np.testing.assert_allclose(tips.uplift, to_the_edge(base, ALL_ROUND) / -low, rtol=1e-6)
    assert (tips.overturning >= tips.uplift).all()


@pytest.mark.slow
@given(st.integers(0, 10**6), st.floats(-7.0, 7.0))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_tipping_turns_with_the_rock(seed: int, yaw: float) -> None:
    hull = random_rock(seed)
    turned = hull.turned(Rotation.from_euler("z", yaw).as_matrix())
    # Not multiples of a degree: those hit no symmetry of a random rock.
    directions = ALL_ROUND[::7] + 0.0123
    here, there = tipping(hull, directions), tipping(turned, directions + yaw)
    np.testing.assert_allclose(there.uplift, here.uplift, rtol=1e-6)
    np.testing.assert_allclose(there.overturning, here.overturning, rtol=1e-6)


@given(st.integers(0, 10**6), st.floats(0.01, 100.0))
@settings(max_examples=30, deadline=None, derandomize=True)
def test_tipping_does_not_know_the_size(seed: int, scale: float) -> None:
    hull = random_rock(seed)
    here = tipping(hull, ALL_ROUND[::5])
    there = tipping(convex_hull(scale * hull.vertices), ALL_ROUND[::5])
    np.testing.assert_allclose(there.uplift, here.uplift, rtol=1e-6)
    np.testing.assert_allclose(there.overturning, here.overturning, rtol=1e-6)


@pytest.mark.parametrize("noise", slow_but([1e-12], [0.0, 1e-12, 1e-9]))
@given(st.integers(0, 10**6), HALF, HALF, HALF)
@example(376459, 0.5, 0.0546875, 4.5)  # facets of the base merged to a face that is not convex
@example(639577, 0.21608583988690133, 0.2732651065819341, 4.055313125175025)
@settings(max_examples=30, deadline=None, derandomize=True)
def test_points_in_the_base_and_its_edges_do_not_matter(
    noise: float, seed: int, bx: float, by: float, h: float
) -> None:
    """Neither inside the face nor on its edges, nor where rounding moves them a little.

    Points a third of the half-width apart and off by ``noise`` of it tilt a facet by some 1e-8.
    """
    rng = np.random.default_rng(seed)
    corners = SIGNS * (bx, by, h)
    x, y = np.meshgrid(np.linspace(-bx, bx, 7), np.linspace(-by, by, 7))
    extra = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, -h)])
    extra[:, 2] += noise * min(bx, by) * rng.uniform(-1, 1, len(extra))
    plain = tipping(convex_hull(corners), ALL_ROUND[::3])
    crowded = convex_hull(np.vstack([corners, extra]))
    tips = tipping(crowded, ALL_ROUND[::3])
    np.testing.assert_allclose(tips.uplift, plain.uplift, rtol=1e-6, atol=1e-7)
    np.testing.assert_allclose(tips.overturning, plain.overturning, rtol=1e-6, atol=1e-7)
    assert settle(crowded)[1] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("cut", [0.0, 0.05])
@pytest.mark.parametrize("size", [1e-8, 1e-7, 1e-6, 1e-5, 1e-4])
def test_a_base_flat_but_for_rounding_is_left_at_its_edge(
    cut: float, size: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Within what the rock leans, at rest and on a facet of it; and a walk takes few turns."""
    turns: list[float] = []

    def counted(a: Array, b: Array) -> Array:
        turns.append(0.0)
        assert len(turns) < 1000
        return rolled(a, b)

    rolled = tipping_of._rotation
    monkeypatch.setattr(tipping_of, "_rotation", counted)
    rng, top = np.random.default_rng(6), SIGNS[SIGNS[:, 2] > 0.0] * (0.3, 0.3, 0.9)
    slope = Rotation.from_euler("y", cut).as_matrix()
    for _ in range(4):
        base = np.column_stack([rng.uniform(-0.3, 0.3, (200, 2)), np.full(200, -0.9)])
        written = np.round(np.vstack([base, top]) @ slope.T / size) * size
        if not cut:
            written[:200, 2] += size * rng.standard_normal(200)
        hull = convex_hull(written)
        hull = hull.turned(settle(hull)[0])
        expected = np.arctan(to_the_edge(base[:, :2], ALL_ROUND[::40]) / 0.9)
        leans = np.linalg.norm(hull.normals[hull.normals[:, 2] < -0.9, :2], axis=1).max()
        turns.clear()
        found = tipping(hull, ALL_ROUND[::40]).angle
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=2.0 * leans + 10.0 * size)


@given(st.integers(0, 10**6), st.floats(0.1, 10.0), st.floats(-7.0, 7.0))
@settings(max_examples=15, deadline=None, derandomize=True)
def test_a_leaning_base_in_few_digits_tips_alike_turned_and_larger(
    seed: int, scale: float, yaw: float
) -> None:
    """Of seven digits its facets lean by 1e-8: less than their height tells, more than rounding."""
    rng = np.random.default_rng(seed)
    base = np.column_stack([rng.uniform(-0.4, 0.4, (250, 2)), np.full(250, -1.0)])
    top = rng.uniform((-0.5, -0.5, 0.0), (0.5, 0.5, 1.0), (30, 3))
    leans = Rotation.from_rotvec(rng.normal(0.0, 0.05, 3)).as_matrix()
    hull = convex_hull(np.round(np.vstack([base, top]) @ leans.T, 7))
    hull = hull.turned(settle(hull)[0])
    turned = Rotation.from_euler("z", yaw).as_matrix()
    here = tipping(hull, ALL_ROUND[::15])
    there = tipping(convex_hull(scale * hull.vertices @ turned.T), ALL_ROUND[::15] + yaw)
    np.testing.assert_allclose(there.uplift, here.uplift, rtol=1e-4)
    np.testing.assert_allclose(there.overturning, here.overturning, rtol=1e-4)


@given(st.floats(0.2, 0.9), st.floats(0.02, 0.6), st.floats(0.5, 3.0))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_chamfered_block_finds_a_second_rest(narrow: float, rise: float, h: float) -> None:
    """A bevel of slope delta below the outer edge, which stands alpha' from the vertical.

    The block lifts at b/h, lies down on the bevel, and tips over the outer edge once the
    resultant leans by alpha' - delta.
    """
    c, d = 1.0, min(rise * (1.0 - narrow), 0.9 * h)
    section = [(narrow, -h), (c, d - h), (c, h)]
    points = np.array([(s * x, y, z) for x, z in section for s in (-1, 1) for y in (-9, 9)])
    tips = tipping(convex_hull(points), np.array([0.0, math.pi]))
    bevel = math.atan2(d, c - narrow)
    expected = max(narrow / h, math.tan(math.atan2(c, h - d) - bevel))
    np.testing.assert_allclose(tips.uplift, narrow / h, rtol=1e-9)
    np.testing.assert_allclose(tips.overturning, expected, rtol=1e-9)


@pytest.mark.parametrize("d", [0.002, 0.01, 0.08])
def test_rock_on_three_points_with_others_just_above(d: float) -> None:
    """Lifts over the line of two feet, comes to stand on a third point, and tips over that.

    Feet at radius r, and above the middle of each side of their triangle a point at radius R, a
    little higher by d. Toward such a point the rock turns by delta = atan(d / (R - r/2)) about
    two feet before the point lands; the point then stands atan(R / (h - d)) - delta ahead of the
    centre. Everything beyond is a vertical wall: it has toppled.
    """
    r, big, h = 0.3, 0.5, 1.0
    feet, points = np.radians([60.0, 180.0, 300.0]), np.radians([0.0, 120.0, 240.0])
    rock = np.vstack(
        [
            np.column_stack([r * np.cos(feet), r * np.sin(feet), np.full(3, -h)]),
            np.column_stack([big * np.cos(points), big * np.sin(points), np.full(3, d - h)]),
            np.column_stack([big * np.cos(points), big * np.sin(points), np.full(3, h)]),
        ]
    )
    hull = convex_hull(rock)
    tips = tipping(hull, points)
    delta = math.atan2(d, big - 0.5 * r)
    stands = math.tan(math.atan2(big, h - d) - delta)
    np.testing.assert_allclose(tips.uplift, 0.5 * r / h, rtol=1e-9)
    np.testing.assert_allclose(tips.overturning, stands, rtol=1e-9)
    assert stands > 1.5 * 0.5 * r / h
    # It leans there unpushed too once the centre has passed the two feet.
    leaning = [delta] * 3 if delta > math.atan2(0.5 * r, h) else []
    tilts = rest_tilts(hull)
    np.testing.assert_allclose(tilts[tilts < 1.0], [0.0, *leaning], atol=1e-9)


def bumpy_rock(seed: int) -> Hull:
    """A post of .6 x .6 x 1.8 m at rest on the bumps of its base, which are of 4 mm."""
    rng = np.random.default_rng(seed)
    base = [rng.uniform(-0.3, 0.3, (14, 2)), -0.9 + 0.004 * rng.standard_normal((14, 1))]
    hull = convex_hull(np.vstack([np.hstack(base), SIGNS[SIGNS[:, 2] > 0.0] * (0.3, 0.3, 0.9)]))
    return hull.turned(settle(hull)[0])


def pushed_ever_harder(hulls: list[Hull], direction: Array, pace: float, rate: float) -> Array:
    """Push [g] under which each hull comes to lean by 1 rad, from its corners alone.

    ``down`` u goes down the slope of the energy while the push a grows slowly. Rolled without
    twist by du, a rock that touches at p rises by du . (p - a h t), with t the direction of the
    push, which is carried along, and h = u . p. Late by what the push grows while it topples.
    """
    most = max(len(hull.vertices) for hull in hulls)
    rocks = np.array([np.resize(hull.vertices, (most, 3)) for hull in hulls])
    down = np.tile([0.0, 0.0, -1.0], (len(hulls), 1))
    toward = np.column_stack([np.cos(direction), np.sin(direction), 0.0 * direction])
    push, toppled = 0.0, np.full(len(hulls), np.nan)
    while np.isnan(toppled).any():
        point = rocks[np.arange(len(hulls)), np.argmax((rocks @ down[:, :, None])[..., 0], axis=1)]
        height = (point * down).sum(axis=1, keepdims=True)
        down = down - pace * (point - height * (down + push * toward))
        down /= np.sqrt((down * down).sum(axis=1, keepdims=True))
        toward -= down * (toward * down).sum(axis=1, keepdims=True)
        toward /= np.sqrt((toward * toward).sum(axis=1, keepdims=True))
        toppled[np.isnan(toppled) & (down[:, 2] > -math.cos(1.0))] = push
        push += rate
    return toppled


def test_bumps_turn_a_rock_aside_and_it_still_has_to_tip() -> None:
    """It rolls over a bump to the side, and the push brings it back to a face it stood on."""
    rocks = [bumpy_rock(seed) for seed in (14, 24, 24, 190, 191)]
    toward = np.radians([114.0, 324.0, 327.0, 282.0, 42.0])
    walked = [tipping(rock, toward[[k]]).angle[0] for k, rock in enumerate(rocks)]
    pushed = np.arctan(pushed_ever_harder(rocks, toward, 5e-3, 5e-6))
    np.testing.assert_allclose(walked, pushed, atol=0.01)


@pytest.mark.slow
def test_rocks_on_bumps_tip_where_a_growing_push_topples_them() -> None:
    """In the directions said to be weakest and strongest, of 60."""
    rocks = [bumpy_rock(seed) for seed in range(50) if seed != 33]  # which falls over on its bumps
    walked = np.array([tipping(rock, ALL_ROUND[::6]).angle for rock in rocks])
    for at in (walked.argmin(axis=1), walked.argmax(axis=1)):
        pushed = np.arctan(pushed_ever_harder(rocks, ALL_ROUND[::6][at], 1e-3, 5e-7))
        np.testing.assert_allclose(walked[np.arange(len(rocks)), at], pushed, atol=0.01)


@given(HALF, HALF, HALF, st.floats(0.1, 14.9), st.floats(0.0, 360.0))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_slightly_tilted_box_settles_on_its_base(
    bx: float, by: float, h: float, tilt: float, direction: float
) -> None:
    """By the angle it was tilted, if its centre stood over the base."""
    h = min(h, 3.0 * min(bx, by))  # alpha > 18 deg
    axis = np.array([math.cos(math.radians(direction)), math.sin(math.radians(direction)), 0.0])
    given_pose = Rotation.from_rotvec(math.radians(tilt) * axis).as_matrix()
    hull = convex_hull(SIGNS * (bx, by, h)).turned(given_pose)
    rotation, turned = settle(hull)
    assert turned == pytest.approx(math.radians(tilt), abs=1e-9)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    np.testing.assert_allclose(rotation @ given_pose, np.eye(3), atol=1e-9)


@given(st.integers(0, 10**6))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_settled_rock_stands_on_what_its_centre_does_not_overhang(seed: int) -> None:
    rng = np.random.default_rng(seed)
    hull = random_rock(seed).turned(Rotation.from_rotvec(rng.uniform(-0.1, 0.1, 3)).as_matrix())
    try:
        rotation, turned = settle(hull)
    except InvalidInput:
        reject()
    assert turned <= MAX_SETTLING_TURN
    rest = hull.turned(rotation)
    base = base_polygon(rest.vertices, 1e-9)
    assert (to_the_edge(base, ALL_ROUND[::10]) < np.inf).all()
    assert (ConvexHull(base).equations[:, 2] < 1e-6).all()
    assert rest_tilts(rest)[0] == pytest.approx(0.0, abs=1e-6)
    again, more = settle(rest)
    assert more == pytest.approx(0.0, abs=1e-7)
    np.testing.assert_allclose(again, np.eye(3), atol=1e-7)


@pytest.mark.parametrize("size", [(1.0, 1.0, 2.0), (1.0, 1.0, 1.0), (2.0, 2.0, 1.0)])
def test_a_box_that_does_not_stand_is_refused(size: tuple[float, float, float]) -> None:
    hull = convex_hull(0.5 * SIGNS * size)
    tilted = Rotation.from_euler("y", 40.0, degrees=True).as_matrix()
    with pytest.raises(InvalidInput, match="falls by"):
        settle(hull.turned(tilted))


def test_an_overhanging_rock_rolls_further_than_allowed() -> None:
    """A leaning prism whose centre lies beyond its foot."""
    points = SIGNS * (0.2, 0.5, 1.0)
    points[:, 0] += 0.5 * points[:, 2]  # its foot ends at x = -0.3, its centre is at 0
    with pytest.raises(InvalidInput, match="falls by"):
        settle(convex_hull(points))


def test_rest_poses_of_boxes() -> None:
    quarter = 0.5 * math.pi
    np.testing.assert_allclose(
        rest_tilts(convex_hull(SIGNS * (0.4, 0.7, 1.3))), [0.0, *[quarter] * 4, math.pi]
    )


def test_rest_poses_leave_out_faces_that_the_centre_overhangs() -> None:
    points = SIGNS * (0.2, 0.5, 1.0)
    points[:, 0] += 0.5 * points[:, 2]
    lean = math.atan(0.5)
    # Not its slanting ends: only the two long slanted sides and the two flanks.
    np.testing.assert_allclose(
        rest_tilts(convex_hull(points)),
        [0.5 * math.pi - lean, 0.5 * math.pi, 0.5 * math.pi, 0.5 * math.pi + lean],
    )


@given(st.integers(0, 10**6), st.integers(5, 80))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_contact_tilts_hold_every_support_that_sampling_finds(seed: int, count: int) -> None:
    hull = random_rock(seed, count)
    rng = np.random.default_rng(seed)
    down = rng.standard_normal((4000, 3))
    down /= np.linalg.norm(down, axis=1, keepdims=True)
    # And directions near each face's and edge's, where supports change hands.
    between = hull.normals + hull.normals[hull.neighbours[:, 0]] * rng.uniform(
        0, 1, (len(hull.normals), 1)
    )
    down = np.vstack([down, between / np.linalg.norm(between, axis=1, keepdims=True)])
    tilt = np.arccos(np.clip(-down[:, 2], -1.0, 1.0))
    support = np.argmax(down @ hull.vertices.T, axis=1)
    least, greatest = contact_tilts(hull)
    assert (least[support] <= tilt + 1e-9).all()
    assert (tilt <= greatest[support] + 1e-9).all()
    for limit in np.radians([10.0, 45.0, 80.0, 120.0]):
        assert touching(hull, limit)[support[tilt <= limit]].all()


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_the_tip_of_a_fine_fan_touches_straight_above_and_below(way: float) -> None:
    """Its facets are much alike, and none of their normals is near the vertical."""
    around = np.linspace(0.0, 2.0 * math.pi, 40, endpoint=False)
    ring = np.column_stack([np.cos(around), np.sin(around), 0.0 * around])
    rings = [ring - [0.0, 0.0, 0.2 * way], 0.5 * ring + [0.0, 0.0, 0.31 * way]]
    hull = convex_hull(np.vstack([*rings, [[0.0, 0.0, 0.62 * way], [0.0, 0.0, -2.0 * way]]]))
    least, greatest = contact_tilts(hull)
    for tilt in np.radians(np.arange(0.0, 181.0)):
        down = np.array([math.sin(tilt), 0.0, -math.cos(tilt)])
        support = int(np.argmax(hull.vertices @ down))
        assert least[support] <= tilt <= greatest[support]


def test_touching_leaves_something_out() -> None:
    """Of a finely faceted ball, what lies well above the tilt."""
    points = np.random.default_rng(0).standard_normal((600, 3))
    hull = convex_hull(points / np.linalg.norm(points, axis=1, keepdims=True))
    kept = touching(hull, math.radians(60.0))
    polar = np.arccos(-hull.vertices[:, 2])
    assert kept[polar < math.radians(60.0)].all()
    assert not kept[polar > math.radians(110.0)].any()


def test_base_polygon_runs_counter_clockwise() -> None:
    polygon = base_polygon(SIGNS * (0.4, 0.7, 1.3) + (0.0, 0.0, 5.0), 1e-6)
    after = np.roll(polygon, -1, axis=0)
    area = 0.5 * np.sum(polygon[:, 0] * after[:, 1] - polygon[:, 1] * after[:, 0])
    assert area == pytest.approx(0.8 * 1.4)
    feet = np.array(
        [[0.4, 0.0, -1.3], [-0.2, 0.3, -1.3], [-0.2, -0.3, -1.3], [0.9, 0.9, -1.3 + 5e-6]]
    )
    assert len(base_polygon(feet, 1e-6)) == 3
    assert len(base_polygon(feet, 1e-5)) == 4


@pytest.mark.parametrize(
    "points",
    [
        np.zeros((0, 3)),
        np.zeros((8, 3)),
        np.column_stack([np.random.default_rng(0).random((9, 2)), np.zeros(9)]),
        SIGNS + np.array([3.0, 0.0, 0.0]),
    ],
    ids=["none", "one point", "flat", "centre outside"],
)
def test_what_is_no_rock_is_refused(points: Array) -> None:
    with pytest.raises(InvalidInput):
        convex_hull(points)
