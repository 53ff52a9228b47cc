"""A rock's age and the stages in which it was exhumed: survival, and what cannot be."""

from __future__ import annotations

import math
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from conftest import Ran
from support.hazard_site import BOX, CURVES, GRID, HAZARD, by_row, levels_and_rates, parts_of

from pipeline import cli
from pipeline.workflow.datasets import read

FIVE_AGES = "age_a\n3000\n2900\n3100\n2000\n3000\n"

EXHUMED = (
    f"hazard: {{curves: {CURVES}, age: {{kind: samples, file: ages.csv}}, "
    "history: [{site: buried.yaml, until: {kind: normal, mean: 1200, source: invented}}]}\n"
)


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
def test_a_stage_has_the_draws_of_the_rock(
    vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path
) -> None:
    """A rock that was as it is has one survival, also where observations chose its draws.

    But for PGA beyond the grid, where draws go on by the fits of their ensemble.
    """
    sure = "amplitude: {mean: 1, sd: 0}, azimuth: {mean: 0, sd: 0}"  # else drawn for each member
    grid = GRID.replace("members: 0", f"members: 8, friction: [0.6, 0.6], {sure}")
    grid = grid.replace("0.05, 0.1, 0.2, 0.4", "0.06, 0.12, 0.24").replace(
        "yaw: [0, 90]", "yaw: [0]"
    )
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
