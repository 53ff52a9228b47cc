"""A fragility in PGA alone, against integrals and simulated shaking."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ndtr

from vsr_core.hazard.averaging import averaged, ratio_of_curves, row_shares
from vsr_core.hazard.curve import HazardCurve

RATIOS = np.linspace(0.02, 1.0, 50)
LEVELS = np.array([0.1, 50.0])


def test_all_directions_count_equally_where_pgv_does_not_matter() -> None:
    medians = np.array([[2.0], [5.0], [9.0]]) * np.ones((3, 50))
    betas = np.full((3, 50), 0.3)
    found = averaged(medians, betas, RATIOS, lambda a: 0.1 + 0.0 * a, 0.5, LEVELS)
    a = np.array([1.0, 3.0, 6.0, 20.0])
    exact = np.mean([ndtr(np.log(a / median) / 0.3) for median in (2.0, 5.0, 9.0)], axis=0)
    np.testing.assert_allclose(found(a), exact, atol=2e-4)


def test_shares_are_those_of_drawn_ratios() -> None:
    rng = np.random.default_rng(2)
    drawn = np.log(0.12) + 0.5 * rng.normal(size=200_000)
    nearest = np.abs(drawn[:, None] - np.log(RATIOS)).argmin(axis=1)
    counted = np.bincount(nearest, minlength=50) / len(drawn)
    shares = row_shares(RATIOS, np.array([0.12]), 0.5)[:, 0]
    assert shares.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(shares, counted, atol=4.0 * np.sqrt(0.25 / len(drawn)))


def test_a_rock_that_needs_velocity_topples_by_the_ratio() -> None:
    """Median PGA times PGV/PGA constant: both spreads add up, as variances in logarithms."""
    medians = 0.3 / RATIOS[None]
    fine = np.geomspace(0.01, 2.0, 400)
    for ratios, atol in ((RATIOS, 0.03), (fine, 2e-3)):
        medians = 0.3 / ratios[None]
        betas = np.full_like(medians, 0.2)
        found = averaged(medians, betas, ratios, lambda a: 0.15 + 0.0 * a, 0.4, LEVELS)
        a = np.geomspace(0.5, 8.0, 9)
        exact = ndtr(np.log(a * 0.15 / 0.3) / np.hypot(0.2, 0.4))
        np.testing.assert_allclose(found(a), exact, atol=atol)


def test_it_never_falls() -> None:
    """Though strong shaking may have so low a PGV/PGA that it topples less."""
    medians = np.where(RATIOS < 0.1, 1e3, 1.0)[None]
    found = averaged(medians, np.full_like(medians, 0.1), RATIOS, lambda a: 0.2 / a, 0.2, LEVELS)
    assert (np.diff(found(np.geomspace(0.1, 50.0, 300))) >= 0.0).all()


def test_the_ratio_of_curves_is_where_both_are_as_rare() -> None:
    a = np.geomspace(0.01, 20.0, 30)
    pga, pgv = HazardCurve(a, 1e-3 * a**-2.0), HazardCurve(0.1 * a, 1e-3 * a**-2.0)
    np.testing.assert_allclose(ratio_of_curves(pga, pgv)(np.array([1e-3, 1.0, 99.0])), 0.1)
    steeper = HazardCurve(0.1 * a, 1e-3 * a**-4.0)
    # 0.1 a' with a'^-4 = a^-2, so that the ratio is 0.1 a^-1/2.
    found = ratio_of_curves(pga, steeper)(np.array([0.5, 2.0]))
    np.testing.assert_allclose(found, 0.1 * np.array([0.5, 2.0]) ** -0.5, rtol=1e-3)
