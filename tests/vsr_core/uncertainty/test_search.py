"""The search for boundaries against tables of which all cells are known."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from vsr_core.rock.solid import block
from vsr_core.uncertainty import search
from vsr_core.uncertainty.search import UNKNOWN, Table

COLUMNS = 24


def searched(truth: Table, expected: int, *, rough: bool) -> Table:
    """The table of one row once the search wants no more of it."""
    table = np.full((1, truth.size), UNKNOWN, dtype=np.int8)
    while (ask := search.next_cells(table, np.array([expected]), np.array([rough]))).any():
        assert (table[ask] == UNKNOWN).all()
        table[ask] = truth[None][ask]
    return table


@settings(deadline=None)
@given(first=st.integers(0, COLUMNS), expected=st.integers(0, COLUMNS), rough=st.booleans())
def test_a_single_boundary_is_found_from_anywhere(first: int, expected: int, rough: bool) -> None:
    truth = (np.arange(COLUMNS) >= first).astype(np.int8)
    table = searched(truth, expected, rough=rough)
    np.testing.assert_array_equal(search.completed(table)[0], truth)
    near = int((table != UNKNOWN).sum())
    away = abs(first - expected)
    assert near <= 5 + 2 * np.log2(1 + away) + 2 * rough


@settings(deadline=None)
@given(first=st.integers(2, 18), island=st.integers(1, 3), gap=st.integers(0, 1))
def test_a_ragged_row_is_followed_until_it_is_calm(first: int, island: int, gap: int) -> None:
    """One cell that topples, then cells that stand: all are run."""
    truth = (np.arange(COLUMNS) >= first).astype(np.int8)
    truth[first + 1 + gap : first + 1 + gap + island] = 0
    completed = search.completed(searched(truth, first, rough=True))[0]
    taken = island if gap else 0  # two that topple are taken for calm
    assert (completed != truth).sum() == taken


@settings(deadline=None)
@given(
    row=st.lists(st.sampled_from([0, 1, -1]), min_size=1, max_size=12),
    expected=st.integers(0, 12),
    rough=st.booleans(),
)
def test_any_row_is_searched_to_an_end(row: list[int], expected: int, rough: bool) -> None:
    truth = np.array(row, dtype=np.int8)
    table = searched(truth, expected, rough=rough)
    run = table[0] != UNKNOWN
    np.testing.assert_array_equal(search.completed(table)[0][run], truth[run])
    assert set(search.completed(table)[0].tolist()) <= {-1, 0, 1}


def test_rows_between_are_expected_where_those_beside_them_moved() -> None:
    expected = np.array([[0.0, 1.0, 2.0, 3.0, 4.0]])
    found = np.array([[0.5, 4.5]])
    moved = search.from_own_rows(expected, found, np.array([0, 4]))
    np.testing.assert_allclose(moved, expected + 0.5)
    rows = search.first_rows(13, ordered=True)
    assert rows[0] == 0
    assert rows[-1] == 12
    np.testing.assert_array_equal(search.first_rows(4, ordered=False), np.arange(4))


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
