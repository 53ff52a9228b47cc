"""`vsr run hazard` on a block and the shipped curves, recomputed here from curves and fits.

Nothing of the program's physics is used: curves are parsed, interpolated and integrated anew, ages
are integrated in closed form, and the numbers of the page are those found here.
"""

from __future__ import annotations

import csv
import html
import math
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from conftest import Ran
from matplotlib.figure import Figure
from scipy.stats import norm
from support.hazard_site import (
    AGE,
    BOX,
    CURVES,
    GRID,
    HAZARD,
    LEAST,
    SD,
    Array,
    by_row,
    levels_and_rates,
    parts_of,
    rate_at,
    survived,
)

from pipeline import cli
from pipeline.stages.hazard import hazard as stage
from pipeline.stages.hazard import hazard_page
from pipeline.stages.hazard.hazard_figures import shaking
from pipeline.stages.hazard.sensitivity import AS_GIVEN, AS_TESTED, BASE_CASE, DRAWN_ANEW
from pipeline.stages.observations import observations
from pipeline.workflow.datasets import read


def weights() -> Array:
    lines = (CURVES / "realizations_1.csv").read_text(encoding="utf-8").splitlines()[2:]
    found = np.array([float(line.split(",")[2]) for line in lines])
    return found / found.sum()


def level_at(rate: float, levels: Array, rates: Array) -> float:
    held = rates > 0.0
    x, y = np.log(levels[held])[::-1], np.log(rates[held])[::-1]
    return float(np.exp(np.interp(math.log(rate), y, x)))


