"""Grids of many runs: what is held and written grows no faster than it must."""

from __future__ import annotations

import hashlib
import struct
import tracemalloc
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pipeline.config.layers import load_site
from pipeline.stages.motions.motion_grid import Cell, Pulses
from pipeline.stages.runs import runner
from pipeline.stages.runs.runner import Kind, Run, missing, run_missing, stored
from pipeline.stages.runs.study import Cells, GridRuns
from pipeline.workflow import graph
from pipeline.workflow.cluster import Cluster
from pipeline.workflow.rows import RunRow
from pipeline.workflow.run_store import RunStore
from pipeline.workflow.stage import Job, Work
from pipeline.workflow.store import Store
from vsr_core.outcome import Outcome

SCENES = (bytes(range(16)), bytes(range(1, 17)))


def grid(rows: int, columns: int) -> Pulses:
    return Pulses(
        tuple(0.05 + 1e-4 * row for row in range(rows)),
        tuple(0.1 + 1e-4 * column for column in range(columns)),
    )


def runs_of(scene: bytes, motions: Pulses) -> GridRuns:
    return GridRuns(scene, Cells.of(motions))


def work(shared: Any, items: tuple[Cell, ...]) -> list[tuple[Any, ...]]:
    return [(int(Outcome.BALANCED), 0, item.pga, None, 0.0, item.row) for item in items]


KIND = Kind("runs", "runs", RunRow, work, batch=5)


@pytest.fixture
def job(tmp_path: Path) -> Iterator[Work]:
    with Store(tmp_path) as store:
        store.open()
        site = load_site("cuboid_1x1x2", settings=("simulation.engine=bullet",))
        yield graph.work_of("runs", "key", Job(site, store, Cluster(0), lambda line: None))


def test_keys_are_those_of_runs_taken_one_by_one() -> None:
    motions = grid(3, 4)
    for scene in SCENES:
        expected = []
        for ratio in motions.pgv_pga:
            for pga in motions.pga:
                told = scene + struct.pack("<2d", ratio, pga)
                expected.append(scene[:4] + hashlib.blake2b(told, digest_size=12).digest())
        runs = runs_of(scene, motions)
        assert [run.key for run in runs] == expected
        assert [run.item for run in runs] == [Cell(row, p) for row in range(3) for p in motions.pga]
    both = {run.key for scene in SCENES for run in runs_of(scene, motions)}
    assert len(both) == 24


def test_parts_give_what_the_whole_gives(job: Work, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "AT_ONCE", 7)
    motions = grid(5, 6)

    def wanted(scene: bytes) -> GridRuns:
        return runs_of(scene, motions)

    stays = [run.key for run in wanted(SCENES[0])][::3]
    with closing(RunStore(job.runs, RunRow)) as runs:
        runs.add([RunRow(key, int(Outcome.OVERTURNED)) for key in stays])
        marks = missing(wanted(SCENES[0]), runs)
        assert marks == bytes(0 if place % 3 == 0 else 1 for place in range(30))
    assert run_missing(job, KIND, SCENES, wanted, lambda scene: None).runs == 50
    found: dict[bytes, list[RunRow]] = {scene: [] for scene in SCENES}
    for scene, rows in stored(job.runs, KIND, SCENES, wanted):
        assert len(rows) <= 7
        found[scene] += rows
    assert [row.steps for row in found[SCENES[1]]] == [row for row in range(5) for _ in range(6)]
    assert [row.peak_tilt for row in found[SCENES[1]]] == [*motions.pga] * 5
    for place, row in enumerate(found[SCENES[0]]):
        toppled = row.outcome == Outcome.OVERTURNED
        assert toppled == (place % 3 == 0)
        assert row.steps == (0 if toppled else place // 6)


@pytest.mark.slow
def test_a_batch_is_written_to_few_pages(job: Work) -> None:
    """Rows of a batch lie side by side, although keys are as good as random."""
    motions = grid(100, 100)
    order: list[list[bytes]] = []

    class Noting(Cluster):
        def run(self, function: Any, batches: Any, shared: Any) -> Any:
            for batch in batches:
                order.append([run.key for run in batch.items])
                yield batch, (work(None, tuple(run.item for run in batch.items)), 0.0)

    noting = replace(job, cluster=Noting(0))
    kind = replace(KIND, batch=100)
    run_missing(noting, kind, SCENES, lambda scene: runs_of(scene, motions), lambda scene: None)
    assert {len(batch) for batch in order} == {100}
    places = {key: place for place, key in enumerate(sorted(key for b in order for key in b))}
    for batch in order:
        at = [places[key] for key in batch]
        assert max(at) - min(at) == 99


@pytest.mark.parametrize("engine", ["bullet", "nonsmooth"])
@pytest.mark.parametrize(("each", "largest"), [(1e-6, 1000), (1e-3, 300), (1e-2, 30), (1.0, 1)])
def test_batches_follow_the_cost_of_a_run(
    job: Work, engine: str, each: float, largest: int
) -> None:
    sizes: list[int] = []

    class Costly(Cluster):
        def run(self, function: Any, batches: Any, shared: Any) -> Any:
            for batch in batches:
                sizes.append(len(batch.items))
                rows = work(None, tuple(run.item for run in batch.items))
                yield batch, (rows, each * len(rows))

    motions = grid(60, 60)
    costly = replace(job, cluster=Costly(0), engine=engine)
    run_missing(costly, KIND, SCENES[:1], lambda scene: runs_of(scene, motions), lambda scene: None)
    assert sizes[0] == 5
    assert max(sizes[1:]) == pytest.approx(largest, abs=1)
    assert sum(sizes) == 3600


@pytest.mark.slow
def test_memory_does_not_grow_with_the_grid(job: Work, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "AT_ONCE", 1000)
    monkeypatch.setattr(runner, "LARGEST_BATCH", 50)

    def peak(rows: int) -> int:
        motions = grid(rows, 100)
        runs = runs_of(struct.pack(">Q", rows) * 2, motions)
        tracemalloc.reset_peak()
        before = tracemalloc.get_traced_memory()[0]
        assert (
            run_missing(job, KIND, (0,), lambda group: runs, lambda group: None).runs == 100 * rows
        )
        return tracemalloc.get_traced_memory()[1] - before

    tracemalloc.start()
    try:
        peak(10)  # what is loaded once
        small, large = peak(20), peak(200)
    finally:
        tracemalloc.stop()
    # 18,000 more runs: a mark for each, twice while the marks become bytes, and nothing else.
    assert large - small < 4 * 18_000


def test_runs_may_be_asked_for_again_and_again() -> None:
    runs = runs_of(SCENES[0], grid(2, 3))
    assert list(runs) == list(runs)
    assert all(isinstance(run, Run) for run in runs)
