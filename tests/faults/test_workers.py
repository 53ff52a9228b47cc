"""Workers with threads, of other code, killed, late; schedulers that die: nothing wrong or lost."""

from __future__ import annotations

import os
import random
import shutil
import signal
import sqlite3
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, nullcontext
from pathlib import Path
from typing import Any

import dask
import pytest
from support.dask_processes import Farm

from pipeline import ROOT
from pipeline.stages.runs import runner
from pipeline.workflow import dispatch
from pipeline.workflow.cluster import Cluster
from pipeline.workflow.run_store import RUNS
from pipeline.workflow.workers import BATCHES_IN_FLIGHT, Batch
from vsr_core.outcome import Outcome

GRID = """
motion: {pga: {start: 0.1, stop: 1.0, num: 12}, pgv_pga: {start: 0.05, stop: 0.5, num: 8}}
yaw: 30
simulation: {engine: %s, time_step: 0.002}
"""


def quiet(line: str) -> None:
    pass


@pytest.fixture(autouse=True)
def always_a_cluster(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "SMALL", 0)


@pytest.fixture
def farm(tmp_path: Path) -> Iterator[Farm]:
    with Farm(tmp_path / "farm") as farm:
        yield farm


@pytest.fixture(scope="module")
def threads(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Farm]:
    """A worker with four threads, for tests that leave it as it was."""
    with Farm(tmp_path_factory.mktemp("threads")) as farm:
        farm.worker("--nthreads", "4")
        yield farm


def rows(folder: Path) -> dict[bytes, tuple[Any, ...]]:
    if not (folder / RUNS).exists():
        return {}
    with closing(sqlite3.connect(f"file:{folder / RUNS}?mode=ro", uri=True)) as database:
        try:
            return {row[0]: row for row in database.execute("SELECT * FROM runs")}
        except sqlite3.OperationalError:
            return {}


def sleeper() -> Callable[[float, tuple[int, ...]], list[float]]:
    """Work that takes 20 ms an item; not known to a worker by its name."""

    def sleeping(shared: float, items: tuple[int, ...]) -> list[float]:
        found = []
        for item in items:
            time.sleep(0.02)
            found.append(shared * item)
        return found

    return sleeping


# Threads


