"""`vsr run exclusion` on a block: its numbers found again from fits, and broken files refused."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from conftest import Ran
from scipy.stats import norm

from pipeline.config.layers import load_site
from pipeline.workflow.graph import identities
from vsr_core.hazard.ratio import CORRELATION, PGA, PGV

BOX = "rock: {shape: box, size: [0.25, 0.5, 1.2], density: 2110}\n"
GRID = (
    "motion: {pga: [0.15, 0.3, 0.45, 0.6], pgv_pga: [0.05, 0.1, 0.2, 0.4]}\nyaw: [0, 90]\n"
    "simulation: {engine: nonsmooth, time_step: 0.0015}\nuncertainty: {members: 0}\n"
)
AGE = 3000.0
FAULTS = """\
name,magnitude,distance_km,rate_per_year,mechanism
near,6.5,5,0.001,strike-slip
far,7.2,40,0.005,reverse
"""
TABLE = """\
magnitude,distance_km,pga_g,pga_log_sd,pgv_cm_s,pgv_log_sd
5,1,0.2,0.5,10,0.5
5,100,0.01,0.5,0.5,0.5
7,1,0.6,0.5,60,0.5
7,100,0.06,0.5,6,0.5
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "faults.csv").write_text(FAULTS)
    (tmp_path / "motion.csv").write_text(TABLE)
    return tmp_path


def site_text(
    folder: Path, *, age: str = f"{{kind: normal, mean: {AGE:g}}}", more: str = ""
) -> str:
    return f"{BOX}{GRID}hazard: {{faults: {folder / 'faults.csv'}, age: {age}{more}}}\n"


def chance(fits: xr.Dataset, magnitude: float, distance: float) -> float:
    """Probability of toppling, summed over both residuals, with the fits of the nearest row."""
    parts = np.linspace(-6.0, 6.0, 1501)
    one, other = (part.ravel() for part in np.meshgrid(parts, parts))
    own = np.array([magnitude]), np.array([distance])
    pga = np.exp(PGA.log_median(*own) + PGA.log_sd * one) / 9.80665
    joined = CORRELATION * one + np.sqrt(1.0 - CORRELATION**2) * other
    pgv = np.exp(PGV.log_median(*own) + PGV.log_sd * joined)
    rows = np.log(fits["pgv_pga"].values)
    row = np.abs(np.log(pgv / (9.80665 * pga))[:, None] - rows).argmin(axis=1)
    theta, beta = (fits[name].values[:, 0][:, row] for name in ("theta", "beta"))
    weight = norm.pdf(one) * norm.pdf(other)
    return float(norm.cdf(np.log(pga / theta) / beta).mean(axis=0) @ weight / weight.sum())


def test_numbers_are_those_of_fits_and_ground_motion(
    vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path, folder: Path
) -> None:
    ran = vsr("run", "exclusion", "--site", write_site(site_text(folder)))
    assert ran.code == 0, ran.err
    with xr.open_dataset(derived / "rock" / "fragility.nc") as fits:
        wanted = [chance(fits, 6.5, 5.0), chance(fits, 7.2, 40.0)]
    rows = list(csv.DictReader((derived / "rock" / "exclusion_faults.csv").open()))
    found = np.array([float(row["toppling_probability"]) for row in rows])
    np.testing.assert_allclose(found, wanted, rtol=0.004)
    rates = np.array([0.001, 0.005])
    survived = np.array([float(row["survival"]) for row in rows])
    np.testing.assert_allclose(survived, np.exp(-rates * found * AGE), rtol=1e-4)
    assert [row["rejected"] for row in rows] == [str(int(one < 0.05)) for one in survived]
    with xr.open_dataset(derived / "rock" / "exclusion.nc") as data:
        assert data["survival_together"].item() == pytest.approx(survived.prod(), rel=1e-6)
        by_distance = data["scenario_toppling_probability"].values
        assert (np.diff(by_distance, axis=1) <= 1e-12).all()
        assert (np.diff(by_distance[:, 0]) >= 0.0).all()
        one = data.sel(magnitude=6.5, method="nearest")
        least = one["least_distance"].sel(standing_probability=0.95).item()
        there = np.interp(
            np.log(least), np.log(data["distance"]), one["scenario_toppling_probability"]
        )
        assert there == pytest.approx(0.05, abs=0.002)
    page = (derived / "rock" / "exclusion.html").read_text(encoding="utf-8")
    assert "<strong>near</strong>" in page or "of each fault with 5" in page


