"""A rock's fragility from products, and the survival that follows, on cases worked by hand."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.stats import norm

from pipeline.config.hazard_schema import (
    BoundedAge,
    EarlierStage,
    LognormalAge,
    NormalAge,
    SampledAge,
)
from pipeline.config.layers import Origin
from pipeline.config.observation_schema import Earthquake
from pipeline.config.problems import InputError
from pipeline.stages.fragility.summary import SEARCHED
from pipeline.stages.hazard import exclusion
from pipeline.stages.hazard.fault_files import Fault, Faults
from pipeline.stages.hazard.hazard_dataset import survival_error, survival_range
from pipeline.stages.hazard.hazard_model import Branch, HazardModel
from pipeline.stages.hazard.hazard_page import sentence
from pipeline.stages.hazard.open_ends import begun_late, left_open, of_scale, open_cases, untested
from pipeline.stages.hazard.open_runs import of_branches, off_runs
from pipeline.stages.hazard.open_scenarios import open_faults, open_magnitudes
from pipeline.stages.hazard.other_rocks import dated
from pipeline.stages.hazard.rock_ages import ages_of, back_to
from pipeline.stages.hazard.rock_fragility import (
    DRAWN,
    FITTED,
    OTHER_ROWS,
    RockFragility,
    all_borders,
    of_fits,
    of_members,
)
from pipeline.stages.hazard.sensitivity import (
    AS_NOW,
    BASE_CASE,
    DRAWN_ANEW,
    Case,
    cases,
    too_coarse,
)
from pipeline.stages.hazard.survival_analysis import DatedRock, SurvivalAnalysis
from vsr_core import GRAVITY
from vsr_core.hazard.curve import HazardCurve
from vsr_core.hazard.events import Events
from vsr_core.hazard.ratio import RatioTable
from vsr_core.hazard.scenarios import Shaking
from vsr_core.hazard.shaking import CurveShaking, counted_shaking
from vsr_core.hazard.toppling import borders_of

SLOPE = 2.0
TABLE = RatioTable(np.array([1.0]), np.array([0.1]), np.array([0.4]))


def curve(rate: float) -> HazardCurve:
    """Power law with the given rate at 1 g."""
    level = np.geomspace(0.01, 10.0, 40)
    return HazardCurve(GRAVITY * level, rate * level**-SLOPE)


def model(*rates: float) -> HazardModel:
    share = 1.0 / len(rates)
    branches = tuple(Branch(str(n), f"b{n}", share, curve(rate)) for n, rate in enumerate(rates))
    return HazardModel(branches, (0.0, 50.0))


def of_curves(hazard: HazardModel, *rocks: DatedRock, component: float = 1.0) -> SurvivalAnalysis:
    borders = all_borders(stage for rock in rocks for stage in rock.stages)
    shaking = CurveShaking(tuple(one.pga for one in hazard.branches), TABLE, borders)
    return SurvivalAnalysis(hazard, rocks, shaking.times(component), 0.05)


def numbered(data: xr.Dataset, seeds: Sequence[int] = ()) -> xr.Dataset:
    """The same with the seeds of its members, each another unless some are given, and brackets."""
    seed, edges = ("member", list(seeds or range(data.sizes["member"]))), data["member_boundary"]
    brackets = {f"member_boundary_{end}": edges for end in ("lower", "upper")}
    return data.assign(brackets | {"drawn_seed": seed})


def ensemble(thresholds: list[float], number: int = 80, seeds: Sequence[int] = ()) -> RockFragility:
    """Members that topple from a PGA on [g], whatever the direction and PGV/PGA."""
    pga = np.geomspace(0.05, 2.0, number)
    falls = np.array([pga >= threshold for threshold in thresholds]).astype(np.int8)
    falls = np.broadcast_to(falls[:, None, None, :], (len(falls), 2, 3, len(pga)))
    edges = np.broadcast_to(np.array(thresholds)[:, None, None], falls.shape[:3])
    beta = 0.05  # so narrow about this median that E[threshold^-SLOPE] is that of the members
    theta = np.mean(np.array(thresholds) ** -SLOPE) ** (-1.0 / SLOPE) * np.exp(beta**2)
    data = xr.Dataset(
        {
            "overturned": (("member", "yaw", "pgv_pga", "pga"), falls),
            "member_boundary": (("member", "yaw", "pgv_pga"), edges),
            "theta": (("yaw", "pgv_pga"), np.full((2, 3), theta)),
            "beta": (("yaw", "pgv_pga"), np.full((2, 3), beta)),
        },
        {"yaw": [0.0, 90.0], "pgv_pga": [0.05, 0.1, 0.2], "pga": pga},
        {"searched_from_g": 0.05, "searched_to_g": 2.0},
    )
    return replace(of_members(numbered(data, seeds)), static=min(thresholds))


def test_survival_of_members_that_topple_from_a_level_on() -> None:
    """Each member survives exp(-T lambda(threshold)); the range is 5 to 95 % of them."""
    thresholds = np.linspace(0.2, 0.6, 21)
    rock = ensemble(thresholds.tolist())
    assert rock.source == DRAWN
    analysis = of_curves(model(1e-5, 1e-4), DatedRock("rock", rock, np.array([2e3])))
    low, high = survival_range(analysis, analysis.survival_of_others())
    for n, rate in enumerate((1e-5, 1e-4)):
        exact = np.exp(-2e3 * rate * thresholds**-SLOPE)
        # a threshold lies within a step of the grid of PGA, 4.8 %
        expected = np.percentile(exact, [5.0, 95.0])
        assert [low[n], high[n]] == pytest.approx(expected, rel=0.12)
    exact = [np.exp(-2e3 * rate * thresholds**-SLOPE).mean() for rate in (1e-5, 1e-4)]
    np.testing.assert_allclose(analysis.results().survival, exact, rtol=0.06)


def ended(level: float, often: float, years: float) -> HazardCurve:
    """A power law up to a level [g], which is so often exceeded in some years."""
    levels = np.geomspace(0.01, level, 20)
    return HazardCurve(GRAVITY * levels, often / years * (levels / level) ** -SLOPE)


@pytest.mark.parametrize(
    ("level", "often", "told"),
    [
        (0.3, 0.04, ""),
        (0.3, 0.2, "survival is 0.82 if all of them topple a rock, 1 if none does"),  # exp(-0.2)
        (0.3, 8.0, "refused"),
        (0.3, 0.7, "refused"),  # exp(-0.7) = 0.497
        (1.0, 1.0, ""),  # which topples the rock, and all beyond
    ],
)
def test_a_curve_that_ends_before_the_rock_topples(level: float, often: float, told: str) -> None:
    """One that topples from 0.5 g on; what is beyond the last level of the curve topples it or not.

    Alone, and beside a branch that is rejected, of which nothing matters any more.
    """
    origin, years = Origin(name="rock", file="rock.yaml", path=Path("rock.yaml")), 2e3
    rock = DatedRock("rock", ensemble([0.5], 800), np.array([years]))
    for others in [], [curve(1.0)]:
        curves = [ended(level, often, years), *others]
        branches = map(Branch, "ab", "ab", [1.0 / len(curves)] * 2, curves)
        analysis = of_curves(HazardModel(tuple(branches), None), rock)
        if told != "refused":
            words = left_open(analysis, analysis.results(), origin, of_pgv=False)
            assert len(words) == bool(told)
            assert all(told in one for one in words)
            continue
        with pytest.raises(InputError, match=r"rock\.yaml: hazard\.curves: got a curve"):
            left_open(analysis, analysis.results(), origin, of_pgv=False)


@pytest.mark.parametrize(
    ("thresholds", "told"), [([0.5] * 20, 0), ([0.1, *[0.5] * 19], 1), ([0.1, 0.5], 2)]
)
@pytest.mark.parametrize("where", ["as it stands", "in an earlier stage", "beside a stronger one"])
def test_curves_that_begin_where_a_rock_topples(
    thresholds: list[float], told: int, where: str
) -> None:
    """At 0.20 g, where none, a 20th or half of the draws topple: silent, told, refused."""
    origin = Origin(name="rock", file="rock.yaml", path=Path("rock.yaml"))
    ages, strong = np.array([1e3]), ensemble([0.5] * len(thresholds), 800)
    weak = DatedRock("weak", ensemble(thresholds, 800), ages)
    rocks = {
        "as it stands": (weak,),
        "in an earlier stage": (DatedRock("weak", strong, ages, ((weak.fragility, 0.5 * ages),)),),
        "beside a stronger one": (DatedRock("strong", strong, ages), weak),
    }[where]
    whole = curve(1e-5)
    late = HazardCurve(whole.levels[17:], whole.rates[17:])
    analysis = of_curves(HazardModel((Branch("a", "a", 1.0, late),), None), *rocks)
    if told == 2:
        with pytest.raises(InputError, match=r"begins at 0.203 g, of which 50% topples weak"):
            begun_late(analysis, origin)
    else:
        assert len(begun_late(analysis, origin)) == told


@pytest.mark.parametrize(("often", "told"), [(0.04, ""), (0.5, "0.61"), (0.8, "refused")])
def test_a_rock_that_topples_beyond_what_was_tried(often: float, told: str) -> None:
    """From 3 g on by its fit, which is so often exceeded within its age; runs go to 2 g."""
    origin, years = Origin(name="rock", file="rock.yaml", path=Path("rock.yaml")), 1e3
    rock = DatedRock("rock", ensemble([3.0], 800), np.array([years]))
    analysis = of_curves(model(often / years * 3.0**SLOPE), rock)
    results = analysis.results()
    if told == "refused":  # exp(-0.8) = 0.45
        with pytest.raises(InputError, match=r"fragility\.highest: got no runs of rock above 2 g"):
            untested(analysis, results, origin)
        tried = replace(analysis, rocks=(replace(rock, fragility=ensemble([1.9], 800)),))
        assert untested(tried, tried.results(), origin) == ()  # it stays toppled beyond
    else:
        words = untested(analysis, results, origin)
        assert len(words) == bool(told)
        assert all(f"survival is {told} with what its fits" in one for one in words)
    case = Case("study: other", analysis, results)
    said = list(open_cases([case], [case.name], [], origin))
    assert len(said) == bool(told)
    assert all(one.startswith("study: other: no runs of rock above 2 g") for one in said)
    assert not list(open_cases([case], [], [], origin))
    own = [one.removeprefix("study: other: ") for one in said]
    assert not list(open_cases([case], [case.name], own, origin))


@pytest.mark.parametrize(
    ("factor", "told"),
    [(0.5, ""), (1.0, ""), (1.4, ""), (2.0, "5%"), (3.0, "100%"), (np.inf, "100%")],
)
def test_a_factor_of_curves_that_begin_late(factor: float, told: str) -> None:
    """At 0.203 g; of 20 draws one topples from 0.3 g on, the others from 0.5 g on."""
    rock = DatedRock("rock", ensemble([0.3, *[0.5] * 19], 800), np.array([1e3]))
    whole = curve(1e-5)
    late = HazardCurve(whole.levels[17:], whole.rates[17:])
    analysis = of_curves(HazardModel((Branch("a", "a", 1.0, late),), None), rock)
    found, words = of_scale(analysis, factor, of_pgv=False)
    assert (len(words), math.isnan(found)) == (bool(told), told == "100%")
    assert all(f"with it {told} of the shaking of their first level, 0.203 g" in w for w in words)


def test_a_factor_that_hangs_on_what_was_not_tried() -> None:
    """Of a rock that topples from 3 g on by its fit, and whose runs go to 2 g."""
    for threshold, told in ((1.0, 0), (3.0, 1)):
        rock = DatedRock("rock", ensemble([threshold], 800), np.array([1e3]))
        analysis = of_curves(model(1e-5), rock)
        factor = math.sqrt(3.0 / 1e3 / 1e-5) * threshold  # which leaves exp(-3)
        assert analysis.survival_scaled(factor) == pytest.approx(math.exp(-3.0), rel=0.05)
        found, words = of_scale(analysis, factor, of_pgv=False)
        assert (found, len([one for one in words if "no runs of rock above 2 g" in one])) == (
            factor,
            told,
        )


@pytest.mark.parametrize(
    ("ratios", "told"),
    [([0.05, 0.1, 0.2], ""), ([0.15], "may be far off"), ([0.2], "is not known")],
)
def test_a_factor_of_shaking_that_no_run_is_near(ratios: list[float], told: str) -> None:
    """Which is too weak to topple the rock; times 27, 56 or 81 % is too short by 1.41."""
    rows = replace(rows_from(ratios, [0.5] * len(ratios)), static=0.4)
    # 1e-6 (PGA / g)^-2 is once in 1000 years at 0.032 g, and 1 % at 0.32 g
    analysis = of_curves(model(1e-6), DatedRock("rock", rows, np.array([1e3])))
    assert off(analysis, Origin(name="rock", file="rock.yaml", path=Path("rock.yaml"))) == ()
    found, words = of_scale(analysis, 27.0, of_pgv=False)
    assert math.isnan(found) is (told == "is not known")
    assert [told in one for one in words] == [True] * bool(told)


@pytest.mark.parametrize(("last", "told"), [(0.4, 1), (1.2, 0)])
def test_a_factor_of_curves_that_end_early(last: float, told: int) -> None:
    """A rock that topples from 0.5 g on: times 0.5, all that does is beyond 0.4 g, not 1.2 g."""
    rock = DatedRock("rock", ensemble([0.5], 800), np.array([1e3]))
    curves = (Branch("a", "a", 1.0, ended(last, 1.0, 1e3)),)
    _, words = of_scale(of_curves(HazardModel(curves, None), rock), 0.5, of_pgv=False)
    assert len(words) == told
    assert all("may be too large: survival with it is 0.37 if" in one for one in words)  # exp(-1)


@pytest.mark.parametrize(("threshold", "refused"), [(0.5, False), (0.3, True)])
def test_curves_of_pgv_that_begin_where_the_rock_topples(threshold: float, refused: bool) -> None:
    """Where PGA is 0.4 g; what is known of a rock that stands there needs no PGV/PGA below it."""
    origin = Origin(name="rock", file="rock.yaml", path=Path("rock.yaml"))
    analysis = of_curves(model(1e-5), DatedRock("rock", ensemble([threshold], 800), np.ones(1)))
    table = RatioTable(GRAVITY * np.array([0.4, 2.0]), np.full(2, 0.1), np.full(2, 0.4))
    analysis = replace(analysis, shaking=replace(analysis.shaking, table=table))
    assert begun_late(analysis, origin) == ()
    if refused:
        with pytest.raises(InputError, match=r"PGV begins where PGA is 0.4 g, of which 100%"):
            begun_late(analysis, origin, of_pgv=True)
    else:
        assert begun_late(analysis, origin, of_pgv=True) == ()


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


@pytest.mark.parametrize(("thresholds", "told"), [([99.0, 0.05], 1), ([0.05, 0.05], 0)])
def test_a_verdict_on_a_fault_that_turns_with_every_second_row_is_told(
    thresholds: list[float], told: int
) -> None:
    """By 0.03 s alone the rock stands, by 0.15 s alone it topples in each of 20 earthquakes."""
    rock, ages = rows_from([0.03, 0.15], thresholds), np.array([1e3])
    fault = Fault(name="A", magnitude=6.5, distance_km=5.0, rate_per_year=0.02)
    faults = Faults((), {}, (fault,), None)
    words = exclusion.too_coarse(rock, faults, ages, exclusion.of_faults(rock, faults, ages), 0.05)
    assert ["another verdict on 1 of 1 fault:" in one for one in words] == [True] * told


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


def rows_from(ratios: Sequence[float], thresholds: Sequence[float]) -> RockFragility:
    """Rows of PGV/PGA [s] that topple from a PGA on [g]."""
    falls = GRAVITY * np.array(thresholds)[:, None]
    return replace(
        ensemble([0.5]),
        ratios=np.array(ratios),
        static=min(thresholds),
        mean=lambda level: (level > falls) * 1.0,
        others=(lambda level: (level > falls) * 1.0,),
        by_yaw={},
    )


def test_every_second_row_is_a_case_and_a_verdict_that_turns_with_it_is_told() -> None:
    ratios, thresholds, age = [0.05, 0.08, 0.125, 0.2], [3.0, 2.0, 0.3, 0.3], np.array([1e3])
    found = {}
    for pick in (slice(None), slice(0, None, 2), slice(1, None, 2)):
        rows = rows_from(ratios[pick], thresholds[pick])
        analysis = of_curves(model(4e-4, 1e-4), DatedRock("rock", rows, age))
        found[pick.start, pick.step] = cases(analysis, {}, {})
    whole = found[None, None]
    halves = [one.results for one in whole if "every second" in one.name]
    for half, alone in zip(halves, (found[0, 2], found[1, 2]), strict=True):
        np.testing.assert_allclose(half.survival, alone[0].results.survival, rtol=1e-3)
    assert halves[0].survival[0] < 0.05 < whole[0].results.survival[0] < halves[1].survival[0]
    (told,) = too_coarse(whole)
    assert "gives another verdict on 1 of 2 branches" in told
    alike = of_curves(model(1e-4), DatedRock("rock", rows_from(ratios, [0.5] * 4), age))
    assert {one.name for one in cases(alike, {}, {})} > {*OTHER_ROWS}
    assert too_coarse(cases(alike, {}, {})) == ()


def test_a_verdict_that_turns_where_rows_are_moved_is_told() -> None:
    """It topples from 0.02 s / (PGV/PGA) on. Rows of a factor of 2, and halves of them, have more
    that topples, so that 0.04 survive by them of 0.0508."""
    ratios, age = np.geomspace(0.0125, 0.8, 7), np.array([1e3])
    rows = rows_from(ratios.tolist(), (0.02 / ratios).tolist())
    exact = 0.02**-2.0 * 0.1**2 * math.exp(2.0 * 0.4**2)  # E[threshold^-2] of a lognormal PGV/PGA
    rate = -math.log(0.0508) / (age[0] * exact)
    found = cases(of_curves(model(rate), DatedRock("rock", rows, age)), {}, {})
    survived = {one.name: one.results.survival[0] for one in found}
    half, other, shorter, longer = (survived[name] for name in OTHER_ROWS)
    assert max(half, other, shorter, survived[BASE_CASE]) < 0.05 < 0.0508 < longer
    (told,) = too_coarse(found)
    assert "another verdict on 1 of 1 branch:" in told


def test_of_one_pgv_pga_no_half_is_a_case() -> None:
    one = of_curves(model(1e-4), DatedRock("rock", rows_from([0.1], [0.5]), np.array([1e3])))
    assert not {case.name for case in cases(one, {}, {})} & {*OTHER_ROWS}


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


@pytest.mark.parametrize(("threshold", "refused"), [(0.5, False), (0.15, True)])
def test_earthquakes_of_which_weak_shaking_was_left_out(threshold: float, refused: bool) -> None:
    """From 0.2 g on, as OpenQuake's minimum intensity does, of a rock that topples at 0.15 g."""
    origin = Origin(name="rock", file="rock.yaml", path=Path("rock.yaml"))
    rock = DatedRock("rock", ensemble([threshold], 800), np.array([1e3]))
    pga, number = GRAVITY * np.geomspace(0.2, 2.0, 100), np.arange(100)
    events = Events(pga, None, 0 * number, number, 1e5, None)
    borders = borders_of(rock.fragility.ratios)
    shaking = counted_shaking(events, np.full(100, 0.1), borders, np.ones(1))
    analysis = SurvivalAnalysis(model(1e-5), (rock,), shaking, 0.05)
    if refused:
        with pytest.raises(InputError, match=r"hazard\.events: .* begins at 0.2 g, of which 100%"):
            begun_late(analysis, origin)
    else:
        assert begun_late(analysis, origin) == ()


