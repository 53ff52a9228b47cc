"""Speed of the loop, of one yaw and of a whole site, against plainer ways of doing the same."""

from __future__ import annotations

import json
import math
import os
import random
import resource
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.table import Row, say
from pipeline.config.layers import load_site
from pipeline.stages.mesh.products import Standing
from pipeline.stages.runs.scenes import Group, Scenes, flat_case
from pipeline.workflow.cluster import Cluster
from pipeline.workflow.stage import Job
from pipeline.workflow.store import Store
from vsr_core import GRAVITY, engines
from vsr_core.motions.pulses import CosinePulse
from vsr_core.run.cases import Case, Settings
from vsr_core.run.overturning import simulate
from vsr_core.run.time_step import step_unit

WORKERS = 2
REAL_TIME_HOURS = 7.0  # 2,500 runs of the published set-up, in real time (its public scripts)

STEP_SHARE = 0.006
"""Time step of the loop's comparison, in units of sqrt(radius / g)."""


def site_file(folder: Path, scan: Path | None) -> Path:
    """Site YAML of Double Rock: a given scan, or the surrogate."""
    mesh = scan.resolve() if scan else folder / "no-scan"
    yaws = ", ".join(str(30 * i) for i in range(12))
    path = folder / "double_rock.yaml"
    path.write_text(
        f"rock: {{shape: mesh, mesh: {mesh}, fallback: double_rock, density: 2110}}\n"
        f"yaw: [{yaws}]\n"
    )
    return path


def loop(site: Path, folder: Path) -> Iterator[Row]:
    """The guarded loop against bare steps of the engine, same scene, motions and step counts."""
    say("the run loop against bare steps of the engine")
    case, settings = case_of(site, folder)
    chosen = cells(150)
    guarded = bare = 0.0
    for pga, pgv_pga in chosen:
        motion = CosinePulse(pga * GRAVITY, pgv_pga)
        start = time.process_time()
        response = simulate(case, motion, settings)
        middle = time.process_time()
        _bare_steps(case, motion, settings, response.steps)
        guarded += middle - start
        bare += time.process_time() - middle
    yield "run loop / bare engine steps, one step a call", f"{guarded / bare:.2f}", "at most 1.3"


def one_yaw(site: Path, folder: Path) -> Iterator[Row]:
    """2,500 cold runs of one yaw, and a plain fixed 1 kHz loop."""
    say("2,500 runs of yaw 0")
    seconds, notes = timed_command(site, folder / "one", "yaw=0")
    cpu, wall = notes["cpu_seconds"], notes["seconds"]
    waste = wall * WORKERS / cpu - 1.0
    yield "2,500 runs of yaw 0, cold: runs stage [s]", f"{wall:.1f}", "at most 10"
    yield "  the same, whole command [s]", f"{seconds:.1f}", ""
    yield "  CPU of a run [ms]", f"{1e3 * cpu / 2500:.2f}", ""
    beyond = "  workers, store and start-up beyond the runs' CPU [%]"
    yield beyond, f"{100 * waste:.0f}", "at most 10"
    say("a plain loop at 1 kHz")
    case, _ = case_of(site, folder)
    plain = plain_loop(case) * 2500
    yield "  plain fixed 1 kHz loop / this, CPU", f"{plain / cpu:.1f}", ""
    yield "  real-time table / this, wall", f"{REAL_TIME_HOURS * 3600 / seconds:.0f}", "1,000"


def whole_site(site: Path, folder: Path) -> Iterator[Row]:
    """Twelve yaws with fragility and report, then the same again; memory of the client."""
    say("30,000 runs of twelve yaws, fragility and report")
    seconds, notes = timed_command(site, folder / "all")
    waste = notes["seconds"] * WORKERS / notes["cpu_seconds"] - 1.0
    yield "12 yaws, 30,000 runs, fragility and report [s]", f"{seconds:.0f}", "at most 120"
    yield "  runs stage [s]", f"{notes['seconds']:.0f}", ""
    yield "  workers and store beyond the runs' CPU [%]", f"{100 * waste:.0f}", "at most 10"
    say("the same command again")
    again, _ = timed_command(site, folder / "all")
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    yield "  the second call [s]", f"{again:.2f}", "at most 3"
    yield "  largest process [MB]", f"{peak:.0f}", ""
    say("the client's memory with 2,500 and 30,000 runs")
    small, large = _client_memory(site, folder)
    yield "client's memory, 30,000 runs / 2,500 runs", f"{large / small:.2f}", "about 1"


