"""Running the cells of a grid that are not stored yet, where the workers are."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from typing import Any

from pipeline.config.schema import Config
from pipeline.stages.motions import shaking
from pipeline.stages.motions.shaking import Cell
from pipeline.stages.runs.scenes import identity
from pipeline.stages.runs.step_choice import time_step
from pipeline.workflow import keys
from pipeline.workflow.cluster import Batch
from pipeline.workflow.progress import Progress
from pipeline.workflow.stage import Job, Product
from pipeline.workflow.store import RUNS, DisplacementRow, RunRow, RunStore, Store
from vsr_core.outcome import Outcome

SMALL = 200
"""Below this many runs no worker process is started."""


@dataclass(frozen=True)
class Work:
    """A kind of run, and how its results are kept.

    Attributes
    ----------
    row : type of its rows
    function : run on a worker, from what its cells share (place and settings, and the motions) and
        the cells to the values of a row after the key, for each; and the CPU time used [s] as a
        last entry
    shared : from the job and a group's name, yaw and friction, to its place and settings
    crashed : values of a row whose worker died
    batch : int, runs handed to a worker at once, 0.2-0.5 s of work
    """

    row: type[RunRow] | type[DisplacementRow]
    function: Callable[[Any, tuple[Cell, ...]], list[Any]]
    shared: Callable[[Job, float, float], tuple[Any, Any]]
    crashed: tuple[Any, ...]
    batch: int


@dataclass(frozen=True)
class Group:
    """All runs of one yaw and one friction.

    Attributes
    ----------
    yaw, friction : float [degree], [1]
    cells : tuple of Cell, PGA running fastest
    keys : tuple of bytes, identity of each run
    """

    yaw: float
    friction: float
    cells: tuple[Cell, ...]
    keys: tuple[bytes, ...]

    @property
    def name(self) -> str:
        """Name by which workers know its scene."""
        return f"{self.yaw}/{self.friction}"


def groups(config: Config, store: Store) -> Iterator[Group]:
    """Groups of a configuration, with the keys of their runs."""
    motions = shaking.of_store(config, store)
    common = {**identity(config, store), "motion": motions.identity()}
    steps = {friction: time_step(config, store, friction) for friction in config.contact.friction}
    cells = shaking.cells(motions)
    tokens = [motions.token(cell) for cell in cells]
    for yaw in config.yaw:
        for friction, step in steps.items():
            scene = {**common, "yaw": yaw, "friction": friction, "time_step": repr(step)}
            name = keys.digest(scene).encode()
            yield Group(yaw, friction, cells, tuple(_key(name, token) for token in tokens))


def missing(group: Group, runs: RunStore[Any]) -> list[int]:
    """Positions of the runs of a group that are not stored; crashed ones are tried again."""
    stored = runs.outcomes(group.keys)
    return [
        i for i, key in enumerate(group.keys) if stored.get(key, Outcome.CRASHED) == Outcome.CRASHED
    ]


def run_missing(job: Job, name: str, work: Work) -> Product:
    """Do the missing runs of a kind; ``name`` is the stage's, for the log."""
    start = time.monotonic()
    with closing(RunStore(job.store.folder, work.row)) as runs:
        total = sum(len(missing(group, runs)) for group in groups(job.config, job.store))
        cluster = job.cluster.in_process() if total < SMALL else job.cluster
        cpu = 0.0
        motions = shaking.of_store(job.config, job.store)

        def shared(group: str) -> tuple[Any, ...]:
            return *work.shared(job, *map(float, group.split("/"))), motions

        with Progress(total, job.log) as progress:
            batches = _batches(job, runs, work.batch)
            for batch, results in cluster.run(work.function, batches, shared):
                rows, used = _rows(batch, results, work)
                runs.add(rows)
                cpu += used
                progress.add([row.outcome for row in rows])
    seconds = time.monotonic() - start
    workers = cluster.workers if cluster.local else -1
    job.store.note(name, runs=total, seconds=seconds, cpu_seconds=cpu, workers=workers)
    rate = f" in {seconds:.1f} s, {1e3 * cpu / total:.1f} ms of CPU each" if total else ""
    crashed = progress.outcomes[Outcome.CRASHED]
    return Product({}, f"{total} {name} done{rate}", retry=crashed)


def database_is_there(store: Store) -> str:
    """What is wrong with the database of runs, or an empty string."""
    return "" if (store.folder / RUNS).is_file() else f"{RUNS} is missing"


def _batches(job: Job, runs: RunStore[Any], size: int) -> Iterator[Batch]:
    for group in groups(job.config, job.store):
        todo = missing(group, runs)
        for start in range(0, len(todo), size):
            part = todo[start : start + size]
            tag = {group.cells[i]: group.keys[i] for i in part}
            yield Batch(tag, group.name, tuple(group.cells[i] for i in part))


def _rows(batch: Batch, results: Any, work: Work) -> tuple[list[Any], float]:
    if results is None:
        return [work.row(batch.tag[cell], *work.crashed) for cell in batch.items], 0.0
    *rows, (cpu,) = results
    return [
        work.row(batch.tag[cell], *row) for cell, row in zip(batch.items, rows, strict=True)
    ], cpu


def _key(scene: bytes, motion: bytes) -> bytes:
    return hashlib.blake2b(motion, key=scene, digest_size=16).digest()
