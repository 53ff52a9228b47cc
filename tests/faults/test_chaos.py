"""Client, worker, scheduler or all of them are killed at random moments, again and again."""

from __future__ import annotations

import logging
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from support.dask_processes import Farm

from pipeline import ROOT
from pipeline.workflow.cluster import Cluster
from pipeline.workflow.datasets import read
from pipeline.workflow.workers import BATCHES_IN_FLIGHT, Batch
from vsr_core.outcome import Outcome

GRID = """
motion: {pga: {start: 0.1, stop: 1.0, num: 12}, pgv_pga: {start: 0.05, stop: 0.5, num: 8}}
yaw: [0, 30]
simulation: {engine: bullet, time_step: 0.002}
"""
STUDY = 192
"""Its runs."""

BATCH, WORKERS = 4, 2
"""Runs that are handed out at once, and to how many workers."""

CLIENT = f"""
import sys, time
from dataclasses import replace
from pipeline import cli
from pipeline.stages.runs import overturning_runs, runner

count, simulate = sys.argv.pop(1), overturning_runs.KIND.function

def counted(shared, cells):
    found = []
    for cell in cells:
        time.sleep(0.02)  # or a run would be over before it can be killed
        found += simulate(shared, (cell,))
        with open(count, "a") as file:
            file.write(".")
    return found

def run():
    runner.SMALL = 0
    overturning_runs.KIND = replace(overturning_runs.KIND, function=counted, batch={BATCH})
    sys.exit(cli.main(sys.argv[1:]))

if __name__ == "__main__":
    run()
"""


def is_over(group: int) -> bool:
    """Whether no process of a group is left."""
    with suppress(ProcessLookupError):
        os.killpg(group, 0)
        return False
    return True


class Study:
    """One command, started again and again with the same products to make.

    Parameters
    ----------
    folder : Path, for all its files
    site : str
    """

    def __init__(self, folder: Path, site: str) -> None:
        folder.mkdir()
        self.folder, self.site, self.kills = folder, site, 0
        self.client: subprocess.Popen[str] | None = None
        self.said = ""
        (folder / "client.py").write_text(CLIENT)

    def start(self, farm: Farm | None) -> None:
        """Give the command, with workers of its own or those of a farm."""
        where = ["--scheduler", farm.address] if farm else ["--workers", str(WORKERS)]
        script, count, derived = (
            str(self.folder / name) for name in ("client.py", "count", "into")
        )
        command = ["run", "responses", "--site", self.site, *where, "--derived", derived]
        self.client = subprocess.Popen(
            [sys.executable, script, count, *command],
            stderr=subprocess.PIPE,
            text=True,
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            start_new_session=True,
        )

    def goes_on(self, chance: random.Random) -> bool:
        """Wait for a random moment, most often while runs are done; whether it is not over yet."""
        assert self.client is not None
        begun, starting = self.simulated(), chance.random() < 0.25
        while self.client.poll() is None and not starting and self.simulated() == begun:
            time.sleep(0.01)
        with suppress(subprocess.TimeoutExpired):
            self.client.wait(chance.uniform(0.0, 2.0 if starting else 0.8))
        return self.client.poll() is None

    def end(self) -> int:
        """Wait for the command, and for the workers that it has started."""
        assert self.client is not None
        _, self.said = self.client.communicate(timeout=120)
        assert "Traceback" not in self.said, self.said
        deadline = time.monotonic() + 30.0
        while not is_over(self.client.pid):
            assert time.monotonic() < deadline, "workers outlive their client"
            time.sleep(0.05)
        code, self.client = self.client.returncode, None
        return code

    def workers(self) -> list[int]:
        """Processes of the workers that the command itself has started."""
        assert self.client is not None
        parent = {}
        for entry in Path("/proc").glob("[0-9]*"):
            with suppress(OSError):
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
                if int(fields[2]) == self.client.pid:  # its group
                    text = (entry / "cmdline").read_bytes()
                    parent[int(entry.name)] = b"spawn_main" in text
        return [process for process, spawned in parent.items() if spawned]

    def simulated(self) -> int:
        """Runs done in any of its processes."""
        count = self.folder / "count"
        return count.stat().st_size if count.exists() else 0


def strike(victim: str, study: Study, farm: Farm | None, chance: random.Random) -> bool:
    """Kill something of what is at work; returns whether it was there."""
    found = []
    if victim in ("worker", "all"):
        workers = [process.pid for process in farm.workers] if farm else study.workers()
        found += workers if victim == "all" else workers and [chance.choice(workers)]
    if victim in ("scheduler", "all") and farm:
        found.append(farm.scheduler.pid)
    if victim in ("client", "all") and study.client:
        found.append(study.client.pid)
    for process in found:
        with suppress(ProcessLookupError):
            os.kill(process, signal.SIGKILL)
    study.kills += bool(found)
    return bool(found)