def toppling_rate(hazard: xr.Dataset, levels: Array, rates: Array) -> float:
    """Integral of the probability over the rates, on a grid of its own."""
    held = levels[rates > 0.0]
    fine = np.geomspace(held[0], held[-1], 20_000)
    chance = np.interp(np.log(fine), np.log(hazard["pga"]), hazard["toppling_probability"])
    exceeded = rate_at(fine, levels, rates)
    within = (0.5 * (chance[1:] + chance[:-1]) * -np.diff(exceeded)).sum()
    return float(within + chance[-1] * exceeded[-1])


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the products of a block whose hazard is asked."""
    folder = tmp_path_factory.mktemp("hazard")
    (folder / "rock.yaml").write_text(BOX + GRID + HAZARD, encoding="utf-8")
    given = ["run", "hazard", "--site", str(folder / "rock.yaml"), "--workers", "0"]
    assert cli.main([*given, "--derived", str(folder / "derived")]) == 0
    return folder / "derived" / "rock"


@pytest.fixture(scope="module")
def hazard(made: Path) -> xr.Dataset:
    return read(made / "hazard.nc")


@pytest.fixture(scope="module")
def table(made: Path) -> dict[str, list[str]]:
    with (made / "hazard.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {name: [row[name] for row in rows] for name in rows[0]}


@pytest.fixture(scope="module")
def page(made: Path) -> str:
    """Text of the page, without its pictures and tags."""
    text = (made / "hazard.html").read_text(encoding="utf-8")
    text = re.sub(r"<style>.*?</style>", " ", text, flags=re.DOTALL)
    text = re.sub(r"</t[dh]>", " | ", text)
    text = html.unescape(re.sub(r"<[^>]*>", "", text))
    return " ".join(text.replace("\u202f", "").split())


def test_the_table_has_the_columns_that_are_promised(table: dict[str, list[str]]) -> None:
    assert list(table) == [
        "branch", "path", "weight", "toppling_rate_per_year", "survival", "survival_low",
        "survival_high", "survival_error", "rejected", "new_weight",
    ]  # fmt: skip
    assert table["branch"] == [str(n) for n in range(9)]
    assert table["path"][3] == "AB~A"


def test_figures_and_cases_can_be_downloaded_as_they_are_in_the_dataset(
    hazard: xr.Dataset, made: Path
) -> None:
    curves = pd.read_csv(made / "hazard_curves.csv")
    ages = pd.read_csv(made / "hazard_survival.csv")
    cases = pd.read_csv(made / "hazard_cases.csv")
    for number, name in enumerate(hazard["branch"].values):
        told = curves[f"branch_{name}_per_year"], ages[f"survival_branch_{name}"]
        for found, own in zip(told, ("branch_rate", "survival_at_age"), strict=True):
            np.testing.assert_allclose(found, hazard[own][number], rtol=1e-5)
    upper = hazard["rate_after"].sel(fractile=0.95)
    np.testing.assert_allclose(curves["fractile_0.95_after_per_year"], upper, rtol=1e-5)
    np.testing.assert_allclose(curves["pga_g"], hazard["pga"], rtol=1e-5)
    assert cases["case"].tolist() == hazard["case"].values.tolist()
    np.testing.assert_allclose(cases["survival"], hazard["case_survival"], rtol=1e-5)


def test_rates_and_survival_are_those_of_curves_and_fragility(
    hazard: xr.Dataset, table: dict[str, list[str]]
) -> None:
    levels, rates = levels_and_rates("PGA")
    expected = np.array([toppling_rate(hazard, levels, row) for row in rates])
    np.testing.assert_allclose(hazard["toppling_rate"], expected, rtol=2e-3)
    chances = survived(expected)
    np.testing.assert_allclose(hazard["survival"], chances, rtol=1e-2)
    rejected = chances < LEAST
    assert 0 < rejected.sum() < 9, "the example shows both"
    assert [bool(int(one)) for one in table["rejected"]] == rejected.tolist()
    new = np.where(rejected, 0.0, weights() * chances)
    np.testing.assert_allclose(hazard["new_weight"], new / new.sum(), rtol=1e-2)
    assert float(hazard["new_weight"].sum()) == pytest.approx(1.0)
    np.testing.assert_allclose(np.array(table["survival"], float), hazard["survival"], rtol=1e-5)
    low, high = (hazard[f"survival_{end}"].values for end in ("low", "high"))
    assert (low <= hazard["survival"].values).all()
    assert (high >= hazard["survival"].values).all()
    effective = 1.0 / (weights() ** 2).sum()
    assert hazard["effective_branches_before"].item() == pytest.approx(effective)


def test_curves_before_and_after(hazard: xr.Dataset) -> None:
    levels, rates = levels_and_rates("PGA")
    for name, weight in (("before", weights()), ("after", hazard["new_weight"].values)):
        mean = weight @ rates
        at = np.array([0.02, 0.1, 0.5])
        found = np.interp(np.log(at), np.log(hazard["pga"]), np.log(hazard[f"mean_rate_{name}"]))
        # the grid of the dataset is finer than, but not on, the levels of the curves
        np.testing.assert_allclose(np.exp(found), rate_at(at, levels, mean), rtol=1e-3)
        for years in (475.0, 2475.0):
            pga = float(hazard[f"pga_{name}"].sel(return_period=years))
            assert pga == pytest.approx(level_at(1.0 / years, levels, mean), rel=1e-6)
        here = int(np.abs(hazard["pga"].values - 0.2).argmin())
        branch = np.array([rate_at(hazard["pga"].values[[here]], levels, row)[0] for row in rates])
        order = np.argsort(branch)
        reached = np.cumsum(weight[order]) >= 0.5 - 1e-12
        median = branch[order][np.flatnonzero(reached)[0]]
        assert hazard[f"rate_{name}"].sel(fractile=0.5).values[here] == pytest.approx(median)


def test_the_mean_curve_scaled_leaves_just_the_chance_asked_for(
    made: Path, hazard: xr.Dataset
) -> None:
    """Velocities go with accelerations, so that an earthquake keeps its PGV/PGA."""
    levels, rates = levels_and_rates("PGA")
    pga, rate = parts_of(levels, weights() @ rates)
    fits, scale = read(made / "fragility.nc"), hazard["scale_factor"].item()
    chance = by_row(fits, hazard, pga, scale).sum(axis=0)
    assert survived(np.array(chance @ rate)) == pytest.approx(LEAST, rel=0.02)
    own = fits["pgv_pga"].values  # each twice the one before
    others = [fits.isel(pgv_pga=slice(first, None, 2)) for first in (0, 1)]
    others += [fits.assign_coords(pgv_pga=own * 2.0**part) for part in (-0.1, 0.1)]
    for end, furthest in (("low", min), ("high", max)):
        factor = hazard[f"scale_factor_{end}"].item()
        stood = [
            float(survived(np.array(by_row(one, hazard, pga, factor).sum(axis=0) @ rate)))
            for one in (fits, *others)
        ]
        assert furthest(stood) == pytest.approx(LEAST, rel=0.03)


def test_the_fragility_is_that_of_the_fits_over_pgv_pga_of_the_curves(
    made: Path, hazard: xr.Dataset
) -> None:
    """Drawn: a direction, and a PGV/PGA about that of curves exceeded as often."""
    fits = read(made / "fragility.nc")
    theta, beta = fits["theta"].values[:, 0], fits["beta"].values[:, 0]
    ratios = fits["pgv_pga"].values
    levels, rates = levels_and_rates("PGA")
    speeds, speed_rates = levels_and_rates("PGV")
    rng, number = np.random.default_rng(1), 200_000
    log_sd = math.hypot(0.2562, 0.1083) * math.log(10.0) * math.sqrt(1.0 - 0.733**2)
    for pga in (0.2, 0.4, 0.8):
        rate = float(rate_at(np.array([pga]), levels, weights() @ rates)[0])
        median = 0.01 * level_at(rate, speeds, weights() @ speed_rates) / (pga * 9.80665)
        drawn = np.log(median) + log_sd * rng.standard_normal(number)
        row = np.abs(drawn[:, None] - np.log(ratios)).argmin(axis=1)
        yaw = rng.integers(0, 2, number)
        chance = norm.cdf(np.log(pga / theta[yaw, row]) / beta[yaw, row]).mean()
        found = np.interp(np.log(pga), np.log(hazard["pga"]), hazard["toppling_probability"])
        assert found == pytest.approx(chance, abs=0.01)
    assert (np.diff(hazard["toppling_probability"]) >= 0.0).all()


def test_the_rate_is_told_by_pga_and_pgv_pga(made: Path, hazard: xr.Dataset) -> None:
    """Each bin against earthquakes counted one small step of PGA at a time, row by row."""
    levels, rates = levels_and_rates("PGA")
    pga, rate = parts_of(levels, weights() @ rates)
    toppling = rate * by_row(read(made / "fragility.nc"), hazard, pga)
    starts = hazard["pga_bin"].values
    # the last bin is what lies beyond the levels, and no step of the finest grid is split
    of = np.searchsorted(starts, pga, side="right") - 1
    of[-1] = len(starts) - 1
    counted = np.array([np.bincount(of, row, minlength=len(starts)) for row in toppling])
    total = counted.sum()
    found = hazard["toppling_rate_by_pgv_pga"].transpose("pgv_pga", "pga_bin")
    np.testing.assert_allclose(found, counted, rtol=0.02, atol=1e-3 * total)
    by_pga = hazard["toppling_rate_by_pga"].values
    np.testing.assert_allclose(by_pga, counted.sum(axis=0), rtol=0.02, atol=1e-3 * total)
    assert by_pga.sum() == pytest.approx(total, rel=5e-3)
    assert (by_pga > 0.01 * total).sum() > 5
    np.testing.assert_allclose(hazard["pga_bin_end"], np.append(starts[1:], np.inf))


def test_shaking_that_topples_is_drawn_on_its_axes(hazard: xr.Dataset) -> None:
    _, axes, _ = shaking(hazard, (0.1, 1.0)).axes
    assert axes.get_xlabel() == "peak ground acceleration [g]"
    assert axes.get_ylabel() == "PGV/PGA [s]"


def test_a_single_branch_is_compared_with_no_others(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its own curve is the mean, without fractiles, weights or a posterior beside it."""
    labels: list[str] = []

    def looked_at(figure: Figure) -> str:
        labels.extend(part.get_text() for legend in figure.legends for part in legend.get_texts())
        return "data:,"

    monkeypatch.setattr(hazard_page, "svg_uri", looked_at)
    for path in CURVES.glob("hazard_curve-mean-*.csv"):
        shutil.copy(path, tmp_path)
    command = ["run", "hazard", "--site", str(made.parents[1] / "rock.yaml"), "--workers", "0"]
    copy = shutil.copytree(made.parent, tmp_path / "derived")
    assert cli.main([*command, "--curves", str(tmp_path), "--derived", str(copy)]) == 0
    found = read(copy / "rock" / "hazard.nc")
    assert found["branch"].values.tolist() == ["mean"]
    assert labels == ["branch retained", "branch retained", "5 %"]  # of curves, and of survival
    page = (copy / "rock" / "hazard.html").read_text(encoding="utf-8")
    pga = found["pga_before"].sel(return_period=2475.0).item()
    assert f'<td class="n">2,475</td><td class="n">{pga:.3f}</td></tr>' in page
    assert 'alt="Prior and posterior weight' not in page
    said = page.partition("<h2>Assumptions")[0].partition("<h1>")[2]
    for words in (
        "fractile",
        "of the branches",
        "all branches",
        "prior weight times",
        "under each",
    ):
        assert words not in said, words


