"""`vsr run hazard --events` on a block and made-up events, summed here event by event."""

from __future__ import annotations

import csv
import html
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from conftest import Ran
from numpy.typing import NDArray
from scipy.stats import norm

from pipeline import ROOT, cli
from pipeline.stages.hazard.shaking_ratio import DRAWN_AGAIN
from pipeline.workflow.datasets import read
from tests.support.event_sets import EventSet

Array = NDArray[np.float64]

SAMPLE = ROOT / "data" / "raw" / "hazard" / "made_up_events"
SET, AGE = EventSet(), 6000.0
BOX = (
    "rock: {shape: box, size: [0.25, 0.5, 1.2], density: 2110}\n"
    "motion: {pga: [0.15, 0.3, 0.45, 0.6], pgv_pga: [0.05, 0.1, 0.2, 0.4]}\nyaw: [0, 90]\n"
    "simulation: {engine: nonsmooth, time_step: 0.0015}\nuncertainty: {members: 0}\n"
    f"hazard: {{events: {SAMPLE}, age: {{kind: normal, mean: {AGE:g}, sd: 0}}}}\n"
)


def chances(fits: xr.Dataset, pga: Array, pgv: Array) -> Array:
    """Of each event [g, cm/s]: of the row nearest to its PGV/PGA, of any direction."""
    theta, beta = (fits[name].values[:, 0] for name in ("theta", "beta"))
    ratio = 0.01 * pgv / (9.80665 * pga)
    row = np.abs(np.log(ratio)[:, None] - np.log(fits["pgv_pga"].values)).argmin(axis=1)
    return norm.cdf(np.log(pga / theta[:, row]) / beta[:, row]).mean(axis=0)


def drawn() -> dict[str, Array]:
    """The events of the sample, as its files have them."""
    with (SAMPLE / "events_1.csv").open(encoding="utf-8") as file:
        events = list(csv.DictReader(line for line in file if not line.startswith("#")))
    with (SAMPLE / "gmf-data_1.csv").open(encoding="utf-8") as file:
        shaken = list(csv.DictReader(line for line in file if not line.startswith("#")))
    assert [one["event_id"] for one in events] == [one["event_id"] for one in shaken]
    return {
        "rlz": np.array([int(one["rlz_id"]) for one in events]),
        "rup": np.array([int(one["rup_id"]) for one in events]),
        "pga": np.array([float(one["gmv_PGA"]) for one in shaken]),
        "pgv": np.array([float(one["gmv_PGV"]) for one in shaken]),
    }


@pytest.mark.slow
def test_events_of_the_same_size_and_date_are_read_again(
    tmp_path: Path, vsr: Callable[..., Ran], derived: Path
) -> None:
    """In one process: whether files differ is not decided by dates."""
    events = tmp_path / "events"
    shutil.copytree(SAMPLE, events)
    (tmp_path / "rock.yaml").write_text(BOX.replace(str(SAMPLE), str(events)))
    path, strongest = events / "gmf-data_1.csv", []
    for factor in (1.0, 0.5):
        rows = list(csv.reader((SAMPLE / path.name).read_text().splitlines()))
        for row in rows[2:]:
            row[1:3] = [f"{factor * float(value):.5E}" for value in row[1:3]]
        path.write_text("\n".join(map(",".join, rows)) + "\n")
        os.utime(path, (1e9, 1e9))
        assert vsr("run", "hazard", "--site", tmp_path / "rock.yaml", "--workers", 0).code == 0
        found = read(derived / "rock" / "hazard.nc")
        strongest.append(found["pga_before"].sel(return_period=2475).item())
    assert strongest[1] == pytest.approx(0.5 * strongest[0], rel=0.01)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("events")
    (folder / "rock.yaml").write_text(BOX, encoding="utf-8")
    given = ["run", "hazard", "--site", str(folder / "rock.yaml"), "--workers", "0"]
    assert cli.main([*given, "--derived", str(folder / "derived")]) == 0
    return folder / "derived" / "rock"


@pytest.fixture(scope="module")
def hazard(made: Path) -> xr.Dataset:
    return read(made / "hazard.nc")


