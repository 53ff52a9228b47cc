"""What simulated earthquakes topple: against their sum one by one, closed forms, and curves."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import norm

from vsr_core.hazard.curve import HazardCurve
from vsr_core.hazard.events import Events
from vsr_core.hazard.ratio import RatioTable
from vsr_core.hazard.shaking import CurveShaking, EventShaking, Shaking, counted_shaking
from vsr_core.hazard.survival import Stage, Standing, survival_of
from vsr_core.hazard.toppling import (
    Fragility,
    RowFragility,
    any_of,
    borders_of,
    lognormal_rows,
    row_shares,
)

SLOPE, LEAST, YEARS = 2.5, 0.5, 1e5
TABLE = RatioTable(np.array([1.0]), np.array([0.1]), np.array([0.5]))
RATIOS, OTHER = np.array([0.04, 0.1, 0.25]), np.array([0.06, 0.12])
ROWS = lognormal_rows(np.array([[4.0, 3.0, 2.0], [6.0, 4.0, 2.5]]), np.full((2, 3), 0.3))
OTHER_ROWS = lognormal_rows(np.array([[5.0, 2.2]]), np.full((1, 2), 0.4))
BORDERS = np.unique(np.concatenate([borders_of(RATIOS), borders_of(OTHER)]))
WEIGHTS = np.array([0.3, 0.7])


def catalogue(*rates: float, seed: int = 4) -> Events:
    """Branches with so many events a year above 0.5 m/s^2, which is a power law."""
    rng = np.random.default_rng(seed)
    numbers = [rng.poisson(rate * YEARS) for rate in rates]
    pga = LEAST * rng.uniform(size=sum(numbers)) ** (-1.0 / SLOPE)
    branch = np.repeat(np.arange(len(rates)), numbers)
    return Events(pga, None, branch, np.arange(len(pga)), YEARS, None)


def counted(events: Events, ratio: np.ndarray) -> EventShaking:
    weights = WEIGHTS if events.branch.max() else np.ones(1)
    return counted_shaking(events, ratio, BORDERS, weights)


def chance(
    rows: RowFragility, ratios: np.ndarray, pga: np.ndarray, ratio: np.ndarray
) -> np.ndarray:
    """Of each event, of the row that is nearest to it."""
    nearest = np.abs(np.log(ratio)[:, None] - np.log(ratios)).argmin(axis=1)
    return rows(pga)[nearest, np.arange(len(pga))]


@pytest.fixture(scope="module")
def events() -> Events:
    return catalogue(0.1, 0.3)


@pytest.fixture(scope="module")
def ratio(events: Events) -> np.ndarray:
    return events.ratio_of_table(TABLE, seed=9)


def test_rates_are_sums_over_events(events: Events, ratio: np.ndarray) -> None:
    """Of either rock, of both in the same earthquakes, and with all of it 1.3 times as strong."""
    shaking = counted(events, ratio)
    one, other = shaking.fragility(ROWS, RATIOS), shaking.fragility(OTHER_ROWS, OTHER)
    for factor in (1.0, 1.3):
        own = chance(ROWS, RATIOS, factor * events.pga, ratio)
        its = chance(OTHER_ROWS, OTHER, factor * events.pga, ratio)
        for fragility, wanted in (
            (one, own),
            (other, its),
            (any_of([one, other]), 1.0 - (1.0 - own) * (1.0 - its)),
        ):
            found = shaking.times(factor).rates(fragility)
            np.testing.assert_allclose(found, np.bincount(events.branch, wanted) / YEARS, rtol=1e-3)
    mean = shaking.mean(WEIGHTS).rates(one)
    np.testing.assert_allclose(mean, [WEIGHTS @ shaking.rates(one)])


def test_events_that_are_all_alike() -> None:
    """Three of 4 m/s^2 with a PGV/PGA of 0.1 s in 100 years, of two directions."""
    pga = np.full(3, 4.0)
    events = Events(pga, 0.1 * pga, np.zeros(3, int), np.arange(3), 100.0, None)
    shaking = counted_shaking(events, events.ratio_as_simulated(), BORDERS, np.ones(1))
    found = shaking.rates(shaking.fragility(ROWS, RATIOS))
    own = 0.5 * (norm.cdf(np.log(4.0 / 3.0) / 0.3) + norm.cdf(0.0))
    np.testing.assert_allclose(found, 0.03 * own, rtol=5e-3)
    median, log_sd = shaking.table.at(np.array([1.0, 4.0]))
    np.testing.assert_allclose(median, 0.1)
    assert (log_sd < 1e-3).all()


def test_rates_of_a_power_law_in_closed_form(events: Events, ratio: np.ndarray) -> None:
    """A row that topples from a level c on has rate (c / 0.5)^-2.5 times its share of PGV/PGA."""
    levels = np.array([1.0, 2.0, 3.0])

    def from_level_on(pga: np.ndarray) -> np.ndarray:
        return (pga >= levels[:, None]).astype(float)

    shaking = counted(events, ratio)
    found = shaking.rates(shaking.fragility(from_level_on, RATIOS))
    shares = row_shares(RATIOS, np.array([0.1]), np.array([0.5]))[:, 0]
    for rate, of_branch in zip((0.1, 0.3), found, strict=True):
        exact = rate * (shares @ (levels / LEAST) ** -SLOPE)
        assert of_branch == pytest.approx(exact, abs=4.0 * math.sqrt(exact / YEARS))


def test_curves_and_events_of_one_hazard_agree(events: Events, ratio: np.ndarray) -> None:
    level = np.geomspace(LEAST, 500.0 * LEAST, 200)
    curves = tuple(HazardCurve(level, rate * (level / LEAST) ** -SLOPE) for rate in (0.1, 0.3))
    expected = CurveShaking(curves, TABLE, BORDERS)
    found = counted(events, ratio)

    def either(shaking: Shaking) -> Fragility:
        rocks = ((ROWS, RATIOS), (OTHER_ROWS, OTHER))
        return any_of([shaking.fragility(*rock) for rock in rocks])

    for factor in (1.0, 1.2):
        for fragility in (lambda one: one.fragility(ROWS, RATIOS), either):
            wanted, got = (one.times(factor).rates(fragility(one)) for one in (expected, found))
            assert (np.abs(got - wanted) < 4.0 * np.sqrt(wanted / YEARS)).all()
    rates = [one.mean(WEIGHTS).by_row(ROWS, RATIOS)[1].sum(axis=1) for one in (expected, found)]
    error = 4.0 * np.sqrt(rates[0] / YEARS)
    assert (np.abs(rates[1] - rates[0]) < error).all()


@pytest.mark.parametrize("factor", [0.5, 1.2, 3.0])
def test_stronger_shaking_keeps_its_pgv_pga(factor: float) -> None:
    """A rock in it is as one that topples at accelerations that are smaller by the factor."""
    level = np.geomspace(LEAST, 500.0 * LEAST, 200)
    curve = HazardCurve(level, 0.1 * (level / LEAST) ** -SLOPE)
    table = RatioTable(np.array([1.0, 10.0]), np.array([0.05, 0.2]), np.array([0.5, 0.3]))
    shaking = CurveShaking((curve,), table, BORDERS)
    weak = lognormal_rows(np.array([[4.0, 3.0, 2.0]]) / factor, np.full((1, 3), 0.3))
    strong = lognormal_rows(np.array([[4.0, 3.0, 2.0]]), np.full((1, 3), 0.3))
    moved = shaking.times(factor)
    found = moved.rates(moved.fragility(strong, RATIOS))
    np.testing.assert_allclose(found, shaking.rates(shaking.fragility(weak, RATIOS)), rtol=2e-3)


def test_rocks_that_topple_by_velocity_feel_one_pgv_pga_under_curves() -> None:
    """Two that are alike and topple for certain from a PGV on are one: both or none falls."""
    level = np.geomspace(LEAST, 500.0 * LEAST, 200)
    ratios = np.geomspace(0.02, 0.5, 40)
    sharp = lognormal_rows(0.4 / ratios[None], np.full((1, 40), 1e-6))
    curve = HazardCurve(level, 0.1 * (level / LEAST) ** -SLOPE)
    shaking = CurveShaking((curve,), TABLE, borders_of(ratios))
    one = shaking.fragility(sharp, ratios)
    np.testing.assert_allclose(shaking.rates(any_of([one, one])), shaking.rates(one), rtol=1e-3)


def test_where_it_topples_adds_up(events: Events, ratio: np.ndarray) -> None:
    shaking = counted(events, ratio).mean(WEIGHTS)
    starts, rates = shaking.by_row(ROWS, RATIOS)
    assert rates.sum() == pytest.approx(shaking.rates(shaking.fragility(ROWS, RATIOS))[0])
    own = chance(ROWS, RATIOS, events.pga, ratio) * WEIGHTS[events.branch] / YEARS
    beyond = np.searchsorted(starts, 3.0)
    np.testing.assert_allclose(
        rates[:, beyond:].sum(), own[events.pga >= starts[beyond]].sum(), rtol=2e-3
    )


def test_two_rocks_survive_the_same_earthquakes(events: Events, ratio: np.ndarray) -> None:
    """Ages of 400 and 900 years: for 400 either topples, before only the older could."""
    shaking = counted(events, ratio)
    one, other = shaking.fragility(ROWS, RATIOS), shaking.fragility(OTHER_ROWS, OTHER)
    rocks = [Standing(one, np.array([400.0])), Standing(other, np.array([900.0]))]
    own = chance(ROWS, RATIOS, events.pga, ratio)
    its = chance(OTHER_ROWS, OTHER, events.pga, ratio)
    either = 1.0 - (1.0 - own) * (1.0 - its)
    exposed = np.bincount(events.branch, 400.0 * either + 500.0 * its) / YEARS
    np.testing.assert_allclose(survival_of(shaking.rates, rocks), np.exp(-exposed), rtol=2e-3)


def test_a_rock_feels_the_events_of_a_stage_as_it_stood_then(
    events: Events, ratio: np.ndarray
) -> None:
    """400 years as one rock, and 500 before as another."""
    shaking = counted(events, ratio)
    before = Stage(shaking.fragility(OTHER_ROWS, OTHER), np.array([400.0]))
    rock = Standing(shaking.fragility(ROWS, RATIOS), np.array([900.0]), (before,))
    own = chance(ROWS, RATIOS, events.pga, ratio)
    its = chance(OTHER_ROWS, OTHER, events.pga, ratio)
    exposed = np.bincount(events.branch, 400.0 * own + 500.0 * its) / YEARS
    np.testing.assert_allclose(survival_of(shaking.rates, [rock]), np.exp(-exposed), rtol=2e-3)


def grouped(events: Events, size: int) -> Events:
    return Events(events.pga, None, events.branch, np.arange(len(events.pga)) // size, YEARS, None)


def test_the_sampling_error_is_poissons_where_ruptures_are_of_one_event() -> None:
    """sqrt(sum of P^2) over the years; of four events that come together it is four times that."""
    events = catalogue(0.02, seed=6)
    ratio = events.ratio_of_table(TABLE)

    def certain(pga: np.ndarray) -> np.ndarray:
        return np.repeat((pga >= 1.0)[None].astype(float), 3, axis=0)

    for fragile in (certain, ROWS):
        chances = chance(fragile, RATIOS, events.pga, ratio)
        exact = math.sqrt((chances**2).sum()) / YEARS
        shaking = counted(events, ratio)
        fragility = shaking.fragility(fragile, RATIOS)
        drawn = shaking.resampled(fragility, 1000)
        independent = math.sqrt(shaking.variance_of_independent(fragility)[0])
        assert independent == pytest.approx(exact, rel=2e-3)
        assert drawn.mean() == pytest.approx(chances.sum() / YEARS, rel=0.02)
        assert drawn.std() == pytest.approx(exact, rel=0.1)
    together = Events(*(np.repeat(one, 4) if isinstance(one, np.ndarray) else one for one in (
        events.pga, None, events.branch, events.rupture, YEARS, None,
    )))  # fmt: skip
    shaking = counted(together, np.repeat(ratio, 4))
    drawn = shaking.resampled(shaking.fragility(ROWS, RATIOS), 1000)
    assert drawn.std() == pytest.approx(4.0 * exact, rel=0.1)


def test_branches_that_share_their_ruptures_are_off_together() -> None:
    """The same earthquakes in both: each as uncertain, and their mean no less."""
    events = catalogue(0.02, seed=6)
    number = len(events.pga)
    ratio = np.tile(events.ratio_of_table(TABLE), 2)
    branch = np.repeat([0, 1], number)
    for rupture, alike in ((np.tile(np.arange(number), 2), 1.0), (np.arange(2 * number), 0.0)):
        both = Events(np.tile(events.pga, 2), None, branch, rupture, YEARS, None)
        shaking = counted(both, ratio)
        drawn = shaking.resampled(shaking.fragility(ROWS, RATIOS), 1000)
        assert np.corrcoef(drawn.T)[0, 1] == pytest.approx(alike, abs=0.12)