def timed_command(site: Path, derived: Path, *settings: str) -> tuple[float, dict[str, float]]:
    """Wall-clock time of a fragility command [s], and its last note in the log."""
    start = time.monotonic()
    command = fragility_command(site, derived, *settings)
    subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
    seconds = time.monotonic() - start
    log = (derived / "double_rock" / "log.jsonl").read_text().splitlines()
    return seconds, json.loads(log[-1])


def fragility_command(site: Path, derived: Path, *settings: str) -> list[str]:
    """Arguments of a fragility command with changed settings."""
    command = [sys.executable, "-m", "pipeline", "run", "fragility", "--site", str(site)]
    command += ["--derived", str(derived), "--workers", str(WORKERS)]
    for setting in settings:
        command += ["--set", setting]
    return command


def case_of(site: Path, folder: Path) -> tuple[Case, Settings]:
    """Rock of a site on a flat pedestal at yaw 0, and the step of the loop's comparison."""
    given = load_site(str(site))
    store = Store(folder / "rock" / given.name)
    if store.manifest("rock") is None:
        from pipeline.workflow import graph

        store.open()
        graph.make("rock", (job := Job(given, store, Cluster(0), lambda line: None)))
    case = flat_case(Scenes(given.config.scene, graph.built(Standing, job)), Group(0.0, 0.6))
    return case, Settings(STEP_SHARE * step_unit(case.full.rock))


def cells(number: int) -> list[tuple[float, float]]:
    """Random PGA [g] and PGV/PGA [s] of runs, the same every time."""
    rng = random.Random(1)
    return [(rng.uniform(0.3, 1.0), rng.uniform(0.1, 1.0)) for _ in range(number)]


def _bare_steps(case: Case, motion: CosinePulse, settings: Settings, steps: int) -> None:
    """The same number of steps of the same length, one engine call each, and nothing else."""
    world = engines.load(settings.engine).build(case.scene, settings.time_step, 1)
    times = (np.arange(steps, dtype=np.float64) + 0.5) * settings.time_step
    world.advance(motion.acceleration(times).tolist())


def plain_loop(case: Case) -> float:
    """CPU time of a run [s]: 1 kHz, half a second of rest before and four seconds after."""
    chosen = cells(12)
    start = time.process_time()
    for pga, pgv_pga in chosen:
        motion = CosinePulse(pga * GRAVITY, pgv_pga)
        steps = math.ceil((0.5 + motion.duration + 4.0) / 1e-3)
        world = engines.load("bullet").build(case.full, 1e-3, 1)
        times = (np.arange(steps, dtype=np.float64) + 0.5) * 1e-3 - 0.5
        world.advance(motion.acceleration(times).tolist())
    return (time.process_time() - start) / len(chosen)


_MEMORY = """
import resource, sys
from pipeline.cli import main
main(["run", "responses", "--site", sys.argv[1], "--derived", sys.argv[2], *sys.argv[3:]])
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


def _client_memory(site: Path, folder: Path) -> tuple[float, float]:
    """Peak memory [kB] of a client with 2,500 and with 30,000 runs of almost no work."""
    sizes = []
    for number, yaw in enumerate(("yaw=0", "yaw={start: 0, stop: 330, num: 12}")):
        # Too weak to move the rock: only the runs' bookkeeping is left.
        grid = "motion.pga={start: 0.0001, stop: 0.001, num: 50}"
        command = [sys.executable, "-c", _MEMORY, str(site), str(folder / f"memory{number}")]
        command += ["--workers", str(WORKERS), "--set", yaw, "--set", grid]
        done = subprocess.run(
            command, check=True, capture_output=True, text=True, env={**os.environ}
        )
        sizes.append(float(done.stdout.split()[-1]))
    return sizes[0], sizes[1]
