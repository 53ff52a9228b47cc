"""What a dataset holds in a few lines: the rock, how its runs ended, the boundary and its error."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr

from pipeline.stages.datasets.stored_runs import tally
from pipeline.stages.fragility.summary import groups, long_rows_in_words, typical_pga, with_interval
from pipeline.stages.reports.report_tables import about_rock
from pipeline.workflow.datasets import read
from pipeline.workflow.pages import filled
from vsr_core.outcome import Outcome

PAGE = "in_short.html"


def in_short(data: xr.Dataset, path: Path, *, is_of_runs: bool = True) -> str:
    """HTML of a dataset that was read from a product, or is a part of it.

    Parameters
    ----------
    path : Path, of the product, beside which the rock is looked for
    is_of_runs : bool, and of no means over them, nor of places that are not known
    """
    lines = []
    if (rock := path.with_name("rock.nc")).is_file():
        lines.append(("rock", _rock(read(rock))))
    if "outcome" in data and is_of_runs:
        codes = data["outcome"].values
        counts = np.array([np.count_nonzero(codes == outcome) for outcome in Outcome])
        lines.append(("runs", f"{counts.sum():,}: {tally(counts)[0]}"))
    if "first_overturning_pga" in data and is_of_runs:
        lines.append(_boundary(with_places(data)))
    if {"boundary_error", "time_step"} <= {*data.variables}:
        lines.append(("error of the boundary", _error(data)))
    return filled(PAGE, {"title": data.attrs["title"], "lines": lines})


def with_places(data: xr.Dataset) -> xr.Dataset:
    """A dataset of one yaw or friction with these as dimensions, as figures and tables take it."""
    missing = [name for name in ("yaw", "friction") if name not in data.dims]
    return data.expand_dims(missing).transpose("yaw", "friction", ...)


def _rock(rock: xr.Dataset) -> str:
    about = about_rock(rock)
    size = " \N{MULTIPLICATION SIGN} ".join(f"{length:.3g}" for length in about["size"])
    return f"{about['shape_source']}, {size} m, {about['mass_kg']:.4g} kg"


def _boundary(fragility: xr.Dataset) -> tuple[str, str]:
    """The first overturning of the weakest and the strongest yaw and friction."""
    typical = typical_pga(fragility)
    first = np.nan_to_num(typical[0], nan=np.inf)
    places = sorted(groups(fragility), key=lambda one: float(first[one[0]]))
    told = {name: with_interval(*typical[:, *place]) for place, name in places}
    ends = list(told)[:: max(len(told) - 1, 1)]
    name = f"first overturning, median over {long_rows_in_words(fragility['pgv_pga'].values)}"
    return name, " to ".join(f"{told[one]} at {one}" for one in ends)


def _error(data: xr.Dataset) -> str:
    """The largest of all frictions; that of a given time step is not measured."""
    error, step = (np.atleast_1d(data[name].values) for name in ("boundary_error", "time_step"))
    known = error[np.isfinite(error)]
    said = f"{100.0 * known.max():.2g} %" if known.size else "not measured"
    return f"{said}, at a time step of {1e3 * step.max():.3g} ms"
