"""Runs: the outcome of every cell of the grid that is not stored yet."""

from __future__ import annotations

import time
from typing import Any

from pipeline.running import Work, database_is_there, run_missing
from pipeline.scenes import ENGINE_CODE, TERRAIN_CODE, engine_version, on_terrain, prepared
from pipeline.shaking import MOTION_CODE, Cell
from pipeline.stage import Job, Product, Stage
from pipeline.stages.precision import time_step
from pipeline.store import RunRow
from vsr_core.outcome import DecidedBy, Outcome


def simulate_batch(shared: Any, cells: tuple[Cell, ...]) -> list[tuple[Any, ...]]:
    """Responses to the cells, on a worker.

    ``shared`` is a Case or a Site with its Settings, and the motions. The last entry of the list is
    the CPU time used [s].
    """
    from vsr_core.simulate import Case, simulate
    from vsr_core.travel import topple

    place, settings, motions = shared
    start = time.process_time()
    rows: list[tuple[Any, ...]] = []
    for cell in cells:
        run = simulate if isinstance(place, Case) else topple
        r = run(place, motions.motion(cell), settings)
        rows.append((int(r.outcome), int(r.decided_by), r.peak_tilt, r.final_tilt, r.slip, r.steps))
    return [*rows, (time.process_time() - start,)]


def make(job: Job) -> Product:
    """Do the missing runs."""
    return run_missing(job, "runs", WORK)


def _shared(job: Job, yaw: float, friction: float) -> Any:
    from vsr_core.simulate import Settings

    scene = on_terrain if job.config.on_terrain else prepared
    simulation = job.config.simulation
    step = time_step(job.config, job.store, friction)
    settings = Settings(step, simulation.reduce, simulation.engine)
    return scene(job.config, job.store, yaw, friction), settings


WORK = Work(
    row=RunRow,
    function=simulate_batch,
    shared=_shared,
    crashed=(int(Outcome.CRASHED), int(DecidedBy.SIMULATION), None, None, None, 0),
    batch=40,
)


STAGE = Stage(
    name="runs",
    make=make,
    needs=("rock", "terrain", "precision", "motions"),
    reads=("pedestal", "contact", "motion", "yaw", "drive", "servo", "simulation"),
    code=(*TERRAIN_CODE, "pipeline.stages.runs:simulate_batch", *MOTION_CODE, *ENGINE_CODE),
    made_elsewhere=True,
    inputs=engine_version,
    check=database_is_there,
)
