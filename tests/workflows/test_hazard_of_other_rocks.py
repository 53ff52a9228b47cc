"""Rocks beside a site's own: joint survival, which of them count, and whose products they are."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from conftest import Ran
from scipy.stats import norm
from support.hazard_site import (
    BOX,
    CURVES,
    GRID,
    HAZARD,
    Array,
    levels_and_rates,
    parts_of,
    survived,
)

from pipeline import cli, commands
from pipeline.config.layers import load_site
from pipeline.stages.archive.archived_rock import PGV_PGA, SHARP, answered
from pipeline.stages.hazard import hazard as stage
from pipeline.stages.hazard import other_rocks
from pipeline.stages.hazard.one_rock import alike_in_shape
from pipeline.stages.hazard.rock_ages import back_to
from pipeline.workflow import graph
from pipeline.workflow.datasets import read
from pipeline.workflow.stage import Job


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


def test_a_hazard_is_of_other_rocks_as_they_are(write_site: Callable[..., str]) -> None:
    """Of their settings that decide what they are, and of no others."""
    age = "{kind: bounds, low: 300, high: 500}"
    site = write_site(
        f"{BOX}{GRID}{HAZARD.split('compare')[0]}rocks: [{{site: other.yaml, age: {age}}}]}}"
    )
    found = []
    for told in ("", "hazard: {minimum_survival_probability: 0.1}\n", "contact: {friction: 0.5}\n"):
        write_site(BOX + GRID + told, name="other")
        read = load_site(site)
        found.append(other_rocks.find(read.config.hazard, read.origin).digests())
    assert found[0] == found[1] != found[2]
    assert found[0].keys() == found[2].keys()


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