def test_a_fault_is_weighed_by_all_kinds_of_its_earthquakes(
    vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path, folder: Path
) -> None:
    """Each kind alone it would survive, both it would not; it is one fault of two."""
    kinds = "near,6.5,5,{0:g},\nnear,6.51,5,{0:g},\nother,6.5,60,1e-5,\n"
    head = "name,magnitude,distance_km,rate_per_year,mechanism\n"
    site = write_site(site_text(folder, more=", minimum_survival_probability: 0.05"))
    (folder / "faults.csv").write_text(head + kinds.format(1e-4))
    assert vsr("run", "exclusion", "--site", site).code == 0
    with xr.open_dataset(derived / "rock" / "exclusion.nc") as data:
        chances = data["fault_toppling_probability"].values
    rate = -np.log(0.1) / (AGE * chances[0])  # of each kind a tenth survives
    (folder / "faults.csv").write_text(head + kinds.format(rate))
    ran = vsr("run", "exclusion", "--site", site)
    assert (ran.code, "1 of 2 faults rejected" in ran.err) == (0, True), ran.err
    rows = list(csv.DictReader((derived / "rock" / "exclusion_faults.csv").open()))
    survived = np.array([float(row["survival"]) for row in rows])
    both = np.exp(-AGE * rate * chances[:2].sum())
    np.testing.assert_allclose(survived[:2], [both, both], rtol=1e-5)
    assert [row["rejected"] for row in rows] == ["1", "1", "0"]
    page = (derived / "rock" / "exclusion.html").read_text(encoding="utf-8")
    assert "<strong>near</strong> (M&nbsp;6.5 and 6.51)" in page


@pytest.mark.slow
def test_other_faults_simulate_nothing_and_none_need_no_age(
    vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path, folder: Path
) -> None:
    site = write_site(site_text(folder))
    assert vsr("run", "exclusion", "--site", site).code == 0
    stored = (derived / "rock" / "responses.nc").stat().st_mtime_ns
    (folder / "faults.csv").write_text(FAULTS.replace("0.001", "0.1"))
    again = vsr("run", "exclusion", "--site", site)
    assert "1 of 2 faults rejected" in again.err
    assert (derived / "rock" / "responses.nc").stat().st_mtime_ns == stored
    without = ("--set", "hazard.age=null", "--set", "hazard.faults=null")
    bare = vsr("run", "exclusion", "--site", site, *without)
    assert (bare.code, "no faults given" in bare.err) == (0, True), bare.err
    assert len((derived / "rock" / "exclusion_faults.csv").read_text().splitlines()) == 1


def test_tables_of_one_name_both_count(write_site: Callable[..., str], folder: Path) -> None:
    tables = [folder / one / "near.csv" for one in ("faults", "motion")]
    for table, text in zip(tables, (FAULTS, TABLE), strict=True):
        table.parent.mkdir()
        table.write_text(text)
    site = f"hazard: {{faults: {tables[0]}, ground_motion: {tables[1]}, age: {{kind: normal, "
    config = load_site(write_site(f"{BOX}{GRID}{site}mean: {AGE:g}}}}}\n"))

    def key() -> str:
        return identities("exclusion", config)["exclusion"].key

    found = [key()]
    for table, old, new in zip(tables, ("0.001", "0.06"), ("0.1", "0.07"), strict=True):
        table.write_text(table.read_text().replace(old, new))
        found.append(key())
    assert len(set(found)) == 3


