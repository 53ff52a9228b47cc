"""Counts of draws against the laws that made them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.stats import CensoredData, beta, norm

from vsr_core.fragility.lognormal import MAX_BETA
from vsr_core.uncertainty import probability


def test_the_interval_is_that_of_jeffreys() -> None:
    draws = np.zeros((32, 33), dtype=np.int8)
    for fell in range(33):
        draws[:fell, fell] = 1
    found = probability.chance(draws)
    fell = np.arange(33)
    np.testing.assert_allclose(found.probability, fell / 32)
    inner = slice(1, 32)
    np.testing.assert_allclose(found.low[inner], beta(fell + 0.5, 32.5 - fell).ppf(0.025)[inner])
    np.testing.assert_allclose(found.high[inner], beta(fell + 0.5, 32.5 - fell).ppf(0.975)[inner])
    assert found.low[0] == 0.0
    assert found.high[32] == 1.0


def test_the_interval_holds_the_truth_as_often_as_it_says() -> None:
    """Mean coverage over probabilities, by simulation."""
    rng = np.random.default_rng(4)
    true = rng.uniform(size=20_000)
    found = probability.chance((rng.uniform(size=(32, true.size)) < true).astype(np.int8))
    held = (found.low <= true) & (true <= found.high)
    assert 0.945 < held.mean() < 0.96


def test_draws_without_a_verdict_do_not_count() -> None:
    found = probability.chance(np.array([[1, -1], [-1, -1], [0, -1]], dtype=np.int8))
    assert found.probability[0] == 0.5
    assert np.isnan([found.probability[1], found.low[1], found.high[1]]).all()


def test_the_law_that_made_the_draws_is_found_also_where_it_is_cut_off() -> None:
    """Three medians, of which the last lies beyond what was tried in most draws."""
    median, ratio = np.array([0.5, 0.35, 4.5]), np.array([0.1, 0.2, 0.4])
    edges = median * np.exp(0.25 * norm.ppf((np.arange(2000) + 0.5) / 2000))[:, None, None]
    edges[edges > 4.0] = np.inf
    theta, beta = probability.lognormal(edges, ratio, 0.01, (0.001, 4.0))
    assert np.isinf(edges[..., 2]).mean() > 0.6
    np.testing.assert_allclose(theta[0], median, rtol=0.01)
    np.testing.assert_allclose(beta[0], 0.25, rtol=0.03)


@pytest.mark.parametrize(("draws", "fell"), [(64, 1), (64, 2), (64, 40), (256, 5), (64, 64)])
def test_no_other_law_makes_the_draws_likelier(draws: int, fell: int) -> None:
    """Also where few topple, as SciPy finds it by a simplex."""
    below = np.log(4.0) - np.random.default_rng(fell).exponential(0.3, fell)
    edges = np.full((draws, 1, 1), np.inf)
    edges[:fell, 0, 0] = np.exp(below)
    found = probability.lognormal(edges, np.ones(1), 0.01, (0.001, 4.0))
    data = CensoredData(below, right=np.full(draws - fell, np.log(4.0)))
    mean, deviation = norm.fit(data)
    np.testing.assert_allclose(found[0], np.exp(mean), rtol=2e-3)
    np.testing.assert_allclose(found[1], deviation, rtol=2e-3)


def test_a_deviation_is_held_between_its_ends() -> None:
    """All that topple do so at one PGA; or from a thousandth of it to where some stand."""
    for fell, most in ((np.full(31, 1.0), None), (np.geomspace(1e-3, 4.0, 8), MAX_BETA)):
        edges = np.append(fell, np.full(24, np.inf))[:, None, None]
        theta, found = probability.lognormal(edges, np.ones(1), 0.01, (0.001, 4.0))
        other = minimize_scalar(
            lambda mean, fell=fell, beta=float(found[0, 0]): (
                -(
                    norm.logpdf(np.log(fell), mean, beta).sum()
                    + 24 * norm.logsf(np.log(4), mean, beta)
                )
            ),
            bounds=(-2.0, 8.0),
            method="bounded",
        )
        np.testing.assert_allclose(np.log(theta[0, 0]), other.x, atol=1e-4)
        assert most is None or found[0, 0] == pytest.approx(most)


def test_rows_of_which_nothing_or_nothing_else_is_known() -> None:
    """No draw topples; none has a verdict; all topple at one PGA, in brackets of 1 %."""
    one = np.array([[np.inf, np.nan, 0.2]] * 3)[:, None]
    theta, beta = probability.lognormal(one, np.array([0.1, 0.2, 0.4]), 0.01, (0.001, 4.0))
    assert 4.0 < theta[0, 0] < 5.0
    assert theta[0, 2] == pytest.approx(0.2)
    assert theta[0, 2] < theta[0, 1] < theta[0, 0]
    assert beta[0, 2] == pytest.approx(np.log(1.01) / np.sqrt(12.0))
    nothing = probability.lognormal(np.full((3, 1, 2), np.nan), np.ones(2), 0.01, (0.001, 4.0))
    assert np.isnan(nothing).all()


def test_the_band_is_made_of_draws() -> None:
    edges = np.append(np.linspace(0.1, 1.9, 19), np.inf)
    np.testing.assert_allclose(probability.band(edges), [0.1, 1.0, 1.9])
