"""The same bits whoever computes, in whatever order, first or last, on whatever processor."""

from __future__ import annotations

import logging
import os
import random
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from support.dask_processes import Farm

from pipeline import ROOT
from pipeline.stages.runs import runner
from pipeline.stages.uncertainty import ensemble
from pipeline.workflow.run_store import RUNS
from vsr_core.judge.proofs import barrier
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import Response
from vsr_core.rock import solid
from vsr_core.run.cases import Case, Settings, prepare
from vsr_core.run.overturning import simulate_all
from vsr_core.scene import Contact, Scene

ENGINES = ("bullet", "nonsmooth")
AND_SLOWLY_BULLET = ("nonsmooth", pytest.param("bullet", marks=pytest.mark.slow))
"""Where processes start again and again."""

GRID = """
rock: {shape: mesh, mesh: nowhere, fallback: double_rock, density: 2110}
motion: {pga: {start: 0.2, stop: 1.0, num: 8}, pgv_pga: {start: 0.05, stop: 0.5, num: 6}}
yaw: [0, 45]
simulation: {engine: %s, time_step: 0.0015}
"""


def rows(folder: Path) -> dict[bytes, tuple[Any, ...]]:
    with closing(sqlite3.connect(folder / RUNS)) as database:
        return {row[0]: row for row in database.execute("SELECT * FROM runs")}


# Order


def case(yaw: float = 0.3) -> Case:
    rock = solid.box((0.5, 1.0, 2.0), 2110.0).rock
    return prepare(Scene(rock, Contact(0.6), yaw), barrier(rock), reduce=True)


PULSES = [CosinePulse.from_g(0.1 * k, ratio) for k in range(3, 11) for ratio in (0.05, 0.1, 0.32)]


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_order_and_batches_change_no_bit(engine: str) -> None:
    """In turn, backwards, shuffled, one by one, and all of them again after 240 others."""
    settings, here = Settings(0.002, engine=engine), case()
    first = simulate_all(here, PULSES, settings)
    assert len({response.outcome for response in first}) > 1
    assert simulate_all(here, PULSES[::-1], settings)[::-1] == first
    chance, places = random.Random(4), list(range(len(PULSES)))
    for size in (1, 5):
        chance.shuffle(places)
        for start in range(0, len(places), size):
            some = places[start : start + size]
            found = simulate_all(here, [PULSES[k] for k in some], settings)
            assert found == [first[k] for k in some]
    for k in range(10):
        simulate_all(case(0.1 * k), PULSES, settings)
    assert simulate_all(here, PULSES, settings) == first


def resident() -> float:
    """Memory of this process that is in use [MB]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_fifty_thousand_runs_in_one_process(engine: str) -> None:
    """Memory stays flat to 5 %, and the last runs are the first ones bit for bit."""
    settings = Settings(0.002, engine=engine)
    first: list[Response] = []
    used: list[float] = []
    for k in range(50_000 // len(PULSES) + 1):
        found = simulate_all(case(0.3 + 0.1 * (k % 7)), PULSES, settings)
        first = first or found
        if k % 7 == 0:
            assert found == first
        if k % 100 == 0:
            used.append(resident())
    said = f"{engine}: {used[2]:.1f} MB after {200 * len(PULSES)} runs, {used[-1]:.1f} MB at last"
    logging.getLogger(__name__).info(said)
    assert max(used[2:]) < 1.05 * used[2]


# Clusters


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_two_clusters_make_one_study(
    vsr: Callable[..., Any],
    write_site: Callable[..., str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    engine: str,
) -> None:
    """Half of the cells on each; the bits are those of one process."""
    monkeypatch.setattr(runner, "SMALL", 0)
    site = write_site(GRID % engine)
    command = ("run", "responses", "--site", site)
    for number, yaw in enumerate(("yaw=[0]", "yaw=[0, 45]")):
        with Farm(tmp_path / f"farm-{number}") as farm:
            farm.worker()
            ran = vsr(*command, "--set", yaw, "--scheduler", farm.address, into=tmp_path / "two")
            assert ran.code == 0, ran.err
    for workers in ("0", "4"):
        alone = tmp_path / workers
        assert vsr(*command, "--workers", workers, into=alone).code == 0
        assert rows(alone / "rock") == rows(tmp_path / "two" / "rock")
        one, other = (folder / "rock" / "responses.nc" for folder in (alone, tmp_path / "two"))
        assert one.read_bytes() == other.read_bytes()


# Draws

DRAWN = """
rock: {shape: box, size: [0.3, 0.8, 1.0], density: 2000}
motion: {pga: {start: 0.1, stop: 0.7, num: 6}, pgv_pga: {start: 0.1, stop: 0.5, num: 9}}
yaw: [0, 45]
simulation: {engine: nonsmooth, time_step: 0.002}
uncertainty: {members: 4}
"""

KILLED = """
import os, signal, sys
from dataclasses import replace

from pipeline.cli import main
from pipeline.stages.uncertainty import draw_runs, ensemble

done = []

def simulate(shared, places):
    done.append(len(places))
    if sum(done) > int(sys.argv[1]):
        os.kill(os.getpid(), signal.SIGKILL)
    return draw_runs.simulate_draw(shared, places)

