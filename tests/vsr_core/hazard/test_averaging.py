"""A fragility in PGA alone, against integrals and simulated shaking."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ndtr

from vsr_core.hazard.curve import HazardCurve
from vsr_core.hazard.ratio import RatioTable
from vsr_core.hazard.toppling import averaged, lognormal_rows, rate_by_row, row_shares, toppling

RATIOS = np.linspace(0.02, 1.0, 50)
LEVELS = np.array([0.1, 50.0])


def table(median: float, log_sd: float) -> RatioTable:
    return RatioTable(np.array([1.0]), np.array([median]), np.array([log_sd]))


def test_all_directions_count_equally_where_pgv_does_not_matter() -> None:
    medians = np.array([[2.0], [5.0], [9.0]]) * np.ones((3, 50))
    rows = lognormal_rows(medians, np.full((3, 50), 0.3))
    found = averaged(rows, RATIOS, table(0.1, 0.5), LEVELS)
    a = np.array([1.0, 3.0, 6.0, 20.0])
    exact = np.mean([ndtr(np.log(a / median) / 0.3) for median in (2.0, 5.0, 9.0)], axis=0)
    np.testing.assert_allclose(found(a), exact, atol=2e-4)


def test_shares_are_those_of_drawn_ratios() -> None:
    rng = np.random.default_rng(2)
    drawn = np.log(0.12) + 0.5 * rng.normal(size=200_000)
    nearest = np.abs(drawn[:, None] - np.log(RATIOS)).argmin(axis=1)
    counted = np.bincount(nearest, minlength=50) / len(drawn)
    shares = row_shares(RATIOS, np.array([0.12]), np.array([0.5]))[:, 0]
    assert shares.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(shares, counted, atol=4.0 * np.sqrt(0.25 / len(drawn)))


def test_a_rock_that_needs_velocity_topples_by_the_ratio() -> None:
    """Median PGA times PGV/PGA constant: both spreads add up, as variances in logarithms."""
    fine = np.geomspace(0.01, 2.0, 400)
    for ratios, atol in ((RATIOS, 0.03), (fine, 2e-3)):
        medians = 0.3 / ratios[None]
        rows = lognormal_rows(medians, np.full_like(medians, 0.2))
        found = averaged(rows, ratios, table(0.15, 0.4), LEVELS)
        a = np.geomspace(0.5, 8.0, 9)
        exact = ndtr(np.log(a * 0.15 / 0.3) / np.hypot(0.2, 0.4))
        np.testing.assert_allclose(found(a), exact, atol=atol)


def test_it_never_falls() -> None:
    """Though strong shaking may have so low a PGV/PGA that it topples less."""
    medians = np.where(RATIOS < 0.1, 1e3, 1.0)[None]
    falling = RatioTable(LEVELS, 0.2 / LEVELS, np.full(2, 0.2))
    rows = lognormal_rows(medians, np.full_like(medians, 0.1))
    found = averaged(rows, RATIOS, falling, LEVELS)
    assert (np.diff(found(np.geomspace(0.1, 50.0, 300))) >= 0.0).all()


def test_rates_by_row_add_up_and_lie_where_the_rock_topples() -> None:
    """A row that cannot topple has none; of two that topple alike, each has its share."""
    a = np.geomspace(0.05, 60.0, 30)
    curve = HazardCurve(a, 1e-3 * a**-2.0)
    ratios = np.array([0.05, 0.1, 0.2])
    rows = lognormal_rows(np.array([[1e6, 2.0, 2.0]]), np.full((1, 3), 0.3))
    given = table(0.1, 0.5)
    fragility = averaged(rows, ratios, given, np.array([0.05, 60.0]))
    levels, rates = rate_by_row(curve, fragility, rows, ratios, given)
    whole = toppling(curve, fragility)
    np.testing.assert_allclose(levels, whole.levels)
    assert rates.sum() == pytest.approx(whole.rate, rel=1e-9)
    shares = row_shares(ratios, np.array([0.1]), np.array([0.5]))[:, 0]
    assert rates[0].sum() < 1e-12
    assert rates[1].sum() / rates[2].sum() == pytest.approx(shares[1] / shares[2], rel=1e-6)
