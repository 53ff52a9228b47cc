"""Workers in SLURM jobs: they end before their walltime does, and others take their place."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from pipeline.config.problems import InputError, Problem

SHARE = 0.1
"""Part of the walltime by which a worker ends early, and by which others end earlier still."""

EVERY = 10.0
"""Time [s] between looks for jobs that have ended."""


@dataclass
class Jobs:
    """SLURM jobs that serve as workers."""

    cluster: Any
    workers: int
    _looked: float = 0.0
    _served: set[str] = field(default_factory=set)

    def renew(self) -> None:
        """Ask for a new job in place of each whose workers have all left."""
        if time.monotonic() - self._looked < EVERY:
            return
        self._looked = time.monotonic()
        self.cluster.sync(self._renew)

    async def _renew(self) -> None:
        serving = self._serving()
        for job in self._served - serving:
            self.cluster.workers.pop(job, None)
        self._served = serving
        self.cluster.scale(self.workers)

    def _serving(self) -> set[str]:
        """Jobs with a worker; those of a job with several are numbered after its name."""
        names = {str(one["name"]) for one in self.cluster.scheduler_info["workers"].values()}
        jobs = {str(job) for job in self.cluster.workers}
        return jobs & (names | {name.rpartition("-")[0] for name in names})


@contextmanager
def jobs(workers: int) -> Iterator[Jobs]:
    """Start jobs as dask-jobqueue is configured to, each of its workers with one thread."""
    import dask

    try:
        from dask_jobqueue.slurm import SLURMCluster

        settings = dask.config.get("jobqueue.slurm")
        seconds = _seconds(str(settings["walltime"]))
        lifetime = ["--lifetime", f"{(1.0 - 2.0 * SHARE) * seconds:.0f}s"]
        stagger = ["--lifetime-stagger", f"{SHARE * seconds:.0f}s"]
        preload = ["--preload", "pipeline.workflow.workers"]
        cluster = SLURMCluster(
            processes=settings["cores"],
            worker_extra_args=[*settings["worker-extra-args"], *lifetime, *stagger, *preload],
        )
    except (ImportError, ValueError, TypeError, OSError) as error:
        rule = "dask-jobqueue is installed, with cores, memory and walltime of a job configured"
        remedy = (
            "install it with .venv/bin/pip install -e '.[slurm]'; see ~/.config/dask/jobqueue.yaml"
        )
        given = f"slurm ({str(error).splitlines()[0]})"
        raise InputError(Problem("--cluster", "", given, rule, remedy)) from None
    with cluster:
        cluster.scale(workers)
        yield Jobs(cluster, workers)


def _seconds(walltime: str) -> float:
    """Seconds of a walltime as SLURM writes it.

    >>> [_seconds(text) for text in ("30", "30:00", "01:00:00", "2-00:00:00", "1-12")]
    [1800.0, 1800.0, 3600.0, 172800.0, 129600.0]
    """
    days, _, clock = walltime.rpartition("-")
    parts = [float(part) for part in clock.split(":")]
    if days:  # days-hours[:minutes[:seconds]]
        hours, minutes, seconds = (*parts, 0.0, 0.0)[:3]
    elif len(parts) == 1:
        hours, minutes, seconds = 0.0, parts[0], 0.0
    else:
        hours, minutes, seconds = (0.0, *parts)[-3:]
    return 86400.0 * float(days or 0) + 3600.0 * hours + 60.0 * minutes + seconds
