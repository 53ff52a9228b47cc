"""The chain from hazard curves to survival, against closed forms and catalogues of earthquakes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.special import ndtr

from vsr_core.errors import InvalidInput
from vsr_core.hazard.curve import (
    HazardCurve,
    curve_of_probabilities,
    effective_number,
    fractiles,
    mean_curve,
    posterior_weights,
)
from vsr_core.hazard.survival import (
    DRAWS,
    Rates,
    Stage,
    Standing,
    in_order,
    independent,
    largest_scale,
    lognormal_ages,
    normal_ages,
    survival,
    survival_of,
    uniform_ages,
)
from vsr_core.hazard.toppling import Fragility, any_of, toppling

Array = NDArray[np.float64]

SLOPE, ANCHOR, RATE = 2.2, 1.0, 1e-3
"""Of a power law: exponent, a level [m/s^2] and the annual rate at which it is exceeded."""


def power_law(low: float = 1e-2, high: float = 1e3, levels: int = 40) -> HazardCurve:
    a = np.geomspace(low, high, levels)
    return HazardCurve(a, RATE * (a / ANCHOR) ** -SLOPE)


def step_at(level: float) -> Fragility:
    return lambda a: (a >= level).astype(float)


def lognormal(theta: float, beta: float) -> Fragility:
    return lambda a: np.asarray(ndtr(np.log(a / theta) / beta))


def catalogue(curve: HazardCurve, years: float, rng: np.random.Generator) -> tuple[Array, Array]:
    """Times before present and peak accelerations of earthquakes of a power law."""
    first = float(curve.levels[0])
    number = rng.poisson(curve.rates[0] * years)
    return rng.uniform(0.0, years, number), first * rng.uniform(size=number) ** (-1.0 / SLOPE)


def test_a_rock_that_topples_at_a_level_topples_as_often_as_that_is_exceeded() -> None:
    for level in (0.3, 1.0, 7.7):
        found = toppling(power_law(), step_at(level))
        # The step lies somewhere within one of the parts.
        width = math.log(1e5) / 39 / 64
        assert found.rate == pytest.approx(RATE * level**-SLOPE, rel=SLOPE * width)
        assert found.below == 0.0


@pytest.mark.parametrize("beta", [0.1, 0.4, 0.8])
def test_a_lognormal_fragility_on_a_power_law(beta: float) -> None:
    """nu = lambda(theta) exp(k^2 beta^2 / 2), by completing the square."""
    theta = 3.0
    found = toppling(power_law(), lognormal(theta, beta))
    exact = RATE * theta**-SLOPE * math.exp(0.5 * (SLOPE * beta) ** 2)
    assert found.rate == pytest.approx(exact, rel=2e-4)
    assert found.rate == pytest.approx(found.parts.sum(), rel=1e-12)


def test_what_lies_beyond_the_levels_is_told() -> None:
    curve = power_law(1.0, 4.0)
    found = toppling(curve, lognormal(4.0, 0.5))
    assert found.beyond == pytest.approx(0.5 * RATE * 4.0**-SLOPE)
    whole = toppling(power_law(1.0, 1e4), lognormal(4.0, 0.5)).rate
    assert found.rate < whole < found.rate + found.beyond
    assert found.below == pytest.approx(ndtr(math.log(0.25) / 0.5))


def under(curve: HazardCurve) -> Rates:
    """Rates of toppling under one branch."""
    return lambda fragility: np.array([toppling(curve, fragility).rate])


def test_survival_of_ages() -> None:
    """Closed forms: one age, a uniform one, and a lognormal one by its definition."""
    nu = 7e-5
    assert survival(nu, normal_ages(2e4, 0.0)) == pytest.approx(math.exp(-nu * 2e4))
    low, high = 1e4, 3e4
    exact = (math.exp(-nu * low) - math.exp(-nu * high)) / (nu * (high - low))
    assert survival(nu, uniform_ages(low, high)) == pytest.approx(exact, rel=1e-6)
    # Of a normal age far from zero: exp(-nu m + nu^2 s^2 / 2).
    exact = math.exp(-nu * 2e4 + 0.5 * (nu * 3e3) ** 2)
    assert survival(nu, normal_ages(2e4, 3e3)) == pytest.approx(exact, rel=1e-4)
    # Cut at zero: of a mean of 0 nearly, a half-normal age, whose mean is sd sqrt(2/pi).
    assert normal_ages(1.0, 1e4).min() > 0.0
    assert normal_ages(1.0, 1e4).mean() == pytest.approx(1e4 * math.sqrt(2 / math.pi), rel=2e-3)
    ages = lognormal_ages(2e4, 0.3)
    assert np.median(ages) == pytest.approx(2e4, rel=1e-3)
    assert np.log(ages).std() == pytest.approx(0.3, rel=2e-3)


def test_survival_is_the_share_of_catalogues_in_which_a_rock_stands() -> None:
    curve, fragility, rng = power_law(0.3), lognormal(6.0, 0.4), np.random.default_rng(3)
    ages, number = normal_ages(2e4, 4e3), 4000
    stands = 0
    for _ in range(number):
        _, shaking = catalogue(curve, float(rng.choice(ages)), rng)
        stands += not (rng.uniform(size=len(shaking)) < fragility(shaking)).any()
    expected = survival(toppling(curve, fragility).rate, ages)
    assert 0.2 < expected < 0.8
    assert stands / number == pytest.approx(expected, abs=4.0 * math.sqrt(0.25 / number))


def test_rocks_of_one_site_feel_the_same_earthquakes() -> None:
    curve, rng = power_law(0.3), np.random.default_rng(5)
    rocks = [lognormal(6.0, 0.3), lognormal(6.5, 0.4), lognormal(9.0, 0.3)]
    ages = [np.array([2e4]), np.array([1.2e4, 1.5e4]), np.array([3e4])]
    number, stand = 4000, 0
    for _ in range(number):
        own = np.array([rng.choice(one) for one in ages])
        time, shaking = catalogue(curve, own.max(), rng)
        toppled = any(
            (rng.uniform(size=len(shaking)) < rock(shaking) * (time < age)).any()
            for rock, age in zip(rocks, own, strict=True)
        )
        stand += not toppled
    (expected,) = survival_of(
        under(curve), [Standing(*one) for one in zip(rocks, ages, strict=True)]
    )
    assert stand / number == pytest.approx(expected, abs=4.0 * math.sqrt(0.25 / number))
    alone = [survival(toppling(curve, r).rate, a) for r, a in zip(rocks, ages, strict=True)]
    assert math.prod(alone) + 0.03 < expected < min(alone)


def test_a_rock_beside_itself_is_one_rock_where_it_topples_for_certain() -> None:
    one = step_at(5.0)
    assert toppling(power_law(), any_of([one, one])).rate == toppling(power_law(), one).rate
    ages = [np.array([1e4]), np.array([2e4])]
    (joint,) = survival_of(under(power_law()), [Standing(one, age) for age in ages])
    assert joint == pytest.approx(survival(toppling(power_law(), one).rate, ages[1]))


def test_the_largest_factor_leaves_just_the_chance_asked_for() -> None:
    """On a power law a factor on accelerations is a factor on rates, k^slope."""
    curve, rock, ages = power_law(1e-4, 1e6, 80), lognormal(6.0, 0.3), normal_ages(1e4, 0.0)

    def chance(factor: float) -> float:
        scaled = HazardCurve(factor * curve.levels, curve.rates)
        return float(survival(toppling(scaled, rock).rate, ages))

    found = largest_scale(chance, 0.05)
    rate = toppling(curve, rock).rate
    assert found == pytest.approx((-math.log(0.05) / (1e4 * rate)) ** (1.0 / SLOPE), rel=1e-3)
    assert largest_scale(lambda factor: 1.0, 0.05) == math.inf
    assert largest_scale(lambda factor: 0.0, 0.05) == 0.0


def test_weights_by_hand() -> None:
    new = posterior_weights(np.array([0.5, 0.25, 0.25]), np.array([0.4, 0.8, 0.04]), 0.05)
    assert new.rejected.tolist() == [False, False, True]
    assert new.weights.tolist() == pytest.approx([0.5, 0.5, 0.0])
    assert effective_number(new.weights) == pytest.approx(2.0)
    none = posterior_weights(np.array([0.7, 0.3]), np.array([0.01, 0.0]), 0.05)
    assert none.rejected.all()
    assert none.weights.tolist() == [0.0, 0.0]
    assert effective_number(none.weights) == 0.0
    with pytest.raises(InvalidInput, match="sum to 1"):
        posterior_weights(np.array([0.5, 0.4]), np.array([0.5, 0.5]), 0.05)


def test_mean_and_fractiles_of_three_curves() -> None:
    levels = np.array([1.0, 2.0])
    curves = [HazardCurve(levels, rate * np.array([1.0, 0.1])) for rate in (1e-3, 3e-3, 2e-3)]
    weights = np.array([0.2, 0.3, 0.5])
    mean = mean_curve(curves, weights, levels)
    np.testing.assert_allclose(mean.rates, [2.1e-3, 2.1e-4])
    assert mean.level_at(1.0 / 2475.0) == pytest.approx(
        2.0 ** (math.log(2.1e-3 * 2475.0) / math.log(10.0))
    )
    found = fractiles(curves, weights, levels, (0.05, 0.2, 0.5, 0.7, 0.71, 0.95))
    np.testing.assert_allclose(found[:, 0], [1e-3, 1e-3, 2e-3, 2e-3, 3e-3, 3e-3])


def test_the_mean_of_curves_that_end_level_ends_level() -> None:
    """Rates that are equal but for rounding do not rise: a curve is the mean of copies of it."""
    levels = np.geomspace(0.1, 10.0, 30)
    rates = np.maximum(0.01 * levels**-2.0, 1e-3)
    for weights in np.random.default_rng(1).dirichlet(np.ones(9), 200):
        mean = mean_curve([HazardCurve(levels, rates)] * 9, weights, levels)
        np.testing.assert_allclose(mean.rates, rates, rtol=1e-12)


@settings(deadline=None, max_examples=60)
@given(st.floats(0.5, 4.0), st.floats(0.5, 20.0), st.floats(0.05, 1.0), st.floats(1e-5, 1e-1))
def test_more_hazard_or_a_weaker_rock_survives_less(
    slope: float, theta: float, beta: float, rate: float
) -> None:
    a = np.geomspace(0.05, 20.0, 30)
    curve, more = (HazardCurve(a, k * rate * a**-slope) for k in (1.0, 1.5))
    ages, rock, weaker = normal_ages(1e4, 2e3), lognormal(theta, beta), lognormal(0.8 * theta, beta)
    chance = survival(toppling(curve, rock).rate, ages)
    assert 0.0 <= chance <= 1.0
    assert survival(toppling(more, rock).rate, ages) <= chance
    assert survival(toppling(curve, weaker).rate, ages) <= chance


def test_probabilities_become_rates() -> None:
    levels = np.array([1.0, 2.0, 3.0])
    curve = curve_of_probabilities(levels, np.array([0.5, 0.1, 0.0]), 50.0)
    assert curve.levels.tolist() == [1.0, 2.0]
    np.testing.assert_allclose(1.0 - np.exp(-50.0 * curve.rates), [0.5, 0.1])
    for wrong, words in (
        ([1.0, 0.1, 0.0], "two or more"),
        ([1.0, 1.0, 1.0], "two or more"),
        ([0.5, 1.0, 0.1], "rises to 1"),
        ([0.1, 0.2, 0.0], "not more frequent"),
        ([0.1, -0.2, 0.0], "from 0 to 1"),
        ([0.1, 0.0, 0.0], "two or more"),
    ):
        with pytest.raises(InvalidInput, match=words):
            curve_of_probabilities(levels, np.array(wrong), 50.0)
    assert math.isnan(curve.level_at(1e-9))
    certain = curve_of_probabilities(np.array([0.5, *levels]), np.array([1.0, 0.5, 0.1, 0.0]), 50.0)
    assert (certain.levels == curve.levels).all()
    assert (certain.rates == curve.rates).all()


@pytest.mark.parametrize("age", [0.0, -5.0, math.nan, math.inf])
def test_an_age_is_positive(age: float) -> None:
    with pytest.raises(InvalidInput, match="ages are positive"):
        normal_ages(age, 0.0)


def rates_on(*curves: HazardCurve) -> Rates:
    return lambda fragility: np.array([toppling(one, fragility).rate for one in curves])


def in_two_stages(now: Fragility, buried: Fragility, until: Array, ages: Array) -> Standing:
    return Standing(now, ages, (Stage(buried, until),))


def test_a_rock_that_came_out_of_the_ground_at_a_known_time() -> None:
    """S = exp(-nu_1 T_1 - nu_2 T_2) with nu = lambda(level)."""
    now, buried = step_at(0.5), step_at(2.0)
    rates = {now: np.array([2e-4, 1e-5]), buried: np.array([3e-5, 4e-6])}
    rock = in_two_stages(now, buried, np.array([3000.0]), np.array([10_000.0]))
    found = survival_of(rates.__getitem__, [rock])
    exact = np.exp([-2e-4 * 3000.0 - 3e-5 * 7000.0, -1e-5 * 3000.0 - 4e-6 * 7000.0])
    np.testing.assert_allclose(found, exact, rtol=1e-14)


def test_a_stage_of_times_that_are_not_known() -> None:
    """Between bounds E[exp(-(nu_1 - nu_2) U)] exp(-nu_2 T) is an integral in closed form."""
    now, buried, low, high, age = step_at(0.5), step_at(2.0), 1000.0, 4000.0, 9000.0
    rates = {now: np.array([3e-4]), buried: np.array([5e-5])}
    drawn = in_order([uniform_ages(low, high), np.array([age])])
    found = survival_of(rates.__getitem__, [in_two_stages(now, buried, drawn[:, 0], drawn[:, 1])])
    k = 3e-4 - 5e-5
    mean = (math.exp(-k * low) - math.exp(-k * high)) / (k * (high - low))
    assert found[0] == pytest.approx(mean * math.exp(-5e-5 * age), rel=1e-6)


def test_stages_alike_are_one() -> None:
    fragility, ages = lognormal(3.0, 0.4), normal_ages(2e4, 3e3)
    rates = rates_on(power_law())
    parted = in_two_stages(fragility, fragility, 0.3 * ages, ages)
    other = Standing(lognormal(2.5, 0.3), uniform_ages(5e3, 3e4))
    for beside in ([], [other]):
        one = survival_of(rates, [Standing(fragility, ages), *beside])
        np.testing.assert_allclose(survival_of(rates, [parted, *beside]), one, rtol=1e-12)


@pytest.mark.parametrize("own", [0, 1])
def test_of_two_rocks_one_came_out_of_the_ground(own: int) -> None:
    """Steps: in the same earthquakes the weaker of those that stand decides, at every time."""
    rock = in_two_stages(step_at(0.5), step_at(2.0), np.array([300.0]), np.array([1000.0]))
    rocks = [Standing(step_at(1.0), np.array([700.0]))]
    rocks.insert(own, rock)
    curve, found = power_law(), survival_of(rates_on(power_law()), rocks)
    weakest = ((0.5, 300.0), (1.0, 400.0), (2.0, 300.0))
    exposed = sum(toppling(curve, step_at(level)).rate * years for level, years in weakest)
    np.testing.assert_allclose(found, [math.exp(-exposed)], rtol=1e-12)


def test_times_out_of_order_are_left_out() -> None:
    """Of two times that are uniform on the same bounds, the later is beyond the middle by 2/3."""
    kept = in_order([uniform_ages(1.0, 2.0), uniform_ages(1.0, 2.0)])
    assert (kept[:, 0] < kept[:, 1]).all()
    assert len(kept) == pytest.approx(0.5 * DRAWS, abs=2 * math.sqrt(DRAWS))
    np.testing.assert_allclose(kept.mean(axis=0), [4 / 3, 5 / 3], atol=0.01)
    assert len(in_order([np.array([9.0]), np.array([8.0])])) == 0


def test_few_samples_of_independent_ages_go_together_in_every_way() -> None:
    """Two stages, and two rocks: S is the mean over all four pairs, in whatever order they stand.

    exp(-nu_1 t - nu_2 (T - t)), and for two steps exp(-lambda(lower) min - lambda(of the older)).
    """
    now, buried = step_at(0.5), step_at(2.0)
    rates = {now: np.array([2e-4]), buried: np.array([3e-5])}
    until, ages = np.array([2000.0, 9000.0]), np.array([10_000.0, 30_000.0])
    pairs = [(t, age) for t in until for age in ages]
    exact = np.mean([math.exp(-2e-4 * t - 3e-5 * (age - t)) for t, age in pairs])
    both = rates_on(power_law(1e-4))
    weak, strong = (both(one)[0] for one in (now, buried))
    old = [(one, other) for one in ages for other in 0.5 * ages]
    together = np.mean([math.exp(-weak * a - (strong * (b - a) if b > a else 0.0)) for a, b in old])
    for order in ([0, 1], [1, 0]):
        drawn = in_order([until, ages[order]])
        rock = in_two_stages(now, buried, drawn[:, 0], drawn[:, 1])
        assert survival_of(rates.__getitem__, [rock])[0] == pytest.approx(exact, rel=1e-12)
        rocks = [Standing(now, ages[order]), Standing(buried, 0.5 * ages)]
        assert survival_of(both, rocks)[0] == pytest.approx(together, rel=1e-9)


def test_many_samples_of_ages_do_not_depend_on_each_other() -> None:
    one, other, third = independent([300, 70, 2000])
    for places, length in ((one, 300), (other, 70), (third, 2000)):
        times = np.bincount(places, minlength=length)
        assert times.max() - times.min() <= 1
    for a, b in ((one, other), (other, third), (one, third)):
        assert abs(np.corrcoef(a, b)[0, 1]) < 4.0 / math.sqrt(DRAWS)


@pytest.mark.parametrize("lengths", [(15_000, 2), (11_000, 15_000), (3000, 8)])
def test_where_a_sample_stands_in_its_file_changes_nothing(lengths: tuple[int, ...]) -> None:
    """Of a sorted file neither the first nor the last ages count more."""
    found = independent(lengths)
    for places, length in zip(found, lengths, strict=True):
        times = np.bincount(places, minlength=length)
        assert times.max() - times.min() <= (length < max(lengths))
        assert places.mean() == pytest.approx((length - 1) / 2, abs=1.0)
