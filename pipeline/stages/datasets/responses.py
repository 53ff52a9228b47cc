"""Responses: the stored runs as a dataset on (yaw, friction, PGV/PGA or record, PGA)."""

from __future__ import annotations

from contextlib import closing
from typing import Any

import numpy as np
import xarray as xr
import yaml

from pipeline.config.problems import InputError, Problem
from pipeline.stages.motions import shaking
from pipeline.stages.motions.motions import MEASURES
from pipeline.stages.motions.shaking import FILE as MOTIONS
from pipeline.stages.motions.shaking import Shaking
from pipeline.stages.runs.running import groups
from pipeline.stages.runs.scenes import left_out, prepared
from pipeline.stages.runs.step_choice import FILE as TIME_STEP
from pipeline.workflow.datasets import described, netcdf, read
from pipeline.workflow.stage import Job, Product
from pipeline.workflow.store import RUNS, RunRow, RunStore
from vsr_core.outcome import Outcome

FILE = "responses.nc"

_TYPES = {
    "outcome": ("i1", -1),
    "decided_by": ("i1", -1),
    "peak_tilt": ("f8", float("nan")),
    "final_tilt": ("f8", float("nan")),
    "slip": ("f8", float("nan")),
    "steps": ("i4", -1),
}


def make(job: Job) -> Product:
    """Assemble the responses."""
    config = job.config
    motions = shaking.of_store(config, job.store)
    dimensions = ("yaw", "friction", motions.dimension, "pga")
    arrays = _arrays(job, motions)
    arrays["overturned"] = np.array([o.overturned for o in Outcome], dtype="i1")[arrays["outcome"]]
    coordinates = {
        "yaw": list(config.yaw),
        "friction": list(config.contact.friction),
        motions.dimension: list(motions.rows),
        "pga": list(motions.pga),
        **_measures(job, motions),
    }
    dataset = xr.Dataset({name: (dimensions, array) for name, array in arrays.items()}, coordinates)
    for name, array in arrays.items():
        fill = -1 if array.dtype.kind == "i" else np.nan
        dataset[name].encoding["_FillValue"] = array.dtype.type(fill)
    case = prepared(config, job.store, config.yaw[0], config.contact.friction[0])
    measured = read(job.path(TIME_STEP))
    for name in ("time_step", "boundary_error", "boundary_error_worst"):
        dataset[name] = ("friction", measured[name].values)
    dataset.attrs["left_out"] = "\n".join(f"{r.what}: {r.why}" for r in left_out(config, case))
    counts = np.bincount(arrays["outcome"].ravel(), minlength=len(Outcome))
    summary = ", ".join(f"{counts[o]} {o.name.lower()}" for o in Outcome if counts[o])
    files = {
        FILE: netcdf(described(dataset, job, "Overturning responses")),
        "config.yaml": lambda path: _write_config(path, job),
    }
    unresolved = int(sum(counts[o] for o in Outcome if o.overturned == -1))
    return Product(files, summary, unresolved=unresolved)


def _measures(job: Job, motions: Shaking) -> dict[str, Any]:
    """Intensity measures of records, as coordinates along them."""
    if motions.dimension != "record":
        return {}
    data = read(job.path(MOTIONS))
    known = (name for name in MEASURES.values() if name in data)
    return {name: ("record", data[name].values) for name in known}


def _arrays(job: Job, motions: Shaking) -> dict[str, Any]:
    config = job.config
    shape = tuple(map(len, (config.yaw, config.contact.friction, motions.rows, motions.pga)))
    arrays = {name: np.full(shape, fill, dtype) for name, (dtype, fill) in _TYPES.items()}
    with closing(RunStore(job.store.folder, RunRow)) as runs:
        for number, group in enumerate(groups(config, job.store)):
            stored = runs.get(group.keys)
            lost = sum(key not in stored for key in group.keys)
            if lost:
                raise _lost(job, lost)
            place = np.unravel_index(number, shape[:2])
            for name, (dtype, fill) in _TYPES.items():
                column = RunRow._fields.index(name)
                values = (stored[key][column] for key in group.keys)
                cells = [fill if value is None else value for value in values]
                arrays[name][place] = np.array(cells, dtype).reshape(shape[2:])
    return arrays


def _lost(job: Job, lost: int) -> InputError:
    job.store.forget("runs")
    file = str(job.store.folder / RUNS)
    return InputError(
        Problem(
            file,
            "",
            f"{lost} runs fewer than were done",
            "no run gets lost",
            "start again to redo them",
        )
    )


def _write_config(path: Any, job: Job) -> None:
    text = yaml.safe_dump(job.config.model_dump(mode="json"), sort_keys=False)
    path.write_text(f"# resolved configuration of {job.site.file}\n{text}", encoding="utf-8")
