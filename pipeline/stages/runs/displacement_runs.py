"""Displacement runs: cells of the grid that are not stored yet, each followed to its end."""

from __future__ import annotations

from typing import Any

from pipeline.config.layers import Site
from pipeline.config.problems import InputError, Problem
from pipeline.stages.motions.motion_grid import Cell, Shaking
from pipeline.stages.runs.runner import Kind
from pipeline.stages.runs.scenes import engine_version, terrain_case
from pipeline.stages.runs.study import run_study
from pipeline.stages.runs.trajectory_packing import pack
from pipeline.workflow.rows import DisplacementRow
from pipeline.workflow.stage import Job, Product
from vsr_core.run.cases import Settings, TerrainCase
from vsr_core.run.displacement import displace


def follow_batch(
    shared: tuple[TerrainCase, Settings, Shaking], cells: tuple[Cell, ...]
) -> list[tuple[Any, ...]]:
    """Simulate the displacement runs of some cells, on a worker."""
    place, settings, motions = shared
    rows = []
    for cell in cells:
        found = displace(place, motions.motion(cell), settings)
        r, packed = found.response, pack(found.trajectory)
        rows.append((int(r.outcome), r.peak_tilt, r.slip, r.steps, int(found.stop), packed))
    return rows


def make(job: Job) -> Product:
    """Do the missing displacement runs."""
    return run_study(job, KIND, terrain_case)


def inputs(site: Site) -> dict[str, str]:
    """Tell the version of the engine; a rock that has no terrain is refused before any work."""
    shape = site.config.pedestal.shape
    if shape != "mesh":
        file, rule = site.file_of("pedestal.shape"), "a rock travels over a terrain"
        remedy = "set pedestal.shape: mesh, with the terrain in the rock's scan"
        raise InputError(Problem(file, "pedestal.shape", shape, rule, remedy))
    return engine_version(site)


KIND = Kind("displacement_runs", "displacement runs", DisplacementRow, follow_batch, batch=4)
