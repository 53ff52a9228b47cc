"""Folders of one study by several clients, brought together."""

from __future__ import annotations

import shutil
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from conftest import STEP, Ran
from support.dask_processes import Farm

from pipeline import ROOT, cli
from pipeline.workflow.rows import Layout, RunRow
from pipeline.workflow.run_store import RUNS
from vsr_core.outcome import Outcome

SITE = """
rock: {shape: box, size: [0.5, 1.0, 2.0], density: 2110}
motion: {pga: [0.2, 0.4, 0.6, 0.8], pgv_pga: [0.1, 0.2, 0.3]}
yaw: [0, 40, 90]
"""

Vsr = Callable[..., Ran]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("site") / "rock.yaml"
    path.write_text(SITE + STEP)
    return str(path)


@pytest.fixture(scope="module")
def clients(site: str, tmp_path_factory: pytest.TempPathFactory, quick_time_step: None) -> Path:
    """A folder of each direction."""
    folder = tmp_path_factory.mktemp("clients")
    for yaw in (0, 40, 90):
        own = ["--set", f"yaw=[{yaw}]", "--derived", str(folder / f"client {yaw}")]
        assert cli.main(["run", "boundary", "--site", site, "--workers", "0", *own]) == 0
    return folder


@pytest.fixture
def shards(clients: Path, tmp_path: Path) -> list[Path]:
    """These folders; the last of them was killed before it had done half."""
    shutil.copytree(clients, tmp_path, dirs_exist_ok=True)
    made = [path.parent for path in sorted(tmp_path.glob(f"client */*/{RUNS}"))]
    with closing(sqlite3.connect(made[-1] / RUNS)) as database:
        database.execute("DELETE FROM runs WHERE key IN (SELECT key FROM runs LIMIT 8)")
        database.commit()
    return made


def joined(vsr: Vsr, site: str, folders: list[Path], into: Path, *more: str) -> Ran:
    return vsr("join", *map(str, folders), "--site", site, *more, into=into)


def bytes_of(vsr: Vsr, site: str, into: Path, *more: str) -> dict[str, bytes]:
    assert vsr("run", "boundary", "--site", site, "--workers", "0", *more, into=into).code == 0
    return {path.name: path.read_bytes() for path in into.glob("*/*.nc")}


def count(folder: Path) -> int:
    with closing(sqlite3.connect(folder / RUNS)) as database:
        return int(database.execute("SELECT COUNT(*) FROM runs").fetchone()[0])


@pytest.mark.slow
def test_joined_shards_give_the_bytes_of_one(
    vsr: Vsr, site: str, shards: list[Path], tmp_path: Path
) -> None:
    together, alone = tmp_path / "together", tmp_path / "alone"
    ran = joined(vsr, site, shards, together)
    assert ran.code == 0, ran.err
    (folder,) = (path.parent for path in together.glob(f"*/{RUNS}"))
    assert count(folder) == sum(map(count, shards))
    assert bytes_of(vsr, site, together) == bytes_of(vsr, site, alone)
    (whole,) = (path.parent for path in alone.glob(f"*/{RUNS}"))
    assert count(folder) == count(whole)


TEN = """
rock: {shape: box, size: [0.5, 1.0, 2.0], density: 2110}
motion: {pga: [0.2, 0.4, 0.6, 0.8], pgv_pga: [0.1, 0.2, 0.3]}
yaw: {start: 0, stop: 81, num: 10}
simulation: {time_step: 0.002}
"""