@pytest.mark.parametrize("often", [8.0, 0.2])
def test_curves_of_pgv_that_end_before_the_rock_topples(often: float) -> None:
    """So often in its age; PGA goes on to 3 g. The rock topples from 0.5 g on."""
    origin, years = Origin(name="rock", file="rock.yaml", path=Path("rock.yaml")), 2e3
    rock = DatedRock("rock", ensemble([0.5], 800), np.array([years]))
    ends = ended(3.0, 1.0, years).levels[11] / GRAVITY
    whole = ended(3.0, often * (ends / 3.0) ** SLOPE, years)
    analysis = of_curves(HazardModel((Branch("a", "a", 1.0, whole),), None), rock)
    table = RatioTable(GRAVITY * np.array([0.01, ends]), np.full(2, 0.1), np.full(2, 0.4))
    analysis = replace(analysis, shaking=replace(analysis.shaking, table=table))
    results, words = analysis.results(), rf"whose PGV ends where PGA is {ends:.3g} g"
    assert left_open(analysis, results, origin, of_pgv=False) == ()
    if often > 1.0:
        with pytest.raises(InputError, match=words):
            left_open(analysis, results, origin, of_pgv=True)
    else:
        (told,) = left_open(analysis, results, origin, of_pgv=True)
        assert words in told
        assert f"survival is {np.exp(-often):.2g} if all of them topple a rock, 1 if" in told


