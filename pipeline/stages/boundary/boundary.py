"""Boundary: each change of outcome along PGA, resolved by runs between the cells of the grid."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from pipeline.config.fragility_schema import FINE, FragilityConfig
from pipeline.stages.boundary.resolution import widths
from pipeline.stages.boundary.search import Search
from pipeline.stages.datasets.responses import TYPES, Responses
from pipeline.stages.datasets.stored_runs import SIDES, with_peaks
from pipeline.stages.runs.overturning_runs import kind
from pipeline.stages.runs.scenes import reach
from pipeline.stages.runs.step_choice import StepData
from pipeline.stages.runs.study import Study
from pipeline.workflow.datasets import Stored, described, netcdf, rows_of
from pipeline.workflow.grammar import counted
from pipeline.workflow.stage import Product, Work
from vsr_core.fragility.bisection import Known, changes, first_changes, middles, of_grid
from vsr_core.outcome import Outcome


class BoundaryData(Stored):
    """Intervals of all changes of outcome along PGA, and the runs that resolved them."""

    FILE = "boundary.nc"


def make(
    work: Work, study: Study, responses: Responses, measured: StepData, config: FragilityConfig
) -> Product:
    """Resolve the changes of outcome of every direction, friction and row."""
    key, data = "fragility.resolution", responses.data
    width = widths(config.resolution, FINE, measured, work.origin, key)
    overturned = data["overturned"].values
    of_level = np.broadcast_to(width[:, None], overturned.shape[:3]).ravel()
    notes: list[dict[str, Any]] = []
    search = Search(replace(work, note=lambda **facts: notes.append(facts)), study)
    levels = overturned.reshape(-1, overturned.shape[-1])
    pga = data["pga"].values  # which may reach further than is looked for a boundary beyond it
    highest = min(config.highest, reach(study.scenes))  # beyond, a table only seems to be shaken
    bounds = min(config.lowest, float(pga[0])), max(highest, float(pga[-1]))
    known = search.resolved(levels, np.log1p(of_level), bounds)
    _note(work, notes)
    dataset = _dataset(data, known, search).assign(boundary_resolution=("friction", width))
    dataset["boundary_error"] = ("friction", measured.data["boundary_error"].values)
    dataset.attrs |= {"searched_from_g": bounds[0], "searched_to_g": bounds[1]}
    files = {BoundaryData.FILE: netcdf(described(dataset, work, "Overturning boundary"))}
    unresolved = int((dataset["outcome"].values >= Outcome.UNSETTLED).sum())
    summary = _summary(dataset, search.rounds)
    return Product(files, summary, unresolved=unresolved, retry=search.crashed)


def runs_of(boundary: xr.Dataset, responses: xr.Dataset, place: tuple[int, int]) -> Known:
    """All runs of one yaw and friction that tell of a change, each row a level.

    Parameters
    ----------
    place : tuple of int, of yaw and friction
    """
    grid, pga = responses["overturned"].values[place], responses["pga"].values
    at = zip(("yaw", "friction"), place, strict=True)
    own = [boundary[f"run_{name}"].values == responses[name].values[n] for name, n in at]
    here = np.flatnonzero(own[0] & own[1])
    row, peaks, outcome = (boundary[n].values[here] for n in ("run_row", "run_pga", "outcome"))
    beside = np.zeros((len(grid), max(len(pga) - 1, 0)), dtype=bool)
    inside = np.flatnonzero((peaks > pga[0]) & (peaks < pga[-1]))
    beside[row[inside], np.searchsorted(pga, peaks[inside]) - 1] = True
    return of_grid(pga, grid, beside).joined(row, peaks, SIDES[outcome])


def _note(work: Work, notes: list[dict[str, Any]]) -> None:
    """What the rounds cost together."""
    if notes:
        spent = ("runs", "seconds", "cpu_seconds")
        work.note(**{name: sum(one[name] for one in notes) for name in spent},
                  engine=work.engine, workers=notes[-1]["workers"])  # fmt: skip


def _dataset(data: xr.Dataset, known: Known, search: Search) -> xr.Dataset:
    dims = ("yaw", "friction", rows_of(data))
    shape = tuple(data.sizes[dim] for dim in dims)
    lower, upper = first_changes(known, int(np.prod(shape)))
    found = changes(known)
    row = kind(on_terrain=search.study.settings.on_terrain).row
    table = pd.DataFrame(search.rows, columns=row._fields)
    table = with_peaks(table, on_terrain=search.study.settings.on_terrain)
    runs = {name: table[name].to_numpy(dtype) for name, dtype in TYPES.items() if name in table}
    level, pga, probe = (np.array(part) for part in zip(*search.places, strict=True)) if (
        search.places
    ) else (np.zeros(0, int), np.zeros(0), np.zeros(0, bool))  # fmt: skip
    wrong = _wrong(data["overturned"].values, data["pga"].values, level, pga, runs["outcome"])
    first = {"": middles(lower, upper), "_lower": lower, "_upper": upper}
    dataset = xr.Dataset(
        {
            **{f"first_overturning_pga{end}": (dims, part.reshape(shape))
               for end, part in first.items()},
            "changes": (dims, np.bincount(found.level, minlength=lower.size)
                        .reshape(shape).astype("i4")),
            **_placed("change", data, found.level),
            "change_lower": ("change", found.lower),
            "change_upper": ("change", found.upper),
            "change_rises": ("change", found.rises.astype("i1")),
            **_placed("run", data, level),
            "run_pga": ("run", pga),
            "run_probe": ("run", probe.astype("i1")),
            **{name: ("run", values) for name, values in runs.items()},
            "probes": (dims[:2], _counted(level[probe], shape)),
            "probes_wrong": (dims[:2], _counted(level[probe & wrong], shape)),
        },
        {name: data[name].drop_attrs().drop_encoding() for name in (*dims, "pgv_pga")},
    )  # fmt: skip
    for name, values in runs.items():  # of a run that crashed there is its outcome alone
        fill = -1 if values.dtype.kind == "i" else np.nan
        dataset[name].encoding["_FillValue"] = values.dtype.type(fill)
    return dataset


def _placed(name: str, data: xr.Dataset, level: Any) -> dict[str, Any]:
    """Direction, friction and number of the row of some levels."""
    row = rows_of(data)
    shape = tuple(data.sizes[dim] for dim in ("yaw", "friction", row))
    yaw, friction, place = np.unravel_index(level, shape)
    return {
        f"{name}_yaw": (name, data["yaw"].values[yaw]),
        f"{name}_friction": (name, data["friction"].values[friction]),
        f"{name}_row": (name, place.astype("i4")),
    }


def _counted(level: Any, shape: tuple[int, ...]) -> Any:
    """Levels of each direction and friction among some."""
    return np.bincount(level // shape[2], minlength=shape[0] * shape[1]).reshape(shape[:2])


def _wrong(overturned: Any, grid: Any, level: Any, pga: Any, outcome: Any) -> Any:
    """Which runs end otherwise than the cell below them."""
    cells = overturned.reshape(-1, len(grid))
    below = np.clip(np.searchsorted(grid, pga) - 1, 0, len(grid) - 1)
    return (SIDES[outcome] >= 0) & (SIDES[outcome] != cells[level, below])


def _summary(dataset: xr.Dataset, rounds: int) -> str:
    width = np.log(dataset["change_upper"].values / dataset["change_lower"].values)
    probes, wrong = (int(dataset[name].sum()) for name in ("probes", "probes_wrong"))
    parts = [
        f"changes of outcome along PGA: {len(width)}",
        f"{counted(dataset.sizes['run'], 'run')} between cells in {counted(rounds, 'round')}",
    ]
    if len(width):
        parts.insert(1, f"resolved to {100 * float(np.median(width)):.2g} % in the median")
    if probes:
        parts.append(f"{wrong} of {counted(probes, 'probe')} differ from the cells around")
    return "; ".join(parts)
