"""`simulation.keep: boundary`: the products of all runs, of which few are kept as rows."""

from __future__ import annotations

import os
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Ran

from pipeline import ROOT
from pipeline.stages.runs import lines, runner
from pipeline.workflow.datasets import read
from pipeline.workflow.run_store import RUNS
from pipeline.workflow.workers import BATCHES_IN_FLIGHT

Vsr = Callable[..., Ran]

SITE = """
rock: {shape: mesh, mesh: nowhere, fallback: double_rock, density: 2110}
motion: {pga: {start: 0.02, stop: 1, num: 40}, pgv_pga: {start: 0.05, stop: 0.5, num: 12}}
yaw: [0, 45]
simulation: {time_step: 0.002}
"""
CELLS, LINES = 40 * 12 * 2, 12 * 2

FILES = ("responses.nc", "boundary.nc")

KEEP = ("--set", "simulation.keep=boundary")

NUMBERS = {
    *("peak_tilt", "final_tilt", "slip", "steps"),
    *("tilt_until_decided", "slip_until_decided"),
}


@pytest.fixture
def site(write_site: Callable[..., str], monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setattr(lines, "SHARE", 0.1)  # so that a small grid has a sample, too
    return write_site(SITE)


def made(vsr: Vsr, site: str, into: Path, *more: str, product: str = "boundary") -> Path:
    ran = vsr("run", product, "--site", site, *more, into=into)
    assert ran.code == 0, ran.err
    return into / "rock"


def table(folder: Path, name: str) -> list[Any]:
    with closing(sqlite3.connect(folder / RUNS)) as database:
        return database.execute(f"SELECT * FROM {name} ORDER BY key").fetchall()


@pytest.mark.slow
def test_products_are_those_of_all_runs(vsr: Vsr, site: str, tmp_path: Path) -> None:
    everything = made(vsr, site, tmp_path / "all", "--workers", "0", product="fragility")
    few = made(vsr, site, tmp_path / "few", "--workers", "0", *KEEP, product="fragility")
    for name in ("boundary.nc", "fragility.nc", "bullet_sample.nc"):
        one, other = read(everything / name), read(few / name)
        assert [v for v in one.variables if not one[v].identical(other[v])] == [], name
    csv = "fragility.csv"
    assert (everything / csv).read_bytes() == (few / csv).read_bytes()
    one, other = read(everything / "responses.nc"), read(few / "responses.nc")
    assert {v for v in one.variables if not one[v].identical(other[v])} == NUMBERS
    sampled = other["steps"].values >= 0
    assert 0.05 * CELLS < sampled.sum() < 0.2 * CELLS
    for name in NUMBERS:
        expected = np.where(sampled, one[name].values, other[name].attrs.get("_FillValue", np.nan))
        if name == "steps":
            expected = np.where(sampled, one[name].values, -1)
        np.testing.assert_array_equal(other[name].values, expected)
    page = " ".join((few / "report.html").read_text().split())
    assert "kept of the unresolved runs and of a random sample" in page
    assert (other.attrs["sampled_share"], other.attrs["sampled_seed"]) == (0.1, lines.SEED)


@pytest.mark.slow
def test_runs_of_the_grid_are_no_rows(vsr: Vsr, site: str, tmp_path: Path) -> None:
    """What stands one by one are the runs between its cells; status and plan count runs."""
    folder = made(vsr, site, tmp_path, "--workers", "0", *KEEP)
    assert len(table(folder, "lines_of_runs")) == LINES
    assert len(table(folder, "runs")) == read(folder / "boundary.nc").sizes["run"]
    told = vsr("status", "fragility", "--site", site, *KEEP, into=tmp_path).out
    assert f"{CELLS} of {CELLS} runs stored" in told
    toppled = int((read(folder / "responses.nc")["overturned"].values == 1).sum())
    assert f"{toppled} overturned" in told
    more = ("--set", "yaw=[0, 45, 90]")
    plan = vsr("plan", "fragility", "--site", site, *KEEP, *more, into=tmp_path).out
    assert f"runs: {3 * CELLS // 2}; {CELLS} stored, {CELLS // 2} to do" in plan
    assert "0 of them proved" not in plan


def test_a_wider_study_does_its_new_rows_only(vsr: Vsr, site: str, tmp_path: Path) -> None:
    half = ("--set", "motion.pgv_pga={start: 0.05, stop: 0.25, num: 5}", "--set", "yaw=[45]")
    folder = made(vsr, site, tmp_path, "--workers", "0", *KEEP, *half, product="responses")
    kept = table(folder, "lines_of_runs")
    ran = vsr("run", "responses", "--site", site, "--workers", "0", *KEEP, *half[:2], into=tmp_path)
    assert f"{5 * 40} runs done" in ran.err
    assert set(kept) < set(table(folder, "lines_of_runs"))


@pytest.mark.slow
def test_workers_change_no_byte(
    vsr: Vsr, site: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the process, on two threads and on two worker processes, which read their own share."""
    monkeypatch.undo()
    alone = made(vsr, site, tmp_path / "alone", "--workers", "0", *KEEP)
    monkeypatch.setattr(runner, "SMALL", 0)
    threads = made(vsr, site, tmp_path / "threads", "--workers", "2", *KEEP)
    monkeypatch.setattr(runner, "QUICK", 0)
    processes = made(vsr, site, tmp_path / "processes", "--workers", "2", *KEEP)
    for other in (threads, processes):
        assert table(other, "lines_of_runs") == table(alone, "lines_of_runs")
        for name in FILES:
            assert (other / name).read_bytes() == (alone / name).read_bytes()


KILLED = """
import os, signal, sys
from dataclasses import replace

from pipeline.cli import main
from pipeline.stages.runs import overturning_runs, runner

done = []

def some(shared, items):
    if len(done) == 9:
        os.kill(os.getpid(), signal.SIGKILL)
    done.append(items)
    return overturning_runs.line_batch(shared, items)

runner.LARGEST_BATCH = 1
overturning_runs.LINES = replace(overturning_runs.LINES, function=some)
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.slow
def test_a_killed_study_goes_on_with_its_next_line(
    vsr: Vsr, site: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.undo()
    alone = made(vsr, site, tmp_path / "alone", "--workers", "0", *KEEP)
    into = tmp_path / "killed"
    command = ["run", "boundary", "--site", site, "--workers", "0", *KEEP, "--derived", str(into)]
    ran = subprocess.run(
        [sys.executable, "-c", KILLED, *command],
        capture_output=True,
        check=False,
        cwd=ROOT,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )
    assert ran.returncode == -signal.SIGKILL, ran.stderr
    kept = table(into / "rock", "lines_of_runs")
    assert 9 - BATCHES_IN_FLIGHT <= len(kept) <= 9
    again = vsr("run", "boundary", "--site", site, "--workers", "0", *KEEP, into=into)
    assert f"{(LINES - len(kept)) * 40} runs done" in again.err
    assert set(kept) <= set(table(into / "rock", "lines_of_runs"))
    assert table(into / "rock", "lines_of_runs") == table(alone, "lines_of_runs")
    for name in FILES:
        assert (into / "rock" / name).read_bytes() == (alone / name).read_bytes()


def test_any_run_can_be_replayed(vsr: Vsr, site: str, tmp_path: Path) -> None:
    """It is done anew; for its neighbour, the lines of its direction alone."""
    cell = ("--yaw", "45", "--pga", "0.497436", "--pgv-pga", "0.5")
    ran = vsr("replay", "--site", site, *cell, "--and", "neighbour", *KEEP, into=tmp_path)
    assert ran.code == 0, ran.err
    folder = tmp_path / "rock"
    assert len(table(folder, "lines_of_runs")) == LINES // 2
    assert len(table(folder, "runs")) == 2
    (page,) = (folder / "replays").glob("*.html")
    assert "stored in <code>runs.sqlite</code>" in page.read_text(encoding="utf-8")


def test_paths_over_a_terrain_are_all_kept(refused: Callable[..., str]) -> None:
    line = refused(
        *("run", "displacement", "--site", "double_rock_terrain", *KEEP),
        words=("simulation.keep: got boundary", "set simulation.keep: all"),
    )
    assert "its path" in line
