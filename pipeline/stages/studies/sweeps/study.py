"""The study of a sweep: one dataset of all members, and a page that compares them."""

from __future__ import annotations

import json
from os.path import relpath
from typing import Any

import numpy as np
import xarray as xr

from pipeline.config.motion_schema import is_along_x
from pipeline.config.problems import InputError
from pipeline.config.sweep import GRIDS, Dimension, Sweep, taken
from pipeline.drawing.style import svg_uri
from pipeline.stages.datasets.responses import Responses
from pipeline.stages.fragility.summary import Fits
from pipeline.stages.mesh.products import RockData, Standing
from pipeline.stages.motions.motion_grid import MotionData
from pipeline.stages.studies.sweeps import sweep_figures as figures
from pipeline.stages.studies.sweeps.changes import (
    BOUNDARY,
    Change,
    about,
    along,
    changes,
    collapsed,
    headline,
    places,
    quantity,
    spread,
)
from pipeline.workflow import graph, pages, writers
from pipeline.workflow.datasets import described, netcdf, read
from pipeline.workflow.grammar import listed
from pipeline.workflow.registry import upstream
from pipeline.workflow.stage import Job, Product, Work
from pipeline.workflow.sweeps import DATA, PAGE, Swept
from vsr_core.arrays import Array
from vsr_core.rock.solid import standing
from vsr_core.rock.tipping import tipping


def make(swept: Swept, key: str) -> Product:
    """Stack the members of a sweep and compare them.

    Returns
    -------
    Product
        ``study.nc`` and ``study.html``.
    """
    job = swept.job
    data = stacked(swept, graph.work_of("study", key, job))
    dimensions = swept.sweep.dimensions
    compared = [_compared(swept, data, one) for one in dimensions] if BOUNDARY in data else []
    page = {
        "study": swept.sweep.study,
        "site": job.site.name,
        "headline": headline(swept.sweep, [part["sentence"] for part in compared], job.site.name),
        "dimensions": compared,
        "members": _members(swept),
        "sizes": dict(data.sizes),
        "surrogate": _surrogate(swept),
    }
    files = {DATA: netcdf(data), PAGE: writers.text(pages.filled(PAGE, page, job.store.up))}
    sizes = " x ".join(f"{len(one.labels)} {one.name}" for one in dimensions)
    return Product(files, f"{sizes}; {page['headline']}")


def _compared(swept: Swept, data: xr.Dataset, dimension: Dimension) -> dict[str, Any]:
    """What the page shows of one dimension."""
    part = along(data, swept.sweep, dimension)
    found: list[Change] = changes(part, dimension)
    own = collapsed(part)
    apart = spread(own, dimension) if own is not None else None
    others = [one for one in swept.sweep.dimensions if one is not dimension]
    constant = [f"{one.name} {places(one)[one.reference]}" for one in others]
    drawn = {
        "multiples": figures.multiples(part, dimension),
        "over_key": figures.over_key(part, dimension),
        "boundaries": figures.boundaries(part, dimension, own),
    }
    return {
        "name": dimension.name,
        "keys": [(key, quantity(key)[0]) for key in dimension.values],
        "over": _over(part, dimension),
        "changes": found,
        "reference": places(dimension)[dimension.reference],
        "sentence": about(dimension, found, apart, constant),
        "gaps": bool((data["outcome"] < 0).any()),
        "unmeasured": any(np.isnan(one.error) for one in found),
        "panels": min(len(dimension.labels), figures.MOST_PANELS),
        "spread": apart,
        "pictures": {name: svg_uri(figure) for name, figure in drawn.items()},
    }


def _over(part: xr.Dataset, dimension: Dimension) -> str:
    """What curves along a dimension are medians over; nothing where there is one of each."""
    grids = {"yaw": "directions", "friction": "frictions"}
    names = [
        name
        for grid, name in grids.items()
        if part.sizes.get(grid, 1) > 1 and grid != dimension.name
    ]
    return listed(names)


def _members(swept: Swept) -> list[dict[str, str]]:
    """Each member, and the page of its own where its product has one."""
    found = []
    for member in swept.sweep.members:
        folder = swept.jobs[member.place].store.folder
        pages_there = sorted(folder.glob("*.html"))
        page = relpath(pages_there[0], swept.job.store.folder) if pages_there else ""
        found.append({"name": member.name, "page": page})
    return found


def _surrogate(swept: Swept) -> bool:
    """Whether the rock is a surrogate of one that is not public."""
    job = swept.jobs[swept.sweep.reference.place]
    there = job.store.manifest("rock") is not None
    return there and bool(RockData.load(job.store).data.attrs["surrogate"])


TITLE = "Study"