def stand(
    rate: float, years: float, thresholds: list[float], *, same: bool, number: int = 20_000
) -> float:
    """Share of catalogues in which a rock stands that is one of two, or either in each of them."""
    rng, least = np.random.default_rng(11), min(thresholds)
    count = rng.poisson(rate * least**-SLOPE * years, number)
    of = np.repeat(np.arange(number), count)
    shaking = least * rng.uniform(size=len(of)) ** (-1.0 / SLOPE)
    rock = rng.choice(thresholds, number)[of] if same else rng.choice(thresholds, len(of))
    return 1.0 - len(np.unique(of[shaking >= rock])) / number


def test_a_rock_that_is_the_same_in_all_earthquakes_stands_more_often() -> None:
    """Two draws that topple from 0.3 and from 0.6 g, and catalogues over 1,000 years.

    Of the second branch the rates are 5.11e-3 and 1.28e-3: drawn anew in each earthquake the rock
    survives with exp(-3.19) = 0.041 and rejects it, as one of the two with 0.142 and keeps it.
    """
    thresholds, rates, years = [0.3, 0.6], [1e-4, 4.6e-4], 1000.0
    rock = DatedRock("rock", ensemble(thresholds, 2000), np.array([years]))
    analysis = of_curves(model(*rates), rock)
    found = cases(analysis, {}, {"another": rock.fragility})
    same, anew = (case.results for case in found[:2])
    assert [case.name for case in found[:3]] == [BASE_CASE, DRAWN_ANEW, "another"]
    another = found[2].results  # which is the same ensemble
    np.testing.assert_array_equal(another.survival, same.survival)
    alone = analysis.survival_for(0, np.array([0.0, years]))[1]
    np.testing.assert_allclose(alone, [1.0, same.survival[1]])
    error = survival_error(analysis, analysis.survival_of_others())
    nu = np.array([[rate * level**-SLOPE for rate in rates] for level in thresholds])
    np.testing.assert_allclose(same.survival, np.exp(-years * nu).mean(axis=0), rtol=0.01)
    half = 0.5 * np.abs(np.diff(np.exp(-years * nu), axis=0))[0]  # of two: their half distance
    np.testing.assert_allclose(error, half, rtol=0.02)
    np.testing.assert_allclose(anew.survival, np.exp(-years * nu.mean(axis=0)), rtol=0.03)
    for n, rate in enumerate(rates):
        for results, alike in ((same, True), (anew, False)):
            share = stand(rate, years, thresholds, same=alike)
            assert results.survival[n] == pytest.approx(share, abs=4.0 * math.sqrt(0.25 / 20_000))
    assert anew.rejected.tolist() == [False, True]
    assert same.rejected.tolist() == [False, False]
    weights = np.exp(-years * nu).mean(axis=0)
    assert same.after is not None
    after = math.sqrt(float(weights @ rates / weights.sum()) * 2475.0)
    assert same.after.level_at(1 / 2475) / GRAVITY == pytest.approx(after, rel=0.01)


