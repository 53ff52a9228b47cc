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
from pipeline.stage import Job, Product, Stage
from pipeline.store import RUNS, RunRow, RunStore, Store
from vsr_core import GRAVITY, engines
from vsr_core.outcome import DecidedBy, Outcome
from vsr_core.servo import Servo

BATCH = 40
"""Runs handed to a worker at once, 0.2-0.5 s of work."""

SMALL = 200
"""Below this many runs no worker process is started."""

SIMULATION_CODE = (
    "vsr_core.simulate:prepare",
    "vsr_core.simulate:simulate",
    "vsr_core.simulate:automatic_time_step",
    "vsr_core.bounds:barrier",
    "vsr_core.motion:CosinePulse",
    "vsr_core.engines.bullet:build",
)
"""What determines a run, for its key."""

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
    from pipeline.stages.rock import load_rock

    rock, _ = load_rock(store)
    parts = (rock.vertices, rock.inertia, rock.axes)
    shape = keys.digest_bytes(rock.shape.encode(), *(part.tobytes() for part in parts))
    common = {
        "rock": [shape, rock.mass],
        "pedestal": config.pedestal.shape,
        "contact": [config.contact.restitution, config.contact.rolling_friction],
        "drive": config.servo.model_dump() if config.drive == "servo" else config.drive,
        "motion": config.motion.kind,
        "simulation": [config.simulation.engine, time_step(config, rock), config.simulation.reduce],
        "engine": engines.load(config.simulation.engine).VERSION,
        "code": keys.digest(keys.code(SIMULATION_CODE)),
    }
    cells = tuple((r, a) for r in config.motion.pgv_pga for a in config.motion.pga)
    for yaw in config.yaw:
        for friction in config.contact.friction:
            scene = keys.digest({**common, "yaw": yaw, "friction": friction}).encode()
            yield Group(yaw, friction, cells, tuple(_key(scene, cell) for cell in cells))


def time_step(config: Config, rock: Any) -> float:
    """Time step [s] of a configuration; ``rock`` is a ``vsr_core.scene.Rock``."""
    from vsr_core.simulate import automatic_time_step

    given = config.simulation.time_step
    if given == "auto":
        return automatic_time_step(rock, config.simulation.tolerance)
    return given


def missing(group: Group, runs: RunStore) -> list[int]:
    """Positions of the runs of a group that are not stored; crashed ones are tried again."""
    stored = runs.get(group.keys)
    return [
        i
        for i, key in enumerate(group.keys)
        if key not in stored or stored[key].outcome == Outcome.CRASHED
    ]


def prepared(config: Config, store: Store, yaw: float, friction: float) -> Any:
    """The ``vsr_core.simulate.Case`` of one yaw [degree] and friction."""
    import math

    from pipeline.stages.rock import load_rock
    from vsr_core.scene import Contact, Scene
    from vsr_core.simulate import prepare

    rock, limits = load_rock(store)
    contact = Contact(friction, config.contact.restitution, config.contact.rolling_friction)
    scene = Scene(rock, contact, math.radians(yaw), drive=_drive(config))
    return prepare(scene, limits, reduce=config.simulation.reduce)


def _drive(config: Config) -> Servo | None:
    return config.servo.servo() if config.drive == "servo" else None


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
    settings = Settings(time_step(job.config, case.full.rock), simulation.reduce, simulation.engine)
    return case, settings


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
    needs=("rock",),
    reads=("pedestal", "contact", "motion", "yaw", "drive", "servo", "simulation"),
    code=(*SIMULATION_CODE, "pipeline.stages.runs:simulate_batch"),
    made_elsewhere=True,
    versions=("pybullet",),
    check=_check,
)
