"""Runs: the outcome of every cell of the grid that is not stored yet."""

from __future__ import annotations

from typing import Any

from pipeline.stages.motions.motion_grid import Cell, Shaking
from pipeline.stages.runs.runner import Kind
from pipeline.stages.runs.scenes import flat_case, terrain_case
from pipeline.stages.runs.study import run_study
from pipeline.workflow.rows import RunRow
from pipeline.workflow.stage import Job, Product
from vsr_core.outcome import Response
from vsr_core.run.cases import Case, Settings, TerrainCase
from vsr_core.run.displacement import respond
from vsr_core.run.overturning import simulate_all


def simulate_batch(
    shared: tuple[Case | TerrainCase, Settings, Shaking], cells: tuple[Cell, ...]
) -> list[tuple[Any, ...]]:
    """Simulate the responses to some cells, on a worker.

    Parameters
    ----------
    shared : Case or TerrainCase, Settings, and the motions
    cells : tuple of Cell

    Returns
    -------
    list of tuple, values of a ``RunRow`` after its key
    """
    place, settings, motions = shared
    moved = [motions.motion(cell) for cell in cells]
    if isinstance(place, Case):
        return [values(response) for response in simulate_all(place, moved, settings)]
    return [values(respond(place, motion, settings)) for motion in moved]


def values(response: Response) -> tuple[Any, ...]:
    """List a response as a row keeps it.

    Parameters
    ----------
    response : Response

    Returns
    -------
    tuple, values of a ``RunRow`` after its key
    """
    r = response
    return int(r.outcome), int(r.decided_by), r.peak_tilt, r.final_tilt, r.slip, r.steps


def make(job: Job) -> Product:
    """Do the missing runs.

    Parameters
    ----------
    job : Job

    Returns
    -------
    Product
    """
    return run_study(job, KIND, terrain_case if job.config.on_terrain else flat_case)


KIND = Kind("runs", "runs", RunRow, simulate_batch, batch=40)
