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
from typing import Any

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from conftest import Ran
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.stats import norm

from pipeline import ROOT, cli, commands
from pipeline.config.layers import load_site
from pipeline.stages.archive.archived_rock import PGV_PGA, SHARP, answered
from pipeline.stages.hazard import hazard as stage
from pipeline.stages.hazard import hazard_page, other_rocks
from pipeline.stages.hazard.hazard_figures import shaking
from pipeline.stages.hazard.one_rock import alike_in_shape
from pipeline.stages.hazard.rock_ages import back_to
from pipeline.stages.hazard.sensitivity import AS_GIVEN, AS_TESTED, BASE_CASE, DRAWN_ANEW
from pipeline.stages.observations import observations
from pipeline.workflow import graph
from pipeline.workflow.datasets import read
from pipeline.workflow.stage import Job

Array = NDArray[np.float64]

CURVES = ROOT / "data" / "raw" / "hazard" / "made_up"
AGE, SD, LEAST = 3500.0, 400.0, 0.05
BOX = "rock: {shape: box, size: [0.25, 0.5, 1.2], density: 2110}\n"
GRID = (
    "motion: {pga: [0.15, 0.3, 0.45, 0.6], pgv_pga: [0.05, 0.1, 0.2, 0.4]}\nyaw: [0, 90]\n"
    "simulation: {engine: nonsmooth, time_step: 0.0015}\nuncertainty: {members: 0}\n"
)
HAZARD = (
    f"hazard: {{curves: {CURVES}, "
    f"age: {{kind: normal, mean: {AGE:g}, sd: {SD:g}, source: invented.}}, "
    "compare: [{name: slippery, set: [contact.friction=0.3]}]}\n"
)
FIVE_AGES = "age_a\n3000\n2900\n3100\n2000\n3000\n"

EXHUMED = (
    f"hazard: {{curves: {CURVES}, age: {{kind: samples, file: ages.csv}}, "
    "history: [{site: buried.yaml, until: {kind: normal, mean: 1200, source: invented}}]}\n"
)


def levels_and_rates(measure: str) -> tuple[Array, Array]:
    """Levels, and annual rates of each branch, of the shipped files: shape (branches, levels)."""
    rows = []
    for path in sorted(CURVES.glob(f"hazard_curve-rlz-*-{measure}_1.csv")):
        _, names, values = csv.reader(path.read_text(encoding="utf-8").splitlines())
        rows.append([-math.log1p(-float(value)) for value in values[3:]])
    return np.array([float(name.split("-")[1]) for name in names[3:]]), np.array(rows)


def weights() -> Array:
    lines = (CURVES / "realizations_1.csv").read_text(encoding="utf-8").splitlines()[2:]
    found = np.array([float(line.split(",")[2]) for line in lines])
    return found / found.sum()


def rate_at(level: Array, levels: Array, rates: Array) -> Array:
    held = rates > 0.0
    y = np.interp(np.log(level), np.log(levels[held]), np.log(rates[held]), right=-np.inf)
    return np.exp(y)


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


def by_row(fits: xr.Dataset, hazard: xr.Dataset, pga: Array, factor: float = 1.0) -> Array:
    """Probability of a PGV/PGA and of toppling at it, shape (rows, n), from the fits of a rock.

    The rock feels the shaking multiplied by the factor.

    A row stands for what is nearer to it than to the others, in logarithms; of the directions each
    is as likely.
    """
    theta, beta = (fits[name].values[:, 0, :, None] for name in ("theta", "beta"))
    chance = norm.cdf(np.log(factor * pga / theta) / beta).mean(axis=0)
    known = np.log(hazard["pga"].values)
    middle = np.interp(np.log(pga), known, np.log(hazard["pgv_pga_median"].values))
    spread = np.interp(np.log(pga), known, hazard["pgv_pga_log_sd"].values)
    rows = np.log(fits["pgv_pga"].values)
    borders = np.concatenate([[-np.inf], 0.5 * (rows[1:] + rows[:-1]), [np.inf]])
    return np.diff(norm.cdf((borders[:, None] - middle) / spread), axis=0) * chance


def shaken(fits: xr.Dataset, hazard: xr.Dataset, pga: Array) -> Array:
    """Probability of toppling at equally likely PGV/PGA, one a line, shape (lines, n).

    They are those of any rock, each of which topples by the row that is nearest.
    """
    theta, beta = (fits[name].values[:, 0, :, None] for name in ("theta", "beta"))
    chance = norm.cdf(np.log(pga / theta) / beta).mean(axis=0)
    known = np.log(hazard["pga"].values)
    middle = np.interp(np.log(pga), known, np.log(hazard["pgv_pga_median"].values))
    spread = np.interp(np.log(pga), known, hazard["pgv_pga_log_sd"].values)
    drawn = middle + spread * norm.ppf((np.arange(200) + 0.5) / 200)[:, None]
    rows = np.log(fits["pgv_pga"].values)
    nearest = np.abs(drawn[..., None] - rows).argmin(axis=-1)
    return chance[nearest, np.arange(len(pga))]


def parts_of(levels: Array, rates: Array) -> tuple[Array, Array]:
    """PGA in fine steps, the last beyond all levels, and the rate of earthquakes of each."""
    held = levels[rates > 0.0]
    fine = np.geomspace(held[0], held[-1], 5_000)
    exceeded = rate_at(fine, levels, rates)
    middles = np.sqrt(fine[1:] * fine[:-1])
    return np.append(middles, fine[-1]), np.append(-np.diff(exceeded), exceeded[-1])


