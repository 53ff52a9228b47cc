"""The one runner of grids, displacement runs and recorded tests, on runs that take no time."""

from __future__ import annotations

import re
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from pipeline.config.layers import load_site
from pipeline.config.problems import InputError, Unfinished
from pipeline.stages.runs.runner import Kind, Run, run_missing, stored
from pipeline.workflow import graph
from pipeline.workflow.cluster import Cluster
from pipeline.workflow.rows import RunRow
from pipeline.workflow.run_store import RunStore
from pipeline.workflow.stage import Job, Work
from pipeline.workflow.store import Store
from pipeline.workflow.workers import Batch, Done
from vsr_core.outcome import Outcome

GROUPS = ("north", ("east", 0.6))
"""Any hashable will do."""


def wanted(group: Any) -> list[Run]:
    """Five runs of a group; the last two are the same one."""
    first = GROUPS.index(group) * 10
    return [Run(bytes([number]) * 16, number) for number in (*range(first, first + 4), first + 3)]


def work(shared: tuple[Any, list[int]], items: tuple[int, ...]) -> list[tuple[Any, ...]]:
    """Rows whose steps are the items, noted in a list that they share."""
    shared[1].extend(items)
    return [(int(Outcome.BALANCED), 0, 0.1, 0.0, 0.0, item) for item in items]


KIND = Kind("runs", "runs", RunRow, work, batch=2)


class Deadly(Cluster):
    """A cluster whose worker dies of item 2."""

    def run(self, function: Any, batches: Any, shared: Any) -> Any:
        for batch in batches:
            for item in batch.items:
                one = Batch(batch.shared, (item,))
                dies = item.item == 2
                yield Done(one, None if dies else function(shared(batch.shared), one.items))


def work_in(folder: Path, cluster: Cluster) -> Work:
    with Store(folder) as store:
        store.open()
    job = Job(load_site("cuboid_1x1x2"), Store(folder), cluster, lambda line: None)
    return graph.work_of("runs", "key", job)


def test_only_what_is_not_stored_is_run_and_rows_come_in_order(tmp_path: Path) -> None:
    work = work_in(tmp_path, Cluster(0))
    with closing(RunStore(tmp_path, RunRow)) as runs:
        runs.add([RunRow(bytes([11]) * 16, int(Outcome.OVERTURNED), 0, 1.0, 1.0, 0.0, 7)])
    asked: list[Any] = []
    done: list[int] = []

    def shared(group: Any) -> tuple[Any, list[int]]:
        asked.append(group)
        return group, done

    tally = run_missing(work, KIND, GROUPS, wanted, shared)
    assert asked == list(GROUPS)
    assert sorted(done) == [0, 1, 2, 3, 3, 10, 12, 13, 13]
    assert (tally.runs, tally.crashed) == (9, 0)
    assert tally.summary.startswith("9 runs done in ")
    rows = dict(stored(tmp_path, KIND, GROUPS, wanted))
    assert [row.steps for row in rows["north"]] == [0, 1, 2, 3, 3]
    assert [row.steps for row in rows["east", 0.6]] == [10, 7, 12, 13, 13]
    (note,) = work.notes("runs")
    assert note["runs"] == 9
    assert note["workers"] == 0
    assert note["cpu_seconds"] >= 0.0
    again = run_missing(work, KIND, GROUPS, wanted, shared)
    assert again.summary == "0 runs done"
    assert len(done) == 9


def test_a_run_that_kills_its_worker_is_stored_as_crashed_and_tried_again(tmp_path: Path) -> None:
    work = work_in(tmp_path, Deadly(0))
    done: list[int] = []
    tally = run_missing(work, KIND, GROUPS, wanted, lambda group: (group, done))
    assert tally.crashed == 1
    ((_, rows), _) = stored(tmp_path, KIND, GROUPS, wanted)
    assert rows[2] == RunRow(bytes([2]) * 16, int(Outcome.CRASHED))
    assert rows[2].peak_tilt is rows[2].slip is None
    work = work_in(tmp_path, Cluster(0))
    done.clear()
    assert run_missing(work, KIND, GROUPS, wanted, lambda group: (group, done)).crashed == 0
    assert done == [2]


def test_a_run_that_is_lost_is_told(tmp_path: Path) -> None:
    work = work_in(tmp_path, Cluster(0))
    run_missing(work, KIND, GROUPS[:1], wanted, lambda group: (group, []))
    with pytest.raises(InputError, match="5 runs fewer than were done"):
        list(stored(tmp_path, KIND, GROUPS, wanted))


class Losing(Cluster):
    """A cluster that never gives one of its batches back."""

    def run(self, function: Any, batches: Any, shared: Any) -> Any:
        for number, batch in enumerate(batches):
            if number != 1:
                yield Done(batch, function(shared(batch.shared), batch.items))


def test_what_was_planned_is_stored_or_crashed_or_told(tmp_path: Path) -> None:
    work = work_in(tmp_path, Losing(0))
    with pytest.raises(Unfinished, match="of 10 runs came back") as lost:
        run_missing(work, KIND, GROUPS, wanted, lambda group: (group, []))
    came = int(re.findall(r"\d+", str(lost.value))[0])
    assert 0 < came < 10
    work = work_in(tmp_path, Cluster(0))
    assert run_missing(work, KIND, GROUPS, wanted, lambda group: (group, [])).runs == 10 - came
