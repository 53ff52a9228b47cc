"""Runs: every cell of the grid that is not stored yet, simulated where the workers are."""

from __future__ import annotations

import hashlib
import struct
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from typing import Any

from pipeline import keys
from pipeline.cluster import Batch
from pipeline.config import Config
from pipeline.progress import Progress
from pipeline.scenes import RUN_CODE, engine_version, identity, prepared
from pipeline.stage import Job, Product, Stage
from pipeline.stages.precision import time_step
from pipeline.store import RUNS, RunRow, RunStore, Store
from vsr_core import GRAVITY
from vsr_core.outcome import DecidedBy, Outcome

BATCH = 40
"""Runs handed to a worker at once, 0.2-0.5 s of work."""

SMALL = 200
"""Below this many runs no worker process is started."""

Cell = tuple[float, float]  # PGV/PGA [s], PGA [g]


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
    common = {**identity(config, store), "motion": config.motion.kind}
    steps = {friction: time_step(config, store, friction) for friction in config.contact.friction}
    cells = tuple((r, a) for r in config.motion.pgv_pga for a in config.motion.pga)
    for yaw in config.yaw:
        for friction, step in steps.items():
            scene = {**common, "yaw": yaw, "friction": friction, "time_step": repr(step)}
            name = keys.digest(scene).encode()
            yield Group(yaw, friction, cells, tuple(_key(name, cell) for cell in cells))


def missing(group: Group, runs: RunStore) -> list[int]:
    """Positions of the runs of a group that are not stored; crashed ones are tried again."""
    stored = runs.get(group.keys)
    return [
        i
        for i, key in enumerate(group.keys)
        if key not in stored or stored[key].outcome == Outcome.CRASHED
    ]


def simulate_batch(shared: Any, cells: tuple[Cell, ...]) -> list[tuple[Any, ...]]:
    """Responses to the cells, on a worker; ``shared`` is a Case and its Settings.

    The last entry of the list is the CPU time used [s].
    """
    from vsr_core.motion import CosinePulse
    from vsr_core.simulate import simulate

    case, settings = shared
    start = time.process_time()
    rows: list[tuple[Any, ...]] = []
    for pgv_pga, pga in cells:
        r = simulate(case, CosinePulse(pga * GRAVITY, pgv_pga), settings)
        rows.append((int(r.outcome), int(r.decided_by), r.peak_tilt, r.final_tilt, r.slip, r.steps))
    return [*rows, (time.process_time() - start,)]


def make(job: Job) -> Product:
    """Do the missing runs."""
    start = time.monotonic()
    with closing(RunStore(job.store.folder)) as runs:
        total = sum(len(missing(group, runs)) for group in groups(job.config, job.store))
        cluster = job.cluster.in_process() if total < SMALL else job.cluster
        cpu = 0.0
        with Progress(total, job.log) as progress:
            batches = _batches(job, runs)
            for batch, results in cluster.run(simulate_batch, batches, partial(_shared, job)):
                rows, used = _rows(batch, results)
                runs.add(rows)
                cpu += used
                progress.add([row.outcome for row in rows])
    seconds = time.monotonic() - start
    workers = cluster.workers if cluster.local else -1
    job.store.note("runs", runs=total, seconds=seconds, cpu_seconds=cpu, workers=workers)
    rate = f" in {seconds:.1f} s, {1e3 * cpu / total:.1f} ms of CPU each" if total else ""
    crashed = progress.outcomes[Outcome.CRASHED]
    return Product({}, f"{total} runs done{rate}", retry=crashed)


def _shared(job: Job, name: str) -> Any:
    from vsr_core.simulate import Settings

    yaw, friction = map(float, name.split("/"))
    case = prepared(job.config, job.store, yaw, friction)
    simulation = job.config.simulation
    step = time_step(job.config, job.store, friction)
    return case, Settings(step, simulation.reduce, simulation.engine)


def _batches(job: Job, runs: RunStore) -> Iterator[Batch]:
    for group in groups(job.config, job.store):
        todo = missing(group, runs)
        for start in range(0, len(todo), BATCH):
            part = todo[start : start + BATCH]
            tag = {group.cells[i]: group.keys[i] for i in part}
            yield Batch(tag, group.name, tuple(group.cells[i] for i in part))


def _rows(batch: Batch, results: Any) -> tuple[list[RunRow], float]:
    if results is None:
        crashed = (int(Outcome.CRASHED), int(DecidedBy.SIMULATION), None, None, None, 0)
        return [RunRow(batch.tag[cell], *crashed) for cell in batch.items], 0.0  # type: ignore[arg-type]
    *rows, (cpu,) = results
    return [RunRow(batch.tag[cell], *row) for cell, row in zip(batch.items, rows, strict=True)], cpu


def _key(scene: bytes, cell: Cell) -> bytes:
    return hashlib.blake2b(struct.pack("<2d", *cell), key=scene, digest_size=16).digest()


def _check(store: Store) -> str:
    return "" if (store.folder / RUNS).is_file() else f"{RUNS} is missing"


STAGE = Stage(
    name="runs",
    make=make,
    needs=("rock", "precision"),
    reads=("pedestal", "contact", "motion", "yaw", "drive", "servo", "simulation"),
    code=(
        *RUN_CODE,
        "pipeline.stages.runs:simulate_batch",
        "vsr_core.engines.bullet:build",
        "vsr_core.engines.mujoco:build",
    ),
    made_elsewhere=True,
    inputs=engine_version,
    check=_check,
)