def survived(rate: Array) -> Array:
    """Of a normal age, seven standard deviations from zero."""
    return np.exp(-rate * AGE + 0.5 * (rate * SD) ** 2)


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
    for what in ("slippery", "yaw 0°", "yaw 90°", "PGV/PGA: a quarter larger", "1.2 times"):
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


@pytest.mark.parametrize(("listed", "told"), [("", 0), ("400", 0), ("410", 0), ("4000", 1)])
def test_another_age_in_the_archive_is_told(
    vsr: Callable[..., Ran], write_site: Callable[..., str], listed: str, told: int
) -> None:
    rock = "{site: Ridge 7, archive: rocks.csv, age: {kind: bounds, low: 300, high: 500}}"
    site = write_site(BOX + GRID + HAZARD.split(", compare")[0] + f", rocks: [{rock}]}}\n")
    text = f"name,alpha_1_deg,alpha_2_deg,r_1_m,r_2_m,age_mean_a\nRidge 7,10,12,0.5,0.5,{listed}\n"
    Path(site).with_name("rocks.csv").write_text(text, encoding="utf-8")
    ran = vsr("plan", "hazard", "--site", site)
    said = "hazard.rocks: Ridge 7 is 400 years old, and 4,000 in its archive"
    assert (ran.code, ran.err.count(said)) == (cli.DONE, told), ran.err


def test_two_rocks_of_an_archive_that_topple_alike_are_told(
    vsr: Callable[..., Ran], write_site: Callable[..., str]
) -> None:
    """As one that is there by two names, with its sides exchanged."""
    age = "age: {kind: bounds, low: 300, high: 500}"
    rocks = ", ".join(f"{{site: {name}, archive: rocks.csv, {age}}}" for name in ("A", "B"))
    path = write_site(BOX + GRID + HAZARD)
    for other, number in (("12,10,0.5,0.4", 1), ("12,10.5,0.5,0.4", 0)):
        text = f"name,alpha_1_deg,alpha_2_deg,r_1_m,r_2_m\nA,10,12,0.4,0.5\nB,{other}\n"
        Path(path).with_name("rocks.csv").write_text(text, encoding="utf-8")
        ran = vsr("plan", "hazard", "--site", path, "--set", f"hazard.rocks=[{rocks}]")
        said = "hazard.rocks: B topples as A does, in either direction"
        assert (ran.code, ran.err.count(said)) == (cli.DONE, number), ran.err


@pytest.mark.slow
def test_a_rock_of_an_archive_stands_beside_that_of_the_site(
    vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path
) -> None:
    """The older of the two is the site's own, as in the test of two sites."""
    hazard = HAZARD.split(", compare")[0] + (
        ", rocks: [{site: Ridge 7, archive: rocks.csv, "
        "age: {kind: bounds, low: 300, high: 500}}]}\n"
    )
    site = write_site(BOX + GRID + hazard, name="beside")
    archive = Path(site).with_name("rocks.csv")
    header = "name,alpha_1_deg,alpha_2_deg,r_1_m,r_2_m\n"
    archive.write_text(f"{header}Ridge 7,10,12,0.5,0.5\n", encoding="utf-8")
    ran = vsr("run", "hazard", "--site", site, "--workers", 0)
    assert ran.code == 0, ran.err
    found = read(derived / "beside" / "hazard.nc")
    rock = answered(archive, "Ridge 7")
    dims = ("yaw", "friction", "pgv_pga")
    photographed = xr.Dataset(
        {
            "theta": (dims, rock.median[:, None]),
            "beta": (dims, np.hypot(rock.log_sd, SHARP)[:, None]),
        },
        {"pgv_pga": list(PGV_PGA)},
    )
    levels, rates = levels_and_rates("PGA")
    for row, survival in zip(rates, found["survival"].values, strict=True):
        pga, rate = parts_of(levels, row)
        own = shaken(read(derived / "beside" / "fragility.nc"), found, pga)
        only = float(rate @ ((1.0 - own) * shaken(photographed, found, pga)).mean(axis=0))
        spared = (math.exp(-300.0 * only) - math.exp(-500.0 * only)) / (200.0 * only)
        assert spared < 0.999
        assert survival == pytest.approx(survived(rate @ own.mean(axis=0)) * spared, rel=0.02)
    assert "hazard: up to date" in vsr("why", "hazard", "--site", site).out
    archive.write_text(f"{header}Ridge 7,10,12,0.6,0.6\n", encoding="utf-8")
    assert "hazard: up to date" not in vsr("why", "hazard", "--site", site).out
    archive.write_text(f"{header}Ridge 8,10,12,0.6,0.6\n", encoding="utf-8")
    refused = vsr("run", "hazard", "--site", site, "--workers", 0)
    assert refused.code == 2
    assert "no such rock; its rocks are Ridge 8" in refused.err


