"""Workers change nothing but the time; one that dies takes only the item that killed it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline import ROOT
from pipeline.stages.runs import overturning_runs, runner
from pipeline.workflow.cluster import Cluster
from pipeline.workflow.datasets import read
from pipeline.workflow.workers import BATCHES_IN_FLIGHT, Batch
from vsr_core.outcome import Outcome

GRID = (
    "motion: {pga: {start: 0.2, stop: 1.0, num: 5}, pgv_pga: [0.15, 0.3, 0.6]}\nyaw: [0, 60]\n"
    "simulation: {engine: bullet, time_step: 0.002}\n"
)


def quiet(line: str) -> None:
    pass


@pytest.fixture(autouse=True)
def always_a_cluster(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "SMALL", 0)


@pytest.fixture(scope="module")
def clusters() -> Iterator[dict[int, Cluster]]:
    """By the number of their workers, for tests that leave them as they were."""
    with Cluster(0, log=quiet) as none, Cluster(2, log=quiet) as two:
        yield {0: none, 2: two}


@pytest.fixture
def responses(
    vsr: Callable[..., Any], write_site: Callable[..., str], tmp_path: Path
) -> Callable[..., Path]:
    """Make responses from nothing in a folder of its own; returns their file."""

    def make(name: str, workers: int) -> Path:
        into = tmp_path / name
        site = write_site(GRID)
        ran = vsr("run", "responses", "--site", site, "--workers", workers, into=into)
        assert ran.code == 0, ran.err
        assert ("dashboard: " in ran.err) == (workers > 0)
        return into / "rock" / "responses.nc"

    return make


@pytest.mark.slow
@pytest.mark.parametrize(
    "ways",
    [((0, 7), (2, 2)), pytest.param(((0, 1), (1, 4), (2, 1), (2, 1000)), marks=pytest.mark.slow)],
)
def test_same_bytes_for_any_workers_and_batches(
    responses: Callable[..., Path],
    monkeypatch: pytest.MonkeyPatch,
    ways: tuple[tuple[int, int], ...],
) -> None:
    one = responses("alone", 0).read_bytes()
    assert set(np.unique(read(responses("alone", 0))["overturned"])) == {0, 1}
    for workers, batch in ways:
        monkeypatch.setattr(overturning_runs, "KIND", replace(overturning_runs.KIND, batch=batch))
        assert responses(f"{workers}-{batch}", workers).read_bytes() == one


@pytest.mark.slow  # the run that crashes, below, is of the quick suite
@pytest.mark.parametrize("way", ["kill", "exit"])
def test_item_that_kills_its_worker_comes_back_alone(way: str) -> None:
    def work(shared: int, items: tuple[int, ...]) -> list[int]:
        if 17 in items and way == "exit":
            os._exit(3)
        if 17 in items:
            os.kill(os.getpid(), signal.SIGKILL)
        time.sleep(0.01)
        return [shared * item for item in items]

    # Batches of one are there too: those next to the culprit are innocent.
    batches = [Batch("two", tuple(range(10 * k, 10 * k + 10))) for k in range(4)]
    batches += [Batch("two", (k,)) for k in range(40, 48)]
    done: dict[int, int | None] = {}
    with Cluster(2, log=quiet) as cluster:
        for batch, results in cluster.run(work, iter(batches), lambda name: 2):
            assert not set(batch.items) & set(done)
            done.update(zip(batch.items, results or [None] * len(batch.items), strict=True))
    assert done == {item: None if item == 17 else 2 * item for item in range(48)}


@pytest.mark.slow
@pytest.mark.parametrize("workers", [0, 2])
def test_error_in_the_function_is_raised(workers: int) -> None:
    def work(shared: int, items: tuple[int, ...]) -> list[int]:
        raise ZeroDivisionError("mine")

    with Cluster(workers, log=quiet) as cluster, pytest.raises(ZeroDivisionError, match="mine"):
        list(cluster.run(work, iter([Batch("a", (1,))]), lambda name: 2))


@pytest.mark.slow
@pytest.mark.parametrize("workers", [0, 2])
def test_holds_no_more_than_the_batches_in_flight(
    clusters: dict[int, Cluster], workers: int
) -> None:
    taken = 0

    def batches() -> Iterator[Batch]:
        nonlocal taken
        for taken in range(1, 101):
            yield Batch(None, (taken,))

    most = 0
    results = []
    done = clusters[workers].run(lambda shared, items: list(items), batches(), lambda name: None)
    for batch, result in done:
        results += result
        assert batch.items == tuple(result)
        most = max(most, taken - len(results))
    assert sorted(results) == list(range(1, 101))
    assert most <= BATCHES_IN_FLIGHT * max(workers, 1)
    if workers == 0:
        assert most == 0


@pytest.mark.parametrize("workers", [0, 2])
def test_each_item_has_its_result_and_what_it_shared(
    clusters: dict[int, Cluster], workers: int
) -> None:
    def work(shared: float, items: tuple[int, ...]) -> list[float]:
        return [shared * item for item in items]

    batches = (Batch((0.5, k), (k, 10 * k)) for k in range(3))  # any hashable key
    done = clusters[workers].each(work, batches, lambda key: sum(key))
    found = {(key, item): result for key, item, result in done}
    assert found == {((0.5, k), i): (0.5 + k) * i for k in range(3) for i in {k, 10 * k}}


def test_shared_things_are_asked_for_once_each(clusters: dict[int, Cluster]) -> None:
    asked = []

    def shared(name: str) -> str:
        asked.append(name)
        return name.upper()

    batches = [Batch("ab"[k // 5], (k,)) for k in range(10)]
    for cluster in clusters.values():
        asked.clear()
        done = cluster.run(lambda thing, items: [thing], iter(batches), shared)
        assert {batch.items: result for batch, result in done} == {
            (k,): ["AB"[k // 5]] for k in range(10)
        }
        assert asked == ["a", "b"]


@pytest.mark.slow
def test_crashed_run_is_told_and_tried_again(
    vsr: Callable[..., Any],
    write_site: Callable[..., str],
    derived: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    site = write_site(GRID)
    command = ("run", "responses", "--site", site, "--workers", "1")
    simulate_batch = overturning_runs.simulate_batch

    def deadly(shared: Any, cells: tuple[Any, ...]) -> list[tuple[Any, ...]]:
        if (1, 0.8) in cells and shared[0].full.yaw == 0.0:
            os._exit(1)
        return simulate_batch(shared, cells)

    with monkeypatch.context() as patch:
        few = replace(overturning_runs.KIND, function=deadly, batch=2)
        patch.setattr(overturning_runs, "KIND", few)
        ran = vsr(*command)
    assert ran.code == 1
    assert "1 run is unresolved" in ran.err
    assert "Traceback" not in ran.err
    data = read(derived / "rock" / "responses.nc")
    lost = data["outcome"].values == Outcome.CRASHED
    assert np.argwhere(lost).tolist() == [[0, 0, 1, 3]]  # yaw 0, 0.3 s, 0.8 g
    assert data["overturned"].values[lost].tolist() == [-1]
    assert np.isnan(data["peak_tilt"].values[lost]).all()
    assert "1 run crashed before" in vsr("why", "responses", "--site", site).out

    simulated = []

    def counting(shared: Any, cells: tuple[Any, ...]) -> list[tuple[Any, ...]]:
        simulated.extend(cells)
        return simulate_batch(shared, cells)

    monkeypatch.setattr(overturning_runs, "KIND", replace(overturning_runs.KIND, function=counting))
    assert vsr(*command[:-1], "0").code == 0
    assert simulated == [(1, 0.8)]
    whole = tmp_path / "whole"
    assert vsr(*command[:-1], "0", into=whole).code == 0
    again = (derived / "rock" / "responses.nc").read_bytes()
    assert again == (whole / "rock" / "responses.nc").read_bytes()


INTERRUPTED = """
import os, signal, sys, time
from dataclasses import replace
from pipeline import cli
from pipeline.stages.runs import overturning_runs, runner

