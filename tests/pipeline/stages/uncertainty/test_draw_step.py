"""Which time step draws are run at, and to which width their boundaries are told."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.config.problems import InputError
from pipeline.stages.uncertainty import draw_runs, draw_step
from pipeline.stages.uncertainty.draw_runs import Search
from pipeline.stages.uncertainty.draw_step import DrawStep
from vsr_core.arrays import Array, Indices
from vsr_core.run.cases import Settings
from vsr_core.uncertainty import step_error
from vsr_core.uncertainty.step_error import StepErrors

OWN, MOVED = 0.004, 0.02
"""A site's time step [s], and how far it moves boundaries [ln g], in proportion to a step."""

EDGES = np.linspace(0.1, 0.5, 30).reshape(3, 10)
"""Boundaries as a step of nothing finds them [g], of three directions."""


@pytest.fixture
def wanted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Search:
    """Five draws that are the site itself; a step moves their boundaries as far as it is long."""

    def run(
        self: draw_runs.Runner, draw: Indices, yaw: Indices, row: Indices, pga: Array
    ) -> NDArray[np.int8]:
        moved = np.exp(MOVED * self._wanted.settings.time_step / OWN)
        return (pga >= EDGES[yaw, row] * moved).astype(np.int8)

    monkeypatch.setattr(draw_runs.Runner, "run", run)
    member = SimpleNamespace(amplitude=1.0)
    draw = SimpleNamespace(member=member, seat=None, scales=lambda: np.zeros((5, 3)))
    work: Any = SimpleNamespace(runs=tmp_path, log=lambda line: None)
    nothing: Any = None
    every: Any = [draw] * 5
    bounds = (0.001, 4.0)
    given = np.zeros((5, 3))
    return Search(work, every, given, nothing, Settings(OWN), nothing, EDGES, 0.01, bounds)


@pytest.mark.parametrize(("tolerance", "taken"), [(0.03, 1.0), (0.01, 0.5), (0.001, 0.25)])
def test_the_longest_step_within_the_tolerance_is_taken(
    wanted: Search, tolerance: float, taken: float
) -> None:
    """Against an eighth of the site's step these move boundaries by 7, 3 and 1 eighths of it."""
    found = draw_step.measured(wanted, "auto", tolerance)
    assert found.time_step == taken * OWN
    assert found.errors.levels >= step_error.LEVELS
    expected = MOVED * np.array([0.875, 0.375, 0.125])
    np.testing.assert_allclose(found.errors.shift, expected, atol=4 * found.errors.unsure.max())
    assert found.within == (tolerance > 0.001)
    assert not found.errors.islands.any()


def test_a_step_that_is_given_stays_and_its_error_is_measured(wanted: Search) -> None:
    found = draw_step.measured(wanted, OWN, 0.001)
    assert found.tried.tolist() == [OWN]
    assert found.time_step == OWN
    assert found.errors.shift[0] == pytest.approx(0.875 * MOVED, abs=4 * found.errors.unsure[0])


def test_levels_are_spread_over_draws_directions_and_rows() -> None:
    draw, yaw, row = step_error.levels(8, 12, 50)
    assert np.bincount(draw).tolist() == [3] * 8
    assert len(set(yaw.tolist())) == 12
    assert np.bincount(row // 10, minlength=5).min() >= 2
    draw, yaw, row = step_error.levels(3, 1, 2)  # all that there are
    assert len(draw) == 6


@pytest.fixture
def step() -> DrawStep:
    """One of 3 ms, at which errors and islands are wider than at the next one."""
    parts = ([0.02, 0.004], [0.001, 0.001], [0.03, 0.01], [0.02, 0.0])
    errors = StepErrors(*(np.array(part) for part in parts), levels=24)
    return DrawStep(np.array([0.003, 0.0015]), errors, 0, 0.03)


def test_a_bracket_is_as_wide_as_error_and_islands_together(step: DrawStep) -> None:
    nothing: Any = None
    assert draw_step.resolution("auto", 0.01, step, nothing) == pytest.approx(0.05)
    assert draw_step.resolution("auto", 0.1, step, nothing) == 0.1
    assert draw_step.resolution(0.03, 0.01, step, nothing) == 0.03


def test_a_bracket_finer_than_the_error_is_refused_with_the_step_that_allows_it(
    step: DrawStep,
) -> None:
    origin: Any = SimpleNamespace(file_of=lambda key: "site.yaml")
    with pytest.raises(InputError) as refused:
        draw_step.resolution(0.02, 0.01, step, origin)
    text = str(refused.value)
    for words in ("uncertainty.resolution", "0.02", "0.03 at a time step of 3 ms", "=0.0015"):
        assert words in text
    with pytest.raises(InputError, match=r"give 0\.03 or more"):
        draw_step.resolution(0.005, 0.01, step, origin)
