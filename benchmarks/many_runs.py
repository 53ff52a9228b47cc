"""What client, scheduler and store cost beyond the runs themselves, in grids of many runs.

    python -m benchmarks.many_runs [--runs NUMBER]

prints the table; ``--runs`` is the size of the grids that are filled with runs that take no time.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import resource
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

from benchmarks.speed import WORKERS
from benchmarks.table import Row, say, show
from pipeline.config.layers import load_site
from pipeline.stages.motions.motion_grid import Cell
from pipeline.stages.runs import runner
from pipeline.stages.runs.overturning_runs import KIND
from pipeline.stages.runs.runner import run_missing
from pipeline.stages.runs.study import Study
from pipeline.workflow import graph
from pipeline.workflow.cluster import Cluster
from pipeline.workflow.run_store import RUNS
from pipeline.workflow.stage import Job
from pipeline.workflow.store import Store
from vsr_core.outcome import DecidedBy, Outcome

SITE = "cuboid_1x1x2"

NUMBER = 200_000

WAYS = {"threads": "nonsmooth", "processes": "bullet"}
"""Engine whose runs are done in threads of the client, or in Dask's worker processes."""

LENGTH, BATCH, WAITING = 5e-3, 60, 3000
"""Time of a run that waits [s], runs in a batch of 0.3 s, and how many runs wait."""


def rows(folder: Path, number: int) -> Iterator[Row]:
    """All rows of the table."""
    for way in WAYS:
        yield from _filled(folder / way, way, number)
    yield _efficiency(folder)
    yield from _commands(folder / "commands", number)
    yield from _plans(folder / "plans")


def _filled(folder: Path, way: str, number: int) -> Iterator[Row]:
    say(f"{number} runs that take no time, in {way}")
    found = _apart("fill", folder, way, number, WORKERS)
    what = f"{number} runs that take no time, in {way}"
    yield f"{what}: CPU of the client a run [ms]", f"{found['cpu']:.3f}", "at most 0.25"
    yield "  wall-clock time a run [ms]", f"{found['seconds']:.3f}", ""
    yield "  growth of the client's memory [MB]", f"{found['memory']:.0f}", "flat"
    yield "  database, bytes a run", f"{found['stored']:.0f}", ""


def _efficiency(folder: Path) -> Row:
    """Rate of workers over that of one; runs wait, so that no two of them share a processor."""
    say(f"{WAITING} runs that wait {1e3 * LENGTH:.0f} ms, on one worker and on {WORKERS}")
    rates = [
        1.0 / _apart("wait", folder / f"{n}", "processes", WAITING, n)["seconds"]
        for n in (1, WORKERS)
    ]
    what = f"rate of {WORKERS} workers, of {WORKERS} times that of one"
    return what, f"{rates[1] / rates[0] / WORKERS:.2f}", "at least 0.92"


