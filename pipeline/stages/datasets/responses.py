"""Responses: the stored runs as a dataset on (yaw, friction, PGV/PGA or record, PGA)."""

from __future__ import annotations

import os
from collections.abc import Iterator
from itertools import repeat
from typing import Any

import numpy as np
import xarray as xr

from pipeline.stages.datasets import stored_runs
from pipeline.stages.datasets.stored_runs import SIDES, moved, tally, with_peaks
from pipeline.stages.datasets.vertical import VARIABLE, by_parts
from pipeline.stages.mesh.products import RockData
from pipeline.stages.motions import motion_grid
from pipeline.stages.motions.motions import MEASURES
from pipeline.stages.runs import lines
from pipeline.stages.runs.overturning_runs import LevelRuns, Runs
from pipeline.stages.runs.quantity_errors import beside
from pipeline.stages.runs.runner import at_once
from pipeline.stages.runs.scenes import flat_case, left_out
from pipeline.stages.runs.step_choice import StepData
from pipeline.stages.runs.study import Study
from pipeline.workflow import writers
from pipeline.workflow.datasets import Opened, Place, described, netcdf, unwritten
from pipeline.workflow.stage import Product, Work
from pipeline.workflow.store import writing
from vsr_core.arrays import Array, Indices
from vsr_core.outcome import AT_REST, Outcome


class Responses(Opened):
    """What every run of the grid came to."""

    FILE = "responses.nc"


TYPES = {
    "outcome": "i1",
    "movement": "i1",
    "decided_by": "i1",
    "peak_tilt": "f8",
    "final_tilt": "f8",
    "slip": "f8",
    "tilt_until_decided": "f8",
    "slip_until_decided": "f8",
    "steps": "i4",
    VARIABLE: "i1",
    "overturned": "i1",
}


def make(
    work: Work,
    study: Study,
    runs: Runs,
    level: LevelRuns | None,
    rock: RockData,
    measured: StepData,
) -> Product:
    """Assemble the responses, part by part."""
    settings, one_way = study.settings, motion_grid.one_way(study.motions)
    names = [name for name in TYPES if name != VARIABLE or level is not None]
    dataset = _unwritten(study, names).assign_coords(_measures(study))
    for name in ("time_step", "boundary_error", "boundary_error_worst"):
        dataset[name] = ("friction", measured.data[name].values)
    dataset = beside(dataset, measured.data, AT_REST)
    case = flat_case(study.scenes, study.groups[0])
    reductions = left_out(settings, case, one_way=one_way)
    dataset.attrs["left_out"] = "\n".join(map(str, reductions))
    dataset.attrs["left_out_names"] = " ".join(r.reduction.name.lower() for r in reductions)
    if settings.simulation.keep == "boundary":
        dataset.attrs |= {"sampled_share": lines.SHARE, "sampled_seed": lines.SEED}
    dataset = described(dataset, work, "Overturning responses")
    counts = np.zeros(len(Outcome), dtype=int)
    parts = _parts(study, runs, level, rock, counts)
    columns = len(study.motions.pga)
    rows = min(at_once(columns) // columns, len(study.motions.rows))
    part = work.runs / f".part-{os.getpid()}-{work.stage}"  # what a kill leaves goes with others
    try:
        with writing(work.runs):  # while the part still fills the disk
            netcdf(dataset, parts, (1, 1, rows, columns))(part)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
    summary, unresolved = tally(counts)
    return Product({Responses.FILE: writers.moved(part)}, summary, unresolved=unresolved)


def _unwritten(study: Study, names: list[str]) -> xr.Dataset:
    """The grid (yaw, friction, PGV/PGA or record, PGA), and its variables without their values."""
    motions = study.motions
    coordinates = {
        "yaw": list(study.yaw),
        "friction": list(study.settings.contact.friction),
        motions.dimension: list(motions.rows),
        "pga": list(motions.pga),
    }
    shape = tuple(map(len, coordinates.values()))
    grid = {name: unwritten(tuple(coordinates), shape, TYPES[name]) for name in names}
    return xr.Dataset(grid, coordinates)


def _parts(
    study: Study, runs: Runs, level: LevelRuns | None, rock: RockData, counts: Indices
) -> Iterator[tuple[Place, dict[str, Array]]]:
    """Values of the grid, of some rows of a yaw and friction at once.

    Parameters
    ----------
    counts : ndarray of int, shape (outcomes,), to which the runs of each outcome are added
    """
    on_terrain, columns = study.settings.on_terrain, len(study.motions.pga)
    others = repeat(None) if level is None else by_parts(level, study)
    for (place, table), other in zip(stored_runs.parts(runs.database, study), others, strict=False):
        counts += np.bincount(table["outcome"], minlength=len(counts))
        if "movement" not in table:
            in_air = table.pop("air_share") if on_terrain else np.full(len(table), np.nan)
            table = table.assign(movement=moved(rock, table, np.asarray(in_air, dtype=float)))
        table = with_peaks(table, on_terrain=on_terrain)
        table = table.assign(overturned=SIDES[table["outcome"]], **{VARIABLE: other})
        yield (
            place,
            {
                name: table[name].to_numpy(dtype).reshape(-1, columns)
                for name, dtype in TYPES.items()
                if name != VARIABLE or other is not None
            },
        )


def _measures(study: Study) -> dict[str, Any]:
    """Intensity measures of records, as coordinates along them."""
    if study.motions.dimension != "record":
        return {}
    data = study.motion_data.data
    known = (name for name in MEASURES.values() if name in data)
    return {name: ("record", data[name].values) for name in known}
