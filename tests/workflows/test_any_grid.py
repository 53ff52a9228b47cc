"""The same rock on 12 x 12, 25 x 25 and 50 x 50 cells: one boundary, and models that agree."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from pipeline import cli
from pipeline.workflow import graph
from pipeline.workflow.datasets import read
from pipeline.workflow.jobs import job_of

pytestmark = pytest.mark.slow

EVERY = np.round(np.linspace(0.02, 1.0, 50), 12)
GRIDS = {"12": 12, "25": 25, "50": 50, "auto": 50}
"""Rows of each grid, and its PGAs."""


def site(name: str) -> str:
    rows = EVERY[np.linspace(0, 49, GRIDS[name]).round().astype(int)].tolist()
    pga = name if name == "auto" else f"{{start: 0.02, stop: 1.0, num: {name}}}"
    return (
        "rock: {shape: mesh, mesh: nowhere, fallback: double_rock, density: 2110}\n"
        f"motion: {{pga: {pga}, pgv_pga: {rows}}}\n"
        "yaw: [0, 90]\nsimulation: {time_step: 0.006}\n"
    )


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[xr.Dataset, xr.Dataset]]:
    """Fragility and boundary on each grid."""
    folder, found = tmp_path_factory.mktemp("grids"), {}
    for name in GRIDS:
        path = folder / f"rock{name}.yaml"
        path.write_text(site(name))
        line = ["run", "boundary", "--site", str(path), "--derived", str(folder), "--workers", "0"]
        job = job_of(cli.parsed(line))
        with job.store, job.cluster:
            graph.make("fragility", job)
        found[name] = read(job.path("fragility.nc")), read(job.path("boundary.nc"))
    return found


def on_common_rows(
    made: dict[str, tuple[xr.Dataset, xr.Dataset]], name: str
) -> tuple[xr.Dataset, xr.Dataset]:
    own = made[name][0]
    return own, made["50"][0].sel(pgv_pga=own["pgv_pga"])


@pytest.mark.parametrize("name", ["12", "25", "auto"])
def test_boundaries_are_within_one_per_cent(
    made: dict[str, tuple[xr.Dataset, xr.Dataset]], name: str
) -> None:
    """But for a few rows, with islands that the cells of one grid see and the other's do not."""
    first, reference = (data["first_overturning_pga"].values for data in on_common_rows(made, name))
    known = np.isfinite(reference)
    np.testing.assert_array_equal(np.isfinite(first), known)
    assert known.mean() > 0.9
    apart = np.log(first[known] / reference[known])
    assert (np.abs(apart) > 0.01).mean() < 0.12
    assert np.median(np.abs(apart)) < 0.001  # most are the same interval
    assert abs(apart.mean()) < 0.01  # and the boundary as a whole does not move


@pytest.mark.parametrize("name", ["12", "25", "auto"])
@pytest.mark.parametrize("model", ["logistic", "lognormal", "smooth"])
def test_models_lie_in_each_other_s_intervals(
    made: dict[str, tuple[xr.Dataset, xr.Dataset]], name: str, model: str
) -> None:
    ends = [
        data["median_pga_interval"].sel(model=model).values for data in on_common_rows(made, name)
    ]
    (low, high), (fine_low, fine_high) = (np.moveaxis(each, -1, 0) for each in ends)
    assert ((low <= 1.01 * fine_high) & (fine_low <= 1.01 * high)).mean() > 0.9


@pytest.mark.parametrize("name", GRIDS)
def test_the_fits_have_the_boundary_of_the_runs(
    made: dict[str, tuple[xr.Dataset, xr.Dataset]], name: str
) -> None:
    fragility, boundary = made[name]
    for end in ("", "_lower", "_upper"):
        own = fragility[f"first_overturning_pga{end}"].values
        np.testing.assert_array_equal(own, boundary[f"first_overturning_pga{end}"].values)


def test_auto_takes_fewer_than_half_the_runs(
    made: dict[str, tuple[xr.Dataset, xr.Dataset]],
) -> None:
    runs = {}
    for name in ("auto", "50"):
        fragility, boundary = made[name]
        cells = fragility["first_overturning_pga"].size * fragility.sizes["pga"]
        runs[name] = cells + boundary.sizes["run"]
    assert runs["auto"] < 0.4 * runs["50"]
