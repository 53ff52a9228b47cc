"""What whole commands take, each from nothing, and in which stages.

    python -m benchmarks.commands [--tests FOLDER] [--long]

prints the table of docs/scale.md as Markdown. ``--tests`` takes recorded shake-table tests;
``--long`` adds what takes minutes.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

from benchmarks.table import say
from pipeline.cli import DONE, UNRESOLVED
from pipeline.workflow.registry import BY_NAME

SHOWN = 3
"""Stages of a command that are named, those that take longest."""

_CELL = "--yaw 120 --pga 0.38 --pgv-pga 0.66"

COMMANDS = {
    "fragility of Double Rock, 12 directions": "run fragility --site double_rock",
    "the same again": "run fragility --site double_rock",
    "the same, one direction": "run fragility --site double_rock --name one --set yaw=[0]",
    "a replay, nothing there yet": f"replay --site double_rock --name two {_CELL}",
}

LONG = {
    "hazard of Double Rock": "run hazard --site double_rock --name three",
    "study of friction": "run study --site double_rock --study friction --name four",
    "displacement on terrain": "run displacement --site double_rock_terrain",
    "stability": "run stability --site cuboid_1x1x2",
    "accuracy of Double Rock": "run accuracy --site double_rock --name five",
}


class Cost(NamedTuple):
    """What a command took: wall-clock and CPU time [s], and wall-clock time by stage [s]."""

    wall: float
    cpu: float
    stages: dict[str, float]


def measured(words: list[str]) -> Cost:
    """Do a command and time it; a stage takes the time until it says that it is done."""
    stages: dict[str, float] = defaultdict(float)
    command = [sys.executable, "-m", "pipeline", *words]
    before, begun = _cpu(), time.monotonic()
    last = begun
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        for line in process.stderr:
            stage, now = line.partition(":")[0], time.monotonic()
            if stage in BY_NAME:
                stages[stage] += now - last
                last = now
    if process.returncode not in (DONE, UNRESOLVED):
        raise subprocess.CalledProcessError(process.returncode, command)
    return Cost(time.monotonic() - begun, _cpu() - before, stages)


def _cpu() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def row(what: str, words: str, cost: Cost) -> str:
    """A row of the table."""
    largest = sorted(cost.stages.items(), key=lambda one: -one[1])[:SHOWN]
    parts = ", ".join(f"{name} {seconds:.1f}" for name, seconds in largest if seconds > 0.05)
    return f"| {what} | {cost.wall:.1f} | {cost.cpu:.1f} | {parts} | `vsr {words}` |"


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="benchmarks.commands")
    parser.add_argument("--tests", type=Path, help="folder of recorded shake-table tests")
    parser.add_argument("--long", action="store_true", help="also what takes minutes")
    options = parser.parse_args()
    commands = COMMANDS | (LONG if options.long else {})
    if options.tests:
        commands |= {"validation of recorded tests": "run validation --table TABLE"}
    print("| | wall [s] | CPU [s] | largest stages [s] | command |\n|---|---:|---:|---|---|")
    with tempfile.TemporaryDirectory() as derived:
        for what, words in commands.items():
            say(what)
            given = [word if word != "TABLE" else str(options.tests) for word in words.split()]
            cost = measured([*given, "--derived", derived])
            print(row(what, words, cost), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