def _commands(folder: Path, number: int) -> Iterator[Row]:
    """A whole command whose rock never moves, and the same for the thousandth that is lost."""
    say(f"a command of {number} runs that are proved, and 99.9 % of it resumed")
    command = ["run", "responses", *_grid(number), "--derived", str(folder)]
    command += ["--workers", str(WORKERS)]
    wall, cpu, memory = _command(command)
    yield f"a command of {number} runs that are proved: CPU [s]", f"{cpu:.1f}", ""
    yield "  wall-clock time [s]", f"{wall:.1f}", ""
    yield "  largest memory [MB]", f"{memory:.0f}", ""
    with closing(sqlite3.connect(folder / SITE / RUNS)) as database, database:
        database.execute(
            "DELETE FROM runs WHERE key IN (SELECT key FROM runs ORDER BY random() LIMIT ?)",
            (number // 1000,),
        )
    (folder / SITE / ".stages" / "runs.json").unlink()
    wall, cpu, _ = _command(command)
    yield "  resumed with 99.9 % stored: CPU [s]", f"{cpu:.1f}", "at most 3"
    yield "  wall-clock time [s]", f"{wall:.1f}", ""


def _plans(folder: Path) -> Iterator[Row]:
    for number, goal in ((100, ""), (10**6, "1 beyond that of 100"), (10**9, "the same")):
        say(f"a plan of {number} runs")
        _, cpu, memory = _command(["plan", "responses", *_grid(number), "--derived", str(folder)])
        yield f"plan of {number:.0e} runs: CPU [s]", f"{cpu:.1f}", goal
        yield "  largest memory [MB]", f"{memory:.0f}", ""


def _grid(number: int) -> list[str]:
    """Options of a command whose grid has so many runs."""
    given = [part for setting in _settings(number) for part in ("--set", setting)]
    return ["--site", SITE, *given]


def _settings(number: int) -> tuple[str, ...]:
    """Grid of pulses too weak to move the rock, a million runs a direction at most."""
    yaws = math.ceil(number / 10**6)
    ratios = math.isqrt(number // yaws)
    return (
        f"motion.pga={{start: 0.01, stop: 0.3, num: {number // yaws // ratios}}}",
        f"motion.pgv_pga={{start: 0.05, stop: 1, num: {ratios}}}",
        f"yaw={{start: 0, stop: 359, num: {yaws}}}" if yaws > 1 else "yaw=0",
        "simulation.time_step=0.002",
    )


def _command(arguments: list[str]) -> tuple[float, float, float]:
    """Wall-clock and CPU time [s] of a command, and its largest memory [MB]."""
    start = time.monotonic()
    command = [sys.executable, "-m", "pipeline", *arguments]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command)
    return time.monotonic() - start, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def _apart(what: str, *given: object) -> dict[str, float]:
    """What a process of its own finds."""
    command = [sys.executable, "-m", "benchmarks.many_runs", "--apart", what, *map(str, given)]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    found: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return found


def _measured(what: str, given: str, way: str, number: str, workers: str) -> dict[str, float]:
    """Time [ms], CPU of this process [ms] and bytes of the database for a run; memory [MB]."""
    folder, grid = Path(given), _settings(int(number))
    site = load_site(SITE, settings=(*grid, f"simulation.engine={WAYS[way]}"))
    with Store(folder) as store, Cluster(int(workers)) as cluster:
        store.open()
        job = Job(site, store, cluster, lambda line: None)
        for stage in ("rock", "motions", "time_step"):
            graph.make(stage, job)
        study = graph.built(Study, job)
        if what == "wait":
            runner.LARGEST_BATCH = BATCH
        kind = replace(KIND, function={"fill": _nothing, "wait": _wait}[what], batch=BATCH)
        if way == "processes":
            list(cluster.run(_nothing, iter([]), lambda group: None))  # starts the workers
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        start, cpu = time.monotonic(), time.process_time()
        work = graph.work_of("runs", "", job)
        done = run_missing(work, kind, study.groups, study.wanted, lambda group: None)
        seconds, cpu = time.monotonic() - start, time.process_time() - cpu
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    return {
        "seconds": 1e3 * seconds / done.runs,
        "cpu": 1e3 * cpu / done.runs,
        "memory": grown / 1024,
        "stored": (folder / RUNS).stat().st_size / done.runs,
    }


def _nothing(shared: Any, cells: tuple[Cell, ...]) -> list[tuple[Any, ...]]:
    by = int(DecidedBy.SIMULATION)
    return [(int(Outcome.BALANCED), by, cell.pga, 0.0, 1e-3, cell.row) for cell in cells]


def _wait(shared: Any, cells: tuple[Cell, ...]) -> list[tuple[Any, ...]]:
    time.sleep(LENGTH * len(cells))
    return _nothing(shared, cells)


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="benchmarks.many_runs")
    parser.add_argument("--runs", type=int, default=NUMBER, help="runs of a grid")
    parser.add_argument("--apart", nargs=5, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.apart:
        print(json.dumps(_measured(*options.apart)))
        return 0
    with tempfile.TemporaryDirectory() as temporary:
        for row in rows(Path(temporary), options.runs):
            show(row)
    return 0


if __name__ == "__main__":
    sys.exit(main())
