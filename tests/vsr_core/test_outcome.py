"""What is stored of a run means the same for ever, and only a rock known to stand counts so."""

from __future__ import annotations

from vsr_core.outcome import Movement, Outcome


def test_codes_are_those_of_the_documentation() -> None:
    """``docs/conventions.md``; files that exist hold these numbers."""
    assert {one.name: one.value for one in Outcome} == {
        "BALANCED": 0, "OVERTURNED": 1, "DISPLACED": 2, "UNSETTLED": 3, "UNSTABLE": 4, "CRASHED": 5,
    }  # fmt: skip
    assert {one.name: one.value for one in Movement} == {
        "STAYED": 0, "ROLLED_OVER": 1, "FELL": 2, "SLID": 3,
    }  # fmt: skip


def test_what_has_no_verdict_counts_on_neither_side() -> None:
    standing, fallen = {Outcome.BALANCED, Outcome.DISPLACED}, {Outcome.OVERTURNED}
    assert {one for one in Outcome if one.overturned == 0} == standing
    assert {one for one in Outcome if one.overturned == 1} == fallen
    assert {one.overturned for one in set(Outcome) - standing - fallen} == {-1}
