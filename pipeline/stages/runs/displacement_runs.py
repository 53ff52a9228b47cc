"""Journeys: every cell of the grid that is not stored yet, followed over the terrain to its end."""

from __future__ import annotations

import time
from typing import Any

from pipeline.config.problems import InputError, Problem
from pipeline.stages.motions.shaking import Cell
from pipeline.stages.runs.running import Work, run_missing
from pipeline.stages.runs.scenes import on_terrain
from pipeline.stages.runs.step_choice import time_step
from pipeline.stages.runs.trajectory_packing import pack
from pipeline.workflow.stage import Job, Product
from pipeline.workflow.store import DisplacementRow
from vsr_core.outcome import Outcome, StopReason
from vsr_core.run.cases import Settings
from vsr_core.run.displacement import displace


def follow_batch(shared: Any, cells: tuple[Cell, ...]) -> list[tuple[Any, ...]]:
    """Journeys of the cells, on a worker.

    ``shared`` is a TerrainCase with its Settings, and the motions. The last entry of the list
    is the CPU
    time used [s].
    """
    site, settings, motions = shared
    start = time.process_time()
    rows: list[tuple[Any, ...]] = []
    for cell in cells:
        found = displace(site, motions.motion(cell), settings)
        r = found.response
        packed = pack(found.trajectory)
        rows.append((int(r.outcome), r.peak_tilt, r.slip, r.steps, int(found.stop), packed))
    return [*rows, (time.process_time() - start,)]


def make(job: Job) -> Product:
    """Do the missing displacement runs."""
    if not job.config.on_terrain:
        raise InputError(
            Problem(
                job.site.file,
                "pedestal.shape",
                job.config.pedestal.shape,
                "a rock travels over a terrain",
                "set pedestal.shape: mesh, with the terrain in the rock's scan",
            )
        )
    return run_missing(job, "displacement_runs", WORK)


def _shared(job: Job, yaw: float, friction: float) -> Any:
    simulation = job.config.simulation
    step = time_step(job.config, job.store, friction)
    settings = Settings(step, simulation.reduce, simulation.engine)
    return on_terrain(job.config, job.store, yaw, friction), settings


WORK = Work(
    row=DisplacementRow,
    function=follow_batch,
    shared=_shared,
    crashed=(int(Outcome.CRASHED), None, None, 0, int(StopReason.UNDONE), b""),
    batch=4,
)
