"""The same rock on 12 x 12, 25 x 25 and 50 x 50 cells: one boundary, and models that agree."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from pipeline import cli
from pipeline.workflow import graph
from pipeline.workflow.datasets import read
from pipeline.workflow.jobs import job_of

EVERY = np.round(np.linspace(0.02, 1.0, 50), 12)
NUMBERS = (12, 25, 50)


def site(number: int) -> str:
    rows = EVERY[np.linspace(0, 49, number).round().astype(int)].tolist()
    return (
        "rock: {shape: mesh, mesh: nowhere, fallback: double_rock, density: 2110}\n"
        f"motion: {{pga: {{start: 0.02, stop: 1.0, num: {number}}}, pgv_pga: {rows}}}\n"
        "yaw: [0, 90]\nsimulation: {time_step: 0.006}\n"
    )


@pytest.fixture(scope="module")
def fragility(tmp_path_factory: pytest.TempPathFactory) -> dict[int, xr.Dataset]:
    folder, found = tmp_path_factory.mktemp("grids"), {}
    for number in NUMBERS:
        path = folder / f"rock{number}.yaml"
        path.write_text(site(number))
        line = ["run", "boundary", "--site", str(path), "--derived", str(folder), "--workers", "0"]
        job = job_of(cli.parsed(line))
        with job.store, job.cluster:
            graph.make("fragility", job)
        found[number] = read(job.path("fragility.nc"))
    return found


@pytest.mark.parametrize("number", NUMBERS[:2])
def test_boundaries_are_within_one_per_cent(fragility: dict[int, xr.Dataset], number: int) -> None:
    """But for a few rows, with islands that the cells of one grid see and the other's do not."""
    own, fine = fragility[number], fragility[50].sel(pgv_pga=fragility[number]["pgv_pga"])
    first, reference = (data["first_overturning_pga"].values for data in (own, fine))
    known = np.isfinite(reference)
    np.testing.assert_array_equal(np.isfinite(first), known)
    assert known.mean() > 0.9
    apart = np.abs(np.log(first[known] / reference[known])) > 0.01
    assert apart.mean() < 0.1
    # of the shift of a whole boundary nothing is left
    assert abs(np.log(first[known] / reference[known]).mean()) < 0.01


@pytest.mark.parametrize("number", NUMBERS[:2])
@pytest.mark.parametrize("model", ["logistic", "lognormal", "smooth"])
def test_models_lie_in_each_other_s_intervals(
    fragility: dict[int, xr.Dataset], number: int, model: str
) -> None:
    own, fine = fragility[number], fragility[50].sel(pgv_pga=fragility[number]["pgv_pga"])
    ends = [data["median_pga_interval"].sel(model=model).values for data in (own, fine)]
    (low, high), (fine_low, fine_high) = (np.moveaxis(each, -1, 0) for each in ends)
    assert ((low <= 1.01 * fine_high) & (fine_low <= 1.01 * high)).mean() > 0.9