@pytest.mark.slow
def test_rocks_of_one_site_are_combined(
    vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path
) -> None:
    """The younger stands with the older while it is there, and topples or not by itself.

    Of the older all ages are longer than any of the younger, so that the chance is that of the
    older alone, times that of no earthquake in the younger's time that topples only the younger.
    """
    write_site(BOX.replace("0.25", "0.3") + GRID, name="broad")
    hazard = HAZARD.split(", compare")[0] + (
        ", rocks: [{site: broad.yaml, age: {kind: bounds, low: 300, high: 500}}]}\n"
    )
    site = write_site(BOX + GRID + hazard)
    ran = vsr("run", "hazard", "--site", site, "--workers", 0)
    assert ran.code == 0, ran.err
    found = read(derived / "rock" / "hazard.nc")
    page = (derived / "rock" / "hazard.html").read_text(encoding="utf-8")
    assert "The 2 rocks&#39; joint survival probability" in page
    assert "age are changed of rock alone" in page
    levels, rates = levels_and_rates("PGA")
    expected, alone = [], []
    for row in rates:
        pga, rate = parts_of(levels, row)
        narrow, broad = (
            shaken(read(derived / name / "fragility.nc"), found, pga) for name in ("rock", "broad")
        )
        only = float(rate @ ((1.0 - narrow) * broad).mean(axis=0))
        spared = (math.exp(-300.0 * only) - math.exp(-500.0 * only)) / (200.0 * only)
        alone.append(survived(rate @ narrow.mean(axis=0)))
        expected.append(alone[-1] * spared)
    assert min(np.array(expected) / alone) < 0.98
    np.testing.assert_allclose(found["survival"], expected, rtol=0.02)
    (derived / "broad" / "fragility.nc").write_bytes(b"else")
    why = vsr("why", "hazard", "--site", site).out
    assert "hazard: up to date" in why
    assert "fragility: fragility.nc is not what was written" in why
    other = Path(site).with_name("broad.yaml")
    other.write_text(other.read_text(encoding="utf-8").replace("density: 2", "density: 1"))
    assert "hazard: file ../broad edited" in vsr("why", "hazard", "--site", site).out


@pytest.mark.slow
def test_a_rock_that_came_out_of_the_ground(
    vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path
) -> None:
    """exp(-nu T - nu' T') by the fragilities of two sites; ages are in a file of samples."""
    write_site(BOX.replace("1.2]", "0.9]") + GRID, name="buried")
    site = write_site(BOX + GRID + EXHUMED)
    ages = Path(site).with_name("ages.csv")
    ages.write_text("age_a\n2500\n4000\n", encoding="utf-8")
    ran = vsr("run", "hazard", "--site", site, "--workers", 0)
    assert ran.code == 0, ran.err
    found = read(derived / "rock" / "hazard.nc")
    page = (derived / "rock" / "hazard.html").read_text(encoding="utf-8")
    assert (
        "Until 1,200 years, taken as exact before present (invented) rock stood as buried" in page
    )
    levels, rates = levels_and_rates("PGA")
    expected = []
    for row in rates:
        pga, rate = parts_of(levels, row)
        now, before = (
            float(rate @ by_row(read(derived / name / "fragility.nc"), found, pga).sum(axis=0))
            for name in ("rock", "buried")
        )
        assert before < 0.8 * now
        expected.append(
            np.mean([math.exp(-1200 * now - (t - 1200) * before) for t in (2500, 4000)])
        )
    np.testing.assert_allclose(found["survival"], expected, rtol=0.02)
    assert "history: as it stands now, for all of its age" in found["case"].values.tolist()
    assert "hazard: up to date" in vsr("why", "hazard", "--site", site).out
    ages.write_text("age_a\n2500\n4100\n", encoding="utf-8")
    assert "hazard: up to date" not in vsr("why", "hazard", "--site", site).out


