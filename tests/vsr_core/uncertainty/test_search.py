"""The search for boundaries against known thresholds."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from vsr_core.arrays import Array
from vsr_core.fragility.bisection import first_changes
from vsr_core.rock.solid import block
from vsr_core.uncertainty import search
from vsr_core.uncertainty.search import Brackets

WIDTH, BOUNDS = 0.01, (0.001, 4.0)
peaks = st.floats(np.log(5e-4), np.log(8.0)).map(np.exp)


def bracketed(topples: Callable[[Array], Array], expected: Array, scale: float) -> Brackets:
    """Brackets of some levels once the search wants no more runs of them."""
    found = Brackets(np.log(expected), np.full(len(expected), scale), WIDTH, BOUNDS)
    while len((asked := found.next_runs())[0]):
        assert len(found.known.pga) < 200 * len(expected)
        found.add(*asked, topples(asked[1]).astype(np.int8))
    return found


@settings(deadline=None)
@given(threshold=peaks, expected=peaks, scale=st.floats(0.002, 1.0))
def test_a_threshold_is_bracketed_from_anywhere(
    threshold: float, expected: float, scale: float
) -> None:
    """Within the bounds to its width, and beyond them by the bound that was tried."""
    found = bracketed(lambda pga: pga >= threshold, np.array([expected]), scale)
    lower, upper = (end[0] for end in first_changes(found.known, 1))
    if threshold <= BOUNDS[0]:
        assert np.isnan(lower)
        assert upper == BOUNDS[0]
    elif threshold > BOUNDS[1]:
        assert (lower, upper) == (BOUNDS[1], np.inf)
    else:
        assert lower < threshold <= upper
        assert np.log(upper / lower) <= WIDTH


def test_what_is_expected_well_takes_two_runs_and_what_is_not_a_few_more() -> None:
    rng = np.random.default_rng(4)
    threshold = np.exp(rng.uniform(-3.0, 0.0, 500))
    runs = []
    for apart in (0.004, 0.1):
        expected = threshold * np.exp(apart * rng.uniform(-1.0, 1.0, 500))
        known = Brackets(np.log(expected), np.full(500, 0.5 * apart), WIDTH, BOUNDS)
        while len((asked := known.next_runs())[0]):
            known.add(*asked, (asked[1] >= threshold[asked[0]]).astype(np.int8))
        runs.append(len(known.known.pga) / 500)
    assert 2.0 <= runs[0] < 2.1
    assert runs[1] < 2.0 + np.log2(0.2 / WIDTH)


@settings(deadline=None)
@given(st.lists(st.sampled_from([0, 1, -1]), min_size=2, max_size=8), peaks)
def test_any_outcomes_are_searched_to_an_end(sides: list[int], expected: float) -> None:
    """A run without a verdict is no end of a bracket; what it tells is the change that it met."""
    steps = np.geomspace(*BOUNDS, len(sides) + 1)[1:-1]
    found = bracketed(
        lambda pga: np.array(sides)[np.searchsorted(steps, pga, side="right")],
        np.array([expected]),
        0.1,
    )
    lower, upper = (end[0] for end in first_changes(found.known, 1))
    assert not lower >= upper
    if -1 not in sides and np.isfinite(lower) and np.isfinite(upper):
        assert np.log(upper / lower) <= WIDTH


def test_pga_is_rounded_by_less_than_a_part_of_the_bracket() -> None:
    pga = np.geomspace(*BOUNDS, 1000)
    rounded = search.rounded(pga, WIDTH)
    assert np.abs(np.log(rounded / pga)).max() <= WIDTH / 64.0
    np.testing.assert_array_equal(search.rounded(rounded * (1.0 + 1e-14), WIDTH), rounded)


def test_rows_between_are_expected_where_those_beside_them_moved() -> None:
    expected = np.array([[0.0, 1.0, 2.0, 3.0, 4.0]])
    found = np.array([[0.5, 4.5]])
    moved = search.from_own_rows(expected, found, np.array([0, 4]))
    np.testing.assert_allclose(moved, expected + 0.5)
    stages = search.stages(13, ordered=True)
    assert sorted(np.concatenate(stages).tolist()) == list(range(13))
    assert [rows.tolist() for rows in stages[:3]] == [[7], [3, 11], [1, 5, 9]]
    (rows,) = search.stages(4, ordered=False)
    assert rows.tolist() == [0, 1, 2, 3]


def test_the_way_that_was_nearer_counts_more() -> None:
    ways = np.array([[[0.0, 0.0]], [[1.0, 1.0]]])
    expected, scale = search.together(ways, np.array([[0.01, 0.2], [0.02, 0.2]]))
    np.testing.assert_allclose(expected, [[0.2, 0.5]])
    np.testing.assert_allclose(scale, [0.01, 0.2])


def test_the_scale_that_boundaries_go_with_is_taken() -> None:
    """Boundaries proportional to the third scale, and nothing else to any other."""
    rng = np.random.default_rng(2)
    scale = rng.normal(size=(6, 4, 3))
    boundary = scale[:, 2][..., None] + np.array([0.1, -0.4])
    chosen, offset = search.offsets(boundary, scale)
    assert chosen.tolist() == [2, 2, 2]
    np.testing.assert_allclose(offset, np.tile([0.1, -0.4], (3, 1)))


def test_a_block_tips_about_the_points_at_its_corners_as_by_its_hull() -> None:
    rock, yaw = block((0.5, 0.8, 1.1), 2000.0), np.radians([0.0, 25.0, 90.0, 200.0])
    foot = rock.vertices[rock.vertices[:, 2] < 0.0]
    np.testing.assert_allclose(search.scales_on(foot, yaw), search.scales(rock.hull, yaw))


def test_a_rock_on_points_askew_tips_by_the_angles_to_its_edges() -> None:
    """Two of four points lie lower: uphill it tips at tan(a - s), downhill at tan(a + s)."""
    width, height, slope = 0.3, 0.9, 0.1
    foot = np.array([(x, y, -height) for x in (-width, width) for y in (-0.4, 0.4)])
    c, s = np.cos(slope), np.sin(slope)
    turned = foot @ np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]).T  # falls toward +x
    found = np.exp(search.scales_on(turned, np.zeros(1))[1:3, 0])
    angle = np.arctan2(width, height)
    np.testing.assert_allclose(found, np.tan([angle + slope, angle - slope]))
