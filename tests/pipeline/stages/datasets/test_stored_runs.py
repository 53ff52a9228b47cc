"""A stored run stands in the dataset at the cell that it was done for."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipeline.stages.datasets import stored_runs
from pipeline.stages.motions.motion_grid import Pulses
from pipeline.stages.runs import overturning_runs, runner
from pipeline.stages.runs.scenes import Group
from pipeline.stages.runs.study import Cells, GridRuns
from pipeline.workflow.rows import RunRow
from vsr_core.outcome import Outcome

PULSES = Pulses((0.1, 0.2, 0.5), (0.3, 0.7))
GROUPS = (Group(0.0, 0.4), Group(0.0, 0.6), Group(90.0, 0.4))


def test_every_run_is_at_its_own_cell(monkeypatch: pytest.MonkeyPatch) -> None:
    """A run tells here by its tilt and its slip for which PGV/PGA and PGA it was done."""
    cells = Cells.of(PULSES)

    class Asked(SimpleNamespace):
        def wanted(self, group: Group) -> GridRuns:
            return GridRuns(repr(group).encode(), cells)

    def done(
        database: Any, kind: Any, groups: Any, wanted: Any
    ) -> Iterator[tuple[Group, list[RunRow]]]:
        for group in groups:
            for run in wanted(group):
                ratio = PULSES.pgv_pga[run.item.row]
                yield group, [RunRow(run.key, 0, 0, ratio, group.friction, run.item.pga, 1)]

    monkeypatch.setattr(runner, "stored", done)
    study: Any = Asked(motions=PULSES, groups=GROUPS)
    runs = stored_runs.stored(Path(), overturning_runs.KIND, study)
    assert len(runs) == 18
    assert (runs["pga"] == runs["slip"]).all()
    assert (runs["friction"] == runs["final_tilt"]).all()
    assert ([PULSES.pgv_pga[row] for row in runs["motion"]] == runs["peak_tilt"]).all()
    assert not runs.duplicated(["yaw", "friction", "motion", "pga"]).any()


def test_a_tally_counts_what_has_no_verdict() -> None:
    ended = [Outcome.UNSETTLED, Outcome.DISPLACED, Outcome.UNSETTLED, Outcome.CRASHED]
    words, unresolved = stored_runs.tally(np.bincount(ended, minlength=len(Outcome)))
    assert (words, unresolved) == ("1 displaced, 2 unsettled, 1 crashed", 3)
