"""The search for changes of outcome along PGA, on outcomes that are known beforehand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from vsr_core.fragility import bisection
from vsr_core.fragility.bisection import Known, changes, first_changes, next_runs, probes
from vsr_core.fragility.boundary import interval

BOUNDS = (0.001, 4.0)
WIDTH = np.log1p(0.005)
GRID = np.linspace(0.02, 1.0, 25)

Side = Callable[[int, float], int]


def cells(side: Side, levels: int, pga: np.ndarray = GRID) -> np.ndarray:
    return np.array([[side(level, p) for p in pga] for level in range(levels)], np.int8)


def searched(
    side: Side, levels: int, pga: np.ndarray = GRID, width: float = WIDTH, most: int = 60
) -> tuple[Known, int]:
    """All that is known in the end, and the number of rounds; no run is ever asked for twice."""
    known = bisection.of_grid(pga, cells(side, levels, pga))
    tried = {(int(n), p) for n in range(levels) for p in pga}
    for rounds in range(most):
        level, peaks = next_runs(known, np.full(levels, width), BOUNDS)
        if not len(level):
            return known, rounds
        asked = set(zip(level.tolist(), peaks.tolist(), strict=True))
        assert len(asked) == len(level)
        assert not asked & tried
        tried |= asked
        known = known.joined(level, peaks, [side(n, p) for n, p in sorted(asked)])
    raise AssertionError("the search does not end")


def piecewise(edges: list[float]) -> Callable[[float], int]:
    """Standing up to the first edge, toppling from there to the second, and so on."""
    return lambda pga: int(np.searchsorted(edges, pga, side="right")) % 2


edges_of_a_level = st.lists(
    st.floats(0.0005, 6.0, allow_nan=False), min_size=0, max_size=5, unique=True
).map(sorted)


@settings(max_examples=60, deadline=None)
@given(st.lists(edges_of_a_level, min_size=1, max_size=4))
def test_every_change_that_the_grid_shows_is_resolved(levels: list[list[float]]) -> None:
    """Whatever the outcomes: each interval holds an edge and is narrow, and none is lost."""
    sides = [piecewise(edges) for edges in levels]

    def side(level: int, pga: float) -> int:
        return sides[level](pga)

    known, _ = searched(side, len(levels))
    found = changes(known)
    assert (found.width <= WIDTH).all()
    for level, low, high in zip(found.level, found.lower, found.upper, strict=True):
        inside = [edge for edge in levels[level] if low < edge <= high]
        assert len(inside) % 2 == 1
    grid = cells(side, len(levels))
    for level, row in enumerate(grid):
        shown = np.flatnonzero(row[1:] != row[:-1])
        own = found.level == level
        for column in shown:
            within = (found.lower[own] >= GRID[column]) & (found.upper[own] <= GRID[column + 1])
            assert within.sum() % 2 == 1


@settings(max_examples=60, deadline=None)
@given(st.floats(0.0005, 6.0), st.sampled_from([WIDTH, 0.05, 0.3]))
def test_a_single_edge_is_found_wherever_it_is(edge: float, width: float) -> None:
    """Below and above the grid, and not beyond the bounds, where only that is said."""
    known, rounds = searched(lambda level, pga: int(pga >= edge), 1, width=width)
    ((lower,), (upper,)) = first_changes(known, 1)
    if edge > BOUNDS[1]:
        assert (lower, upper) == (BOUNDS[1], np.inf)
    elif edge <= BOUNDS[0]:
        assert np.isnan(lower)
        assert upper == BOUNDS[0]
    else:
        assert lower < edge <= upper <= lower * np.exp(width) * (1 + 1e-12)
        assert BOUNDS[0] <= lower
        assert upper <= BOUNDS[1]
    assert rounds < 30


def test_a_round_halves_every_interval() -> None:
    """Six hundred levels take the rounds of one, and as many runs each."""
    edges = np.random.default_rng(3).uniform(0.2, 0.9, 600)
    known, rounds = searched(lambda level, pga: int(pga >= edges[level]), 600)
    lower, upper = first_changes(known, 600)
    assert ((lower < edges) & (edges <= upper)).all()
    most = 1 + np.ceil(np.log2(np.log(GRID[5] / GRID[4]) / WIDTH))
    assert rounds <= most
    assert len(known.pga) <= 600 * (4 + most)


def test_grids_share_the_runs_that_part_their_brackets() -> None:
    """Of 24, 48 and 96 steps: the same last interval, and most runs of the finest."""
    edges = np.random.default_rng(3).uniform(0.2, 0.9, 200)
    tried, ends = [], []
    for number in (25, 49, 97):
        pga = np.linspace(0.02, 1.0, number)
        known, _ = searched(lambda level, pga: int(pga >= edges[level]), 200, pga)
        ends.append(np.array(first_changes(known, 200)))
        own = ~np.isin(known.pga, pga)
        tried.append(set(zip(known.level[own].tolist(), known.pga[own].tolist(), strict=True)))
    same = (ends[0] == ends[1]).all(axis=0) & (ends[1] == ends[2]).all(axis=0)
    assert same.mean() > 0.7  # in the others a cell of one of the grids lies in the interval
    assert len(tried[0] & tried[2]) > 0.6 * len(tried[2])


@settings(max_examples=60, deadline=None)
@given(
    st.floats(0.03, 0.9),
    st.lists(st.tuples(st.floats(0.01, 1.2), st.floats(0.0, 0.1)), max_size=4),
    st.integers(0, 2**32 - 1),
)
def test_unresolved_runs_are_gone_around(
    edge: float, bands: list[tuple[float, float]], seed: int
) -> None:
    """In bands and here and there: the search ends, and no interval ends at such a run."""
    sprinkled: dict[float, bool] = {}
    rng = np.random.default_rng(seed)

    def side(level: int, pga: float) -> int:
        if any(low <= pga <= low + wide for low, wide in bands):
            return -1
        if sprinkled.setdefault(pga, bool(rng.random() < 0.1)):
            return -1
        return int(pga >= edge)

    known, _ = searched(side, 1)
    found = changes(known)
    assert len(found.level) <= 1
    for low, high in zip(found.lower, found.upper, strict=True):
        assert low < edge <= high
        unresolved = known.pga[known.side < 0]
        narrow = np.log(high / low) <= WIDTH
        assert narrow or ((unresolved > low) & (unresolved < high)).any()


@settings(max_examples=40, deadline=None)
@given(edges_of_a_level)
def test_the_first_change_is_that_of_the_whole_grid(edges: list[float]) -> None:
    """What is left of a grid to search on has the interval that all its cells have."""
    side = cells(lambda level, pga: piecewise(edges)(pga), 1)
    low, high = first_changes(bisection.of_grid(GRID, side), 1)
    np.testing.assert_array_equal((low, high), interval(GRID, side))


@settings(max_examples=60, deadline=None)
@given(st.floats(0.05, 4.0))
def test_the_first_change_is_found_below_an_island_of_standing(start: float) -> None:
    """That of a block of 0.25 x 0.5 x 1.2 m at 0.2 s, by Housner, wherever one starts."""
    outcome = piecewise([0.242, 0.604, 0.65])
    known, _ = searched(lambda n, p: outcome(p), 1, np.array([start]))
    lower, upper = bisection.first_changes(known, 1)
    assert lower[0] < 0.242 <= upper[0]


def test_probes_lie_between_cells_of_one_outcome_near_the_boundary() -> None:
    side = cells(lambda level, pga: int(pga >= 0.1 + 0.01 * level), 80)
    drawn = np.random.default_rng(1).random((80, 3))
    level, pga, gap = probes(GRID, side, drawn, 0.5)
    assert set(level) <= set(np.flatnonzero(drawn[:, 0] < 0.5))
    assert len(level) > 25
    assert ((GRID[gap] < pga) & (pga < GRID[gap + 1])).all()
    assert (side[level, gap] == side[level, gap + 1]).all()
    first = np.where(side == 1, GRID, np.inf).min(axis=1)[level]
    assert (np.abs(np.log(pga / first)) < np.log(2.0) + np.log(GRID[1] / GRID[0])).all()
    assert {0, 1} == set(side[level, gap].tolist())


def test_an_island_that_a_probe_finds_is_resolved_like_any_other() -> None:
    toppling, standing = [0.27, 0.30, 0.6], [0.2, 0.31, 0.34]  # between cells at .265, .306, .347
    for own, probe in ((toppling, 0.285), (standing, 0.32)):
        outcome = piecewise(own)
        grid = np.array([[outcome(p) for p in GRID]], np.int8)
        beside = np.zeros((1, len(GRID) - 1), dtype=bool)
        beside[0, np.searchsorted(GRID, probe) - 1] = True
        known = bisection.of_grid(GRID, grid, beside).joined(
            np.array([0]), np.array([probe]), [outcome(probe)]
        )
        while len((runs := next_runs(known, np.array([WIDTH]), BOUNDS))[0]):
            known = known.joined(*runs, [outcome(p) for p in runs[1]])
        found = changes(known)
        assert len(found.level) == 3
        assert all(
            low < edge <= high
            for low, edge, high in zip(found.lower, own, found.upper, strict=True)
        )