@pytest.mark.parametrize(
    ("ages", "given", "words"),
    [
        ("age_a\n2500\nold\n", (), ("ages.csv", "age_a", "row 2")),
        ("age_a,weight\n2500,0.9\n", (), ("ages.csv", "weight", "another column")),
        ("age_ka\n2.5\n", (), ("ages.csv", "age_a", "no such column")),
        ("age_a\n", (), ("ages.csv", "0 rows")),
        ("age_a\n2.5\n3.1\n", (), ("ages.csv", "age_a", "ages up to 3.1", "thousands")),
        (
            "age_a\n3000\n",
            ("hazard.age={kind: normal, mean: 150, sd: 1000}",),
            ("hazard.age.sd", "got 1000", "exchange mean and sd"),
        ),
        (f"{FIVE_AGES}14000\n", (), ("ages.csv", "age_a", "14000, the sum of the others")),
        (
            FIVE_AGES.replace("age_a", "age_a\n14000"),
            (),
            ("ages.csv", "age_a", "14000, the sum of the others"),
        ),
        ("age_a\n3000\n#2900\n3100\n", (), ("ages.csv", "age_a", "'#2900', a row or a comment")),
        ("age_a\n3000\n#VALUE!\n2900\n", (), ("ages.csv", "age_a", "'#VALUE!' in row 2")),
        ("age_a\n3000\n33002900\n", (), ("ages.csv", "age_a", "got 3.30029e+07", "in one line")),
        ("age_a\n900\n800\n", (), ("hazard.history", "in their order in 0 of 2 draws")),
        (None, (), ("ages.csv",)),
        ("age_a\n5000\n", ("hazard.age.values=[5000]",), ("hazard.age", "both")),
        ("age_a\n5000\n", ("hazard.age={kind: samples, file: null}",), ("hazard.age", "neither")),
        (
            "age_a\n5000\n",  # in cm/s/g
            ("hazard.pgv_pga={pga: [0.1], median: [80], log_sd: [0.5]}",),
            ("hazard.pgv_pga.median.0", "got 80", "[s]"),
        ),
        (
            "age_a\n5000\n",
            ("hazard.history=[{site: rock.yaml, until: {kind: normal, mean: 500}}]",),
            ("hazard.history", "rock twice"),
        ),
        ("age_a\n5000\n", ("contact.friction=0.3",), ("hazard.history", "got --set contact.fri")),
        (
            "age_a\n5000\n",
            ("hazard.minimum_survival_probability=0.1 contact.friction=0.3",),
            ("hazard.history", "got --set contact.fri"),
        ),
    ],
)
def test_ages_and_stages_that_cannot_be_are_refused(
    refused: Callable[..., str],
    write_site: Callable[..., str],
    ages: str | None,
    given: tuple[str, ...],
    words: tuple[str, ...],
) -> None:
    write_site(BOX.replace("1.2]", "0.9]") + GRID, name="buried")
    site = write_site(BOX + GRID + EXHUMED)
    if ages is not None:
        Path(site).with_name("ages.csv").write_text(ages, encoding="utf-8")
    refused("run", "hazard", "--site", site, *(f"--set={one}" for one in given), words=words)


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


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("rocks=[{site: rock.yaml, age: {kind: normal, mean: 500}}]", "rock twice"),
        ("compare=[{name: a, set: [yaw=30]},{name: a, set: [yaw=40]}]", "'a' twice"),
        ("compare=[{name: a b, set: [yaw=30]},{name: a_b, set: [yaw=40]}]", "twice"),
        ("compare=[{name: a, set: [yaw=30]},{name: A, set: [yaw=40]}]", "'a' twice"),
        ("compare=[{name: a, set: [yaw=30]},{name: 'a ', set: [yaw=40]}]", "'a' twice"),
        ("compare=[{name: a  b, set: [yaw=30]},{name: a b, set: [yaw=40]}]", "'a b' twice"),
        ("compare=[{name: base case, set: [yaw=30]}]", "'base case' twice"),
    ],
)
def test_a_rock_or_a_comparison_counts_once(
    refused: Callable[..., str], write_site: Callable[..., str], setting: str, words: str
) -> None:
    path = Path(write_site(BOX + GRID + HAZARD))
    key, _, value = setting.partition("=")
    text = path.read_text(encoding="utf-8").replace(
        ", compare: [{name: slippery, set: [contact.friction=0.3]}]}", f", {key}: {value}}}"
    )
    path.write_text(text, encoding="utf-8")
    refused("run", "hazard", "--site", path, words=(f"hazard.{key}", words))


def test_a_copy_of_a_file_is_no_rock_of_its_own(
    refused: Callable[..., str], write_site: Callable[..., str]
) -> None:
    """Nor is one with a remark, in another folder."""
    path = Path(write_site(BOX + GRID + HAZARD))
    copy = path.parent / "elsewhere" / "copy.yaml"
    copy.parent.mkdir()
    copy.write_text(f"# The other rock\n{path.read_text(encoding='utf-8')}", encoding="utf-8")
    rocks = f"hazard.rocks=[{{site: {copy}, age: {{kind: normal, mean: 500}}}}]"
    refused(
        *("run", "hazard", "--site", path, "--set", rocks), words=("hazard.rocks", "a copy of rock")
    )


def test_rocks_that_differ_in_nothing_that_counts_are_told(
    vsr: Callable[..., Ran], write_site: Callable[..., str]
) -> None:
    other = write_site(BOX + GRID, name="other")
    path = write_site(BOX + GRID + HAZARD)
    rocks = f"hazard.rocks=[{{site: {other}, age: {{kind: normal, mean: 500}}}}]"
    said = "hazard.rocks: other is as rock in shape, settings and runs"
    ran = vsr("plan", "hazard", "--site", path, "--set", rocks)
    assert (ran.code, ran.err.count(said)) == (cli.DONE, 1), ran.err


def test_rocks_of_one_size_and_shape_are_told(
    vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path
) -> None:
    """However heavy; another one of its shape is larger."""
    boxes = {
        "rock": BOX,
        "heavy": BOX.replace("2110", "2700"),
        "large": BOX.replace("0.25, 0.5, 1.2", "0.5, 1.0, 2.4"),
    }
    for name, text in boxes.items():
        vsr("run", "rock", "--site", write_site(text + GRID, name=name))
    found = {name: xr.open_dataset(derived / name / "rock.nc") for name in boxes}
    (said,) = alike_in_shape(found)
    assert said.startswith("hazard.rocks: heavy has the size of rock, and tips as easily")


def test_a_setting_that_a_comparison_cannot_have_is_refused_by_its_name(
    refused: Callable[..., str],
) -> None:
    """The site shakes with pulses, which have PGV/PGA; its comparison with records has not."""
    one = "{name: recorded motions, study: records, set: ['motion.pgv_pga=[0.3]']}"
    setting = ("--set", f"hazard.compare=[{one}]", "--set", "motion.pgv_pga=[0.4]")
    words = ("recorded motions", "motion.pgv_pga", "--set hazard.compare=[]")
    line = refused("run", "hazard", "--site", "double_rock", *setting, words=words)
    assert "did you mean" not in line


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


