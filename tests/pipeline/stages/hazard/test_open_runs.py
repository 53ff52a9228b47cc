"""Shaking, of curves and of faults, whose PGV/PGA no run is near."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.config.layers import Origin
from pipeline.config.problems import InputError
from pipeline.stages.hazard.hazard_model import Branch, HazardModel
from pipeline.stages.hazard.open_runs import of_branches, off_runs
from pipeline.stages.hazard.open_scenarios import open_faults, open_magnitudes
from pipeline.stages.hazard.survival_analysis import DatedRock, SurvivalAnalysis
from tests.support.standing_rocks import curve, ensemble, model, of_curves, rows_from
from vsr_core import GRAVITY
from vsr_core.hazard.curve import HazardCurve
from vsr_core.hazard.ratio import RatioTable
from vsr_core.hazard.scenarios import Shaking


@pytest.mark.parametrize(
    ("ratios", "chances", "share"),
    [
        ([0.05, 0.1, 0.2], [1, 1, 1], 0.0),
        ([0.1, 0.15, 0.25], [1, 1, 1], 0.19),  # what is shorter than 0.071 s, if it topples less
        ([0.1, 0.15, 0.25], [0, 1, 1], 0.0),  # it stands as 0.1 s does
        ([0.2, 0.3, 0.4], [1, 1, 1], 0.81),
        ([0.02, 0.03, 0.04], [0, 0, 0], 0.92),  # what is longer than 0.057 s
        ([0.02, 0.03, 0.04], [0, 1, 1], 0.0),
        ([0.05, 0.0707107, 0.5], [0, 0, 1], 0.5),  # from 0.1 s to 0.35 s
    ],
)
def test_runs_of_another_pgv_pga_than_the_shaking(
    ratios: list[float], chances: list[float], share: float
) -> None:
    """That of a lognormal about 0.1 s, of 0.4, more than sqrt(2) times off all runs.

    From 0.316 g on, which 1e-4 (PGA / g)^-2 exceeds once in 1,000 years.
    """
    origin = Origin(name="rock", file="rock.yaml", path=Path("rock.yaml"))
    fragility = replace(
        ensemble([0.5]),
        ratios=np.array(ratios),
        static=0.1**0.5,
        mean=lambda level: np.outer(chances, np.ones_like(level)),
    )
    for years in (1e3, 1e4):
        analysis = of_curves(model(1e-4), DatedRock("rock", fragility, np.array([years])))
        number = share * years / 1e3
        words = f"{number:.2g} on average, as {share:.0%} of the shaking of 0.316"
        if number > 2.0:
            with pytest.raises(InputError, match=rf"rock\.yaml: motion: .* {words}"):
                off(analysis, origin)
        else:
            told = off(analysis, origin)
            assert len(told) == (number > 0.2)
            assert all(words in one for one in told)


def test_longer_shaking_is_open_where_the_runs_stand() -> None:
    """All fall at 0.6 g, none below: half of the shaking is longer than 0.0707 sqrt(2) s."""
    origin = Origin(name="rock", file="rock.yaml", path=Path("rock.yaml"))
    rock = replace(rows_from([0.03, 0.05, 0.0707107], [0.6] * 3), static=0.3)
    (told,) = off(of_curves(model(1e-4), DatedRock("rock", rock, np.array([1e3]))), origin)
    number = 0.5 * 1e3 * 1e-4 * (0.3**-2 - 0.6**-2)
    assert f"{number:.2g} on average, as 50% of the shaking of 0.3 g" in told


@pytest.mark.parametrize(("years", "refused"), [(1e3, False), (1e4, True)])
def test_shaking_between_runs_is_open_where_one_of_them_topples(
    years: float, refused: bool
) -> None:
    """0.2 s from 0.3 g on, 0.04 s from 0.7 g on; 73 % of the shaking is between them."""
    origin = Origin(name="rock", file="rock.yaml", path=Path("rock.yaml"))
    rock = DatedRock("rock", rows_from([0.04, 0.2], [0.7, 0.3]), np.array([years]))
    analysis = of_curves(model(1e-4), rock)
    if refused:
        with pytest.raises(InputError) as caught:
            off(analysis, origin)
        told = str(caught.value)
    else:
        (told,) = off(analysis, origin)
    (number,) = re.findall(r", (\S+) on average, as 73% of the shaking of 0.3", told)
    exact = 0.73 * years * 1e-4 * (0.3**-2 - 0.7**-2)
    assert float(number) == pytest.approx(exact, rel=0.02)  # by parts of PGA, and two digits


@pytest.mark.parametrize("static", [0.5, 0.65])
def test_longer_shaking_is_open_from_the_static_pga_on(static: float) -> None:
    """Half of it is beyond 0.07 s, up to 0.7 g, from where on it topples the rock."""
    origin = Origin(name="rock", file="rock.yaml", path=Path("rock.yaml"))
    rows = replace(rows_from([0.035, 0.05, 0.0707107], [0.9, 0.8, 0.7]), static=static)
    told = off(of_curves(model(1e-4), DatedRock("rock", rows, np.array([1e4]))), origin)
    number = 0.5 * (static**-2 - 0.7**-2)
    assert [f", {number:.2g} on average" in one for one in told] == [True] * (number > 0.2)


def test_shaking_that_topples_no_rock_is_not_open() -> None:
    """Below 0.3 g, where it is longer than all runs; above it is of theirs."""
    origin = Origin(name="rock", file="rock.yaml", path=Path("rock.yaml"))
    rows = replace(rows_from([0.05, 0.1, 0.2, 0.4], [99.0] * 4), static=0.3)
    table = RatioTable(GRAVITY * np.array([0.1, 0.3]), np.array([5.0, 0.1]), np.full(2, 0.4))
    analysis = of_curves(model(1e-4), DatedRock("rock", rows, np.array([1e3])))
    assert off(replace(analysis, shaking=replace(analysis.shaking, table=table)), origin) == ()


def test_earthquakes_are_open_in_the_years_of_a_stage_alone() -> None:
    """Of 10,000 years the rock stood 9,000 as rows of long shaking tell."""
    origin = Origin(name="rock", file="rock.yaml", path=Path("rock.yaml"))
    dense, long_ones = rows_from([0.05, 0.1, 0.2], [0.5] * 3), rows_from([0.2, 0.4], [0.5] * 2)
    until, ages = np.array([1e3]), np.array([1e4])
    for rock, words in (
        (
            DatedRock("rock", dense, ages, ((long_ones, until),)),
            "hazard.history: got .* runs of rock in",
        ),
        (DatedRock("rock", long_ones, ages, ((dense, until),)), ""),
    ):
        analysis = of_curves(model(1e-4), rock)
        if words:
            with pytest.raises(InputError, match=rf"{words} .*, 2.9 on average"):
                off(analysis, origin)
        else:
            (told,) = off(analysis, origin)
            assert re.search(r"0\.3[34] on average, as 81% of the shaking of 0\.5", told)


@pytest.mark.parametrize(("minimum", "turns"), [(0.05, True), (0.2, False)])
def test_a_verdict_that_hangs_on_open_earthquakes_is_told(minimum: float, turns: bool) -> None:
    """Of a rare branch, under which they are ten times as many as by the mean."""
    origin = Origin(name="rock", file="rock.yaml", path=Path("rock.yaml"))
    rows = replace(rows_from([0.05, 0.1], [0.5, 0.5]), static=0.4)
    branches = tuple(
        Branch(name, name, weight, curve(rate))
        for name, weight, rate in (("often", 0.02, 7e-4), ("seldom", 0.98, 1e-5))
    )
    rock = DatedRock("rock", rows, np.array([1e3]))
    analysis = replace(of_curves(HazardModel(branches, None), rock), minimum=minimum)
    # 19 % is longer than 0.14 s, and stands from 0.4 to 0.5 g, as the runs do
    number = 0.193 * 0.7 * (0.4**-2 - 0.5**-2)
    survival = math.exp(-0.7 * 0.5**-2)
    assert survival > 0.05 > survival * math.exp(-number)
    told = [one for one in off(analysis, origin) if "its verdict may be another" in one]
    assert ["under branch often" in one for one in told] == [True] * turns


@pytest.mark.parametrize(("first", "static"), [(0, 0.4), (24, 0.4), (0, 12.0)])
def test_open_earthquakes_under_a_branch_begin_with_its_curve(first: int, static: float) -> None:
    """At 0.7 g it is as if all of the shaking that its first level has were there; 12 g is none."""
    origin = Origin(name="rock", file="rock.yaml", path=Path("rock.yaml"))
    rows = replace(rows_from([0.2, 0.3], [0.5, 0.5]), static=static)
    whole = curve(1e-4)
    late = HazardCurve(whole.levels[first:], whole.rates[first:])
    branches = (Branch("a", "a", 0.5, whole), Branch("b", "b", 0.5, late))
    rock = DatedRock("rock", rows, np.array([100.0]))
    analysis = of_curves(HazardModel(branches, None), rock)
    numbers = of_branches(analysis, rock)
    level = max(0.5, late.levels[0] / GRAVITY)  # from where on it topples; 81 % is too short
    exact = 0.807 * 100.0 * 1e-4 * np.array([0.5**-2, level**-2]) * (static < 10.0)
    np.testing.assert_allclose(numbers, exact, rtol=0.05)
    assert off(analysis, origin) == ()


@pytest.mark.parametrize(("kinds", "told"), [(1, 0), (3, 1), (30, 2)])
def test_earthquakes_of_all_kinds_of_a_fault_are_counted_together(kinds: int, told: int) -> None:
    """Of each kind a tenth of one is open; three are told, and thirty refused."""
    rock, origin = ensemble([0.5], 800), Origin(name="a", file="a.yaml", path=Path("a.yaml"))
    rock, pga = replace(rock, static=0.2), np.log([0.3 * GRAVITY] * kinds)
    sds = {"pga_sd": np.full(kinds, 0.01), "pgv_sd": np.full(kinds, 0.275)}
    shaking = Shaking(pga=pga, pgv=pga, correlation=0.0, **sds)
    for names in (["A"] * kinds, [f"A{n}" for n in range(kinds)]):
        if told == 2:
            with pytest.raises(InputError, match=", 3 on average"):
                open_faults(rock, shaking, names, [0.1] * kinds, origin)
        else:
            assert len(open_faults(rock, shaking, names, [0.1] * kinds, origin)) == told


def off(analysis: SurvivalAnalysis, origin: Origin) -> tuple[str, ...]:
    return off_runs(analysis, analysis.results(), origin)


def test_earthquakes_of_an_older_rock_are_open_within_its_own_age() -> None:
    """Its first run falls from 0.5 g on, and what is shorter, 81 % of the shaking, may not."""
    origin = Origin(name="rock", file="rock.yaml", path=Path("rock.yaml"))
    young = DatedRock("young", ensemble([0.5]), np.array([100.0]))
    longer = rows_from([0.2, 0.3, 0.4], [0.5, 0.4, 0.4])
    for age, told in ((100.0, 0), (8e3, 1)):
        analysis = of_curves(model(1e-4), young, DatedRock("old", longer, np.array([age])))
        if told:
            with pytest.raises(
                InputError, match=r"hazard\.rocks: got .* runs of old .*, 2\.[56] on"
            ):
                off(analysis, origin)
        else:
            assert off(analysis, origin) == ()


@pytest.mark.parametrize(
    ("median", "static", "told"),
    [
        (0.1, 0.2, ""),  # of the runs' own PGV/PGA
        (1.0, 0.2, "1"),  # all is longer, and may topple from less than 0.5 g on
        (1.0, 0.6, ""),  # below which nothing topples, and above which all runs do
        (0.245, 0.2, "0.3"),  # 0.3 of it is beyond 0.2 s times 1.41
    ],
)
def test_faults_of_whose_pgv_pga_there_are_no_runs(median: float, static: float, told: str) -> None:
    """A rock that topples from 0.5 g on at 0.05, 0.1 and 0.2 s, and an earthquake of 0.3 g."""
    rock = replace(ensemble([0.5], 800), static=static)
    origin = Origin(name="a", file="a.yaml", path=Path("a.yaml"))
    pga = np.log([0.3 * GRAVITY])
    without = {"correlation": 0.0, "pga_sd": np.array([0.01]), "pgv_sd": np.array([0.275])}
    shaking = Shaking(pga=pga, pgv=pga + np.log(median), **without)
    words = open_faults(rock, shaking, ["A"], [1.0], origin)
    assert len(words) == bool(told)
    assert all(f", {told} on average" in one for one in words)
    if told:
        with pytest.raises(InputError, match=r"a.yaml: motion: got .* runs of the rock \(3, from"):
            open_faults(rock, shaking, ["A"], [10.0], origin)
    words = open_magnitudes(rock, shaking, np.array([6.5]))
    assert len(words) == bool(told)
    assert all("least distances of M 6.5 may be far off" in one for one in words)


def test_faults_of_many_weak_earthquakes_are_asked_of_their_tail() -> None:
    """Of 0.1 g in the median, whose 0.3 g comes once in 3,500 of them, all longer than the runs."""
    rock = replace(ensemble([0.5], 800), static=0.3)
    origin = Origin(name="a", file="a.yaml", path=Path("a.yaml"))
    pga, sd = np.log([0.1 * GRAVITY]), np.array([0.32])
    shaking = Shaking(pga=pga, pga_sd=sd, pgv=pga, pgv_sd=np.array([0.1]), correlation=0.999)
    assert open_faults(rock, shaking, ["A"], [100.0], origin) == ()
    (told,) = open_faults(rock, shaking, ["A"], [1000.0], origin)
    assert "0.3 on average, as 100% of the shaking of 0.3 g" in told
    with pytest.raises(InputError, match=", 3 on average"):
        open_faults(rock, shaking, ["A"], [10_000.0], origin)
