"""Made raw scans, from the scan to the verdicts of runs; most of them are of the slow suite."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from vsr_core import GRAVITY
from vsr_core.run import displacement
from vsr_core.scene import State
from vsr_core.verification.stability import Verdict, _field
from vsr_core.verification.stability._field import tipping_limit
from vsr_core.verification.stability.raw_scans import CASES, FIELDS, swings

pytestmark = pytest.mark.usefixtures("few_samples")

QUICK = [
    f"rough ground, sunk 1 cm: {asked}"
    for asked in ("volume", "centre", "inertia", "settling", "energy", "tipping", "verdicts")
]


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        case.name if case.name in QUICK else pytest.param(case.name, marks=pytest.mark.slow)
        for case in CASES
    ],
)
def test_verdict(name: str) -> None:
    """A smooth base may roll to and fro for longer than is waited; which does depends on bits."""
    found = next(case for case in CASES if case.name == name).run()
    rolls = name.endswith("verdicts") and ", 1 unsettled;" in found.note
    allowed = (Verdict.RIGHT, Verdict.FLAGGED) if rolls else (Verdict.RIGHT,)
    assert found.verdict in allowed, found


@pytest.mark.slow
def test_machine_code_that_is_compiled_first_is_no_part_of_settling(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    settled, clock = displacement.settled, [0.0]

    def compiling_first(*given: Any) -> State:
        clock[0] = 30.0
        return settled(*given)

    monkeypatch.setattr(displacement, "settled", compiling_first)
    monkeypatch.setattr(_field.time, "thread_time", lambda: clock[0])
    for kept in (_field.settled, _field._load_the_engine):
        kept.cache_clear()
    assert _field.settled(FIELDS["rough ground, sunk 1 cm"]).seconds == 0.0


def test_a_block_tips_about_its_nearest_edge() -> None:
    corners = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
    centre = np.array([0.25, 0.0, 3.0])
    for way, half in ((1.0, 0.75), (-1.0, 1.25)):
        limit = tipping_limit(corners, centre, np.array([way, 0.0, 0.0]))
        assert limit == pytest.approx(GRAVITY * half / 3.0)


@pytest.mark.parametrize(
    ("angles", "first"),
    [
        ([0.0, 0.1, 0.2, 0.2], 0.2),  # it does not come back
        ([0.0, 0.001, 0.0, 0.1, 0.2, 0.1, 0.9, 0.9], 0.2),  # what settles is no swing
        ([0.0, 0.1, 0.099, 0.2, 0.0, 0.3], 0.2),  # nor is a tremble
    ],
)
def test_first_swing(angles: list[float], first: float) -> None:
    """Of two engines, the other with twice as many looks."""
    other = np.array(angles)
    assert swings(0.5 * other[::2], other, 1.0)[1] == first


def test_a_swing_ends_with_the_pulse() -> None:
    assert swings(np.array([0.1, 0.3, 0.5, 0.7]), np.arange(1.0, 9.0), 0.5) == (0.3, 4.0)