@pytest.mark.slow
@pytest.mark.parametrize("anew", [0.55, 0.65])
def test_draws_made_anew_are_said_to_stand_less_where_they_do(
    anew: float, made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the chance of pairs of several rocks, Jensen's inequality may not show."""
    shown_as, case = stage.page, {"survival": anew, "rejected": 2}
    drawn = {"drawn": True, "sampling": 0.01, "mean_survival": 0.6, "anew": case}
    monkeypatch.setattr(stage, "page", lambda *given: shown_as(*given) | drawn)
    command = ["run", "hazard", "--site", str(made.parents[1] / "rock.yaml"), "--workers", "0"]
    copy = shutil.copytree(made.parent, tmp_path / "derived")
    assert cli.main([*command, "--age", "3000", "--derived", str(copy)]) == 0
    page = (copy / "rock" / "hazard.html").read_text(encoding="utf-8").replace("\xa0", " ")
    assert f"{shown(anew)} over all branches in place of 60 %, with 2 of 9 rejected." in page
    assert ("which is smaller (Jensen" in page) is ("too readily:" in page) is (anew < 0.6)


@pytest.mark.slow
def test_of_shaking_that_topples_nothing_no_part_is_named(made: Path, tmp_path: Path) -> None:
    """The strongest has less than a millionth of the PGA that was simulated."""
    (tmp_path / "PGA").mkdir()
    text = "name,lon,lat,1e-8,1e-7,0.05\nhere,-120.9,35.2,1.0e-6,1.0e-9,0\n"
    (tmp_path / "PGA" / "curves.csv").write_text(text, encoding="utf-8")
    command = ["run", "hazard", "--site", str(made.parents[1] / "rock.yaml"), "--workers", "0"]
    command += ["--set", "hazard.pgv_pga={pga: [0.1], median: [0.1], log_sd: [0.4]}"]
    copy = shutil.copytree(made.parent, tmp_path / "derived")
    assert cli.main([*command, "--curves", str(tmp_path), "--derived", str(copy)]) == 0
    assert not read(copy / "rock" / "hazard.nc")["toppling_rate_by_pga"].values.any()
    page = (copy / "rock" / "hazard.html").read_text(encoding="utf-8")
    assert "Under the prior mean curve it topples in no shaking up to the last level." in page
    assert "There are none: the rock does not constrain the curves." in page
    for words in ("Half of them have", "of the rate comes from", "constrains the curves directly"):
        assert words not in page, words


def test_formulas_are_text_and_a_wrong_unit_shows_in_the_log(
    made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """PGA by the mean curve is that of the levels and rates of the files."""
    curves = tmp_path / "curves"
    shutil.copytree(CURVES, curves)
    path = curves / "realizations_1.csv"
    lines = path.read_text(encoding="utf-8")
    formula = "=HYPERLINK(1)"
    assert lines.count("AB~A,") == 1
    path.write_text(lines.replace("AB~A,", f"{formula},"), encoding="utf-8")
    command = ["run", "hazard", "--site", str(made.parents[1] / "rock.yaml"), "--workers", "0"]
    copy = shutil.copytree(made.parent, tmp_path / "derived")
    assert cli.main([*command, "--curves", str(curves), "--derived", str(copy)]) == 0
    with (copy / "rock" / "hazard.csv").open(newline="", encoding="utf-8") as file:
        assert [row["path"] for row in csv.DictReader(file)][3] == f"'{formula}"
    levels, rates = levels_and_rates("PGA")
    once = [level_at(1.0 / years, levels, weights() @ rates) for years in (475.0, 2475.0)]
    told = f"{once[0]:.3g} g is exceeded once in 475 years, and {once[1]:.3g} g once in 2,475"
    assert told in capsys.readouterr().err


def test_what_files_have_that_does_not_fit_is_told_on_the_page(made: Path, tmp_path: Path) -> None:
    """A disaggregated level that is exceeded in a day as often as the curves say in centuries."""
    edges = "mag_bin_edges=[5.0, 7.0], dist_bin_edges=[0.0, 20.0], investigation_time=0.003"
    lines = (f'#,,,,,"{edges}"', "imt,iml,poe,mag,dist,mean", "PGA,0.5,1e-3,6.0,10,1e-3", "")
    (tmp_path / "Mag_Dist-mean-0_2.csv").write_text("\n".join(lines), encoding="utf-8")
    command = ["run", "hazard", "--site", str(made.parents[1] / "rock.yaml"), "--workers", "0"]
    command += ["--set", f"hazard.disaggregation={tmp_path / 'Mag_Dist-mean-0_2.csv'}"]
    copy = shutil.copytree(made.parent, tmp_path / "derived")
    assert cli.main([*command, "--derived", str(copy)]) == 0
    text = (copy / "rock" / "hazard.html").read_text(encoding="utf-8")
    assert "<li>Of the files: disaggregated 0.5 g is exceeded 0.33 times a year" in text


def test_every_variable_is_described(hazard: xr.Dataset) -> None:
    assert hazard.attrs["Conventions"].startswith("CF-")
    for name, variable in hazard.variables.items():
        text = variable.dtype.kind in "OU"  # which has no unit
        assert variable.attrs.keys() >= ({"long_name"} if text else {"long_name", "units"}), name
    assert hazard["survival_at_age"].dims == ("branch", "age")
    width = np.diff(hazard["age"])[0]
    assert float(hazard["age_density"].sum() * width) == pytest.approx(1.0)
    at = np.exp(-hazard["toppling_rate"].values[:, None] * hazard["age"].values)
    np.testing.assert_allclose(hazard["survival_at_age"], at, rtol=1e-9)


def shown(chance: float) -> str:
    """A chance in percent as a table would round it."""
    if chance < 1e-4:
        return "less than 0.01 %"
    return f"{100 * chance:.0f} %" if chance >= 0.0995 else f"{100 * chance:#.2g} %"


def years(rate: float) -> str:
    """Years between events, to two digits."""
    return f"{float(f'{1.0 / rate:.2g}'):,.0f}"


def test_the_page_says_what_was_found(page: str, hazard: xr.Dataset) -> None:
    levels, rates = levels_and_rates("PGA")
    expected = np.array([toppling_rate(hazard, levels, row) for row in rates])
    chances = survived(expected)
    gone = np.flatnonzero(chances < LEAST)
    named = ", ".join(map(str, gone[:-1])) + f" and {gone[-1]}"
    weight = weights()
    kept = np.where(chances < LEAST, 0.0, weight)
    new = kept * chances / (kept * chances).sum()
    pga = [level_at(1 / 2475, levels, w @ rates) for w in (weight, kept / kept.sum(), new)]
    said = (
        f"The rock's survival probability is below 5 % under branches {named}; without them "
        f"the 2,475-year PGA falls from {pga[0]:.2f} to {pga[1]:.2f} g, and with the others "
        f"weighted by survival it is {pga[2]:.2f} g."
    )
    assert page.index(said) < 200, "the sentence stands first"
    assert f"The rejected branches have {shown(weight[gone].sum())} of the prior weight." in page
    assert f"the survival probability over all branches is {shown(weight @ chances)}." in page
    scale = hazard["scale_factor"].item()
    times = "would have to be" if scale < 1.0 else "were"
    assert f"every PGA of the curve, and PGV with it, {times} multiplied by {scale:.3g}" in page
    for period in (475, 2475, 10_000):
        cells = [level_at(1 / period, levels, w @ rates) for w in (weight, kept / kept.sum(), new)]
        row = " | ".join(f"{value:.3f}" for value in cells)
        assert f"{period:,} | {row}" in page
    effective = 1.0 / (weight**2).sum(), 1.0 / (new**2).sum()
    assert "{:.1f} prior, {:.1f} posterior".format(*effective) in page
    for n, chance in enumerate(chances):
        verdict = "rejected" if chance < LEAST else "retained"
        pattern = rf"{n} \| \S+ \| {weight[n]:.3f} \| {years(expected[n])} years \| "
        pattern += rf"{re.escape(shown(chance))} \| [^|]* to [^|]* \| {verdict}[^|]*\| "
        assert re.search(pattern + f"{new[n]:.3f}", page), n


def test_the_page_says_what_was_assumed_and_what_is_open(page: str, hazard: xr.Dataset) -> None:
    assert "Curves: Made up for this project, of no real place" in page
    assert "Age of rock: invented." in page
    assert f"{AGE:,.0f} ± {SD:,.0f} years" in page
    assert "120.86° W, 35.19° N" in page
    assert "Horizontal component of the curves: RotD50" in page
    assert "of equal rate of exceedance" in page
    pga = hazard["pga"].values
    assert 0.001 < pga[0] < pga[-1] < 4.0  # of a box, whose boundary is searched that far
    assert "Hatched" not in page
    assert "The rock is rigid and bears on all of its base" in page  # a box has no scan
    levels, rates = levels_and_rates("PGA")
    mean = weights() @ rates
    probability = hazard["toppling_probability"].values
    assert f"with a probability of {shown(probability[0])}." in page
    beyond = (1.0 - probability[-1]) * mean[mean > 0.0][-1]
    total = toppling_rate(hazard, levels, mean)
    assert f"would be larger by {shown(beyond / total)}." in page
    assert f"it topples once in {years(total)} years" in page
    for what in ("slippery", "yaw 0°", "yaw 90°", "PGV/PGA: a fifth smaller", "1.2 times"):
        assert what in page


def test_half_of_the_rate_comes_from_as_much_pga_as_the_page_says(
    page: str, hazard: xr.Dataset
) -> None:
    said = re.search(r"up to ([\d.]+) g, 90 % have ([\d.]+) to ([\d.]+) g", page)
    assert said
    levels, rates = levels_and_rates("PGA")
    mean = weights() @ rates
    total = toppling_rate(hazard, levels, mean)
    for share, text in zip((0.5, 0.05, 0.95), said.groups(), strict=True):
        cut = float(text)
        weaker = hazard.assign(
            toppling_probability=hazard["toppling_probability"].where(hazard["pga"] <= cut, 0.0)
        )
        # the page rounds to 0.01 g
        assert toppling_rate(weaker, levels, mean) / total == pytest.approx(share, abs=0.03)


def test_what_is_changed_stands_in_the_table_of_changes(
    made: Path, page: str, hazard: xr.Dataset
) -> None:
    """An age alone is changed by hand; the other rows against the numbers of the dataset."""
    levels, rates = levels_and_rates("PGA")
    nus = np.array([toppling_rate(hazard, levels, row) for row in rates])
    for quantile in (0.05, 0.95):
        age = norm.ppf(quantile, AGE, SD)
        chances = np.exp(-nus * age)
        new = np.where(chances < LEAST, 0.0, weights() * chances)
        after = level_at(1 / 2475, levels, new / new.sum() @ rates)
        cells = r"\| ([^|]*) \| (\d) of 9 \| (\S+)"
        found = re.search(rf"age: ([\d,]+) years, its {100 * quantile:g} % value {cells}", page)
        assert found
        assert float(found[1].replace(",", "")) == pytest.approx(age, abs=1.5)
        assert float(found[2].split()[0]) == pytest.approx(100 * weights() @ chances, abs=1.0)
        assert int(found[3]) == (chances < LEAST).sum()
        assert float(found[4]) == pytest.approx(after, abs=0.0051)
    fits = read(made / "compared" / "slippery" / "rock" / "fragility.nc")
    assert fits["friction"].values.tolist() == [0.3]
    for case in hazard["case"].values:
        row = hazard.sel(case=case)
        cells = f"{shown(row['case_survival'].item())} | {row['case_rejected'].item()} of 9"
        assert f"{case} | {cells}" in page


@pytest.mark.slow
def test_an_ensemble_gives_the_mean_and_its_members_the_range(
    vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path
) -> None:
    """Recomputed from the outcomes of the members: shares of directions, drawn PGV/PGA."""
    site = write_site(BOX + GRID.replace("members: 0", "members: 6") + HAZARD)
    ran = vsr("run", "hazard", "--site", site, "--workers", 0)
    assert ran.code == 0, ran.err
    found, drawn = (read(derived / "rock" / f"{name}.nc") for name in ("hazard", "uncertainty"))
    ratios, tried = drawn["pgv_pga"].values, drawn["pga"].values
    rng, number = np.random.default_rng(1), 200_000
    for pga in (0.3, 0.45):
        here = int(np.abs(tried - pga).argmin())
        at = np.abs(found["pga"].values - pga).argmin()
        middle, spread = (found[f"pgv_pga_{part}"].values[at] for part in ("median", "log_sd"))
        logs = np.log(middle) + spread * rng.standard_normal(number)
        row = np.abs(logs[:, None] - np.log(ratios)).argmin(axis=1)
        share = np.bincount(row, minlength=len(ratios)) / number
        members = drawn["overturned"].values[..., here].mean(axis=1) @ share
        low, high = np.percentile(members, [5.0, 95.0])
        for name, expected in (("low", low), ("high", high)):
            probability = found[f"toppling_probability_{name}"].values
            mine = np.interp(np.log(pga), np.log(found["pga"]), probability)
            assert mine == pytest.approx(expected, abs=0.02), (pga, name)
        z = np.log(pga / drawn["theta"].values) / drawn["beta"].values
        mean = np.interp(np.log(pga), np.log(found["pga"]), found["toppling_probability"])
        assert mean == pytest.approx(norm.cdf(z).mean(axis=0) @ share, abs=0.02)
    low, middle, high = (found[f"survival{end}"].values for end in ("_low", "", "_high"))
    assert ((low <= high) & (low <= middle) & (middle <= high)).all()
    page = (derived / "rock" / "hazard.html").read_text(encoding="utf-8")
    assert "5-95 % of the members" in page
    drawings = (derived / "rock" / "uncertainty.html").read_text(encoding="utf-8")
    for text in (page.partition("<h2>Assumptions")[2], drawings):  # of a box
        assert "of the scan" not in text
        assert "rock as scanned" not in text
    assert "as given, without uncertainty, slippery" in page
    used, anew = (float(found["case_survival"].sel(case=name)) for name in (BASE_CASE, DRAWN_ANEW))
    assert anew < used < 1.0
    rejected = int(found["case_rejected"].sel(case=DRAWN_ANEW))
    said = f"{shown(anew)} over all branches in place of {shown(used)}, with {rejected} of 9"
    assert said in page.replace("\N{NO-BREAK SPACE}", " ")
    ran = vsr("run", "uncertainty", "--site", site, "--set", "uncertainty.members=0")
    assert ran.code == 2
    assert "uncertainty.members" in ran.err


@pytest.mark.slow
@pytest.mark.parametrize("given", ["age", "curves"])
def test_another_age_or_other_curves_run_nothing(
    made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], given: str
) -> None:
    site = made.parents[1] / "rock.yaml"
    command = ["run", "hazard", "--site", str(site), "--derived", str(made.parent)]
    command += ["--workers", "0"]
    before = {path: path.stat().st_mtime_ns for path in made.rglob("*.nc")}
    curves = tmp_path / "PGA"
    curves.mkdir()
    text = "name,lon,lat,0.01,0.1,1.0\nhere,-120.9,35.2,0.20,4.0e-3,2.0e-5\n"
    (curves / "curves.csv").write_text(text, encoding="utf-8")
    changes = {"age": ["--age", "3000", "--age-sd", "500"], "curves": ["--curves", str(tmp_path)]}
    capsys.readouterr()
    assert cli.main([*command, *changes[given]]) == 0
    said = capsys.readouterr().err
    assert "hazard: " in said
    assert "runs done" not in said
    after = {path: path.stat().st_mtime_ns for path in made.rglob("*.nc")}
    remade = {path.name for path in after if after[path] != before[path]}
    assert remade - {"exclusion.nc"} == {"hazard.nc"}
    found = read(made / "hazard.nc")
    page = (made / "hazard.html").read_text(encoding="utf-8")
    other = given == "curves"
    assert found["branch"].values.tolist() == (["mean"] if other else list("012345678"))
    assert ("Nothing is known of PGV" in page) is other
    assert ("earthquakes of M 7.5 at 40 km" in page) is other
    assert ("3,000 ± 500 years" in page) is not other
    assert ("invented" in page) is other
    assert cli.main(command) == 0  # and back, for the other tests
    assert "runs done" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("file", "old", "new", "words"),
    [
        ("hazard_curve-rlz-004-PGA_1.csv", "imt='PGA'", "imt='PGV'", "imt"),
        ("hazard_curve-rlz-004-PGA_1.csv", "-120.86000", "-121.86000", "one site"),
        ("hazard_curve-rlz-004-PGA_1.csv", ",0.00000,", ",0.00000,1.0,", "34 fields in row 1"),
        ("hazard_curve-rlz-004-PGA_1.csv", "investigation_time=1.0", "", "years"),
        ("realizations_1.csv", "4,AB~B,1.3200000e-01\n", "", "weight"),
    ],
)
def test_curves_that_break_a_rule_are_refused_before_anything_runs(
    refused: Callable[..., str],
    write_site: Callable[..., str],
    tmp_path: Path,
    file: str,
    old: str,
    new: str,
    words: str,
) -> None:
    folder = tmp_path / "curves"
    folder.mkdir()
    for path in CURVES.glob("*.csv"):
        text = path.read_text(encoding="utf-8")
        if path.name == file:
            assert old in text
            text = text.replace(old, new, 1)
        (folder / path.name).write_text(text, encoding="utf-8")
    site = write_site(BOX + GRID)
    refused("run", "hazard", "--site", site, "--curves", folder, "--age", 1000, words=(words,))