def test_two_rocks_are_not_drawn_alike() -> None:
    """Both stand with exp(-T lambda(lower threshold)), whichever members the two are."""
    thresholds, rate, years = np.linspace(0.2, 0.6, 200), 1e-4, 1000.0
    rocks = tuple(
        DatedRock(name, ensemble(thresholds.tolist(), 400), np.array([years]))
        for name in ("one", "other")
    )
    lower = np.minimum(*np.meshgrid(thresholds, thresholds))
    exact = np.exp(-years * rate * lower**-SLOPE).mean()
    found = of_curves(model(rate), *rocks).survival_of_others().mean()
    assert found == pytest.approx(exact, rel=0.04)
    assert found < 0.85 * np.exp(-years * rate * thresholds**-SLOPE).mean()


def test_of_several_rocks_the_first_is_shaken_in_one_direction() -> None:
    """Each has the yaw of its own scan: the others, weaker from one side, keep all of theirs."""
    weak, strong = ensemble([0.3], 2000), ensemble([0.6], 2000)
    sides = replace(strong, by_yaw={0.0: weak.mean, 90.0: strong.mean})
    rocks = (DatedRock(name, sides, np.array([1000.0])) for name in ("one", "other"))
    analysis = of_curves(model(1e-4), *rocks)
    found = {one.name: one.analysis.rocks for one in cases(analysis, {}, {})}
    for name, yaw in (("yaw 0°, the most", 0.0), ("yaw 90°, the least", 90.0)):
        one, other = found[f"direction: all shaking of one at {name} fragile"]
        assert one.fragility.mean is sides.by_yaw[yaw]
        assert other is analysis.rocks[1]


def test_a_row_that_no_run_topples_may_stand_for_ever() -> None:
    """Its theta has no largest value; that of a row which topples at the lowest PGA no least."""
    rows = ("yaw", "friction", "pgv_pga")
    data = xr.Dataset(
        {
            "theta": (rows, [[[2.0, 0.5, 0.02]]]),
            "beta": (rows, [[[0.1, 0.1, 0.1]]]),
            "theta_interval": ((*rows, "bound"), [[[[1.9, np.inf], [0.4, 0.6], [0.0, 0.022]]]]),
        },
        {"yaw": [0.0], "friction": [0.5], "pgv_pga": [0.1, 0.2, 0.4], "pga": [0.1, 1.0]},
        dict(zip(SEARCHED, (0.02, 1.0), strict=True)),
    )
    found = of_fits(SimpleNamespace(data=data))
    other, folder = data.assign_attrs({SEARCHED[0]: 0.05}), Path("compared/other")
    with pytest.raises(
        InputError, match=r"^compared/other/.*33% of the boundaries of its fits below"
    ):
        of_fits(SimpleNamespace(data=other, folder=folder, FILE="fragility.nc"))
    low, high = (one(GRAVITY * np.array([1e-6, 0.5, 1e6])) for one in found.others)
    assert (high[0] == 0.0).all()
    assert (low[2] == 1.0).all()
    assert 0.0 < low[0, 1] < high[2, 1] == 1.0
    assert low[1, 1] == pytest.approx(norm.cdf(np.log(0.5 / 0.4) / 0.1))
    assert high[1, 1] == pytest.approx(norm.cdf(np.log(0.5 / 0.6) / 0.1))


