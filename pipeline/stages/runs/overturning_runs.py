"""Runs: the outcome of every cell of the grid that is not stored yet."""

from __future__ import annotations

import time
from typing import Any

from pipeline.stages.motions.shaking import Cell
from pipeline.stages.runs.running import Work, run_missing
from pipeline.stages.runs.scenes import on_terrain, prepared
from pipeline.stages.runs.step_choice import time_step
from pipeline.workflow.stage import Job, Product
from pipeline.workflow.store import RunRow
from vsr_core.outcome import DecidedBy, Outcome
from vsr_core.run.cases import Case, Settings
from vsr_core.run.displacement import respond
from vsr_core.run.overturning import simulate


def simulate_batch(shared: Any, cells: tuple[Cell, ...]) -> list[tuple[Any, ...]]:
    """Responses to the cells, on a worker.

    ``shared`` is a Case or a TerrainCase with its Settings, and the motions. The last entry of
    the list is
    the CPU time used [s].
    """
    place, settings, motions = shared
    start = time.process_time()
    rows: list[tuple[Any, ...]] = []
    for cell in cells:
        run = simulate if isinstance(place, Case) else respond
        r = run(place, motions.motion(cell), settings)
        rows.append((int(r.outcome), int(r.decided_by), r.peak_tilt, r.final_tilt, r.slip, r.steps))
    return [*rows, (time.process_time() - start,)]


def make(job: Job) -> Product:
    """Do the missing runs."""
    return run_missing(job, "runs", WORK)


def _shared(job: Job, yaw: float, friction: float) -> Any:
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
