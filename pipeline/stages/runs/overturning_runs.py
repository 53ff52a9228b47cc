"""Runs: the outcome of every cell of the grid that is not stored yet."""

from __future__ import annotations

from typing import Any

from pipeline.stages.motions.motion_grid import Cell, Shaking
from pipeline.stages.runs.runner import Kind, StoredRuns
from pipeline.stages.runs.study import LevelStudy, Study, run_study
from pipeline.workflow.rows import RunRow, TerrainRow
from pipeline.workflow.stage import Product, Work
from vsr_core.outcome import Response
from vsr_core.run.cases import Case, Settings, TerrainCase
from vsr_core.run.displacement import displace
from vsr_core.run.movement import air_share
from vsr_core.run.overturning import simulate_all


def simulate_batch(
    shared: tuple[Case, Settings, Shaking], cells: tuple[Cell, ...]
) -> list[tuple[Any, ...]]:
    """Simulate the responses to some cells on a flat pedestal, on a worker."""
    place, settings, motions = shared
    moved = [motions.motion(cell) for cell in cells]
    return [values(response) for response in simulate_all(place, moved, settings)]


def respond_batch(
    shared: tuple[TerrainCase, Settings, Shaking], cells: tuple[Cell, ...]
) -> list[tuple[Any, ...]]:
    """Simulate the responses to some cells on a terrain, on a worker."""
    place, settings, motions = shared
    rows = []
    for cell in cells:
        found = displace(place, motions.motion(cell), settings, follow=False)
        path, radius = found.trajectory, place.seat.rock.radius
        in_air = air_share(path.position[:, 2], path.contact, radius)
        rows.append((*values(found.response), in_air))
    return rows


def values(response: Response) -> tuple[Any, ...]:
    """List a response as a row keeps it."""
    r = response
    return int(r.outcome), int(r.decided_by), r.peak_tilt, r.final_tilt, r.slip, r.steps


KIND = Kind("runs", "runs", RunRow, simulate_batch, batch=40)
ON_TERRAIN = Kind("runs", "runs", TerrainRow, respond_batch, batch=40)


class Runs(StoredRuns):
    """The runs of a study, each up to where its outcome is decided."""


def kind(*, on_terrain: bool) -> Kind[Any]:
    """Runs on a flat pedestal or on a terrain."""
    return ON_TERRAIN if on_terrain else KIND


class LevelRuns(Runs):
    """The runs of a study without the vertical components of its records."""


def make(work: Work, study: Study) -> Product:
    """Do the missing runs."""
    return run_study(work, study, kind(on_terrain=study.settings.on_terrain))


def make_level(work: Work, study: Study) -> Product:
    """Do the missing runs without the vertical components."""
    return run_study(work, LevelStudy.of(study), kind(on_terrain=study.settings.on_terrain))