class Chaos:
    """Kills with a seed, until enough of them have struck and all studies are made.

    Parameters
    ----------
    folder : Path
    site : str
    calm : Path, products that were made undisturbed
    seed : int
    """

    def __init__(self, folder: Path, site: str, calm: Path, seed: int) -> None:
        self.folder, self.site, self.calm = folder, site, calm
        self.chance = random.Random(seed)
        self.kills = self.studies = self.redone = 0
        self.farm: Farm | None = None

    def rage(self, kills: int) -> None:
        """One study after the other, each killed until it is made."""
        while self.kills < kills:
            self.studies += 1
            study = Study(self.folder / f"study-{self.studies}", self.site)
            while self.disturbed(study, kills):
                pass
            self.redone += self.settled(study)

    def disturbed(self, study: Study, kills: int) -> bool:
        """Give the command once, and kill; returns whether it has to be given again."""
        farm = self.alive() if self.chance.random() < 2 / 3 else None
        study.start(farm)
        dead = False
        while self.kills < kills and not dead and study.goes_on(self.chance):
            places = ["client", "worker", "all", *(["scheduler"] if farm else [])]
            victim = self.chance.choice(places)
            dead = victim != "worker"
            self.kills += strike(victim, study, farm, self.chance)
            if farm and victim == "worker":
                self.alive()
        code = study.end()
        if dead and farm and self.farm is farm:
            farm.end()
            self.farm = None
        refused = code == 2 and "--scheduler: got " in study.said  # gone before it was called
        allowed = (0, 1, -signal.SIGKILL) if dead else (0,)
        assert code in allowed or (dead and refused), study.said
        return code != 0

    def alive(self) -> Farm:
        """The scheduler with all its workers, anew where they were killed."""
        if self.farm is None:
            self.farm = Farm(self.folder / f"farm-{self.kills}")
        farm = self.farm
        farm.workers = [process for process in farm.workers if process.poll() is None]
        while len(farm.workers) < WORKERS:
            farm.worker()
        return farm

    def settled(self, study: Study) -> int:
        """Runs done twice in a study that is made; all else is as if nothing had happened."""
        folder = study.folder / "into" / "rock"
        assert names(folder) == names(self.calm)
        for name in ("rock.nc", "motions.nc", "config.yaml", "responses.nc"):
            assert (folder / name).read_bytes() == (self.calm / name).read_bytes(), name
        assert not (read(folder / "responses.nc")["outcome"].values == Outcome.CRASHED).any()
        twice = study.simulated() - STUDY
        assert 0 <= twice <= study.kills * WORKERS * BATCHES_IN_FLIGHT * BATCH
        return twice


def names(folder: Path) -> set[Path]:
    return {path.relative_to(folder) for path in folder.rglob("*")}


@pytest.mark.slow
@pytest.mark.parametrize(("kills", "seed"), [(1, 74), (100, 8)])
def test_a_kill_costs_only_the_batches_in_flight(
    write_site: Callable[..., str], vsr: Callable[..., Any], tmp_path: Path, kills: int, seed: int
) -> None:
    """A third of the commands has workers of its own, the others those of a scheduler.

    The first seed kills a client that has workers of its own.
    """
    site = write_site(GRID)
    ran = vsr("run", "responses", "--site", site, "--workers", "0", into=tmp_path / "calm")
    assert ran.code == 0, ran.err
    chaos = Chaos(tmp_path, site, tmp_path / "calm" / "rock", seed)
    try:
        chaos.rage(kills)
    finally:
        if chaos.farm:
            chaos.farm.end()
    said = f"{chaos.kills} kills, {chaos.studies} studies, {chaos.redone} runs done twice"
    logging.getLogger(__name__).info(said)


@pytest.mark.slow
def test_dasks_own_chaos() -> None:
    """Its plug-in ends each worker some time after it has started, until three are lost.

    On average that is twice as long as two workers need for their first batch, which on a busy
    machine takes long. Its modes ``sys.exit`` and ``graceful`` end a worker in good order, and Dask
    starts no other.
    """
    from distributed.chaos import KillWorker

    def work(shared: float, items: tuple[int, ...]) -> list[float]:
        time.sleep(0.02 * len(items))
        return [shared * item for item in items]

    given, lost = 0, 0

    def batches() -> Iterator[Batch]:
        nonlocal given
        while lost < 3:
            yield Batch("half", tuple(range(given, given + 10)))
            given += 10

    done: dict[int, Any] = {}
    begun = time.monotonic()
    with Cluster(2, log=lambda line: None) as cluster:
        for _, item, result in cluster.each(work, batches(), lambda name: 0.5):
            assert item not in done
            done[item] = result
            client, _ = cluster._clients[0]
            if len(done) == 1:
                delay = max(2.0, 2.0 * (time.monotonic() - begun))
                client.register_plugin(KillWorker(delay=f"{delay:.1f} s", mode="segfault"))
            lost = client.cluster.scheduler._workers_removed_total
    assert done == {item: 0.5 * item for item in range(given)}