ON_TABLE = "kind: table, pga: [0.5], pgv_pga: [0.2]"


@pytest.mark.parametrize(
    "pulses",
    [
        *("{axis: x, pga_ratio: 2}", "{axis: z}", "{axis: x}, {axis: x}"),
        *("{axis: x}, {axis: x, pga_ratio: -1}", "{axis: x}, {axis: x, pgv_pga: 0.1}"),
        "{axis: x, pgv_pga: 0.1}, {axis: z, pga_ratio: 0.3}",
    ],
)
def test_pulses_whose_pga_or_pgv_is_not_the_grounds_are_refused(
    refused: Callable[..., str], write_site: Callable[..., str], pulses: str
) -> None:
    table = f"motion={{{ON_TABLE}, pulses: [{pulses}]}}"
    site = write_site(BOX + GRID)
    given = ("run", "hazard", "--curves", CURVES, "--age", 5000)
    words = ("motion.pulses", "along x and y", "the larger horizontal component")
    refused(*given, "--site", site, "--set", table, words=words)
    compare = f'hazard.compare=[{{name: other, set: ["{table}"]}}]'
    words = (*words, "hazard.compare: other")
    refused(*given, "--site", site, "--set", compare, words=words)


def test_the_pga_of_a_table_along_x_and_z_is_that_of_x(
    vsr: Callable[..., Ran], write_site: Callable[..., str]
) -> None:
    table = f"motion={{{ON_TABLE}, pulses: [{{axis: x}}, {{axis: z, pga_ratio: 0.7}}]}}"
    age = "hazard.age={kind: normal, mean: 5000, sd: 0}"
    given = [word for one in (f"hazard.curves={CURVES}", age, table) for word in ("--set", one)]
    assert vsr("plan", "hazard", "--site", write_site(BOX + GRID), *given).code == cli.DONE


