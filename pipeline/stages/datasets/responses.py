"""Responses: the stored runs as a dataset on (yaw, friction, PGV/PGA or record, PGA)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
import yaml

from pipeline.config.schema import Config
from pipeline.stages.datasets.stored_runs import moved, stored, tally
from pipeline.stages.motions.motion_grid import FILE as MOTIONS
from pipeline.stages.motions.motion_grid import Shaking
from pipeline.stages.motions.motions import MEASURES
from pipeline.stages.runs.overturning_runs import kind
from pipeline.stages.runs.scenes import flat_case, left_out
from pipeline.stages.runs.step_choice import FILE as TIME_STEP
from pipeline.stages.runs.study import Study, load_study
from pipeline.workflow import writers
from pipeline.workflow.datasets import described, netcdf, read
from pipeline.workflow.stage import Job, Product
from vsr_core.outcome import Outcome

FILE = "responses.nc"

_ASKED_OF_RUNS = {"observed_boulder", "hazard", "uncertainty"}
"""Sections that change no run: the products that they decide hold them."""

_TYPES = {
    "outcome": "i1",
    "movement": "i1",
    "decided_by": "i1",
    "peak_tilt": "f8",
    "final_tilt": "f8",
    "slip": "f8",
    "steps": "i4",
}


def make(job: Job) -> Product:
    """Assemble the responses.

    Returns
    -------
    Product
        ``responses.nc`` and the resolved configuration.
    """
    config = job.config
    study = load_study(config, job.store)
    runs = stored(job, kind(config), study)
    in_air = runs.pop("air_share") if config.on_terrain else np.full(len(runs), np.nan)
    runs = runs.assign(movement=moved(job, runs, np.asarray(in_air, dtype=float)))
    summary, unresolved = tally(runs["outcome"])
    dataset = _dataset(study, runs).assign_coords(_measures(job, study.motions))
    measured = read(job.path(TIME_STEP))
    for name in ("time_step", "boundary_error", "boundary_error_worst"):
        dataset[name] = ("friction", measured[name].values)
    reductions = left_out(config, flat_case(study.scenes, study.groups[0]))
    dataset.attrs["left_out"] = "\n".join(map(str, reductions))
    dataset.attrs["left_out_names"] = " ".join(r.reduction.name.lower() for r in reductions)
    settings = settings_of_runs(config)
    files = {
        FILE: netcdf(described(dataset, job, "Overturning responses")),
        "config.yaml": writers.text(f"# resolved configuration of {job.site.origin}\n{settings}"),
    }
    return Product(files, summary, unresolved=unresolved)


def settings_of_runs(config: Config) -> str:
    """Every setting that decides runs, or what is said of them, as YAML."""
    settings = config.model_dump(mode="json", exclude=_ASKED_OF_RUNS)
    return yaml.safe_dump(settings, sort_keys=False)


def _dataset(study: Study, runs: pd.DataFrame) -> xr.Dataset:
    """The runs on (yaw, friction, PGV/PGA or record, PGA)."""
    config, motions = study.scenes.config, study.motions
    coordinates = {
        "yaw": list(config.yaw),
        "friction": list(config.contact.friction),
        motions.dimension: list(motions.rows),
        "pga": list(motions.pga),
    }
    overturned = np.array([outcome.overturned for outcome in Outcome], "i1")[runs["outcome"]]
    arrays = {name: runs[name].to_numpy(dtype) for name, dtype in _TYPES.items()}
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


def _measures(job: Job, motions: Shaking) -> dict[str, Any]:
    """Intensity measures of records, as coordinates along them."""
    if motions.dimension != "record":
        return {}
    data = read(job.path(MOTIONS))
    known = (name for name in MEASURES.values() if name in data)
    return {name: ("record", data[name].values) for name in known}