@pytest.mark.parametrize("first", [True, False])
def test_a_rock_of_fits_that_has_just_come_leaves_the_draws_of_another(first: bool) -> None:
    """Of two draws of one rock that stand with 0.1 and 0.8 the mean is taken, as without it."""
    drawn = DatedRock("drawn", ensemble([0.3, 0.6], 2000), np.array([1000.0]))
    fits = replace(ensemble([0.4]), source=FITTED)
    fresh = DatedRock("fresh", fits, np.array([1e-6]))
    hazard = model(1e-4, 4.6e-4)
    alone = of_curves(hazard, drawn)
    both = of_curves(hazard, *((fresh, drawn) if first else (drawn, fresh)))
    survival = alone.results().survival
    np.testing.assert_allclose(both.results().survival, survival, rtol=1e-6)
    np.testing.assert_allclose(both.survival_alone(int(first)), survival, rtol=1e-6)
    others, alone_others = both.survival_of_others(), alone.survival_of_others()
    np.testing.assert_allclose(survival_error(both, others), survival_error(alone, alone_others))
    np.testing.assert_allclose(survival_range(both, others), survival_range(alone, alone_others))
    assert DRAWN_ANEW in [case.name for case in cases(both, {}, {})]
    if not first:  # the drawn rock changed for fits leaves nothing drawn
        assert not both.with_first(replace(drawn, fragility=fits)).drawn


def test_draws_that_come_again_beside_those_of_another_make_no_error_smaller() -> None:
    drawn = DatedRock("drawn", ensemble([0.3, 0.6], 2000), np.array([1000.0]))
    fresh = DatedRock("fresh", ensemble([0.4] * 20), np.array([1e-6]))
    alone, both = (of_curves(model(1e-4), *rocks) for rocks in ([drawn], [fresh, drawn]))
    error, alike = (survival_error(one, one.survival_of_others()) for one in (alone, both))
    np.testing.assert_allclose(alike, error, rtol=1e-6)


def test_draws_that_observations_chose_repeatedly_make_no_error_smaller() -> None:
    """Of eight draws that are two, and of some that come once the more often they come."""
    error = []
    for thresholds, seeds in (
        ([0.3, 0.6], [1, 2]),
        ([0.3, 0.6] * 4, [1, 2] * 4),
        ([0.3, 0.6] * 4, range(8)),
    ):
        rock = DatedRock("rock", ensemble(thresholds, seeds=seeds), np.array([1000.0]))
        analysis = of_curves(model(1e-4), rock)
        error.append(float(survival_error(analysis, analysis.survival_of_others())[0]))
    assert error[1] == pytest.approx(error[0])
    assert error[2] == pytest.approx(error[0] / math.sqrt(7.0))


def test_fewer_draws_come_again_spread_over_all_of_them() -> None:
    """64 from weak to strong, as of an archive, beside 96 of a rock that nothing topples."""
    weak_to_strong, rate, years = np.geomspace(0.2, 0.9, 64), 1e-4, np.array([1000.0])
    safe, archived = ensemble([1.9] * 96), ensemble(weak_to_strong.tolist(), 200)
    analysis = of_curves(
        model(rate), DatedRock("safe", safe, years), DatedRock("old", archived, years)
    )
    alone = of_curves(model(rate), DatedRock("old", archived, years)).results().survival
    np.testing.assert_allclose(analysis.survival_alone(1), alone, rtol=1e-12)
    beside = of_curves(model(rate), DatedRock("safe", safe, years)).results().survival
    joint = analysis.results().survival
    assert beside * alone < joint
    np.testing.assert_allclose(joint, alone, rtol=0.03)


def test_a_stage_whose_draws_nothing_chose_hides_no_repeats() -> None:
    """All is of the present stage: that before it lasted a day."""
    own, before = ensemble([0.3, 0.6] * 4, seeds=[1, 2] * 4), ensemble([0.5] * 8)
    age, until = np.array([1000.0]), np.array([1000.0 - 1.0 / 365.0])
    error = []
    for earlier in ((), ((before, until),)):
        analysis = of_curves(model(1e-4), DatedRock("rock", own, age, earlier))
        error.append(survival_error(analysis, analysis.survival_of_others()))
    np.testing.assert_allclose(*error, rtol=1e-3)


@pytest.mark.parametrize("now", [32, 0])
def test_a_stage_that_lacks_draws_of_the_rock_is_refused(now: int) -> None:
    """Or of the first stage that has any, where the rock has none as it stands."""
    drawn = [ensemble(np.linspace(0.3, 0.6, number).tolist()) for number in (32, 8)]
    fits = replace(drawn[0], source=FITTED, numbers=np.array([], int))
    earlier: list[Any] = [
        SimpleNamespace(
            name=name,
            observed=(),
            site=SimpleNamespace(file_of=lambda key: "before.yaml"),
            fragility=lambda folder, one=one: one,
        )
        for name, one in zip(("late", "early"), drawn, strict=True)
    ]
    ends = tuple(
        EarlierStage(site=name, until=NormalAge(kind="normal", mean=mean))
        for name, mean in (("late", 300.0), ("early", 600.0))
    )
    age, own = NormalAge(kind="normal", mean=900.0), drawn[0] if now else fits
    with pytest.raises(InputError, match="24 draws of rock that early has not"):
        dated(Path(), "rock", own, age, ends, (), earlier)
    assert dated(Path(), "rock", own, age, ends[:1], (), earlier[:1]).drawn


def test_fits_of_the_rock_stand_beside_the_draws_that_all_its_stages_have() -> None:
    """Of two stages the later has eight draws more, which are no rock that stood before."""
    thresholds = np.linspace(0.3, 0.6, 16)
    fits = replace(ensemble([1.9]), source=FITTED, numbers=np.array([], int))
    ages, until = np.array([900.0]), np.array([300.0])
    survival = []
    for number in (16, 8):
        stages = ensemble(thresholds[:number].tolist()), ensemble([0.5] * 8)
        earlier = tuple(zip(stages, (until, 2.0 * until), strict=True))
        rock = DatedRock("rock", fits, ages, earlier)
        survival.append(of_curves(model(1e-4), rock).results().survival)
    np.testing.assert_array_equal(*survival)


def test_one_draw_tells_nothing_of_the_error_and_fits_have_none() -> None:
    one = of_curves(
        model(1e-4), DatedRock("rock", ensemble([0.3] * 4, seeds=[7] * 4), np.array([1000.0]))
    )
    assert np.isnan(survival_error(one, one.survival_of_others())).all()
    fits = replace(ensemble([0.3, 0.6]), source=FITTED)
    fitted = of_curves(model(1e-4), DatedRock("rock", fits, np.array([1000.0])))
    assert survival_error(fitted, fitted.survival_of_others()).tolist() == [0.0]


def test_draws_that_observations_chose_go_back_into_the_same_draws() -> None:
    """Draws 3, 1 and 3 of four, in stages that differ in nothing, survive as in one stage."""
    of_all = [0.3, 0.45, 0.6, 0.9]
    chosen = ensemble([of_all[i] for i in (3, 1, 3)], 2000, [3, 1, 3])
    before, age = ensemble(of_all, 2000, range(4)), np.array([4000.0])
    stages = ((before, np.array([1000.0])),)
    found = of_curves(model(1e-4), DatedRock("rock", chosen, age, stages)).results().survival
    exact = np.mean([math.exp(-1e-4 * of_all[i] ** -SLOPE * 4000.0) for i in (3, 1, 3)])
    assert found[0] == pytest.approx(exact, rel=0.01)