def run():
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background ignores it
    runner.SMALL, overturning_runs.KIND = 0, replace(overturning_runs.KIND, batch=3)
    add = runner.RunStore.add
    def stop(store, rows):
        add(store, rows)
        os.killpg(0, signal.SIGINT)  # as a terminal does: the workers get it too
    runner.RunStore.add = stop
    sys.exit(cli.main(sys.argv[1:]))

if __name__ == "__main__":
    run()
"""


@pytest.mark.slow
def test_ctrl_c_stops_the_workers_too(
    write_site: Callable[..., str], derived: Path, tmp_path: Path, vsr: Callable[..., Any]
) -> None:
    script = tmp_path / "interrupted.py"
    script.write_text(INTERRUPTED)
    command = ["run", "responses", "--site", write_site(GRID), "--workers", "1"]
    done = subprocess.run(
        [sys.executable, str(script), *command, "--derived", str(derived)],
        capture_output=True,
        text=True,
        check=False,
        start_new_session=True,
        cwd=ROOT,
        timeout=120,
    )
    assert done.returncode == 130, done.stderr
    assert "Traceback" not in done.stderr
    assert "the same command goes on from there" in done.stderr.splitlines()[-1]
    said = vsr("why", "responses", "--site", write_site(GRID)).out
    assert "runs: 3 of 30 are stored and stay; 27 to do" in said