def test_a_file_whose_pgv_is_that_of_a_slow_z_is_refused(
    refused: Callable[..., str], write_site: Callable[..., str], tmp_path: Path
) -> None:
    """Beside x of 1 Hz a z of a fifth of its acceleration at 0.1 Hz has twice its velocity."""
    time = np.arange(0.0, 20.0, 0.005)
    window = np.sin(np.pi * time / time[-1]) ** 4
    x = window * np.sin(2.0 * np.pi * time) / (2.0 * np.pi) ** 2
    z = 0.2 * window * np.sin(0.2 * np.pi * time) / (0.2 * np.pi) ** 2
    for name, columns, head in (("level", [x], "x [m]"), ("slow", [x, z], "x [m],z [m]")):
        path = tmp_path / f"{name}.csv"
        table, names = np.column_stack([time, *columns]), f"time [s],{head}"
        np.savetxt(path, table, "%.9f", ",", header=names, comments="")
    site = write_site(BOX + "motion: {kind: table, files: level.csv, pga: [0.5]}\n")
    given = ("--curves", CURVES, "--age", 5000, "--set", "motion.files=[level.csv, slow.csv]")
    words = ("motion.files", "a PGV/PGA of 0.15", "(slow: 0.3")
    refused("run", "hazard", "--site", site, *given, words=words)