@pytest.mark.slow
def test_curves_of_a_sweep_lie_beside_who_gives_them(
    vsr: Callable[..., Ran],
    write_site: Callable[..., str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """And not beside the site, where other curves have the same name."""
    (tmp_path / "study.yaml").write_text("sweep: {stood: {hazard.age.mean: [4000, 5000]}}\n")
    (tmp_path / "mine").mkdir()
    shutil.copytree(CURVES, tmp_path / "here" / "mine")
    monkeypatch.chdir(tmp_path / "here")
    site = write_site(BOX + GRID + "hazard: {age: {kind: normal, mean: 4000, source: none}}\n")
    given = ("hazard", "--site", site, "--study", tmp_path / "study.yaml", "--curves", "mine")
    ran = vsr("run", *given)
    assert ran.code == cli.DONE, ran.err
    assert ran.err.count("of 9 branches rejected") == 2


def test_a_hazard_is_swept_of_a_rock_alone(
    refused: Callable[..., str], write_site: Callable[..., str], tmp_path: Path
) -> None:
    (tmp_path / "study.yaml").write_text("sweep: {bounce: {contact.restitution: [0, 0.3]}}\n")
    site = write_site(BOX + GRID + HAZARD)
    given = ("run", "hazard", "--site", site, "--study", tmp_path / "study.yaml")
    refused(*given, words=("hazard.compare", "--set hazard.compare=[]"))


def test_a_comparison_that_changes_no_fragility_is_refused(
    refused: Callable[..., str], write_site: Callable[..., str]
) -> None:
    site = write_site(BOX + GRID + HAZARD)
    study = Path(site).with_name("young.yaml")
    study.write_text("hazard: {age: {mean: 999}}\n")
    for given, got in (
        ("set: [hazard.age.mean=999]", "hazard.age.mean"),
        ("set: [contact.friction=0.4 hazard.age.mean=999]", "hazard.age.mean"),
        (f"study: {study}", "hazard"),
    ):
        compare = f"hazard.compare=[{{name: young, {given}}}]"
        words = ("hazard.compare", f"got {got};", "another fragility")
        refused("run", "hazard", "--site", site, "--set", compare, words=words)
    twice = "hazard.compare=[{name: smooth, set: [contact.friction=0.4, contact.friction=0.8]}]"
    words = ("hazard.compare: smooth: contact.friction", "no setting replaces another")
    refused("run", "hazard", "--site", site, "--set", twice, words=words)


def test_a_study_that_is_compared_lies_beside_who_names_it_and_over_that_of_the_command(
    write_site: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another of its name lies in the current folder."""
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "mine.yaml").write_text("contact: {friction: 0.9}\n")
    (tmp_path / "mine.yaml").write_text("contact: {friction: 0.3}\n")
    (tmp_path / "given.yaml").write_text(
        "contact: {friction: 0.7, restitution: 0.2}\nhazard: {minimum_survival_probability: 0.1}\n"
    )
    age = "age: {kind: normal, mean: 4000, source: none}"
    site = write_site(f"{BOX}{GRID}hazard: {{{age}, compare: [{{name: a, study: mine.yaml}}]}}\n")
    monkeypatch.chdir(tmp_path / "here")
    own = load_site(site, str(tmp_path / "given.yaml"))
    (compared,) = other_rocks.find(own.config.hazard, own.origin).compared
    contact = compared.site.config.contact
    assert (contact.friction, contact.restitution) == ((0.3,), 0.2)
    assert own.config.contact.friction == (0.7,)


PULSES = "motion={kind: cosine_pulse, pga: [0.2, 0.4], pgv_pga: [0.3]}"
PROCESSED = "{order: none, highpass: null, lowpass: null}"
RECORDED = f"{{kind: record, files: waves, pga: [0.3], processing: {PROCESSED}}}"


@pytest.mark.parametrize(
    ("study", "settings", "compared", "kind", "friction", "without"),
    [
        ("", ("contact.friction=0.8",), "contact: {friction: 0.3}", "cosine_pulse", 0.3, ""),
        ("", (PULSES,), f"motion: {RECORDED}", "record", 0.6, ""),
        ("contact: {friction: 0.8}", (PULSES,), "motion: {pga: 0.5}", "cosine_pulse", 0.8, ""),
        (f"motion: {RECORDED}", (), "motion: {pga: 0.5}", "record", 0.6, ""),
        (
            *(f"motion: {RECORDED}", ("contact.friction=0.8",), "motion: {pgv_pga: 0.1}"),
            *("cosine_pulse", 0.8, "the motion of the command"),
        ),
        (
            *("contact: {friction: 0.7}", (f"motion={RECORDED}",), "motion: {pgv_pga: 0.1}"),
            *("cosine_pulse", 0.7, "the motion of the command"),
        ),
    ],
)
def test_a_study_that_is_compared_lies_over_all_of_the_command_that_it_goes_with(
    study: str,
    settings: tuple[str, ...],
    compared: str,
    kind: str,
    friction: float,
    without: str,
    write_site: Callable[..., str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Pulses have PGV/PGA and records have files, so that keys of the one say nothing of others."""
    monkeypatch.chdir(tmp_path)
    Path("given.yaml").write_text(study)
    Path("mine.yaml").write_text(compared)
    age = "age: {kind: normal, mean: 4000, source: none}"
    site = write_site(f"{BOX}{GRID}hazard: {{{age}, compare: [{{name: a, study: mine.yaml}}]}}\n")
    own = load_site(site, "given.yaml" if study else None, settings)
    found = other_rocks.find(own.config.hazard, own.origin)
    (config,) = (one.site.config for one in found.compared)
    assert (config.motion.kind, config.contact.friction) == (kind, (friction,))
    if "{pga: 0.5}" in compared:
        assert config.motion.pga == (0.5,)
    told = f"mine.yaml does not go with {without}; compared without"
    assert [line.partition(": a: ")[2] for line in found.told] == [told] * bool(without)


def test_a_direction_in_radians_of_a_comparison_is_told(vsr: Callable[..., Ran]) -> None:
    compare = "hazard.compare=[{name: turned, set: [yaw=0.785]}, {name: east, set: [yaw=45]}]"
    ran = vsr("plan", "hazard", "--site", "double_rock", "--set", compare)
    assert ran.code == cli.DONE, ran.err
    assert "warning: --set: hazard.compare: turned: --set: yaw: got 0.785" in ran.err
    assert ran.err.count("warning: ") == 1


@pytest.mark.slow
def test_what_a_comparison_leaves_out_of_the_command_is_told_once(vsr: Callable[..., Ran]) -> None:
    compare = "hazard.compare=[{name: coarse, study: coarse_grid}]"
    ran = vsr("plan", "hazard", "--site", "double_rock", "--study", "records", "--set", compare)
    told = "warning: --set: hazard.compare: coarse: coarse_grid does not go with the motion of"
    assert (ran.code, ran.err.count(told)) == (cli.DONE, 1), ran.err


@pytest.mark.slow
def test_stages_of_a_rock_keep_their_settings_but_not_those_of_the_hazard(
    refused: Callable[..., str],
    vsr: Callable[..., Ran],
    write_site: Callable[..., str],
    tmp_path: Path,
) -> None:
    write_site(BOX + GRID, name="buried")
    site = write_site(BOX + GRID + EXHUMED)
    (tmp_path / "ages.csv").write_text("age_a\n2500\n4000\n", encoding="utf-8")
    for name, text in (
        ("rule", "hazard: {minimum_survival_probability: 0.1}"),
        ("smooth", "contact: {friction: 0.3}"),
    ):
        (tmp_path / f"{name}.yaml").write_text(text)
    given = ("--site", site, "--study")
    ran = vsr("plan", "hazard", *given, tmp_path / "rule.yaml")
    assert ran.code == cli.DONE, ran.err
    sections = ("hazard={minimum_survival_probability: 0.1}", "simulation={reduce: true}")
    ran = vsr("plan", "hazard", *given[:2], *(f"--set={one}" for one in sections))
    assert ran.code == cli.DONE, ran.err
    words = ("hazard.history", "smooth.yaml", "keep the settings")
    refused("run", "hazard", *given, tmp_path / "smooth.yaml", words=words)


@pytest.mark.slow
def test_another_rock_takes_no_folder_of_a_site_of_its_name(
    vsr: Callable[..., Ran], write_site: Callable[..., str], tmp_path: Path, derived: Path
) -> None:
    """There are two of the name: one has products, the other stands beside the rock."""
    (tmp_path / "elsewhere").mkdir()
    first = Path(write_site(BOX + GRID, "twin")).rename(tmp_path / "elsewhere" / "twin.yaml")
    assert vsr("run", "fragility", "--site", first).code == cli.DONE
    before = (derived / "twin" / "fragility.nc").read_bytes()
    write_site(BOX.replace("0.25, 0.5, 1.2", "0.3, 0.5, 1.5") + GRID, "twin")
    rocks = "rocks: [{site: twin.yaml, age: {kind: normal, mean: 900, source: none}}]}\n"
    site = write_site(
        BOX
        + GRID
        + HAZARD.replace("compare: [{name: slippery, set: [contact.friction=0.3]}]}\n", rocks)
    )
    ran = vsr("run", "hazard", "--site", site)
    assert ran.code == cli.DONE, ran.err
    assert (derived / "twin" / "fragility.nc").read_bytes() == before
    assert len(list(derived.glob("twin-*/fragility.nc"))) == 1


def test_curves_and_age_have_to_be_given(
    refused: Callable[..., str], write_site: Callable[..., str]
) -> None:
    site = write_site(BOX + GRID)
    refused("run", "hazard", "--site", site, words=("hazard.curves", "CURVES="))
    refused("run", "hazard", "--site", site, "--curves", CURVES, words=("hazard.age", "AGE="))
    wrong = ("--curves", CURVES, "--age", -5)
    refused("run", "hazard", "--site", site, *wrong, words=("hazard.age.mean", "-5"))


@pytest.mark.parametrize(("support", "made"), [("tested", "uncertainty"), ("scan", "fragility")])
def test_the_support_is_that_of_all_rocks_and_unresolved_runs_of_any_count(
    vsr: Callable[..., Ran],
    write_site: Callable[..., str],
    monkeypatch: pytest.MonkeyPatch,
    support: str,
    made: str,
) -> None:
    asked = []

    def make(stage: str, job: Job) -> int:
        asked.append((stage, job.site.name))
        return 3 if job.site.name == "broad" else 0

    monkeypatch.setattr(graph, "make", make)
    write_site(BOX + GRID.replace("members: 0", "members: 4"), name="broad")
    rocks = "compare: [], rocks: [{site: broad.yaml, age: {kind: normal, mean: 900}}]}"
    hazard = f"{HAZARD.split('compare')[0]}support: {support}, {rocks}\n"
    ran = vsr("run", "hazard", "--site", write_site(BOX + GRID + hazard), "--workers", 0)
    assert (ran.code, asked) == (cli.UNRESOLVED, [(made, "broad"), ("hazard", "rock")])
    assert "3 runs are unresolved" in ran.err


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
    grid = grid.replace("yaw: [0, 90]", "yaw: [0]").replace("[0.05, 0.1, 0.2, 0.4]", "[0.1, 0.3]")
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


def test_an_earthquake_before_another_rock_stood_is_refused(
    refused: Callable[..., str], write_site: Callable[..., str]
) -> None:
    quake = "{kind: earthquake, year: 1000, pga: 0.1, pga_log_sd: 0.3, pgv: 4, pgv_log_sd: 0.3}"
    grid = GRID.replace("members: 0", "members: 4")
    write_site(f"{BOX}{grid}observations: [{quake}]\n", name="young")
    rocks = "compare: [], rocks: [{site: young.yaml, age: {kind: normal, mean: 900, sd: 0}}]}"
    site = write_site(f"{BOX}{GRID}{HAZARD.split('compare')[0]}{rocks}\n")
    words = ("young.yaml", "observations.0.year", "1000", "at most 900 years")
    refused("run", "hazard", "--site", site, words=words)


def test_years_in_which_another_rock_was_seen_to_stand_are_no_part_of_its_age(
    write_site: Callable[..., str],
) -> None:
    quake = "{kind: earthquake, year: 1906, pga: 0.1, pga_log_sd: 0.3, pgv: 4, pgv_log_sd: 0.3}"
    seen = f"observations: [{quake}]\n"
    write_site(BOX + GRID.replace("members: 0", "members: 4") + seen, name="other")
    rocks = "compare: [], rocks: [{site: other.yaml, age: {kind: normal, mean: 900, sd: 0}}]}"
    site = load_site(write_site(f"{BOX}{GRID}{HAZARD.split('compare')[0]}{rocks}\n"))
    for support, years in (("tested", 899.0), ("scan", 900.0)):
        hazard = site.config.hazard.model_copy(update={"support": support})
        (other,) = other_rocks.find(hazard, site.origin).rocks
        assert back_to(hazard.rocks[0].age, (), other.observed) == [[years]]


def test_what_looks_wrong_in_the_file_of_another_rock_is_told(
    write_site: Callable[..., str],
) -> None:
    """That of the rock itself is told when the command begins."""
    write_site(f"{BOX}{GRID}contact: {{friction: 35}}\n", name="other")
    age = "age: {kind: normal, mean: 900, sd: 0}"
    compared = "compare: [{name: rough, set: [contact.friction=40]}]"
    rocks = f"{compared}, rocks: [{{site: other.yaml, {age}}}]}}"
    site = load_site(write_site(f"{BOX}{GRID}{HAZARD.split('compare')[0]}{rocks}\n"))
    (told,) = other_rocks.find(site.config.hazard, site.origin).slips()
    assert "other.yaml: contact.friction: got 35" in told


@pytest.mark.slow
def test_a_stage_has_the_draws_of_the_rock(
    vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path
) -> None:
    """A rock that was as it is has one survival, also where observations chose its draws.

    But for PGA beyond the grid, where draws go on by the fits of their ensemble.
    """
    sure = "amplitude: {mean: 1, sd: 0}, azimuth: {mean: 0, sd: 0}"  # else drawn for each member
    grid = GRID.replace("members: 0", f"members: 8, friction: [0.6, 0.6], {sure}")
    grid = grid.replace("[0.05, 0.1, 0.2, 0.4]", "[0.1, 0.3]").replace("yaw: [0, 90]", "yaw: [0]")
    tilt = "observations: [{kind: tilt, direction: 0, angle: 9, outcome: stood, sd: 0.5}]\n"
    always = HAZARD.split(", compare")[0] + ", compare: []}\n"
    stage = ", history: [{site: before.yaml, until: {kind: normal, mean: 1200}}]}\n"
    sites = [
        write_site(BOX + grid + tilt + text, name=name)
        for name, text in (("always", always), ("rock", always.replace("}\n", stage)))
    ]
    write_site(BOX + grid, name="before")
    assert vsr("run", "hazard", "--site", sites[0], "--workers", 0).code == 0
    ran = vsr("run", "hazard", "--site", sites[1], "--workers", 0)
    assert ran.code == 2
    number = int(re.search(r"before.*set uncertainty.members: (\d+) there", ran.err)[1])  # type: ignore[index]
    write_site(BOX + grid.replace("members: 8", f"members: {number}"), name="before")
    assert vsr("run", "hazard", "--site", sites[1], "--workers", 0).code == 0
    one, both = (read(derived / name / "hazard.nc") for name in ("always", "rock"))
    np.testing.assert_allclose(both["survival"], one["survival"], rtol=0.02)


@pytest.mark.slow
def test_another_rock_has_the_stages_of_its_own_file(
    vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path, tmp_path: Path
) -> None:
    """Beside a slab that nothing topples it survives as it does alone, and is told of."""
    write_site(BOX.replace("1.2]", "0.9]") + GRID, name="buried")
    ridge = write_site(BOX + GRID + EXHUMED, name="ridge")
    Path(ridge).with_name("ages.csv").write_text("age_a\n2500\n4000\n", encoding="utf-8")
    age = "{kind: samples, file: ages.csv}"
    slab = BOX.replace("[0.25, 0.5, 1.2]", "[3, 3, 0.2]") + GRID
    site = write_site(
        f"{slab}hazard: {{curves: {CURVES}, age: {{kind: normal, mean: 9000}}, compare: [], "
        f"rocks: [{{site: ridge.yaml, age: {age}}}]}}\n"
    )
    for one in (ridge, site):
        assert vsr("run", "hazard", "--site", one, "--workers", 0).code == 0
    alone, both = (read(derived / name / "hazard.nc")["survival"] for name in ("ridge", "rock"))
    np.testing.assert_allclose(both, alone, rtol=1e-3)
    page = (derived / "rock" / "hazard.html").read_text(encoding="utf-8")
    assert "before present (invented) ridge stood as buried does" in page
    text = Path(ridge).read_text(encoding="utf-8")
    Path(ridge).write_text(text.replace("mean: 1200", "mean: 300"), encoding="utf-8")
    assert "hazard: file stages of ridge edited" in vsr("why", "hazard", "--site", site).out
    Path(ridge).write_text(text, encoding="utf-8")
    own = f"hazard.rocks=[{{site: {ridge}, age: {age}}}]"
    (tmp_path / "deeper").mkdir()
    shutil.copy(tmp_path / "buried.yaml", tmp_path / "deeper" / "rock.yaml")
    Path(ridge).write_text(text.replace("buried.yaml", "deeper/rock.yaml"), encoding="utf-8")
    told = vsr("plan", "hazard", "--site", site, "--set", own)
    assert (told.code, "a stage named rock" in told.err) == (2, True)
    Path(ridge).write_text(text, encoding="utf-8")
    young = f"hazard.rocks=[{{site: {ridge}, age: {{kind: normal, mean: 900}}}}]"
    ran = vsr("plan", "hazard", "--site", site, "--set", young)
    assert ran.code == 2
    assert "ridge.yaml" in ran.err
    assert "hazard.history" in ran.err


@pytest.mark.slow
def test_products_of_another_rock_as_it_was_are_not_taken(
    vsr: Callable[..., Ran],
    write_site: Callable[..., str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its file, or one among the curves, is edited once the work has begun."""
    write_site(BOX + GRID, name="other")
    curves = tmp_path / "curves"
    shutil.copytree(CURVES, curves)
    hazard = HAZARD.split(", compare")[0].replace(str(CURVES), str(curves))
    rocks = ", compare: [], rocks: [{site: other.yaml, age: {kind: normal, mean: 900}}]}\n"
    site = write_site(BOX + GRID + hazard + rocks)
    page, late = stage.page, "hazard_curve-rlz-009-PGA_1.csv"

    def later(*given: Any) -> Any:
        (curves / late).write_text("later\n")
        return page(*given)

    with monkeypatch.context() as patch:
        patch.setattr(stage, "page", later)
        ran = vsr("run", "hazard", "--site", site, "--workers", 0)
    assert ran.code == 2
    assert f"file {late} new while a command" in ran.err
    (curves / late).unlink()
    write_site(BOX.replace("2110", "2500") + GRID.replace("[0, 90]", "[0, 45]"), name="other")
    with monkeypatch.context() as patch:
        patch.setattr(commands, "others_of", lambda job: iter(()))  # as done before the edit
        ran = vsr("run", "hazard", "--site", site, "--workers", 0)
    assert ran.code == 2
    assert "fragility of other files or settings than other has by now" in ran.err
    assert vsr("run", "hazard", "--site", site, "--workers", 0).code == 0


@pytest.mark.parametrize(
    ("year", "words"),
    [
        (300, ()),  # 1,650 years before 1950: within the stage, which ended 1,200 before
        (1906, ("until 1,200 years before 1950",)),
        (-2100, ("at most 4,000 years as it stood then",)),
    ],
)
def test_an_earthquake_of_a_stage_lies_in_its_time(
    vsr: Callable[..., Ran],
    refused: Callable[..., str],
    write_site: Callable[..., str],
    year: int,
    words: tuple[str, ...],
) -> None:
    quake = f"{{kind: earthquake, year: {year}, pga: 0.1, pga_log_sd: 1, pgv: 4, pgv_log_sd: 1}}"
    grid = GRID.replace("members: 0", "members: 4")
    write_site(f"{BOX}{grid}observations: [{quake}]\n", name="buried")
    site = write_site(BOX + GRID + EXHUMED)
    Path(site).with_name("ages.csv").write_text("age_a\n4000\n", encoding="utf-8")
    if words:
        refused("plan", "hazard", "--site", site, words=("buried", "observations.0.year", *words))
    else:
        assert vsr("plan", "hazard", "--site", site).code == 0


@pytest.mark.parametrize("product", ["hazard", "exclusion"])
def test_an_earthquake_before_the_rock_stood_is_refused_at_once(
    vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path, product: str
) -> None:
    """It would weigh the rock by what no rock was there to survive."""
    quake = "{{kind: earthquake, year: {}, pga: 0.1, pga_log_sd: 0.3, pgv: 4, pgv_log_sd: 0.3}}"
    old = f"observations=[{quake.format(1906)}, {quake.format(-2100)}]"
    site = write_site(f"{BOX}{GRID.replace('members: 0', 'members: 4')}{HAZARD}")
    age = "hazard.age={kind: bounds, low: 3000, high: 4000}"
    ran = vsr("run", product, "--site", site, "--set", age, "--set", old)
    assert ran.code == 2, ran.err
    (line,) = [line for line in ran.err.splitlines() if line.startswith("vsr: ")]
    assert "observations.1.year: got -2100" in line
    assert not (derived / "rock" / "responses.nc").exists()
    older = age.replace("high: 4000", "high: 4100")
    assert vsr("plan", product, "--site", site, "--set", older, "--set", old).code == 0
