"""The survival of rocks, and what it makes of branches, on cases worked by hand."""

from __future__ import annotations

import math
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
from pipeline.config.observation_schema import Earthquake
from pipeline.config.problems import InputError
from pipeline.stages.fragility.summary import SEARCHED
from pipeline.stages.hazard.hazard_dataset import survival_error, survival_range
from pipeline.stages.hazard.hazard_page import sentence
from pipeline.stages.hazard.other_rocks import dated
from pipeline.stages.hazard.rock_ages import ages_of, back_to
from pipeline.stages.hazard.rock_fragility import DRAWN, FITTED, of_fits
from pipeline.stages.hazard.sensitivity import AS_NOW, BASE_CASE, DRAWN_ANEW, cases
from pipeline.stages.hazard.survival_analysis import DatedRock
from tests.support.standing_rocks import SLOPE, ensemble, model, of_curves, stand
from vsr_core import GRAVITY


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