draw_runs.KIND = replace(draw_runs.KIND, function=simulate)
ensemble.TOGETHER = 2
sys.exit(main(sys.argv[2:]))
"""


@pytest.fixture
def draws(
    vsr: Callable[..., Any], write_site: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> Callable[..., dict[str, bytes]]:
    """Makes draws of a rock in a folder, two of them after the other two; gives their products."""
    monkeypatch.setattr(ensemble, "TOGETHER", 2)

    def make(into: Path, workers: str = "0") -> dict[str, bytes]:
        site = write_site(DRAWN)
        ran = vsr("run", "uncertainty", "--site", site, "--workers", workers, into=into)
        assert ran.code == 0, ran.err
        names = ("uncertainty.nc", "uncertainty.html")
        return {name: (into / "rock" / name).read_bytes() for name in names}

    return make


@pytest.mark.slow
def test_workers_change_no_byte_of_draws(
    draws: Callable[..., dict[str, bytes]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the process, on two threads and on two worker processes."""
    alone = draws(tmp_path / "alone")
    monkeypatch.setattr(runner, "SMALL", 0)
    assert draws(tmp_path / "threads", "2") == alone
    monkeypatch.setattr(runner, "QUICK", 0)
    assert draws(tmp_path / "processes", "2") == alone
    for other in ("threads", "processes"):
        assert rows(tmp_path / other / "rock") == rows(tmp_path / "alone" / "rock")


@pytest.mark.slow
def test_draws_go_on_after_a_kill(
    draws: Callable[..., dict[str, bytes]], write_site: Callable[..., str], tmp_path: Path
) -> None:
    """Killed in the search of the second two: what was done is not done again."""
    alone, into = draws(tmp_path / "alone"), tmp_path / "killed"
    own = ["run", "uncertainty", "--site", write_site(DRAWN), "--workers", "0"]
    many = len(rows(tmp_path / "alone" / "rock"))
    ran = subprocess.run(
        [sys.executable, "-c", KILLED, str(many // 2), *own, "--derived", str(into)],
        capture_output=True,
        check=False,
        cwd=ROOT,
    )
    assert ran.returncode == -signal.SIGKILL, ran.stderr
    kept = rows(into / "rock")
    assert many // 3 < len(kept) < many
    assert not (into / "rock" / "uncertainty.nc").exists()
    assert draws(into) == alone
    found = rows(into / "rock")
    assert found == rows(tmp_path / "alone" / "rock")
    assert kept.items() <= found.items()


# Processors

OTHER_BLAS = [
    {"OPENBLAS_CORETYPE": name} for name in ("Prescott", "Sandybridge", "SkylakeX", "Zen")
]
PLAIN_NUMPY = {"NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR"}
PLAIN_LIBRARY_OF_C = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F"}
PLAIN_NUMBA = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}


@pytest.fixture(scope="module")
def on_processor(
    tmp_path_factory: pytest.TempPathFactory,
) -> Callable[[str, dict[str, str]], dict[bytes, tuple[Any, ...]]]:
    """Rows of a study, made by libraries that take the processor for another one."""
    folder = tmp_path_factory.mktemp("processors")
    made: dict[str, dict[bytes, tuple[Any, ...]]] = {}

    def make(engine: str, pretended: dict[str, str]) -> dict[bytes, tuple[Any, ...]]:
        name = "-".join((engine, *pretended, *pretended.values())).replace(" ", "-")
        if name not in made:
            site, into = folder / "rock.yaml", folder / str(len(made))
            site.write_text(GRID % engine)
            command = ["-m", "pipeline", "run", "responses", "--site", str(site), "--workers", "0"]
            cache = {"NUMBA_CACHE_DIR": str(folder)} if "NUMBA_CPU_NAME" in pretended else {}
            done = subprocess.run(
                [sys.executable, *command, "--derived", str(into)],
                env={**os.environ, "OPENBLAS_NUM_THREADS": "1", **cache, **pretended},
                capture_output=True,
                text=True,
                check=False,
                cwd=ROOT,
            )
            assert done.returncode == 0, done.stderr
            made[name] = rows(into / "rock")
        return made[name]

    return make


@pytest.mark.slow
@pytest.mark.parametrize("engine", AND_SLOWLY_BULLET)
@pytest.mark.parametrize(
    "pretended",
    [
        OTHER_BLAS[0] | PLAIN_NUMPY | {"OPENBLAS_NUM_THREADS": "2"},
        *(pytest.param(blas, marks=pytest.mark.slow) for blas in OTHER_BLAS[1:]),
        pytest.param(PLAIN_NUMBA, marks=pytest.mark.slow),
    ],
    ids=lambda pretended: "-".join(pretended.values()).replace(" ", "-"),
)
def test_processor_changes_no_bit_of_a_run(
    on_processor: Callable[..., Any], engine: str, pretended: dict[str, str]
) -> None:
    """Keys are the same too: the rock that is made is the same one, bit for bit."""
    assert on_processor(engine, pretended) == on_processor(engine, {})


@pytest.mark.slow
@pytest.mark.parametrize("engine", AND_SLOWLY_BULLET)
def test_library_of_c_changes_no_outcome(on_processor: Callable[..., Any], engine: str) -> None:
    """Its sine may differ by a rounding where a processor cannot multiply and add at once."""
    here, there = (on_processor(engine, kind) for kind in ({}, PLAIN_LIBRARY_OF_C))
    assert here.keys() == there.keys()
    for key, (_, outcome, decided_by, *numbers, steps, _) in here.items():
        _, other_outcome, other_decided_by, *others, other_steps, _ = there[key]
        assert (outcome, decided_by, steps) == (other_outcome, other_decided_by, other_steps)
        assert numbers == pytest.approx(others, abs=1e-9, nan_ok=True)
