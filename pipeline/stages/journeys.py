"""Journeys: every cell of the grid that is not stored yet, followed over the terrain to its end."""

from __future__ import annotations

import time
from typing import Any

from pipeline.problems import InputError, Problem
from pipeline.running import Work, database_is_there, run_missing
from pipeline.scenes import ENGINE_CODE, TERRAIN_CODE, engine_version, on_terrain
from pipeline.shaking import MOTION_CODE, Cell
from pipeline.stage import Job, Product, Stage
from pipeline.stages.precision import time_step
from pipeline.store import JourneyRow
from vsr_core.outcome import Outcome, StopReason


def follow_batch(shared: Any, cells: tuple[Cell, ...]) -> list[tuple[Any, ...]]:
    """Journeys of the cells, on a worker.

    ``shared`` is a Site with its Settings, and the motions. The last entry of the list is the CPU
    time used [s].
    """
    from pipeline.trajectories import pack
    from vsr_core.travel import travel

    site, settings, motions = shared
    start = time.process_time()
    rows: list[tuple[Any, ...]] = []
    for cell in cells:
        found = travel(site, motions.motion(cell), settings)
        r = found.response
        packed = pack(found.trajectory)
        rows.append((int(r.outcome), r.peak_tilt, r.slip, r.steps, int(found.stop), packed))
    return [*rows, (time.process_time() - start,)]


def make(job: Job) -> Product:
    """Do the missing journeys."""
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
    return run_missing(job, "journeys", WORK)


def _shared(job: Job, yaw: float, friction: float) -> Any:
    from vsr_core.simulate import Settings

    simulation = job.config.simulation
    step = time_step(job.config, job.store, friction)
    settings = Settings(step, simulation.reduce, simulation.engine)
    return on_terrain(job.config, job.store, yaw, friction), settings


WORK = Work(
    row=JourneyRow,
    function=follow_batch,
    shared=_shared,
    crashed=(int(Outcome.CRASHED), None, None, 0, int(StopReason.UNDONE), b""),
    batch=4,
)


STAGE = Stage(
    name="journeys",
    make=make,
    needs=("rock", "terrain", "precision", "motions"),
    reads=("pedestal", "contact", "motion", "yaw", "drive", "simulation"),
    code=(*TERRAIN_CODE, "pipeline.stages.journeys:follow_batch", *MOTION_CODE, *ENGINE_CODE),
    made_elsewhere=True,
    inputs=engine_version,
    check=database_is_there,
)
