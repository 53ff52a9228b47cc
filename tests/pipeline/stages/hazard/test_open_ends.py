"""Curves that end, or begin, where a rock topples, and toppling beyond the PGA that was tried."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.config.layers import Origin
from pipeline.config.problems import InputError
from pipeline.stages.hazard.hazard_model import Branch, HazardModel
from pipeline.stages.hazard.open_ends import begun_late, left_open, of_scale, open_cases, untested
from pipeline.stages.hazard.open_runs import off_runs
from pipeline.stages.hazard.sensitivity import Case
from pipeline.stages.hazard.survival_analysis import DatedRock, SurvivalAnalysis
from tests.support.standing_rocks import SLOPE, curve, ended, ensemble, model, of_curves, rows_from
from vsr_core import GRAVITY
from vsr_core.hazard.curve import HazardCurve
from vsr_core.hazard.events import Events
from vsr_core.hazard.ratio import RatioTable
from vsr_core.hazard.shaking import counted_shaking
from vsr_core.hazard.toppling import borders_of


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
    origin = Origin(name="rock", file="rock.yaml", path=Path("rock.yaml"))
    assert off_runs(analysis, analysis.results(), origin) == ()
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