@pytest.mark.slow
def test_a_table_takes_the_place_of_the_equations(
    vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path, folder: Path
) -> None:
    more = f", ground_motion: {folder / 'motion.csv'}"
    ran = vsr("run", "exclusion", "--site", write_site(site_text(folder, more=more)))
    assert ran.code == 0, ran.err
    with xr.open_dataset(derived / "rock" / "exclusion.nc") as data:
        assert (data["magnitude"][0], data["magnitude"][-1]) == (5.0, 7.0)
        assert (data["distance"][0], data["distance"][-1]) == (1.0, 100.0)
    page = (derived / "rock" / "exclusion.html").read_text(encoding="utf-8")
    assert "hazard.ground_motion" in page


@pytest.mark.slow
def test_a_fault_to_which_no_shaking_model_reaches_is_told(
    vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path, folder: Path
) -> None:
    """The nearest shaking of a table is far too strong at 400 km, and M 9.5 is no M 7.6."""
    text = FAULTS + 'far out,6,400,0.001,\nhuge,9.5,50,0.001,\n"#3 of us",6,0,0.001,\n'
    (folder / "faults.csv").write_text(text)
    table = f", ground_motion: {folder / 'motion.csv'}"
    for more, wanted in (("", "00110"), (table, "01111")):
        ran = vsr("run", "exclusion", "--site", write_site(site_text(folder, more=more)))
        number = wanted.count("1")
        told = f"{number} beyond what the shaking is known of"
        assert (ran.code, told in ran.err) == (0, True), ran.err
        assert "exclusion: M 9.5 of huge comes 0.001 times a year" in ran.err
        with (derived / "rock" / "exclusion_faults.csv").open() as file:
            rows = list(csv.DictReader(file))
        assert "".join(row["beyond"] for row in rows) == wanted
        assert rows[-1]["name"] == "#3 of us"
        page = (derived / "rock" / "exclusion.html").read_text(encoding="utf-8")
        assert page.count("beyond the shaking known") == number


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("faults.csv", FAULTS.replace("0.005", "-1"), ("rate_per_year", "'-1' in row 2")),
        ("faults.csv", FAULTS.replace("6.5", "65"), ("magnitude", "'65' in row 1")),
        ("faults.csv", FAULTS.replace("far,7.2,40", "near,6.5,5"), ("twice",)),
        ("faults.csv", FAULTS.splitlines()[0] + "\n", ("0 rows", "1 to 5,000")),
        ("faults.csv", FAULTS.replace("rate_per_year", "rate"), ("no such column",)),
        ("motion.csv", TABLE.rsplit("7,100", 1)[0], ("3 rows of 2", "every distance")),
        ("motion.csv", TABLE.replace(",10,", ",0.1,"), ("PGV/PGA", "cm/s")),
        ("motion.csv", TABLE.replace("0.6", "600"), ("pga_g", "'600' in row 3")),
        ("motion.csv", TABLE.replace("0.6", "5.88"), ("pga_g", "'5.88' in row 3", "not in m/s2")),
    ],
)  # fmt: skip
def test_a_broken_file_is_refused_before_anything_runs(
    vsr: Callable[..., Ran],
    write_site: Callable[..., str],
    derived: Path,
    folder: Path,
    name: str,
    text: str,
    words: tuple[str, ...],
) -> None:
    (folder / name).write_text(text)
    more = f", ground_motion: {folder / 'motion.csv'}"
    ran = vsr("run", "exclusion", "--site", write_site(site_text(folder, more=more)))
    assert ran.code == 2, ran.err
    (line,) = [line for line in ran.err.splitlines() if line.startswith("vsr: ")]
    assert name in line
    assert [word for word in words if word not in line] == []
    assert not (derived / "rock" / "responses.nc").exists()


def test_faults_need_an_age(
    vsr: Callable[..., Ran], write_site: Callable[..., str], folder: Path
) -> None:
    ran = vsr("run", "exclusion", "--site", write_site(site_text(folder, age="null")))
    assert (ran.code, "hazard.age: got nothing" in ran.err) == (2, True), ran.err