def test_an_earlier_stage_has_its_draws_where_the_rock_has_none_now() -> None:
    """It has just come out of what let it stand for 1,000 years with 0.1 or with 0.8."""
    drawn, years = ensemble([0.3, 0.6], 2000), np.array([1000.0])
    fits = replace(ensemble([0.4]), source=FITTED)
    ago = np.array([1e-6])
    changed = of_curves(model(4.6e-4), DatedRock("rock", fits, years, ((drawn, ago),)))
    as_ever = of_curves(model(4.6e-4), DatedRock("rock", drawn, years))
    survival = as_ever.results().survival
    np.testing.assert_allclose(changed.results().survival, survival, rtol=1e-6)
    np.testing.assert_allclose(changed.survival_for(0, years)[:, 0], survival, rtol=1e-6)


def test_cells_without_a_verdict_do_not_count() -> None:
    fell = np.array([[[1, -1], [0, 1]]], dtype=np.int8)[:, :, None, :]  # one member, two yaws
    data = xr.Dataset(
        {
            "overturned": (("member", "yaw", "pgv_pga", "pga"), fell),
            "member_boundary": (("member", "yaw", "pgv_pga"), [[[0.4], [0.7]]]),
            "theta": (("yaw", "pgv_pga"), np.full((2, 1), 1.0)),
            "beta": (("yaw", "pgv_pga"), np.full((2, 1), 1.0)),
        },
        {"yaw": [0.0, 90.0], "pgv_pga": [0.1], "pga": [0.5, 1.0]},
        {"searched_from_g": 0.5, "searched_to_g": 1.0},
    )
    (member,) = of_members(numbered(data)).others
    np.testing.assert_allclose(member(GRAVITY * np.array([0.5, 1.0])), [[0.5, 1.0]])


def test_a_cell_without_a_verdict_above_a_boundary_is_not_known_to_stand() -> None:
    """Two of three draws have none at 1 g, one stands there again; all topple from 0.4 g on.

    A fourth has no verdict at all and is none of the mean.
    """
    fell = np.array([[0, 1, -1], [0, 1, -1], [0, 1, 0], [-1, -1, -1]])[:, None, None, :]
    edges = np.array([0.4, 0.4, 0.4, np.nan])[:, None, None]
    data = xr.Dataset(
        {
            "overturned": (("member", "yaw", "pgv_pga", "pga"), fell),
            "member_boundary": (("member", "yaw", "pgv_pga"), edges),
            "theta": (("yaw", "pgv_pga"), [[0.4]]),
            "beta": (("yaw", "pgv_pga"), [[0.1]]),
        },
        {"yaw": [0.0], "pgv_pga": [0.1], "pga": [0.25, 0.5, 1.0]},
        {"searched_from_g": 0.25, "searched_to_g": 1.0},
    )
    rock, levels = of_members(numbered(data)), GRAVITY * np.array([0.3, 0.6, 0.9])
    each = [one(levels)[0] for one in rock.others[:3]]
    np.testing.assert_array_equal(each, [[0, 1, 1], [0, 1, 1], [0, 1, 0]])
    np.testing.assert_allclose(rock.mean(levels)[0], np.mean(each, axis=0))


def test_beyond_what_was_tried_half_of_what_stands_falls_where_half_would() -> None:
    """Tried are 0.5 and 1 g; the fit has 1/2 at 1 g and Phi(1) at e g, Phi(-2) at exp(-2) g."""
    fell = np.array([[1], [0]], np.int8)  # from one of two directions, at both levels
    falls = np.broadcast_to(fell[None, :, None, :], (1, 2, 1, 2))
    data = xr.Dataset(
        {
            "overturned": (("member", "yaw", "pgv_pga", "pga"), falls),
            "member_boundary": (("member", "yaw", "pgv_pga"), [[[0.4], [np.inf]]]),
            "theta": (("yaw", "pgv_pga"), np.ones((2, 1))),
            "beta": (("yaw", "pgv_pga"), np.ones((2, 1))),
        },
        {"yaw": [0.0, 90.0], "pgv_pga": [0.1], "pga": [0.5, 1.0]},
        {"searched_from_g": 0.5, "searched_to_g": 1.0},
    )
    rock = of_members(numbered(data))
    levels = GRAVITY * np.array([np.exp(-2.0), 0.5, 0.7, 1.0, np.e])
    expected = [
        0.5 * norm.cdf(-2.0) / norm.cdf(np.log(0.5)),
        0.5,
        0.5,
        0.5,
        1.0 - 0.5 * norm.cdf(-1.0) / 0.5,
    ]
    (member,) = rock.others
    np.testing.assert_allclose(member(levels)[0], expected)
    np.testing.assert_allclose(rock.mean(levels)[0], expected)


def test_the_mean_of_draws_counts_those_that_slide_and_never_topple() -> None:
    """A lognormal of all would have 6 % fall at half the PGA that the others need."""
    boundary = np.append(np.geomspace(0.55, 0.7, 27), np.full(5, np.inf))[:, None, None]
    pga = np.array([0.25, 0.5, 1.0, 2.0, 4.0])
    data = xr.Dataset(
        {
            "overturned": (
                ("member", "yaw", "pgv_pga", "pga"), (pga > boundary[..., None]).astype(np.int8)
            ),
            "member_boundary": (("member", "yaw", "pgv_pga"), boundary),
            "theta": (("yaw", "pgv_pga"), [[0.9]]),
            "beta": (("yaw", "pgv_pga"), [[0.8]]),
        },
        {"yaw": [0.0], "pgv_pga": [0.3], "pga": pga},
        {"searched_from_g": 0.25, "searched_to_g": 4.0},
    )  # fmt: skip
    rock, levels = of_members(numbered(data)), GRAVITY * np.array([0.3, 0.5, 0.8, 4.0, 6.0])
    np.testing.assert_allclose(rock.mean(levels[:4])[0], [0.0, 0.0, 27 / 32, 27 / 32])
    each = np.mean([one(levels) for one in rock.others], axis=0)
    np.testing.assert_allclose(rock.mean(levels), each)


def test_a_row_without_a_verdict_goes_by_the_fit_between_its_neighbours() -> None:
    pga = np.array([0.25, 0.5, 1.0])
    boundary = np.array([[[0.4, np.nan]]])
    cells = np.where(np.isnan(boundary)[..., None], -1, pga > boundary[..., None]).astype(np.int8)
    data = xr.Dataset(
        {
            "overturned": (("member", "yaw", "pgv_pga", "pga"), cells),
            "member_boundary": (("member", "yaw", "pgv_pga"), boundary),
            "theta": (("yaw", "pgv_pga"), [[0.4, 0.4]]),
            "beta": (("yaw", "pgv_pga"), [[0.1, 0.1]]),
        },
        {"yaw": [0.0], "pgv_pga": [0.1, 0.2], "pga": pga},
        {"searched_from_g": 0.25, "searched_to_g": 1.0},
    )
    with pytest.raises(InputError, match="no direction with a fragility"):
        of_members(numbered(data.assign(theta=np.nan * data["theta"])))
    rock, levels = of_members(numbered(data)), GRAVITY * np.array([0.3, 0.45, 2.0])
    for rows in (rock.mean, *rock.others, *rock.by_yaw.values()):
        np.testing.assert_allclose(rows(levels)[0], [0.0, 1.0, 1.0])
        np.testing.assert_allclose(rows(levels)[1], norm.cdf(10.0 * np.log(levels / GRAVITY / 0.4)))


