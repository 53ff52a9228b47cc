"""Fragility: models fitted to the responses of each yaw and friction, compared and named."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
import pandas as pd
import xarray as xr
from threadpoolctl import threadpool_limits

from pipeline.stages.boundary.boundary import BoundaryData, runs_of
from pipeline.stages.datasets.responses import Responses
from pipeline.stages.fragility.summary import SEARCHED, TABLE, Fits
from pipeline.workflow import writers
from pipeline.workflow.datasets import described, netcdf, rows_of
from pipeline.workflow.stage import Product, Work
from vsr_core.arrays import Array
from vsr_core.fragility import FragilityResult, ModelFit, fit_all

_COLUMNS = ["yaw_deg", "friction", "toppled_share", "model", "recommended", "log_loss", "brier",
            "accuracy", "separated", "method", "quantity", "pgv_pga_s", "value", "lower",
            "upper"]  # fmt: skip

_Found = dict[tuple[int, int], FragilityResult]


def make(work: Work, responses: Responses, boundary: BoundaryData) -> Product:
    """Fit every model to the boundary of every yaw and friction."""
    data = responses.data
    fits = _fit(data, boundary.data, work.cluster.workers)
    dataset = _dataset(data, fits)
    dataset.attrs |= {name: boundary.data.attrs[name] for name in SEARCHED}
    table = _table(dataset, fits)
    names = [_recommended(fit) for fit in fits.values()]
    best = ", ".join(f"{name} for {names.count(name)}" for name in sorted(set(names)))
    files = {Fits.FILE: netcdf(described(dataset, work, "Fragility")), TABLE: writers.table(table)}
    return Product(files, f"grids fitted: {len(fits)}; recommended: {best}")


def _fit(data: xr.Dataset, boundary: xr.Dataset, workers: int) -> _Found:
    """Fits by position of yaw and friction; none where no run is resolved."""
    overturned = data["overturned"].values
    decided = [at for at in np.ndindex(overturned.shape[:2]) if (overturned[at] >= 0).any()]
    fit = partial(fit_all, data["pga"].values, data["pgv_pga"].values)
    grids, runs = (
        (overturned[at] for at in decided),
        (runs_of(boundary, data, at) for at in decided),
    )
    # in threads, as all but a little of a fit is linear algebra
    with threadpool_limits(1), ThreadPoolExecutor(max(workers, 1)) as pool:
        return dict(zip(decided, pool.map(fit, grids, runs), strict=True))


def _recommended(fit: FragilityResult) -> str:
    """The model for the log, or that there are too few levels of PGV/PGA to compare models."""
    compared = all(np.isfinite(one.scores.log_loss) for one in fit.models)
    few = compared or fit.recommended == "none"
    return fit.recommended if few else f"{fit.recommended} (too few PGV/PGA levels to compare)"


def _dataset(data: xr.Dataset, fits: _Found) -> xr.Dataset:
    """All fits on (yaw, friction); NaN and empty texts where there is none."""
    row, overturned = rows_of(data), data["overturned"].drop_attrs().drop_encoding()
    groups = {place: _group(fit, row) for place, fit in fits.items()}
    if len(groups) < overturned["yaw"].size * overturned["friction"].size:
        nothing = np.zeros(overturned.shape[2:])  # any grid has the form of those without a fit
        form = _group(fit_all(data["pga"].values, data["pgv_pga"].values, nothing), row)
        empty = form.map(lambda part: xr.full_like(part, "" if part.dtype.kind == "U" else np.nan))
        groups = dict.fromkeys(np.ndindex(overturned.shape[:2]), empty) | groups
    nested = [[groups[i, k] for i in range(len(overturned))] for k in range(overturned.shape[1])]
    dataset = xr.combine_nested(nested, ["friction", "yaw"], combine_attrs="drop")
    decided = (overturned >= 0).sum(overturned.dims[2:])
    toppled = (overturned == 1).sum(overturned.dims[2:])
    dataset["toppled_share"] = (toppled / decided.where(decided > 0)).variable
    dataset = dataset.assign_coords(overturned.coords)
    return dataset.assign_coords(bound=["lower", "upper"], parameter=["b0", "b1", "b2"])


def _group(fit: FragilityResult, row: str) -> xr.Dataset:
    """What was learnt from the grid of one yaw and friction."""
    edge = fit.boundary
    grid = {
        "first_overturning_pga": (row, edge.pga),
        "first_overturning_pga_lower": (row, edge.lower),
        "first_overturning_pga_upper": (row, edge.upper),
        "censored": (row, edge.censored.astype(float)),
        "islands": (row, edge.islands.astype(float)),
        "clusters": ((), float(edge.cluster_sizes.size)),
        "recommended": ((), fit.recommended),
        "reason": ((), fit.reason),
    }
    line = fit.model("logistic").parameters
    parameters = {
        "coefficient": ("parameter", [one.value for one in line]),
        "coefficient_interval": (("parameter", "bound"), [(one.lower, one.upper) for one in line]),
    }
    for one in fit.model("lognormal").parameters:
        parameters[one.name] = (row, one.value)
        parameters[f"{one.name}_interval"] = ((row, "bound"), _pair(one.lower, one.upper))
    names = xr.Variable("model", [model.name for model in fit.models])
    models = xr.concat([_model(model, row) for model in fit.models], names)
    return xr.merge([xr.Dataset(grid | parameters), models])


def _model(model: ModelFit, row: str) -> xr.Dataset:
    scores = model.scores
    median = _pair(model.median_lower, model.median_upper)
    return xr.Dataset(
        {
            "median_pga": (row, model.median),
            "median_pga_interval": ((row, "bound"), median),
            "band_pga": ((row, "bound"), _pair(model.band_low, model.band_high)),
            "probability": ((row, "pga"), model.probability.astype("f4")),
            "separated": float(model.separated),
            "log_loss": scores.log_loss,
            "log_loss_error": scores.log_loss_se,
            "brier": scores.brier,
            "accuracy": scores.accuracy,
            "method": model.method,
        }
    )


def _pair(lower: Array, upper: Array) -> Array:
    return np.stack([lower, upper], axis=-1)


def _table(dataset: xr.Dataset, fits: _Found) -> pd.DataFrame:
    """The boundary's rows, then those of each model, of each yaw and friction."""
    rows = {"pgv_pga_s": dataset["pgv_pga"].values.astype(str)}
    if rows_of(dataset) == "record":
        rows["record"] = dataset["record"].values
    parts = [pd.DataFrame(columns=[*_COLUMNS, *list(rows)[1:]])]
    for (i, k), fit in fits.items():
        one = dataset.isel(yaw=i, friction=k)
        edge = fit.boundary
        found = [_quantity(rows, "first_overturning_pga_g", edge.pga, edge.lower, edge.upper)]
        found[0]["model"] = "runs"
        found += [_of_model(rows, model, fit.recommended) for model in fit.models]
        group = {"yaw_deg": str(one["yaw"].item()), "friction": str(one["friction"].item())}
        share = f"{one['toppled_share'].item():.4f}"
        parts.append(pd.concat(found).assign(**group, toppled_share=share))
    table = pd.concat(parts)
    words = table.columns.difference(["value", "lower", "upper"])
    return table.fillna(dict.fromkeys(words, ""))


def _of_model(rows: dict[str, Array], model: ModelFit, recommended: str) -> pd.DataFrame:
    found = [_quantity(rows, p.name, p.value, p.lower, p.upper) for p in model.parameters]
    median = (model.median, model.median_lower, model.median_upper)
    found.append(_quantity(rows, "median_pga_g", *median))
    scores = {
        name: f"{getattr(model.scores, name):.5f}" for name in ("log_loss", "brier", "accuracy")
    }
    return pd.concat(found).assign(
        model=model.name,
        recommended=str(int(model.name == recommended)),
        **scores,
        separated=str(int(model.separated)),
        method=model.method,
    )


def _quantity(rows: dict[str, Array], name: str, *ends: Array) -> pd.DataFrame:
    """Value, lower and upper end of a quantity, for each row or for the whole grid."""
    columns = dict(zip(("value", "lower", "upper"), map(np.atleast_1d, ends), strict=True))
    return pd.DataFrame({**(rows if ends[0].ndim else {}), **columns, "quantity": name})
