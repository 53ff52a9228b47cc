"""Runs: the outcome of every cell of the grid that is not stored yet."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from pipeline.stages.mesh.products import RockData
from pipeline.stages.motions.motion_grid import Cell, Shaking
from pipeline.stages.runs import lines
from pipeline.stages.runs.lines import Line
from pipeline.stages.runs.runner import LARGEST_BATCH, Kind, StoredRuns, Wanted
from pipeline.stages.runs.scenes import Group
from pipeline.stages.runs.study import LevelStudy, Study, run_study
from pipeline.workflow.rows import LineRow, RunRow, TerrainRow
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


def line_batch(
    shared: tuple[Case | TerrainCase, Settings, Shaking, float], batch: tuple[Line, ...]
) -> list[tuple[Any, ...]]:
    """Simulate the responses along some lines, on a worker."""
    place, settings, motions, no_return = shared
    simulate: Any = respond_batch if isinstance(place, TerrainCase) else simulate_batch
    rows = []
    for line in batch:
        cells = tuple(Cell(line.row, pga) for pga in motions.pga)
        parts = (cells[at : at + LARGEST_BATCH] for at in range(0, len(cells), LARGEST_BATCH))
        own = (place, settings, motions)
        runs = np.concatenate([np.array(simulate(own, part)) for part in parts])
        sample = lines.sampled(line, len(cells))
        rows.append((lines.worst(runs), lines.packed(runs, sample, no_return)))
    return rows


KIND = Kind("runs", "runs", RunRow, simulate_batch, batch=40)
ON_TERRAIN = Kind("runs", "runs", TerrainRow, respond_batch, batch=40)
LINES = Kind("runs", "runs", LineRow, line_batch, batch=40)


class Runs(StoredRuns):
    """The runs of a study, each up to where its outcome is decided."""


def kind(*, on_terrain: bool) -> Kind[Any]:
    """Runs on a flat pedestal or on a terrain."""
    return ON_TERRAIN if on_terrain else KIND


def grid_runs(study: Study) -> tuple[Kind[Any], Wanted[Group]]:
    """The runs of a study's grid as they are kept: each, or by rows of the grid."""
    if study.settings.simulation.keep == "all":
        return kind(on_terrain=study.settings.on_terrain), study.wanted
    cells = len(study.motions.pga)
    return replace(LINES, cells=cells, outcomes=partial(lines.outcomes, cells=cells)), study.lines


def shared(study: Study, rock: RockData) -> Callable[[Group], Any]:
    """From a group to what the runs of its grid share."""
    if study.settings.simulation.keep == "all":
        return study.shared
    return lambda group: (*study.shared(group), rock.no_return)


class LevelRuns(Runs):
    """The runs of a study without the vertical components of its records."""


def make(work: Work, study: Study, rock: RockData) -> Product:
    """Do the missing runs."""
    return run_study(work, study, *grid_runs(study), shared(study, rock))


def make_level(work: Work, study: Study, rock: RockData) -> Product:
    """Do the missing runs without the vertical components."""
    return make(work, LevelStudy.of(study), rock)