def test_draws_of_one_direction_go_on_by_its_own_fit() -> None:
    """None fell up to 1 g in either direction, of which one has a median of 2 g, and one of 8 g."""
    data = xr.Dataset(
        {
            "overturned": (("member", "yaw", "pgv_pga", "pga"), np.zeros((1, 2, 1, 2), np.int8)),
            "member_boundary": (("member", "yaw", "pgv_pga"), np.full((1, 2, 1), np.inf)),
            "theta": (("yaw", "pgv_pga"), [[2.0], [8.0]]),
            "beta": (("yaw", "pgv_pga"), np.full((2, 1), 0.5)),
        },
        {"yaw": [0.0, 90.0], "pgv_pga": [0.1], "pga": [0.5, 1.0]},
        {"searched_from_g": 0.5, "searched_to_g": 1.0},
    )
    rock, levels = of_members(numbered(data)), np.array([1.0, 2.0, 4.0])
    for yaw, median in ((0.0, 2.0), (90.0, 8.0), (-270.0, 8.0)):
        (draw,) = rock.towards(yaw).others
        stands = norm.sf(2.0 * np.log(levels / median))
        np.testing.assert_allclose(draw(GRAVITY * levels)[0], 1.0 - stands / stands[0])


def test_a_record_and_its_mirror_image_are_one_row_whatever_their_names() -> None:
    """Each stands for half of the shaking of their PGV/PGA, in either order."""
    levels = GRAVITY * np.array([0.2, 0.5, 1.0])
    found = []
    for medians in ([0.4, 0.8, 1.0], [0.8, 0.4, 1.0]):
        data = xr.Dataset(
            {
                "overturned": (
                    ("member", "yaw", "pgv_pga", "pga"),
                    np.zeros((1, 1, 3, 2), np.int8),
                ),
                "member_boundary": (("member", "yaw", "pgv_pga"), [[medians]]),
                "theta": (("yaw", "pgv_pga"), [medians]),
                "beta": (("yaw", "pgv_pga"), np.full((1, 3), 0.5)),
            },
            {"yaw": [0.0], "pgv_pga": [0.1, 0.1 * (1 + 1e-12), 0.3], "pga": [0.1, 2.0]},
            {"searched_from_g": 0.1, "searched_to_g": 2.0},
        )
        rock = of_members(numbered(data))
        np.testing.assert_allclose(rock.ratios, [0.1, 0.3])
        found.append([rows(levels) for rows in (rock.mean, rock.by_yaw[0.0], *rock.others)])
    chance = [levels > GRAVITY * median for median in (0.4, 0.8)]
    np.testing.assert_allclose(found[0][0][0], np.mean(chance, axis=0))
    np.testing.assert_allclose(found[0], found[1])


def test_a_direction_of_which_nothing_is_known_is_all_of_them() -> None:
    rock = ensemble([0.5])
    assert rock.towards(45.0) is rock


def test_a_member_falls_from_its_boundary_on_also_between_the_cells() -> None:
    """It topples from 0.3 g on, stands again about the cell at 0.8 g, and topples beyond."""
    pga = np.array([0.2, 0.4, 0.8, 1.6])
    data = xr.Dataset(
        {
            "overturned": (("member", "yaw", "pgv_pga", "pga"), np.array([[[[0, 1, 0, 1]]]])),
            "member_boundary": (("member", "yaw", "pgv_pga"), [[[0.3]]]),
            "theta": (("yaw", "pgv_pga"), [[0.3]]),
            "beta": (("yaw", "pgv_pga"), [[0.1]]),
        },
        {"yaw": [0.0], "pgv_pga": [0.1], "pga": pga},
        {"searched_from_g": 0.1, "searched_to_g": 4.0},
    )
    (member,) = of_members(numbered(data)).others
    levels = GRAVITY * np.array([0.25, 0.299, 0.301, 0.45, 0.7, 0.9, 1.3, 3.0])
    np.testing.assert_array_equal(member(levels)[0], [0, 0, 1, 1, 0, 0, 1, 1])


def test_draws_that_topple_at_the_least_pga_are_no_fragility() -> None:
    """Where below it they do is assumed, and more draws that do would make it surer."""
    edges = np.full((4, 1, 1), 0.3)
    data = xr.Dataset(
        {
            "overturned": (("member", "yaw", "pgv_pga", "pga"), np.ones((4, 1, 1, 2))),
            "member_boundary": (("member", "yaw", "pgv_pga"), edges),
            "theta": (("yaw", "pgv_pga"), [[0.3]]),
            "beta": (("yaw", "pgv_pga"), [[0.1]]),
        },
        {"yaw": [0.0], "pgv_pga": [0.1], "pga": [0.34, 0.5]},
        {"searched_from_g": 0.34, "searched_to_g": 4.0},
    )
    data = numbered(data)
    data["member_boundary_lower"] = data["member_boundary"].where(np.arange(4)[:, None, None] > 0)
    with pytest.raises(InputError, match=r"fragility\.lowest: got 25% of the boundaries"):
        of_members(data)


def test_a_kept_and_a_rejected_branch_by_hand() -> None:
    """Rates 1e-4 and 1e-3 at 1 g; a rock that topples at 0.5 g for 2,000 years.

    Rates of toppling are 4e-4 and 4e-3, survival exp(-0.8) = 0.449 and exp(-8) = 0.0003; the
    second is rejected, and the 2,475-year PGA falls from sqrt(5.5e-4 * 2475) = 1.167 g to
    sqrt(1e-4 * 2475) = 0.497 g.
    """
    rock = DatedRock("rock", ensemble([0.5]), np.array([2000.0]))
    analysis = of_curves(model(1e-4, 1e-3), rock)
    results = analysis.results()
    np.testing.assert_allclose(results.rates, [4e-4, 4e-3], rtol=0.06)
    np.testing.assert_allclose(results.survival, [0.449, 0.0003], rtol=0.4)
    assert results.rejected.tolist() == [False, True]
    assert results.weights.tolist() == [1.0, 0.0]
    assert analysis.before.level_at(1 / 2475) / GRAVITY == pytest.approx(1.167, rel=1e-3)
    assert results.after is not None
    assert results.after.level_at(1 / 2475) / GRAVITY == pytest.approx(0.497, rel=2e-3)
    text = sentence(["0", "1"], results.rejected, results.survival, 0.05, (1.167, 0.497, 0.497))
    assert text == (
        "The rock's survival probability is below 5 % under branch 1; "
        "without it the 2,475-year PGA falls from 1.17 to 0.50 g."
    )