CLIENT = """
import os, signal, sys
from dataclasses import replace

from pipeline.cli import main
from pipeline.stages.runs import overturning_runs, runner
from pipeline.workflow.run_store import RunStore

left, add = [int(sys.argv.pop(1))], RunStore.add

def killed_after(store, rows):
    add(store, rows)
    left[0] -= 1
    if left[0] == 0:
        os.kill(os.getpid(), signal.SIGKILL)

RunStore.add = killed_after
runner.SMALL, runner.LARGEST_BATCH = 0, 4
for kind in ("KIND", "LINES"):
    setattr(overturning_runs, kind, replace(getattr(overturning_runs, kind), batch=4))
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.slow
@pytest.mark.parametrize("keep", ["all", "boundary"])
def test_ten_clients_of_one_scheduler_of_which_some_are_killed_give_the_bytes_of_one(
    vsr: Vsr, write_site: Callable[..., str], tmp_path: Path, keep: str
) -> None:
    """Each does a direction of 3 batches; every third is killed once it has stored two of them."""
    site, kept = write_site(TEN), ("--set", f"simulation.keep={keep}")
    yaws, killed = range(0, 90, 9), range(1, 10, 3)
    command = ["run", "responses", "--site", site, *kept]
    with Farm(tmp_path / "farm") as farm:
        farm.worker()
        farm.worker()
        clients = []
        for number, yaw in enumerate(yaws):
            batches = "2" if number in killed else "0"
            own = ["--scheduler", farm.address, "--set", f"yaw=[{yaw}]"]
            own += ["--derived", str(tmp_path / f"client {yaw}")]
            script = [sys.executable, "-c", CLIENT, batches, *command, *own]
            clients.append(subprocess.Popen(script, stderr=subprocess.DEVNULL, cwd=ROOT))
        codes = [client.wait(300) for client in clients]
    assert codes == [-signal.SIGKILL if number in killed else 0 for number in range(len(yaws))]
    folders = [tmp_path / f"client {yaw}" / "rock" for yaw in yaws]
    together = tmp_path / "together"
    ran = joined(vsr, site, folders, together, *kept)
    assert ran.code == 0, ran.err
    told = [f"{8 if number in killed else 12} runs" for number in range(len(yaws))]
    assert [line.rpartition(": ")[2] for line in ran.out.splitlines()[: len(yaws)]] == told
    whole = bytes_of(vsr, site, tmp_path / "alone", *kept)
    assert bytes_of(vsr, site, together, *kept) == whole


def test_joined_twice_changes_nothing(
    vsr: Vsr, site: str, shards: list[Path], tmp_path: Path
) -> None:
    together = tmp_path / "together"
    for _ in range(2):
        assert joined(vsr, site, shards, together).code == 0
    (folder,) = (path.parent for path in together.glob(f"*/{RUNS}"))
    assert count(folder) == sum(map(count, shards))


def test_a_run_with_two_results_is_refused(
    vsr: Vsr, site: str, shards: list[Path], tmp_path: Path
) -> None:
    """Also where both folders are others: before anything is taken."""
    layout = Layout(RunRow)
    with closing(sqlite3.connect(shards[0] / RUNS)) as database:
        row = layout.unsealed(database.execute("SELECT * FROM runs LIMIT 1").fetchone())
    assert row is not None
    other = row._replace(outcome=1 - row.outcome)
    with closing(sqlite3.connect(shards[1] / RUNS)) as database:
        places = ", ".join("?" * layout.width)
        database.execute(f"INSERT INTO runs VALUES ({places})", layout.sealed(other))
        database.commit()
    together = tmp_path / "together"
    ran = joined(vsr, site, shards, together)
    assert ran.code == 2
    assert "1 run with other results than in" in ran.err
    (folder,) = (path.parent for path in together.glob(f"*/{RUNS}"))
    assert count(folder) == 0


def test_crashed_runs_are_told_and_not_taken(
    vsr: Vsr, site: str, shards: list[Path], tmp_path: Path
) -> None:
    layout, there = Layout(RunRow), count(shards[0])
    with closing(sqlite3.connect(shards[0] / RUNS)) as database:
        for kept in database.execute("SELECT * FROM runs LIMIT 3").fetchall():
            row = layout.unsealed(kept)
            assert row is not None
            crashed = layout.sealed(RunRow(row.key, Outcome.CRASHED))
            places = ", ".join("?" * layout.width)
            database.execute(f"REPLACE INTO runs VALUES ({places})", crashed)
        database.commit()
    into = tmp_path / "together"
    ran = joined(vsr, site, shards[:1], into)
    assert ran.out == f"{shards[0]}: {there - 3} runs; 3 crashed, not taken\n"
    (folder,) = (path.parent for path in into.glob(f"*/{RUNS}"))
    assert count(folder) == there - 3


def test_what_cannot_be_joined_is_refused(
    vsr: Vsr, site: str, shards: list[Path], tmp_path: Path, derived: Path
) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    into = tmp_path / "together"
    assert "without runs" in joined(vsr, site, [empty], into).err
    assert "the same folder again" in joined(vsr, site, [shards[0], shards[0]], into).err
    other = joined(vsr, site, shards, into, "--set", "contact.friction=0.3")
    assert "no run that is wanted here" in other.err
    own = tmp_path / "client 0"
    assert "the same folder again" in joined(vsr, site, [shards[0]], own).err
    for ran in (joined(vsr, site, [empty], into), other):
        assert ran.code == 2
        assert "Traceback" not in ran.err


def test_damaged_rows_are_counted_and_a_damaged_database_is_refused(
    vsr: Vsr, site: str, shards: list[Path], tmp_path: Path
) -> None:
    """A quiet command tells it, too."""
    whole, into = (shards[0] / RUNS).read_bytes(), tmp_path / "together"
    there = count(shards[0])
    with closing(sqlite3.connect(shards[0] / RUNS)) as database:
        two = "key IN (SELECT key FROM runs LIMIT 2)"
        database.execute(f"UPDATE runs SET outcome = 1 - outcome WHERE {two}")
        database.commit()
    ran = joined(vsr, site, shards[:1], into, "--quiet")
    told = "2 rows of runs damaged on disk and left out"
    assert (ran.code, ran.err) == (0, f"vsr: warning: {shards[0] / RUNS}: {told}\n")
    assert f": {there - 2} runs" in ran.out
    torn = whole[:4096] + b"\xff" * 4096 + whole[8192:]
    for content, words in (
        (b"", "it is empty"),
        (torn, "code 11"),
        (b"\0" + whole[1:], "not a data"),
    ):
        (shards[0] / RUNS).write_bytes(content)
        ran = joined(vsr, site, shards, into)
        assert ran.code == 2
        assert ran.err.startswith(f"vsr: {shards[0] / RUNS}: got a damaged database (")
        assert words in ran.err
        assert (shards[0] / RUNS).read_bytes() == content
