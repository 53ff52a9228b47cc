"""Whether this machine can do runs: what each needs, looked at one by one."""

from __future__ import annotations

import os
import platform
import shutil
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from pipeline.config.problems import InputError, Problem
from pipeline.workflow import keys
from pipeline.workflow.cluster import Cluster
from pipeline.workflow.grammar import counted, listed
from pipeline.workflow.jobs import cores
from vsr_core import GRAVITY, engines
from vsr_core.compiled import compiling
from vsr_core.judge.proofs import barrier
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import Outcome
from vsr_core.rock import solid
from vsr_core.run.cases import Settings, prepare
from vsr_core.run.overturning import simulate
from vsr_core.run.rocking_block import Block, first_overturning_pga
from vsr_core.scene import Contact, Scene

LEAST_ROOM = 200_000_000
"""Bytes that a study of 30,000 runs takes with its pages, and as many again."""

PGV_PGA = 0.3
"""Pulse of the self-test [s]."""

WITHIN = 0.01
"""Relative error of its boundary."""

Checks = dict[str, Callable[[], str]]


def examined(derived: Path, cluster: Cluster) -> Iterator[tuple[str, str, InputError | None]]:
    """Name of each check, what was found, and what is wrong with it."""
    checks: Checks = {
        "python": lambda: f"{platform.python_version()} on {platform.machine()}",
        "machine code": _machine_code,
        "threads": lambda: f"{counted(cores(), 'core')}, a worker on each",
        "disk": partial(_disk, derived),
        "scheduler": partial(_scheduler, cluster),
        "engines": _engines,
        "self-test": self_test,
    }
    for name, check in checks.items():
        try:
            yield name, check(), None
        except InputError as error:
            yield name, "", error


def _machine_code() -> str:
    """Where it is kept; refused where nothing can be, or what is there will not be used."""
    folder, whole, others = compiling.what_is_kept()
    remedy = "make the checkout or ~/.cache writable, or set NUMBA_CACHE_DIR to a folder of yours"
    if folder is None:
        raise _wrong("machine code", "none that can be kept", "it is kept between commands", remedy)
    if others:
        given = f"{counted(others, 'file')} in {folder} damaged or writable by others"
        remedy = "remove the folder; it is compiled anew"
        raise _wrong("machine code", given, "each file is sealed, and one's own", remedy)
    found = f"{counted(whole, 'sealed file')}" if whole else "none yet: compiled in the first run"
    return f"{folder}, {found}"


def _disk(derived: Path) -> str:
    there = next(folder for folder in (derived, *derived.absolute().parents) if folder.exists())
    if not os.access(there, os.W_OK | os.X_OK):
        rule, remedy = "it is a folder that you may write to", "give another with --derived"
        raise _wrong("disk", str(there), rule, remedy)
    free = shutil.disk_usage(there).free
    if free < LEAST_ROOM:
        rule = f"a study needs {LEAST_ROOM / 1e6:.0f} MB"
        remedy = "free space, or give another folder with --derived"
        raise _wrong("disk", f"{free / 1e6:.0f} MB free for {derived}", rule, remedy)
    return f"{free / 1e9:.1f} GB free for {derived}"


def _scheduler(cluster: Cluster) -> str:
    address = cluster.scheduler or cluster.scheduler_file
    if address is None:
        return "none given; workers are processes of this machine"
    with cluster:
        return f"{address} answers"


def _engines() -> str:
    """The default engine and those that check it, of which one is needed."""
    libraries = {"bullet": "pybullet", "mujoco": "mujoco"}
    there = {name: engines.available(name) for name in libraries}
    if not any(there.values()):
        rule = "one of Bullet and MuJoCo repeats a sample of the runs"
        raise _wrong("engines", "neither", rule, "pip install mujoco")
    told = [f"{name} {keys.installed_version(libraries[name])}" for name in there]
    return listed(["nonsmooth", *told])


def self_test() -> str:
    """A block of 1 x 1 x 2 m stands and topples where Housner's equation has it."""
    before, block = time.perf_counter(), Block(0.5, 1.0)
    answer = first_overturning_pga(block, PGV_PGA, 2.0 * GRAVITY, 0.1 * GRAVITY)
    rock = solid.box((1.0, 1.0, 2.0), 2000.0).rock
    case = prepare(Scene(rock, Contact(10.0)), barrier(rock), reduce=True)
    settings = Settings(1e-3, engine="nonsmooth")
    outcomes = [
        simulate(case, CosinePulse(share * answer, PGV_PGA), settings).outcome
        for share in (1.0 - WITHIN, 1.0 + WITHIN)
    ]
    told = f"{answer / GRAVITY:.3f} g of Housner's equation"
    if outcomes != [Outcome.BALANCED, Outcome.OVERTURNED]:
        given = f"{outcomes[0].name.lower()} 1 % below and {outcomes[1].name.lower()} above {told}"
        rule, remedy = "it stands, then topples", "report it with what vsr --version says"
        raise _wrong("self-test", given, f"a block of 1 x 1 x 2 m: {rule}", remedy)
    took = time.perf_counter() - before
    return f"a block of 1 x 1 x 2 m topples within 1 % of the {told}; {took:.1f} s"


def _wrong(check: str, given: str, rule: str, remedy: str) -> InputError:
    return InputError(Problem(check, "", given, rule, remedy))
