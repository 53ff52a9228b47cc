"""The datasets of all members of a sweep as one, along the dimensions of the sweep."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import xarray as xr

from pipeline.config.sweep import GRIDS, Dimension, Sweep
from pipeline.stages.datasets.responses import Responses
from pipeline.stages.fragility.products import Fits
from pipeline.stages.mesh.products import Standing
from pipeline.stages.studies.sweeps.changes import quantity
from pipeline.workflow.datasets import described, read
from pipeline.workflow.registry import upstream
from pipeline.workflow.stage import Job, Work
from pipeline.workflow.sweeps import Swept
from vsr_core.rock.solid import standing
from vsr_core.rock.tipping import tipping

TITLE = "Study"


def stacked(swept: Swept, work: Work) -> xr.Dataset:
    """Stack the products of all members.

    Returns
    -------
    Dataset
        What the product of each member holds, along the dimensions of the sweep; rows of one
        member that others do not have are filled.
    """
    sweep = swept.sweep
    parts = [_member(swept, member.place) for member in sweep.members]
    common = set.intersection(*(set(part.data_vars) for part in parts))
    parts = [part[[name for name in part.data_vars if name in common]] for part in parts]
    ragged = _ragged(parts)
    parts = [part.drop_dims(ragged) for part in parts]
    data = _nested(parts, sweep.parted)
    data = described(data, work, TITLE)
    for name, variable in data.data_vars.items():
        filled = variable.dtype.kind in "if"
        data[name].encoding = {"_FillValue": _fill(variable)} if filled else {}
    return _named(data, sweep)


def _member(swept: Swept, place: tuple[int, ...]) -> xr.Dataset:
    """What one member's product holds, each coordinate of a grid a dimension."""
    job = swept.jobs[place]
    parts = [read(job.path(name)) for name in _files(job, swept.stage)]
    data = xr.merge(parts, combine_attrs="drop", compat="override").drop_encoding()
    if "record" in data.dims and len(set(data["pgv_pga"].values.tolist())) == data.sizes["record"]:
        data = data.swap_dims(record="pgv_pga").reset_coords("record")
    if "yaw" in data.dims and job.store.manifest("rock"):
        data = data.merge(_rock(job, data["yaw"]))
    swept_keys = {key for one in swept.sweep.parted for key in one.values}
    alone = [dim for key, dim in GRIDS.items() if key in swept_keys and data.sizes.get(dim) == 1]
    data = data.squeeze(alone, drop=True)
    return data.reset_coords()


def _files(job: Job, stage: str) -> tuple[str, ...]:
    """The datasets that a member's product ends with."""
    for one in reversed(upstream(stage)):
        files = (job.store.manifest(one.name) or {"files": {}})["files"]
        found = tuple(sorted(name for name in files if name.endswith(".nc")))
        if found and one.name != "bullet_sample":
            return (Responses.FILE, Fits.FILE) if Fits.FILE in found else found
    return ()


def _rock(job: Job, yaw: xr.DataArray) -> xr.Dataset:
    """Size of the rock, and the steady acceleration that topples it along the shaking."""
    rock = Standing.load(job.store).rock
    level = standing(rock) if job.config.on_terrain else rock
    along = np.radians([-yaw.values, 180.0 - yaw.values])
    weakest = [tipping(level.hull, pair).overturning.min() for pair in along.T]
    return xr.Dataset({"rock_radius": rock.radius, "static_pga": ("yaw", weakest)}, {"yaw": yaw})


def _ragged(parts: list[xr.Dataset]) -> list[str]:
    """Dimensions without coordinates that are not of one length."""
    sizes: dict[str, set[int]] = {}
    for part in parts:
        for name, size in part.sizes.items():
            if name not in part.indexes:
                sizes.setdefault(str(name), set()).add(size)
    return [name for name, found in sizes.items() if len(found) > 1]


def _nested(parts: list[xr.Dataset], dimensions: tuple[Dimension, ...]) -> xr.Dataset:
    """Members along the dimensions, the last of which runs fastest."""
    if not dimensions:
        return parts[0]
    first, *others = dimensions
    each = len(parts) // len(first.labels)
    rows = [_nested(parts[n : n + each], tuple(others)) for n in range(0, len(parts), each)]
    fills = {str(name): _fill(variable) for name, variable in rows[0].data_vars.items()}
    return xr.concat(
        rows, first.name, data_vars="all", join="outer", fill_value=fills, combine_attrs="drop"
    )


def _fill(variable: xr.DataArray) -> Any:
    """What stands where a member has no value."""
    return {"i": variable.dtype.type(-1) if variable.dtype.kind == "i" else -1, "U": ""}.get(
        variable.dtype.kind, np.nan
    )


def _named(data: xr.Dataset, sweep: Sweep) -> xr.Dataset:
    """The dataset with a coordinate for each dimension of the sweep."""
    for one in sweep.dimensions:
        if one.gridded and one.name != GRIDS[one.key]:
            data = data.rename({GRIDS[one.key]: one.name})
        values = list(one.values[one.key]) if one.is_numeric else list(one.labels)
        text, unit = quantity(one.key)
        attributes = {"long_name": text, "units": unit, "keys": ", ".join(one.values)}
        data = data.assign_coords({one.name: (one.name, values, attributes)})
    told = {one.name: {key: list(v) for key, v in one.values.items()} for one in sweep.dimensions}
    data.attrs["vsr_sweep_json"] = json.dumps(told, sort_keys=True)
    return data