@pytest.mark.slow
@pytest.mark.parametrize(
    "engine", ["bullet", "nonsmooth", pytest.param("mujoco", marks=pytest.mark.slow)]
)
def test_threads_of_a_worker_change_no_bit(
    threads: Farm,
    vsr: Callable[..., Any],
    write_site: Callable[..., str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    engine: str,
) -> None:
    if engine == "mujoco":
        pytest.importorskip("mujoco")
    command = ("run", "responses", "--site", write_site(GRID % engine))
    ran = vsr(*command, "--scheduler", threads.address, into=tmp_path / "threads")
    assert ran.code == 0, ran.err
    assert "dashboard: " in ran.err
    assert ran.err.count("start workers with --nthreads 1") == (engine != "nonsmooth")
    assert vsr(*command, "--workers", "0", into=tmp_path / "alone").code == 0
    one, other = (tmp_path / name / "rock" for name in ("threads", "alone"))
    assert len(rows(other)) == 96
    assert {row[1] for row in rows(other).values()} >= {Outcome.BALANCED, Outcome.OVERTURNED}
    assert rows(one) == rows(other)
    assert (one / "responses.nc").read_bytes() == (other / "responses.nc").read_bytes()


def test_of_threads_that_are_stopped_only_what_has_begun_is_done() -> None:
    begun: list[int] = []

    def work(shared: Any, items: tuple[int, ...]) -> list[int]:
        begun.extend(items)
        time.sleep(0.02)
        return list(items)

    batches = (Batch(0, (number,)) for number in range(1000))
    results = Cluster(1).in_threads().run(work, batches, lambda shared: None)
    next(results)
    results.close()
    assert len(begun) <= 3


@pytest.mark.parametrize("together", [False, True])
def test_one_batch_at_a_time_in_a_process_unless_it_shares_nothing(
    threads: Farm, together: bool
) -> None:
    def crowd(shared: None, items: tuple[int, ...]) -> int:
        os.environ["CROWD"] = str(int(os.environ.get("CROWD", "0")) + 1)
        time.sleep(0.1)
        now = int(os.environ["CROWD"])
        os.environ["CROWD"] = str(now - 1)
        return now

    cluster = Cluster(0, threads.address, log=quiet)
    with cluster.in_threads() if together else cluster as chosen:
        done = chosen.run(crowd, (Batch(None, (k,)) for k in range(12)), lambda name: None)
        crowds = [result for _, result in done]
    assert len(crowds) == 12
    assert (max(crowds) > 1) == together


# Other code


@pytest.fixture
def other_code(tmp_path: Path) -> Path:
    """A copy of the project in which the ground of Bullet is softer."""
    folder = tmp_path / "other"
    for package in ("vsr_core", "pipeline"):
        shutil.copytree(ROOT / package, folder / package)
    world = folder / "vsr_core" / "engines" / "bullet" / "world.py"
    text = world.read_text()
    assert "ERP" in text
    world.write_text(text.replace("ERP = ", "ERP = 0.5 * "))
    return folder


@pytest.mark.slow
def test_worker_of_other_code_is_refused(
    farm: Farm,
    vsr: Callable[..., Any],
    write_site: Callable[..., str],
    derived: Path,
    other_code: Path,
) -> None:
    farm.worker(code=other_code)
    ran = vsr(
        "run", "responses", "--site", write_site(GRID % "bullet"), "--scheduler", farm.address
    )
    assert ran.code == 2, ran.err
    refusals = [line for line in ran.err.splitlines() if line.startswith("vsr: ")]
    assert len(refusals) == 1
    for word in ("other code", "vsr_core.engines.bullet.world", "start it again"):
        assert word in refusals[0]
    assert "Traceback" not in ran.err
    assert rows(derived / "rock") == {}


def test_worker_without_this_project_is_refused(
    farm: Farm,
    vsr: Callable[..., Any],
    write_site: Callable[..., str],
    derived: Path,
    tmp_path: Path,
) -> None:
    (tmp_path / "vsr_core").mkdir()
    (tmp_path / "pipeline").mkdir()
    for package in ("vsr_core", "pipeline"):
        (tmp_path / package / "__init__.py").write_text("")
    farm.worker(code=tmp_path)
    ran = vsr(
        "run", "responses", "--site", write_site(GRID % "bullet"), "--scheduler", farm.address
    )
    assert ran.code == 2, ran.err
    assert sum(line.startswith("vsr: ") for line in ran.err.splitlines()) == 1
    assert "a worker without this program" in ran.err
    assert rows(derived / "rock") == {}


# Deaths


@pytest.mark.slow
@pytest.mark.parametrize("second", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_scheduler_that_dies_ends_the_command(
    farm: Farm,
    vsr: Callable[..., Any],
    write_site: Callable[..., str],
    derived: Path,
    tmp_path: Path,
    second: bool,
) -> None:
    """And the same command goes on from there, on a second one or none, to the same bits."""
    site = write_site(GRID % "bullet" + "contact: {friction: [0.5, 0.7, 0.9]}\n")
    command = ("run", "responses", "--site", site)
    farm.worker()

    def kill_it() -> None:
        while len(rows(derived / "rock")) < 50:
            time.sleep(0.02)
        farm.scheduler.send_signal(signal.SIGKILL)

    killer = threading.Thread(target=kill_it)
    killer.start()
    start = time.monotonic()
    ran = vsr(*command, "--scheduler", farm.address)
    killer.join()
    assert time.monotonic() - start < 60.0
    assert ran.code == 1, ran.err
    assert sum(line.startswith("vsr: ") for line in ran.err.splitlines()) == 1
    assert "scheduler cannot be reached" in ran.err.splitlines()[-1]
    assert "Traceback" not in ran.err
    kept = rows(derived / "rock")
    assert 50 <= len(kept) < 288
    assert Outcome.CRASHED not in {row[1] for row in kept.values()}

    with Farm(tmp_path / "second") if second else nullcontext() as other:
        if other:
            other.worker()
        where = ("--scheduler", other.address) if other else ("--workers", "0")
        ran = vsr(*command, *where)
    assert ran.code == 0, ran.err
    assert f"{288 - len(kept)} runs done" in ran.err
    assert rows(derived / "rock").items() >= kept.items()
    assert vsr(*command, "--workers", "0", into=tmp_path / "alone").code == 0
    alone = tmp_path / "alone" / "rock"
    assert (derived / "rock" / "responses.nc").read_bytes() == (alone / "responses.nc").read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("where", ["here", pytest.param("a scheduler's", marks=pytest.mark.slow)])
def test_workers_killed_from_outside_blame_nobody(farm: Farm, where: str) -> None:
    """Four kills of the two workers, one after the other, while 30 batches are done."""
    local = where == "here"
    for _ in range(0 if local else 2):
        farm.worker()
    over = threading.Event()

    def kill_them() -> None:
        chance = random.Random(3)
        for _ in range(4):
            over.wait(0.7)
            victim = chance.randrange(2)
            if local:
                nannies = list(cluster._clients[0][0].cluster.workers.values())
                if nannies[victim].pid is not None:
                    os.kill(nannies[victim].pid, signal.SIGKILL)
            else:
                farm.workers[victim].kill()
                farm.worker()
                farm.workers[victim] = farm.workers.pop()

    batches = [Batch("half", tuple(range(10 * k, 10 * k + 10))) for k in range(30)]
    done: dict[int, Any] = {}
    with Cluster(2, None if local else farm.address, log=quiet) as cluster:
        killer = threading.Thread(target=kill_them)
        for name, item, result in cluster.each(sleeper(), iter(batches), lambda name: 0.5):
            assert name == "half"
            assert item not in done
            done[item] = result
            if len(done) == 1:
                killer.start()
        over.set()
        killer.join()
    assert done == {item: 0.5 * item for item in range(300)}


@pytest.mark.slow
def test_workers_that_are_slow_to_come_back_are_started_anew() -> None:
    """Dask forgets a worker that is not back in time, here at once, and starts no other."""
    batches = [Batch("two", (k,)) for k in range(12)]
    done = []
    with (
        dask.config.set({"distributed.deploy.lost-worker-timeout": "1ms"}),
        Cluster(1, log=quiet) as cluster,
    ):
        for _, item, _ in cluster.each(sleeper(), iter(batches), lambda name: 2.0):
            done.append(item)
            if len(done) == 1:
                (nanny,) = cluster._clients[0][0].cluster.workers.values()
                os.kill(nanny.pid, signal.SIGKILL)
    assert sorted(done) == list(range(12))


@pytest.mark.slow
def test_a_result_that_goes_with_its_worker_is_made_again(tmp_path: Path) -> None:
    """A worker ends while its result is on the way, the next one while it makes it again."""

    def work(folder: str, items: tuple[int, ...]) -> list[Any]:
        class Slow:
            def __reduce__(self) -> Any:
                time.sleep(5.0)
                return int, (7,)

        before = len(list(Path(folder).iterdir()))
        (Path(folder) / str(before)).touch()
        if before == 1:
            os._exit(1)
        if before == 0:
            threading.Timer(1.0, os._exit, [1]).start()
        return [Slow() if before == 0 else 7]

    with Cluster(1, log=quiet) as cluster:
        batches = iter([Batch("folder", (1,))])
        assert [one for _, _, one in cluster.each(work, batches, lambda _: str(tmp_path))] == [7]
    assert len(list(tmp_path.iterdir())) == 3


@pytest.mark.slow
def test_deadly_items_are_found_while_the_others_go_on() -> None:
    """Two items that kill their process; only the workers that first met them are lost."""
    deadly = {17, 203}
    lost = []

    def work(shared: int, items: tuple[int, ...]) -> list[int]:
        if deadly & set(items):
            os.kill(os.getpid(), signal.SIGSEGV)
        time.sleep(0.002 * len(items))
        return [shared * item for item in items]

    batches = [Batch("two", tuple(range(10 * k, 10 * k + 10))) for k in range(40)]
    done: dict[int, int | None] = {}
    with Cluster(2, log=quiet) as cluster:
        for _, item, result in cluster.each(work, iter(batches), lambda name: 2):
            assert item not in done
            done[item] = result
        client, _ = cluster._clients[0]
        lost = client.cluster.scheduler._workers_removed_total
    assert done == {item: None if item in deadly else 2 * item for item in range(400)}
    assert lost <= 2


@pytest.mark.slow
def test_error_of_a_suspect_is_raised() -> None:
    def work(shared: None, items: tuple[int, ...]) -> list[int]:
        if len(items) > 1:
            os._exit(1)
        raise ZeroDivisionError("mine")

    with Cluster(1, log=quiet) as cluster, pytest.raises(ZeroDivisionError, match="mine"):
        list(cluster.run(work, iter([Batch("a", (1, 2))]), lambda name: None))


# Late workers


@pytest.mark.slow
def test_room_follows_workers_that_come_later(farm: Farm, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dispatch, "LONELY", 0.5)
    monkeypatch.setattr(dispatch, "LOOK", 0.1)
    said: list[str] = []
    taken = 0

    def complain(line: str) -> None:
        said.append(line)
        if "no worker" in line and not farm.workers:
            farm.worker()

    def batches() -> Iterator[Batch]:
        nonlocal taken
        for taken in range(1, 81):
            yield Batch("half", tuple(range(5 * taken, 5 * taken + 5)))

    most, done = 0, 0
    monkeypatch.setattr(dispatch, "complain", complain)
    with Cluster(0, farm.address, log=quiet) as cluster:
        for batch, results in cluster.run(sleeper(), batches(), lambda name: 0.5):
            assert results == [0.5 * item for item in batch.items]
            done += 1
            most = max(most, taken - done)
            if done == 5:
                assert most <= BATCHES_IN_FLIGHT
                farm.worker()
                farm.worker()
    assert done == 80
    assert most > 2 * BATCHES_IN_FLIGHT
    lonely = [line for line in said if "no worker" in line]
    assert f"dask worker {farm.address}" in lonely[0]
    assert "the runs in runs.sqlite are kept" in lonely[0]


@pytest.mark.parametrize(
    "given", [("--scheduler", "tcp://127.0.0.1:1"), ("--scheduler-file", "nowhere.json")]
)
def test_no_scheduler_is_said_in_time(
    vsr: Callable[..., Any],
    write_site: Callable[..., str],
    monkeypatch: pytest.MonkeyPatch,
    given: tuple[str, str],
) -> None:
    monkeypatch.setattr("pipeline.workflow.cluster.CONNECTING", 1.0)
    start = time.monotonic()
    ran = vsr("run", "responses", "--site", write_site(GRID % "bullet"), *given)
    assert time.monotonic() - start < 20.0
    assert ran.code == 2, ran.err
    lines = [line for line in ran.err.splitlines() if line.startswith("vsr: ")]
    assert len(lines) == 1
    assert f"{given[0]}: got {given[1]}" in lines[0]


def test_workers_of_a_scheduler_are_not_ours_to_number(
    refused: Callable[..., str], write_site: Callable[..., str]
) -> None:
    site = write_site(GRID % "bullet")
    given = ("--workers", "2", "--scheduler", "tcp://127.0.0.1:1")
    refused("run", "responses", "--site", site, *given, words=("--workers: got 2", "tcp://"))