def test_curves_and_age_have_to_be_given(
    refused: Callable[..., str], write_site: Callable[..., str]
) -> None:
    site = write_site(BOX + GRID)
    refused("run", "hazard", "--site", site, words=("hazard.curves", "CURVES="))
    refused("run", "hazard", "--site", site, "--curves", CURVES, words=("hazard.age", "AGE="))
    wrong = ("--curves", CURVES, "--age", -5)
    refused("run", "hazard", "--site", site, *wrong, words=("hazard.age.mean", "-5"))


@pytest.mark.slow
def test_either_support_weighs_and_the_other_is_a_case(
    vsr: Callable[..., Ran],
    write_site: Callable[..., str],
    derived: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The year of an earthquake that the rock was seen to survive is no part of its age."""
    monkeypatch.setattr(observations, "FIRST", 16)
    monkeypatch.setattr(observations, "MOST", 16)
    grid = GRID.replace("members: 0", "members: 4, centre_of_mass: 0.02")
    grid = grid.replace("yaw: [0, 90]", "yaw: [0]").replace("0.1, 0.2, 0.4]", "0.1, 0.3]")
    site = write_site(f"{BOX}{grid}{HAZARD}")
    found, alone = {}, ("--set", "hazard.compare=[]")
    for support in ("tested", "scan"):
        ran = vsr("run", "hazard", "--site", site, *alone, "--set", f"hazard.support={support}")
        assert ran.code == 0, ran.err
        found[support] = read(derived / "rock" / "hazard.nc").load()
    for support, name in (("tested", AS_GIVEN), ("scan", AS_TESTED)):
        own, (other,) = found[support], found.keys() - {support}
        case = own.isel(case=own["case"].values.tolist().index(name))
        base = found[other].isel(case=0)
        assert float(case["case_survival"]) == pytest.approx(float(base["case_survival"]))
    quake = "{kind: earthquake, year: 1906, pga: 0.1, pga_log_sd: 0.3, pgv: 4, pgv_log_sd: 0.3}"
    old = (*alone, "--set", "hazard.age={kind: normal, mean: 1000, sd: 0}")
    for given, years in (((), 1000.0), (("--set", f"observations=[{quake}]"), 999.0)):
        ran = vsr("run", "hazard", "--site", site, *old, *given)
        assert ran.code == 0, ran.err
        own = read(derived / "rock" / "hazard.nc").load()
        anew = own["case"].values.tolist().index(DRAWN_ANEW)
        wanted = own["weight"] @ np.exp(-own["toppling_rate"] * years)
        assert float(own["case_survival"][anew]) == pytest.approx(float(wanted), rel=1e-9)
