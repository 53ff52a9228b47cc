"""Memory and time of whole studies of many cells, stage by stage, from nothing to the report.

    python -m benchmarks.large_grids [--cells NUMBER ...] [--keep all|boundary]

prints the table of docs/scale.md as Markdown. Runs take no time: their rock topples along a made-up
boundary with islands; client, store, workers, fits and pages are the real ones.
"""

from __future__ import annotations

import argparse
import math
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.table import say
from pipeline import cli
from pipeline.stages.motions.motion_grid import Cell
from pipeline.stages.runs import overturning_runs
from pipeline.workflow.registry import BY_NAME
from vsr_core.arrays import Array
from vsr_core.outcome import DecidedBy, Outcome

SITE, YAWS = "double_rock", 12

PROVED, ISLAND = 0.5, 1.15
"""PGAs up to which runs are proved, and around which islands stand, as shares of the boundary."""


class Peak(NamedTuple):
    """Largest memory of the client from the start of a stage to its end [MB], and its CPU [s]."""

    stage: str
    memory: float
    cpu: float


def measured(cells: int, keep: str, derived: str) -> Iterator[Peak]:
    """Do a study of so many cells; last comes what the client's processes took."""
    each = math.isqrt(cells // YAWS)
    grid = [f"motion.{key}={{start: 0.02, stop: 1, num: {each}}}" for key in ("pga", "pgv_pga")]
    settings = [*grid, f"yaw={{start: 0, stop: 330, num: {YAWS}}}", f"simulation.keep={keep}"]
    words = ["run", "report", "--site", SITE, "--derived", derived]
    words += [part for setting in settings for part in ("--set", setting)]
    command = [sys.executable, "-m", "benchmarks.large_grids", "--apart", *words]
    last = 0.0
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        own = Path("/proc", str(process.pid))
        for line in process.stderr:
            stage, _, told = line.partition(":")
            if stage == CHILDREN:
                yield Peak(stage, *map(float, told.split()))
            elif stage in BY_NAME:
                now = _cpu(own)
                yield Peak(stage, _largest(own), now - last)
                last = now
                own.joinpath("clear_refs").write_text("5")  # starts the peak anew
    if process.returncode not in (cli.DONE, cli.UNRESOLVED):
        raise subprocess.CalledProcessError(process.returncode, command)


CHILDREN = "largest of its processes"


def _cpu(own: Path) -> float:
    """CPU time of a process [s]."""
    fields = own.joinpath("stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return sum(map(int, fields[11:13])) / os.sysconf("SC_CLK_TCK")


def _largest(own: Path) -> float:
    status = own.joinpath("status").read_text(encoding="utf-8")
    (peak,) = (line.split()[1] for line in status.splitlines() if line.startswith("VmHWM"))
    return float(peak) / 1024


def _apart(words: list[str]) -> int:
    """A command whose runs take no time."""
    overturning_runs.KIND = replace(overturning_runs.KIND, function=stand_in)
    overturning_runs.LINES = replace(overturning_runs.LINES, function=stand_in_lines)
    code = cli.main(words)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f"{CHILDREN}: {used.ru_maxrss / 1024} {used.ru_utime + used.ru_stime}", file=sys.stderr)
    return code


def stand_in_lines(shared: Any, lines: tuple[Any, ...]) -> list[tuple[Any, ...]]:
    """Lines of such runs, on a worker."""
    overturning_runs.simulate_batch = _ends  # type: ignore[assignment]
    return overturning_runs.line_batch(shared, lines)


def stand_in(shared: Any, cells: tuple[Cell, ...]) -> list[tuple[Any, ...]]:
    """Such runs one by one, on a worker."""
    rows = _ends(shared, cells).tolist()
    return [(int(row[0]), int(row[1]), *row[2:5], int(row[5])) for row in rows]


def _ends(shared: Any, cells: tuple[Cell, ...]) -> Array:
    """Rows of runs, shape (cells, 6)."""
    row, pga = np.array(cells).T
    ratio = np.array(shared[2].pgv_pga)[row.astype(int)]
    share = pga / (0.15 * (1.0 + 0.1 / ratio))
    stands = (share < 1.0) | ((abs(share - ISLAND) < 0.02) & (row % 7 == 0))
    proved = share < PROVED
    rules = np.where(proved, DecidedBy.NO_UPLIFT_BOUND, DecidedBy.ENERGY_BOUND)
    rules = np.where(stands, rules, DecidedBy.NO_RETURN)
    outcome = np.where(stands, Outcome.BALANCED, Outcome.OVERTURNED)
    tilt = np.where(stands, 0.2 * share, 1.0)
    return np.stack([outcome, rules, tilt, tilt, 1e-3 * share, np.where(proved, 0, 500)], axis=1)


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="benchmarks.large_grids")
    parser.add_argument("--cells", type=int, nargs="+", default=[10**6, 10**7])
    parser.add_argument("--keep", default="boundary", choices=("all", "boundary"))
    parser.add_argument("--apart", nargs=argparse.REMAINDER, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.apart:
        return _apart(options.apart)
    print("| cells | stage | largest memory [MB] | CPU [s] |\n|---|---|---:|---:|")
    for cells in options.cells:
        say(f"a study of {cells} cells")
        with tempfile.TemporaryDirectory() as derived:
            for one in measured(cells, options.keep, derived):
                print(f"| {cells:.0e} | {one.stage} | {one.memory:.0f} | {one.cpu:.0f} |",
                      flush=True)  # fmt: skip
            for name in ("runs.sqlite", "responses.nc", "boundary.nc", "fragility.nc"):
                size = (Path(derived) / SITE / name).stat().st_size / 1e6
                print(f"| {cells:.0e} | {name}: {size:.1f} MB | | |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
