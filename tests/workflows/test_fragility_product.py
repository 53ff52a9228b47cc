"""`vsr run fragility` on six cells a direction and friction: runs, responses, fits and the report.

The rock is a slender block, of which Housner's equation knows what each cell does. Two PGAs lie
close to either side of its boundary, so that no unit may be off by as much as 1.5 %.
"""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from conftest import Ran

from pipeline.workflow.datasets import read
from vsr_core import GRAVITY
from vsr_core.run.rocking_block import Block, first_overturning_pga, rocking_response

pytestmark = pytest.mark.usefixtures("small_pictures")

BLOCK = Block(0.2, 0.8)
RATIOS = (0.08, 0.18)
SLIPS, GRIPS = 0.6, 5.0
"""Frictions, below and above the slenderness of the wide side."""


@pytest.fixture(scope="module")
def pgas() -> list[float]:
    """One that moves nothing, and both sides of the boundary at the longer pulse [g]."""
    boundary = first_overturning_pga(BLOCK, RATIOS[1], 2.0 * GRAVITY, 0.01 * GRAVITY) / GRAVITY
    return [0.15, round(0.985 * boundary, 4), round(1.015 * boundary, 4)]


@pytest.fixture
def made(
    vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path, pgas: list[float]
) -> Ran:
    site = write_site(
        "rock: {shape: box, size: [0.4, 1.2, 1.6], density: 2110}\n"
        f"motion: {{pga: {pgas}, pgv_pga: {list(RATIOS)}}}\n"
        f"yaw: [0, 90]\ncontact: {{friction: [{SLIPS}, {GRIPS}]}}\n"
        "simulation: {time_step: auto}\n"
    )
    return vsr("run", "fragility", "--site", site, "--workers", "0")


def test_from_a_site_to_curves_and_report(made: Ran, derived: Path, pgas: list[float]) -> None:
    assert made.code == 0, made.err
    folder = derived / "rock"
    responses = read(folder / "responses.nc")
    assert responses["outcome"].dims == ("yaw", "friction", "pgv_pga", "pga")
    assert responses["pga"].values.tolist() == pgas
    units = {name: responses[name].attrs["units"] for name in responses["outcome"].dims}
    assert units == {"yaw": "degree", "friction": "1", "pgv_pga": "s", "pga": "g"}
    with xr.open_dataset(folder / "responses.nc", mask_and_scale=False) as stored:
        for name in ("outcome", "decided_by"):  # CF 1.11, section 3.5
            assert stored[name].attrs["flag_values"].dtype == stored[name].dtype
        assert "gram" in stored["pga"].attrs["comment"]
    assert 0.0 < float(responses["time_step"].values[0]) < 0.01
    assert 0.0 < float(responses["boundary_error"].values[0]) <= 0.01

    thin = responses["overturned"].sel(yaw=0, friction=GRIPS).values
    wide = responses["overturned"].sel(yaw=90, friction=SLIPS).values
    exact = [
        [rocking_response(BLOCK, pga * GRAVITY, ratio).overturned for pga in pgas]
        for ratio in RATIOS
    ]
    assert exact[1] == [False, False, True]
    np.testing.assert_array_equal(thin, exact)
    assert (wide == 0).all()

    fragility = read(folder / "fragility.nc")
    first = fragility["first_overturning_pga"].sel(yaw=0, friction=GRIPS).values
    expected = [first_overturning_pga(BLOCK, ratio, 4.0 * GRAVITY, 0.01 * GRAVITY) / GRAVITY
                for ratio in RATIOS]  # fmt: skip
    assert pgas[1] < expected[1] < pgas[2] < expected[0]
    np.testing.assert_allclose(first, expected, rtol=0.01)  # of the time step and the interval
    with (folder / "fragility.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert {float(row["yaw_deg"]) for row in rows} == {0.0, 90.0}

    report = (folder / "report.html").read_text(encoding="utf-8")
    assert "largest share of the grid's runs at <strong>yaw 0 deg</strong>" in report
    for name in ("report.html", "fragility.csv", "responses.nc"):
        assert f"-> {folder / name}" in made.err


@pytest.mark.slow
def test_a_rough_block_topples_under_pulses_far_longer_than_it_rocks(
    vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path
) -> None:
    """Shaken so slowly, above its static limit of .5 g, it falls as on a table that is tilted.

    At such a friction a third of these runs once ended unresolved.
    """
    site = write_site(
        "rock: {shape: box, size: [1.0, 1.0, 2.0], density: 2110}\n"
        "motion: {pga: [0.6, 0.8, 1.0], pgv_pga: [2, 4, 6, 8, 10]}\n"
        "yaw: [0]\ncontact: {friction: 100}\nsimulation: {time_step: auto}\n"
    )
    ran = vsr("run", "responses", "--site", site, "--workers", "0")
    assert ran.code == 0, ran.err
    assert (read(derived / "rock" / "responses.nc")["overturned"] == 1).all()
