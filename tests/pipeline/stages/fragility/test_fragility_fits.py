"""Fits as dataset and table: at which yaw and friction each stands, and which end is which."""

from __future__ import annotations

from io import BytesIO

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from pipeline.stages.fragility import fragility_fits
from vsr_core.fragility import FragilityResult

PGA, RATIO = np.geomspace(0.1, 1.0, 12), np.geomspace(0.1, 0.8, 6)
YAWS, FRICTIONS = [0.0, 90.0, 180.0], [0.4, 0.6]
Fits = dict[tuple[int, int], FragilityResult]


@pytest.fixture(scope="module")
def responses() -> xr.Dataset:
    """Boundaries of 0.2, 0.24, ... g, blurred so that rows disagree; none known at the last."""
    rng = np.random.default_rng(2)
    table = np.empty((3, 2, len(RATIO), len(PGA)), dtype=np.int8)
    for place, at in enumerate(np.ndindex(3, 2)):
        median = (0.2 + 0.04 * place) * RATIO**-0.3
        table[at] = np.log(PGA) > np.log(median)[:, None] + 0.1 * rng.normal(size=(len(RATIO), 1))
    table[2, 1] = -1
    dims = ("yaw", "friction", "pgv_pga", "pga")
    axes = {"yaw": YAWS, "friction": FRICTIONS, "pgv_pga": RATIO, "pga": PGA}
    return xr.Dataset({"overturned": (dims, table)}, axes)


def without_runs() -> xr.Dataset:
    """A boundary between whose cells nothing was run."""
    names = ("run_yaw", "run_friction", "run_pga")
    table = {name: ("run", np.zeros(0)) for name in names}
    whole = {name: ("run", np.zeros(0, int)) for name in ("run_row", "outcome")}
    return xr.Dataset(table | whole)


@pytest.fixture(scope="module")
def fits(responses: xr.Dataset) -> Fits:
    return fragility_fits._fit(responses, without_runs(), 1, BytesIO())


@pytest.fixture(scope="module")
def dataset(responses: xr.Dataset, fits: Fits) -> xr.Dataset:
    return fragility_fits._dataset(responses, fits)


def test_the_lower_end_of_an_interval_is_the_lower(dataset: xr.Dataset) -> None:
    for name in ("median_pga_interval", "band_pga", "theta_interval", "coefficient_interval"):
        ends = dataset[name].isel(friction=0)
        low, high = ends.sel(bound="lower"), ends.sel(bound="upper")
        assert (low <= high).all(), name
        assert (low < high).any(), name


def test_each_fit_stands_at_its_yaw_and_friction(
    responses: xr.Dataset, dataset: xr.Dataset
) -> None:
    """The first overturning of each grid as it is read off, and the medians near it."""
    for i, k in np.ndindex(3, 2):
        one, own = dataset.isel(yaw=i, friction=k), responses["overturned"].values[i, k]
        assert (float(one["yaw"]), float(one["friction"])) == (YAWS[i], FRICTIONS[k])
        if (i, k) == (2, 1):
            assert np.isnan(one["median_pga"]).all()
            assert not str(one["recommended"].values)
            continue
        np.testing.assert_array_equal(one["first_overturning_pga_upper"], PGA[own.argmax(axis=1)])
        assert one["toppled_share"].item() == pytest.approx(own.mean())
        median = (0.2 + 0.04 * (2 * i + k)) * RATIO**-0.3
        np.testing.assert_allclose(one["median_pga"].sel(model="logistic"), median, rtol=0.25)


def test_the_table_says_what_the_dataset_says(dataset: xr.Dataset, fits: Fits) -> None:
    table = pd.concat(fragility_fits._tables(dataset, fits))
    assert set(zip(table["yaw_deg"], table["friction"], strict=True)) == {
        (str(YAWS[i]), str(FRICTIONS[k])) for i, k in fits
    }
    for (yaw, friction), rows in table.groupby(["yaw_deg", "friction"]):
        one = dataset.sel(yaw=float(yaw), friction=float(friction))
        for model in ("logistic", "lognormal", "smooth"):
            fit, own = one.sel(model=model), rows[rows["model"] == model]
            median = own[own["quantity"] == "median_pga_g"]
            np.testing.assert_array_equal(median["value"], fit["median_pga"])
            ends = median[["lower", "upper"]].to_numpy()
            np.testing.assert_array_equal(ends, fit["median_pga_interval"])
            assert set(own["log_loss"]) == {f"{fit['log_loss'].item():.5f}"}
            named = {"1"} if model == str(one["recommended"].values) else {"0"}
            assert set(own["recommended"]) == named
        theta = rows[rows["quantity"] == "theta"]
        assert set(theta["unit"]) == {"g"}
        assert set(rows[rows["quantity"] == "beta"]["unit"].astype(str)) == {"1"}
        np.testing.assert_array_equal(theta["value"], one["theta"])
        np.testing.assert_array_equal(theta[["lower", "upper"]], one["theta_interval"])
        line = rows[rows["quantity"].isin(["b0", "b1", "b2"])]
        np.testing.assert_array_equal(line["value"], one["coefficient"])
        np.testing.assert_array_equal(line[["lower", "upper"]], one["coefficient_interval"])
        grid = rows[rows["model"] == "runs"]
        np.testing.assert_array_equal(grid["lower"], one["first_overturning_pga_lower"])
        np.testing.assert_array_equal(grid["upper"], one["first_overturning_pga_upper"])
