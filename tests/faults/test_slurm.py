"""SLURM jobs as workers, with a stand-in ``sbatch`` that runs the job's script here."""

from __future__ import annotations

import re
import stat
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import dask
import pytest

from pipeline.workflow import dispatch
from pipeline.workflow.cluster import Cluster, slurm_jobs
from pipeline.workflow.workers import Batch

SBATCH = """#!/bin/bash
cd {folder}
cp "$1" job-$$.sh
setsid bash job-$$.sh > job-$$.log 2>&1 < /dev/null &
echo $! > job-$$.pid
echo "Submitted batch job $$"
"""

SCANCEL = """#!/bin/bash
kill -KILL -- -$(cat {folder}/job-$1.pid)
"""


@pytest.fixture
def jobs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Folder of the jobs of a SLURM whose walltime is ten seconds."""
    pytest.importorskip("dask_jobqueue")
    folder = tmp_path / "jobs"
    folder.mkdir()
    for name, text in (("sbatch", SBATCH), ("scancel", SCANCEL)):
        script = tmp_path / name
        script.write_text(text.format(folder=folder))
        script.chmod(script.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    monkeypatch.setenv("PYTHONPATH", ":".join(filter(None, sys.path)))
    settings = {
        "cores": 1,
        "memory": "1GB",
        "walltime": "00:00:10",
        "local-directory": str(tmp_path),
        "scheduler-options": {"host": "127.0.0.1", "dashboard_address": "127.0.0.1:0"},
    }
    with dask.config.set({f"jobqueue.slurm.{key}": value for key, value in settings.items()}):
        yield folder


def running(jobs: Path) -> int:
    """Processes that jobs have left."""
    groups = ",".join(path.read_text().strip() for path in jobs.glob("job-*.pid"))
    found = subprocess.run(["pgrep", "-g", groups], capture_output=True, check=False, text=True)
    return len(found.stdout.split())


def test_script_of_a_job_says_when_it_ends(jobs: Path) -> None:
    hour = {"jobqueue.slurm.walltime": "01:00:00", "jobqueue.slurm.cores": 4}
    with dask.config.set(hour), slurm_jobs(0) as started:
        script = started.cluster.job_script()
    assert "#SBATCH -t 01:00:00" in script
    assert "--nthreads 1 " in script
    assert "--nworkers 4 " in script
    assert "--lifetime 2880s --lifetime-stagger 360s" in script


@pytest.mark.slow
@pytest.mark.parametrize("cores", [1, 2])
def test_jobs_that_end_are_replaced(
    jobs: Path, monkeypatch: pytest.MonkeyPatch, cores: int
) -> None:
    monkeypatch.setattr("pipeline.workflow.cluster.JOBS_EVERY", 0.5)
    monkeypatch.setattr(dispatch, "LOOK", 0.2)
    started = time.monotonic()

    def work(shared: float, items: tuple[int, ...]) -> list[float]:
        time.sleep(0.1)
        return [shared * item for item in items]

    def batches() -> Iterator[Batch]:
        number = 0
        while time.monotonic() - started < 25.0:
            yield Batch("half", (number,))
            number += 1

    done: dict[int, Any] = {}
    with (
        dask.config.set({"jobqueue.slurm.cores": cores}),
        Cluster(2, slurm=True, log=lambda line: None) as cluster,
    ):
        for _, item, result in cluster.each(work, batches(), lambda name: 0.5):
            assert item not in done
            done[item] = result
    assert done == {item: 0.5 * item for item in range(len(done))}
    assert len(done) > 60
    scripts = [path.read_text() for path in jobs.glob("job-*.sh")]
    assert len(scripts) >= 2 * 2 // cores
    assert all(re.search(r"--lifetime 8s --lifetime-stagger 1s", text) for text in scripts)
    deadline = time.monotonic() + 10.0
    while running(jobs):
        assert time.monotonic() < deadline
        time.sleep(0.1)


def test_without_its_configuration_slurm_is_refused(
    jobs: Path, vsr: Callable[..., Any], write_site: Callable[..., str]
) -> None:
    site = write_site(
        "motion: {pga: {start: 0.1, stop: 1.0, num: 20}, "
        "pgv_pga: {start: 0.1, stop: 0.5, num: 20}}\n"
    )
    with dask.config.set({"jobqueue.slurm.cores": None}):
        ran = vsr("run", "responses", "--site", site, "--cluster", "slurm", "--workers", "2")
    assert ran.code == 2, ran.err
    refusals = [line for line in ran.err.splitlines() if line.startswith("vsr: ")]
    assert len(refusals) == 1
    assert "--cluster: got slurm" in refusals[0]
    assert "jobqueue.yaml" in refusals[0]