def stacked(swept: Swept, work: Work) -> xr.Dataset:
    """Stack the products of all members.

    Returns
    -------
    Dataset
        What the product of each member holds, along the dimensions of the sweep; rows of one
        member that others do not have are filled. Variables that only some members have, and
        those along other dimensions of several lengths, are left out, and told.
    """
    sweep = swept.sweep
    parts = [_member(swept, member.place) for member in sweep.members]
    parts = _by_record(swept, parts)
    held = [{str(name) for name in part.data_vars} for part in parts]
    common = set.intersection(*held)
    if lost := sorted(set.union(*held) - common):
        work.log(f"{work.stage}: not in {DATA}, as some members have none: {', '.join(lost)}")
    parts = [part[[name for name in part.data_vars if name in common]] for part in parts]
    if ragged := _ragged(parts):
        why = f"as members differ in length: what lies along {listed(ragged)}"
        work.log(f"{work.stage}: not in {DATA}, {why}")
    parts = [part.drop_dims(ragged) for part in parts]
    names = set[Any]().union(*(part.variables.keys() | part.dims for part in parts))
    if wrong := [one.name for one in sweep.parted if one.name in names]:
        raise InputError(*(taken(sweep.file, name) for name in wrong))
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
    if "record" in data.dims:
        ratio = data["pgv_pga"] if "pgv_pga" in data else data["record_pgv_pga"]
        data = data.assign(record_pgv_pga=ratio.variable)
        data["pgv_pga"] = ("record", ratio.values)
        data = data.swap_dims(record="pgv_pga").reset_coords("record")
    if "yaw" in data.dims and job.store.manifest("rock"):
        data = data.merge(_rock(job, data["yaw"]))
    swept_keys = {key for one in swept.sweep.parted for key in one.values}
    alone = [dim for key, dim in GRIDS.items() if key in swept_keys and data.sizes.get(dim) == 1]
    data = data.squeeze(alone, drop=True)
    return data.reset_coords()


def _apart(ratios: Array) -> Array:
    """PGV/PGA of which each is a row: records that share one, such as mirror images, are set apart.

    >>> _apart(np.array([0.2, 0.1, 0.2])).tolist()
    [0.2, 0.1, 0.20000000020000003]
    """
    before = [(ratios[:place] == ratio).sum() for place, ratio in enumerate(ratios)]
    return ratios * (1.0 + 1e-9 * np.array(before))


def _by_record(swept: Swept, parts: list[xr.Dataset]) -> list[xr.Dataset]:
    """Members whose rows are those of the same records, at the PGV/PGA of the reference.

    A record processed otherwise has a PGV/PGA that is a little different, and is the same record;
    another of its name is not. Pulses are rows without a record.
    """
    if not any("record" in part and "pgv_pga" in part.dims for part in parts):
        return parts
    own = [
        _known(swept.jobs[member.place], part)
        for member, part in zip(swept.sweep.members, parts, strict=True)
    ]
    reference, ratios = swept.sweep.members.index(swept.sweep.reference), dict[str, float]()
    for number in (reference, *range(len(parts))):
        found = zip(own[number], parts[number]["pgv_pga"].values, strict=False)
        ratios = dict(found) | ratios
    at = dict(zip(ratios, _apart(np.array([*ratios.values()])), strict=True))
    return [
        part.assign_coords(pgv_pga=[at[record] for record in records])
        if records
        else part.assign(record=("pgv_pga", [""] * part.sizes["pgv_pga"]))
        for part, records in zip(parts, own, strict=True)
    ]


def _known(job: Job, part: xr.Dataset) -> list[str]:
    """What tells the records of a member from others of their names."""
    if "record" not in part:
        return []
    motions = MotionData.load(job.store).data
    found: list[str] = motions["record_digest"].sel(record=part["record"].values).values.tolist()
    return [f"{one} {found[:place].count(one)}" for place, one in enumerate(found)]


def _files(job: Job, stage: str) -> tuple[str, ...]:
    """The datasets that a member's product ends with."""
    for one in reversed(upstream(stage)):
        files = (job.store.manifest(one.name) or {"files": {}})["files"]
        found = tuple(sorted(name for name in files if name.endswith(".nc")))
        if found and one.name != "bullet_sample":
            return (Responses.FILE, Fits.FILE) if Fits.FILE in found else found
    return ()


def _rock(job: Job, yaw: xr.DataArray) -> xr.Dataset:
    """Size of the rock, and the steady acceleration that topples it along x, if shaken so."""
    rock = Standing.load(job.store).rock
    if not is_along_x(job.config.motion.model_dump()):
        return xr.Dataset({"rock_radius": rock.radius})
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
        if one.gridded and GRIDS[one.key] in data and "run" in data[GRIDS[one.key]].dims:
            continue  # each run has its own
        if one.gridded and one.name != GRIDS[one.key]:
            data = data.rename({GRIDS[one.key]: one.name})
        values = list(one.values[one.key]) if one.is_numeric else list(one.labels)
        text, unit = quantity(one.key)
        attributes = {"long_name": text, "units": unit, "keys": ", ".join(one.values)}
        data = data.assign_coords({one.name: (one.name, values, attributes)})
    told = {one.name: {key: list(v) for key, v in one.values.items()} for one in sweep.dimensions}
    data.attrs["vsr_sweep_json"] = json.dumps(told, sort_keys=True)
    return data
