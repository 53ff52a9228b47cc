"""Fragility: models fitted to the responses of each yaw and friction, compared and named."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from threadpoolctl import threadpool_limits

from pipeline.stages.datasets.responses import FILE as RESPONSES
from pipeline.workflow.datasets import described, netcdf, read, rows_of
from pipeline.workflow.stage import Job, Product
from vsr_core.fragility import FragilityResult, ModelFit, fit_all

FILE = "fragility.nc"
TABLE = "fragility.csv"

Fits = dict[tuple[int, int], "FragilityResult"]


def make(job: Job) -> Product:
    """Fit every model to every (yaw, friction)."""
    data = read(job.path(RESPONSES))
    fits = _fit(data)
    dataset = described(_dataset(data, fits), job, "Fragility")
    names = [fit.recommended for fit in fits.values()]
    best = ", ".join(f"{name} for {names.count(name)}" for name in sorted(set(names)))
    files = {FILE: netcdf(dataset), TABLE: lambda path: _write_table(path, data, fits)}
    return Product(files, f"{len(fits)} grids fitted; recommended: {best}")


def _fit(data: Any) -> Fits:
    fits: Fits = {}
    with threadpool_limits(1):
        for i, k in np.ndindex(data.sizes["yaw"], data.sizes["friction"]):
            grid = data["overturned"].values[i, k]
            if (grid >= 0).any():
                fits[i, k] = fit_all(data["pga"].values, data["pgv_pga"].values, grid)
    return fits


def _dataset(data: Any, fits: Fits) -> Any:
    sizes = data.sizes
    groups, row = ("yaw", "friction"), rows_of(data)
    models = ["logistic", "lognormal", "smooth"]
    shapes: dict[str, tuple[str, ...]] = {
        "last_balanced_pga": (*groups, row),
        "first_overturning_pga": (*groups, row),
        "censored": (*groups, row),
        "islands": (*groups, row),
        "clusters": groups,
        "toppled_share": groups,
        "median_pga": (*groups, "model", row),
        "median_pga_interval": (*groups, "model", row, "bound"),
        "band_pga": (*groups, "model", row, "bound"),
        "probability": (*groups, "model", row, "pga"),
        "separated": (*groups, "model"),
        "log_loss": (*groups, "model"),
        "log_loss_error": (*groups, "model"),
        "brier": (*groups, "model"),
        "accuracy": (*groups, "model"),
        "coefficient": (*groups, "parameter"),
        "coefficient_interval": (*groups, "parameter", "bound"),
        "theta": (*groups, row),
        "theta_interval": (*groups, row, "bound"),
        "beta": (*groups, row),
        "beta_interval": (*groups, row, "bound"),
    }
    length = {**sizes, "model": len(models), "bound": 2, "parameter": 3}
    arrays = {
        name: np.full([length[d] for d in dims], np.nan, "f4" if name == "probability" else "f8")
        for name, dims in shapes.items()
    }
    words = {
        name: np.full([sizes["yaw"], sizes["friction"]], "", object)
        for name in ("recommended", "reason")
    }
    methods = np.full([sizes["yaw"], sizes["friction"], len(models)], "", object)
    for place, fit in fits.items():
        _put_grid(arrays, place, fit, data["overturned"].values[place])
        for number, name in enumerate(models):
            _put_model(arrays, (*place, number), fit.model(name))
            methods[(*place, number)] = fit.model(name).method
        words["recommended"][place], words["reason"][place] = fit.recommended, fit.reason
    dataset = xr.Dataset(
        {name: (dims, arrays[name]) for name, dims in shapes.items()},
        {**{d: data[d].values for d in ("yaw", "friction", row, "pga")}, "model": models}
        | {str(name): (row, c.values) for name, c in data[row].coords.items() if name != row}
        | {"bound": ["lower", "upper"], "parameter": ["b0", "b1", "b2"]},
    )
    for name, array in words.items():
        dataset[name] = (groups, array.astype(str))
    dataset["method"] = ((*groups, "model"), methods.astype(str))
    return dataset


def _put_grid(arrays: Any, place: Any, fit: FragilityResult, grid: Any) -> None:
    edge = fit.boundary
    arrays["last_balanced_pga"][place] = edge.lower
    arrays["first_overturning_pga"][place] = edge.upper
    arrays["censored"][place] = edge.censored
    arrays["islands"][place] = edge.islands
    arrays["clusters"][place] = edge.cluster_sizes.size
    arrays["toppled_share"][place] = (grid == 1).sum() / (grid >= 0).sum()


def _put_model(arrays: Any, place: Any, model: ModelFit) -> None:
    arrays["median_pga"][place] = model.median
    arrays["median_pga_interval"][place] = _pair(model.median_lower, model.median_upper)
    arrays["band_pga"][place] = _pair(model.band_low, model.band_high)
    arrays["probability"][place] = model.probability
    arrays["separated"][place] = model.separated
    arrays["log_loss"][place] = model.scores.log_loss
    arrays["log_loss_error"][place] = model.scores.log_loss_se
    arrays["brier"][place] = model.scores.brier
    arrays["accuracy"][place] = model.scores.accuracy
    group = place[:2]
    for number, parameter in enumerate(model.parameters):
        pair = _pair(parameter.lower, parameter.upper)
        if model.name == "logistic":
            arrays["coefficient"][(*group, number)] = parameter.value
            arrays["coefficient_interval"][(*group, number)] = pair
        else:
            arrays[parameter.name][group] = parameter.value
            arrays[f"{parameter.name}_interval"][group] = pair


def _pair(lower: Any, upper: Any) -> Any:
    return np.stack([lower, upper], axis=-1)


def _write_table(path: Path, data: Any, fits: Fits) -> None:
    """One row per yaw, friction and model, with the boundary's rows after it."""
    columns = ["yaw_deg", "friction", "toppled_share", "model", "recommended", "log_loss", "brier"]
    columns += [
        "accuracy",
        "separated",
        "method",
        "quantity",
        "pgv_pga_s",
        "value",
        "lower",
        "upper",
    ]
    names = {}
    if rows_of(data) == "record":
        columns.append("record")
        names = dict(zip(data["pgv_pga"].values, data["record"].values, strict=True))

    def named(r: Any) -> list[str]:
        return [str(names.get(r, ""))] if names else []

    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(columns)
        for (i, k), fit in fits.items():
            grid = data["overturned"].values[i, k]
            share = (grid == 1).sum() / (grid >= 0).sum()
            group = [float(data["yaw"][i]), float(data["friction"][k]), f"{share:.4f}"]
            for r, low, high in zip(
                data["pgv_pga"].values, fit.boundary.lower, fit.boundary.upper, strict=True
            ):
                empty = [""] * 6
                table.writerow(
                    [
                        *group,
                        "grid",
                        *empty,
                        "first_overturning_pga_g",
                        r,
                        _g(high),
                        _g(low),
                        _g(high),
                        *named(r),
                    ]
                )
            for model in fit.models:
                scores = [
                    f"{getattr(model.scores, s):.5f}" for s in ("log_loss", "brier", "accuracy")
                ]
                about = [
                    model.name,
                    int(model.name == fit.recommended),
                    *scores,
                    int(model.separated),
                    model.method,
                ]
                for quantity, r, *values in _quantities(data["pgv_pga"].values, model):
                    table.writerow([*group, *about, quantity, r, *map(_g, values), *named(r)])


def _quantities(pgv_pga: Any, model: ModelFit) -> Any:
    for parameter in model.parameters:
        if parameter.value.ndim == 0:
            yield parameter.name, "", parameter.value, parameter.lower, parameter.upper
        else:
            for row in zip(pgv_pga, parameter.value, parameter.lower, parameter.upper, strict=True):
                yield (parameter.name, *row)
    for row in zip(pgv_pga, model.median, model.median_lower, model.median_upper, strict=True):
        yield ("median_pga_g", *row)


def _g(value: float) -> str:
    return f"{float(value):.6g}"
