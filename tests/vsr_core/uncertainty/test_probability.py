"""Counts of draws against the laws that made them."""

from __future__ import annotations

import numpy as np
from scipy.stats import beta, norm

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


def test_the_surface_is_the_law_that_made_the_draws_and_never_falls() -> None:
    pga, ratio = np.linspace(0.05, 1.0, 40), np.array([0.1, 0.2, 0.4])
    median = np.array([0.5, 0.35, 0.3])
    edges = median * np.exp(0.25 * norm.ppf((np.arange(400) + 0.5) / 400))[:, None]
    draws = (pga >= edges[..., None]).astype(np.int8)
    fitted, theta, spread = probability.surface(pga, ratio, draws)
    np.testing.assert_allclose(theta, median, rtol=0.01)
    np.testing.assert_allclose(spread, 0.25, rtol=0.03)
    np.testing.assert_allclose(fitted, norm.cdf(np.log(pga / median[:, None]) / 0.25), atol=0.01)
    rng = np.random.default_rng(1)
    noisy, _, _ = probability.surface(pga, ratio, rng.integers(0, 2, draws.shape).astype(np.int8))
    assert (np.diff(noisy, axis=1) >= 0.0).all()


def test_the_band_is_made_of_draws() -> None:
    edges = np.append(np.linspace(0.1, 1.9, 19), np.inf)
    np.testing.assert_allclose(probability.band(edges), [0.1, 1.0, 1.9])
