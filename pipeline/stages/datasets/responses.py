"""Responses: the stored runs as a dataset on (yaw, friction, PGV/PGA or record, PGA)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from pipeline.stages.datasets.stored_runs import moved, stored, tally, with_peaks
from pipeline.stages.datasets.vertical import VARIABLE, without
from pipeline.stages.mesh.products import RockData
from pipeline.stages.motions import motion_grid
from pipeline.stages.motions.motions import MEASURES
from pipeline.stages.runs.overturning_runs import LevelRuns, Runs, kind
from pipeline.stages.runs.quantity_errors import beside
from pipeline.stages.runs.scenes import flat_case, left_out
from pipeline.stages.runs.step_choice import StepData
from pipeline.stages.runs.study import Study
from pipeline.workflow.datasets import Stored, described, netcdf
from pipeline.workflow.stage import Product, Work
from vsr_core.outcome import AT_REST, Outcome


class Responses(Stored):
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
}


def make(
    work: Work,
    study: Study,
    runs: Runs,
    level: LevelRuns | None,
    rock: RockData,
    measured: StepData,
) -> Product:
    """Assemble the responses."""
    settings, one_way = study.settings, motion_grid.one_way(study.motions)
    table = stored(runs.database, kind(on_terrain=settings.on_terrain), study)
    in_air = table.pop("air_share") if settings.on_terrain else np.full(len(table), np.nan)
    table = table.assign(movement=moved(rock, table, np.asarray(in_air, dtype=float)))
    table = with_peaks(table, on_terrain=settings.on_terrain)
    summary, unresolved = tally(table["outcome"])
    if level is not None:
        table = table.assign(**{VARIABLE: without(level, study)})
    dataset = _dataset(study, table).assign_coords(_measures(study))
    for name in ("time_step", "boundary_error", "boundary_error_worst"):
        dataset[name] = ("friction", measured.data[name].values)
    dataset = beside(dataset, measured.data, AT_REST)
    case = flat_case(study.scenes, study.groups[0])
    reductions = left_out(settings, case, one_way=one_way)
    dataset.attrs["left_out"] = "\n".join(map(str, reductions))
    dataset.attrs["left_out_names"] = " ".join(r.reduction.name.lower() for r in reductions)
    files = {Responses.FILE: netcdf(described(dataset, work, "Overturning responses"))}
    return Product(files, summary, unresolved=unresolved)


def _dataset(study: Study, runs: pd.DataFrame) -> xr.Dataset:
    """The runs on (yaw, friction, PGV/PGA or record, PGA)."""
    motions = study.motions
    coordinates = {
        "yaw": list(study.yaw),
        "friction": list(study.settings.contact.friction),
        motions.dimension: list(motions.rows),
        "pga": list(motions.pga),
    }
    overturned = np.array([outcome.overturned for outcome in Outcome], "i1")[runs["outcome"]]
    arrays = {name: runs[name].to_numpy(dtype) for name, dtype in TYPES.items() if name in runs}
    shape = tuple(map(len, coordinates.values()))
    dataset = xr.Dataset(
        {
            name: (tuple(coordinates), array.reshape(shape))
            for name, array in (arrays | {"overturned": overturned}).items()
        },
        coordinates,
    )
    for variable in dataset.data_vars.values():
        fill = -1 if variable.dtype.kind == "i" else np.nan
        variable.encoding["_FillValue"] = variable.dtype.type(fill)
    return dataset


def _measures(study: Study) -> dict[str, Any]:
    """Intensity measures of records, as coordinates along them."""
    if study.motions.dimension != "record":
        return {}
    data = study.motion_data.data
    known = (name for name in MEASURES.values() if name in data)
    return {name: ("record", data[name].values) for name in known}
