"""Fragility: models fitted to the responses of each yaw and friction, compared and named."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from tempfile import TemporaryFile
from typing import IO

import numpy as np
import pandas as pd
import xarray as xr
from threadpoolctl import threadpool_limits

from pipeline.stages.boundary.boundary import BoundaryData, runs_of
from pipeline.stages.datasets.responses import Responses
from pipeline.stages.fragility.summary import SEARCHED, TABLE, Fits
from pipeline.stages.runs.runner import at_once
from pipeline.workflow import writers
from pipeline.workflow.datasets import Place, described, netcdf, rows_of, unwritten
from pipeline.workflow.stage import Product, Work
from vsr_core.arrays import Array
from vsr_core.fragility import FragilityResult, ModelFit, fit_all

_COLUMNS = ["yaw_deg", "friction", "toppled_share", "model", "recommended", "log_loss", "brier",
            "accuracy", "separated", "method", "quantity", "unit", "pgv_pga_s", "value",
            "lower", "upper"]  # fmt: skip

_IN_G = ("first_overturning_pga_g", "median_pga_g", "theta")
"""Quantities that are accelerations; the others are pure numbers."""

_CELLS_AT_ONCE = 2**24
"""Cells of the grids that are fitted at once: each takes some 35 bytes of memory."""

_Found = dict[tuple[int, int], FragilityResult]


def make(work: Work, responses: Responses, boundary: BoundaryData) -> Product:
    """Fit every model to the boundary of every yaw and friction."""
    data = responses.data
    aside: IO[bytes] = TemporaryFile(dir=work.runs)  # noqa: SIM115 (until the product is written)
    fits = _fit(data, boundary.data, work.cluster.workers, aside)
    dataset = _dataset(data, fits)
    dataset.attrs |= {name: boundary.data.attrs[name] for name in SEARCHED}
    names = [_recommended(fit) for fit in fits.values()]
    best = ", ".join(f"{name} for {names.count(name)}" for name in sorted(set(names)))
    table = writers.tables(_tables(dataset, fits))
    dataset = described(dataset, work, "Fragility")
    rows, columns = dataset["probability"].shape[3:]
    parts = _probabilities(aside, dataset.sizes["model"], (rows, columns), fits)
    size = (1, 1, 1, min(at_once(columns) // columns, rows), columns)
    files = {Fits.FILE: netcdf(dataset, parts, size), TABLE: table}
    return Product(files, f"grids fitted: {len(fits)}; recommended: {best}")


def _fit(data: xr.Dataset, boundary: xr.Dataset, workers: int, aside: IO[bytes]) -> _Found:
    """Fits by position of yaw and friction; none where no run is resolved.

    Parameters
    ----------
    aside : file, to which probabilities are moved, a number for each cell and model
    """
    overturned = data["overturned"].values
    decided = [at for at in np.ndindex(overturned.shape[:2]) if (overturned[at] >= 0).any()]
    fit = partial(fit_all, data["pga"].values, data["pgv_pga"].values)
    grids, runs = (
        (overturned[at] for at in decided),
        (runs_of(boundary, data, at) for at in decided),
    )
    found: _Found = {}
    # in threads, as all but a little of a fit is linear algebra
    threads = max(min(workers, _CELLS_AT_ONCE // max(overturned[0, 0].size, 1)), 1)
    with threadpool_limits(1), ThreadPoolExecutor(threads) as pool:
        for at, one in zip(decided, pool.map(fit, grids, runs), strict=True):
            for model in one.models:
                aside.write(model.probability.astype("f4").tobytes())
            models = (replace(model, probability=np.zeros((0, 0))) for model in one.models)
            found[at] = replace(one, models=tuple(models))
    return found


def _probabilities(
    aside: IO[bytes], models: int, shape: tuple[int, int], fits: _Found
) -> Iterator[tuple[Place, dict[str, Array]]]:
    """What was put aside, model by model."""
    with aside:
        aside.seek(0)
        for place in fits:
            for model in range(models):
                cells = np.frombuffer(aside.read(4 * shape[0] * shape[1]), "f4").reshape(shape)
                yield (*place, model), {"probability": cells}


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
    sizes = {**overturned.sizes, "model": dataset.sizes["model"]}
    dims = ("yaw", "friction", "model", row, "pga")
    dataset["probability"] = unwritten(dims, tuple(sizes[dim] for dim in dims), "f4")
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


def _tables(dataset: xr.Dataset, fits: _Found) -> Iterator[pd.DataFrame]:
    """The boundary's rows, then those of each model, one yaw and friction after the other."""
    rows = {"pgv_pga_s": dataset["pgv_pga"].values.astype(str)}
    if rows_of(dataset) == "record":
        rows["record"] = dataset["record"].values
    columns = [*_COLUMNS, *list(rows)[1:]]
    words = [name for name in columns if name not in ("value", "lower", "upper")]
    yield pd.DataFrame(columns=columns)
    for (i, k), fit in fits.items():
        one = dataset.isel(yaw=i, friction=k)
        edge = fit.boundary
        found = [_quantity(rows, "first_overturning_pga_g", edge.pga, edge.lower, edge.upper)]
        found[0]["model"] = "runs"
        found += [_of_model(rows, model, fit.recommended) for model in fit.models]
        group = {"yaw_deg": str(one["yaw"].item()), "friction": str(one["friction"].item())}
        share = f"{one['toppled_share'].item():.4f}"
        table = pd.concat(found).assign(**group, toppled_share=share).reindex(columns=columns)
        yield table.fillna(dict.fromkeys(words, ""))


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
    named = {"quantity": name, "unit": "g" if name in _IN_G else "1"}
    return pd.DataFrame({**(rows if ends[0].ndim else {}), **columns, **named})