def said(page: Path) -> str:
    text = re.sub(r"<style>.*?</style>", " ", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    return " ".join(html.unescape(re.sub(r"<[^>]*>", "", text)).replace("\u00a0", " ").split())


def test_the_sample_is_what_its_generator_writes(tmp_path: Path) -> None:
    SET.write(tmp_path)
    for path in tmp_path.iterdir():
        assert (SAMPLE / path.name).read_bytes() == path.read_bytes(), path.name


def test_rates_survival_and_weights_are_those_of_the_events(made: Path, hazard: xr.Dataset) -> None:
    event = drawn()
    chance = chances(read(made / "fragility.nc"), event["pga"], event["pgv"])
    rates = np.bincount(event["rlz"], chance) / SET.years
    np.testing.assert_allclose(hazard["toppling_rate"], rates, rtol=0.01)
    survival = np.exp(-AGE * rates)
    np.testing.assert_allclose(hazard["survival"], survival, rtol=0.01)
    rejected = survival < 0.05
    assert 0 < rejected.sum() < 3, "the sample shows both"
    assert hazard["rejected"].values.tolist() == rejected.tolist()
    weight = np.array([0.3, 0.4, 0.3]) * np.where(rejected, 0.0, survival)
    np.testing.assert_allclose(hazard["new_weight"], weight / weight.sum(), rtol=0.02)
    by_row = hazard["toppling_rate_by_pgv_pga"].sum()
    assert float(by_row) == pytest.approx(np.array([0.3, 0.4, 0.3]) @ rates, rel=0.01)
    for at in (0.05, 0.2):
        wanted = [(event["pga"][event["rlz"] == n] > at).sum() / SET.years for n in range(3)]
        found = hazard["branch_rate"].sel(pga=at, method="nearest")
        np.testing.assert_allclose(found, wanted, rtol=0.08)


def test_sampling_errors_are_those_of_ruptures(made: Path, hazard: xr.Dataset) -> None:
    """sqrt(sum of squares) of what each rupture adds to a branch, and to the mean."""
    event = drawn()
    chance = chances(read(made / "fragility.nc"), event["pga"], event["pgv"]) / SET.years
    added = np.zeros((event["rup"].max() + 1, 3))
    np.add.at(added, (event["rup"], event["rlz"]), chance)
    exact = np.sqrt((added**2).sum(axis=0))
    np.testing.assert_allclose(hazard["toppling_rate_error"], exact, rtol=0.15)
    weights = np.array([0.3, 0.4, 0.3])
    mean = np.sqrt(((added @ weights) ** 2).sum())
    assert hazard["mean_toppling_rate_error"].item() == pytest.approx(mean, rel=0.15)
    alone = np.sqrt(((weights[event["rlz"]] * chance) ** 2).sum())
    assert hazard["mean_toppling_rate_error_independent"].item() == pytest.approx(alone, rel=0.01)
    # Survival is exp(-age rate), lognormal where the rate is nearly normal.
    spread = AGE * hazard["toppling_rate_error"].values
    lognormal = np.exp(0.5 * spread**2) * np.sqrt(np.expm1(spread**2)) * hazard["survival"].values
    np.testing.assert_allclose(hazard["survival_sampling_error"], lognormal, rtol=0.3)


def test_the_page_tells_what_independence_costs(made: Path, hazard: xr.Dataset) -> None:
    page = said(made / "hazard.html")
    rates = dict(zip(hazard["case"].values, hazard["case_toppling_rate"].values, strict=True))
    base, again = rates["base case"], rates[DRAWN_AGAIN]
    event = drawn()
    assert f"{len(event['pga']):,} events in 3 branches, each simulated for 20,000 years" in page
    measured = re.search(r"have a correlation of (-?\d\.\d\d); in recorded earthquakes", page)
    assert measured is not None
    assert float(measured[1]) == pytest.approx(0.0, abs=4.0 / np.sqrt(len(event["pga"])) + 0.01)
    years = f"{float(f'{1.0 / again:.2g}'):,.0f}"
    assert f"it topples once in {years} years, {again / base:.2f} times as often" in page
    assert DRAWN_AGAIN in page
    assert "the sum over the events of a branch" in page
    assert "between levels ln λ is linear" not in page


@pytest.mark.slow
def test_without_pgv_the_table_is_as_of_curves(
    made: Path, tmp_path: Path, vsr: Callable[..., Ran], derived: Path
) -> None:
    folder = shutil.copytree(SAMPLE, tmp_path / "events")
    path = folder / "gmf-data_1.csv"
    path.write_text(path.read_text().replace("gmv_PGV", "gmv_SA(0.3)"))
    shutil.copytree(made, derived / "rock")
    site = str(made.parents[1] / "rock.yaml")
    table = "hazard.pgv_pga={pga: [0.1], median: [0.1], log_sd: [0.5]}"
    for more in ((), ("--set", table)):
        ran = vsr("run", "hazard", "--site", site, "--events", str(folder), *more)
        assert ran.code == 0, ran.err
        assert "The events have no PGV." in said(derived / "rock" / "hazard.html")
    found, event = read(derived / "rock" / "hazard.nc"), drawn()
    rng = np.random.default_rng(3)
    speed = 980.665 * event["pga"] * 0.1 * np.exp(0.5 * rng.standard_normal(len(event["pga"])))
    chance = chances(read(made / "fragility.nc"), event["pga"], speed)
    rates = np.bincount(event["rlz"], chance) / SET.years
    np.testing.assert_allclose(found["toppling_rate"], rates, rtol=0.25)


def test_what_is_wrong_is_refused_before_anything_is_made(
    tmp_path: Path, vsr: Callable[..., Ran], derived: Path
) -> None:
    (tmp_path / "rock.yaml").write_text(BOX, encoding="utf-8")
    site = str(tmp_path / "rock.yaml")
    broken = shutil.copytree(SAMPLE, tmp_path / "events")
    path = broken / "events_1.csv"
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:-40]))
    for more, words in (
        (("--events", str(broken)), "gmf-data_1.csv: event_id: got event"),
        (("--events", str(tmp_path / "none")), "folder not found; events are in a folder"),
        (("--set", "hazard.effective_time=5"), "hazard.effective_time: got 5"),
        (("--set", f"hazard.curves={SAMPLE}"), "events stand in place of curves"),
    ):
        ran = vsr("run", "hazard", "--site", site, *more)
        assert ran.code == 2, ran.err
        (line,) = [line for line in ran.err.splitlines() if line.startswith("vsr: ")]
        assert words in line
    assert not (derived / "rock" / "responses.nc").exists()