def test_no_branch_left_is_an_answer_too() -> None:
    rock = DatedRock("rock", ensemble([0.5]), np.array([1e6]))
    results = of_curves(model(1e-4, 1e-3), rock).results()
    assert results.after is None
    assert results.weights.tolist() == [0.0, 0.0]
    text = sentence(["0", "1"], results.rejected, results.survival, 0.05, (1.0, math.nan, math.nan))
    assert text.startswith("The rock's survival probability is below 5 % under every branch")
    assert text.endswith("are inconsistent.")


def test_a_component_moves_the_rock_along_the_curve() -> None:
    """On a power law a factor on PGA is a factor on rates, to the power of the slope."""
    rock = DatedRock("rock", ensemble([0.5]), np.array([2000.0]))
    rates = [
        of_curves(model(1e-4), rock, component=component).results().rates[0]
        for component in (1.0, 1.2)
    ]
    assert rates[1] / rates[0] == pytest.approx(1.2**SLOPE, rel=0.02)


def test_ages_of_each_kind() -> None:
    normal = ages_of(NormalAge(kind="normal", mean=2e4, sd=3e3))
    assert (normal.mean(), normal.std()) == pytest.approx((2e4, 3e3), rel=2e-3)
    assert np.median(ages_of(LognormalAge(kind="lognormal", median=9e3, log_sd=0.2))) == (
        pytest.approx(9e3, rel=1e-3)
    )
    bounds = ages_of(BoundedAge(kind="bounds", low=1e3, high=3e3))
    assert (bounds.min(), bounds.max()) == pytest.approx((1e3, 3e3), rel=1e-3)
    assert ages_of(SampledAge(kind="samples", values=(5.0, 7.0))).tolist() == [5.0, 7.0]


@pytest.mark.parametrize(
    ("rejected", "pga", "words"),
    [
        ([False, False], (0.5, 0.5, 0.4), "at least 5 % under every branch"),
        ([False, False], (0.5, 0.5, 0.4), "by survival, the 2,475-year PGA falls from 0.50 to"),
        ([True, False], (0.5, 0.5, 0.5), "stays at 0.50 g."),
        ([True, False], (0.5, 0.5, 0.4), "stays at 0.50 g, and with the others weighted by"),
        ([True, False], (0.4, 0.5, 0.5), "rises from 0.40 to 0.50 g."),
        ([True, False], (0.4, math.nan, math.nan), "is beyond the levels of the curves."),
    ],
)
def test_sentences(rejected: list[bool], pga: tuple[float, float, float], words: str) -> None:
    chances = np.where(rejected, 0.01, 0.4)
    assert words in sentence(["3", "7"], np.array(rejected), chances, 0.05, pga)


def test_many_branches_are_counted_not_named() -> None:
    names, rejected = [str(n) for n in range(1000)], np.arange(1000) < 400
    text = sentence(names, rejected, np.where(rejected, 0.01, 0.4), 0.05, (0.5, 0.4, 0.4))
    assert text.startswith(
        "The rock's survival probability is below 5 % under 400 of 1,000 branches"
    )


def test_members_keep_what_is_unknown_of_them_through_stages() -> None:
    """Mean of exp(-nu_m T_1 - nu'_m T_2) over members, and the case without the stage before."""
    now, buried, rate, age = [0.3, 0.6], [0.5, 0.9], 1e-4, 2000.0
    stage = EarlierStage(site="buried", until=NormalAge(kind="normal", mean=800.0))
    given = NormalAge(kind="normal", mean=age)
    until, reached = back_to(given, (stage,), ()).T
    own, before = ensemble(now, 2000), ensemble(buried, 2000)
    rock = DatedRock("rock", own, reached, ((before, until),))
    analysis = of_curves(model(rate), rock)
    nu, nu_before = (rate * np.array(levels) ** -SLOPE for levels in (now, buried))
    found = {case.name: case.results.survival[0] for case in cases(analysis, {}, {})}
    exact = np.exp(-nu * 800.0 - nu_before * 1200.0).mean()
    assert found[BASE_CASE] == pytest.approx(exact, rel=0.01)
    assert found[AS_NOW] == pytest.approx(np.exp(-nu * age).mean(), rel=0.01)
    assert found[AS_NOW] < 0.9 * found[BASE_CASE]
    alone = of_curves(model(rate), DatedRock("rock", own, reached)).results().survival[0]
    assert found[AS_NOW] == alone
    at = analysis.survival_for(0, np.array([0.0, 500.0, age]))[0]
    expected = [1.0, np.exp(-nu * 500.0).mean(), found[BASE_CASE]]
    np.testing.assert_allclose(at, expected, rtol=0.01)
    np.testing.assert_allclose(analysis.survival_alone(0)[0], found[BASE_CASE], rtol=1e-12)


def test_years_in_which_a_stage_was_seen_to_stand_shorten_that_stage_alone() -> None:
    stages = tuple(
        EarlierStage(site=name, until=NormalAge(kind="normal", mean=mean))
        for name, mean in (("half", 100.0), ("buried", 300.0))
    )
    age = NormalAge(kind="normal", mean=1000.0)
    one, two = (
        Earthquake(kind="earthquake", year=year, pga=0.1, pga_log_sd=0.3, pgv=4, pgv_log_sd=0.3)
        for year in (1700, 1750)
    )
    lasted = [
        np.diff(back_to(age, stages, *seen), prepend=0.0).tolist()
        for seen in (((), (), ()), ((), (one, two, two), ()), ((one,), (), (one,)))
    ]
    assert lasted == [[[100.0, 200.0, 700.0]], [[100.0, 198.0, 700.0]], [[99.0, 200.0, 699.0]]]


def test_the_direction_and_the_age_of_a_rock_are_those_of_its_stages_too() -> None:
    """Both fragilities have one in all directions; young and old rocks are of the same stages."""
    rate, spread = 1e-4, BoundedAge(kind="bounds", low=1000.0, high=3000.0)
    stage = EarlierStage(site="buried", until=BoundedAge(kind="bounds", low=500.0, high=1500.0))
    until, reached = back_to(spread, (stage,), ()).T
    assert (until < reached).all()
    weak, strong = ensemble([0.3] * 2, 2000), ensemble([0.6] * 2, 2000)
    analysis = of_curves(model(rate), DatedRock("rock", weak, reached, ((strong, until),)))
    found = {case.name: case.results.survival[0] for case in cases(analysis, {}, {})}
    for name, chance in found.items():
        if name.startswith("direction"):
            assert chance == pytest.approx(found[BASE_CASE], rel=1e-9)
    ages = {name: chance for name, chance in found.items() if name.startswith("age")}
    assert len(ages) == 2
    for share, chance in zip((5.0, 95.0), ages.values(), strict=True):
        age = np.percentile(reached, share)
        ended = until[until < age]
        lasted = np.exp(-rate * (0.3**-SLOPE * ended + 0.6**-SLOPE * (age - ended)))
        assert chance == pytest.approx(lasted.mean(), rel=0.01)


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
