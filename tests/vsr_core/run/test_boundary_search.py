"""The search for a boundary, on made-up verdicts: a run without one counts for neither side."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsr_core.outcome import Outcome
from vsr_core.run.boundary_search import Bracket, first_boundary, halved, verdict

LEVELS = [0.1 * k for k in range(1, 11)]


class Tried:
    """Verdicts of a rock that topples from ``limit`` on and keeps its outcome to itself in gaps."""

    def __init__(self, limit: float, *gaps: tuple[float, float]) -> None:
        self.limit, self.gaps = limit, gaps
        self.levels: dict[float, bool | None] = {}

    def __call__(self, level: float) -> bool | None:
        unknown = any(low <= level <= high for low, high in self.gaps)
        self.levels[level] = None if unknown else level > self.limit
        return self.levels[level]

    def are_ends_of(self, found: Bracket) -> bool:
        """Whether the ends of a bracket are levels with the verdicts that they stand for."""
        stands = found.stands == 0.0 or self.levels[found.stands] is False
        return stands and (math.isnan(found.topples) or self.levels[found.topples] is True)


def bisected(topples: Callable[[float], bool | None], low: float, high: float, times: int) -> float:
    for _ in range(times):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if topples(middle) else (middle, high)
    return 0.5 * (low + high)


@given(limit=st.floats(1.0, 2.0), halvings=st.integers(1, 30))
def test_with_a_verdict_of_every_run_it_is_a_bisection(limit: float, halvings: int) -> None:
    found = halved(Tried(limit), 1.0, 2.0, halvings)
    assert found.decided
    assert found.middle == bisected(Tried(limit), 1.0, 2.0, halvings)


@given(
    limit=st.floats(0.15, 0.95),
    gaps=st.lists(st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 0.3)), max_size=3),
)
def test_ends_of_a_bracket_are_runs_with_a_verdict(
    limit: float, gaps: list[tuple[float, float]]
) -> None:
    topples = Tried(limit, *((low, low + width) for low, width in gaps))
    found = first_boundary(topples, LEVELS, 8)
    assert found.stands <= limit
    assert topples.are_ends_of(found)
    known = [level for level in LEVELS if topples(level)]
    assert math.isnan(found.topples) == (not known)
    if known:
        assert limit < found.topples <= known[0]


def test_runs_without_a_verdict_pass_neither_for_standing_nor_for_toppling() -> None:
    """Between 0.38 and 0.62 nothing is known: the boundary lies somewhere there."""
    found = first_boundary(Tried(0.5, (0.38, 0.62)), LEVELS, 20)
    assert not found.decided
    assert found.stands == pytest.approx(0.38, abs=0.15)
    assert found.stands < 0.38 < 0.62 < found.topples


def test_nothing_is_found_where_no_run_has_a_verdict() -> None:
    lost = first_boundary(lambda level: None, LEVELS, 4)
    assert lost.stands == 0.0
    assert math.isnan(lost.topples)
    stuck = halved(lambda level: None, 1.0, 2.0, 4)
    assert (stuck.stands, stuck.topples, stuck.decided) == (1.0, 2.0, False)


def test_a_rock_that_stands_everything_has_no_boundary() -> None:
    found = first_boundary(Tried(2.0), LEVELS, 4)
    assert found.stands == LEVELS[-1]
    assert math.isnan(found.topples)


def test_the_search_ends_at_a_tolerance() -> None:
    topples = Tried(1.37)
    found = halved(topples, 1.0, 2.0, 100, 0.01)
    assert found.topples - found.stands <= 0.01 * found.topples
    assert len(topples.levels) == 7


def test_only_three_outcomes_are_verdicts() -> None:
    known = {outcome: verdict(outcome) for outcome in Outcome}
    assert [outcome for outcome, found in known.items() if found] == [Outcome.OVERTURNED]
    standing = [outcome for outcome, found in known.items() if found is False]
    assert standing == [Outcome.BALANCED, Outcome.DISPLACED]
