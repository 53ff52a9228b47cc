"""Indices of functions whose indices are known, and of numbers that say nothing."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from scipy.stats import qmc

from vsr_core.arrays import Array
from vsr_core.uncertainty import sensitivity
from vsr_core.uncertainty.sensitivity import Unknown


def unit(even: Array) -> Array:
    """Even numbers on (0, 1) as such of unit variance."""
    return np.asarray((2.0 * even - 1.0) * math.sqrt(3.0))


def unknowns(even: Array) -> list[Unknown]:
    return [Unknown(f"x{k}", unit(even[:, [k]]), unit) for k in range(even.shape[1])]


@pytest.mark.slow
def test_indices_of_ishigami_are_its_own() -> None:
    """Ishigami & Homma (1990), with a = 7 and b = 0.1, in closed form."""
    a, b = 7.0, 0.1
    even = qmc.Sobol(3, rng=3).random(256)
    x = math.pi * (2.0 * even - 1.0)
    values = np.sin(x[:, 0]) + a * np.sin(x[:, 1]) ** 2 + b * x[:, 2] ** 4 * np.sin(x[:, 0])
    found = sensitivity.shares(unknowns(even), values)
    one = 0.5 * (1.0 + b * math.pi**4 / 5.0) ** 2
    two, both = a**2 / 8.0, 8.0 * b**2 * math.pi**8 / 225.0
    whole = one + two + both
    assert found.explained > 0.99
    np.testing.assert_allclose(found.first[0], np.array([one, two, 0.0]) / whole, atol=0.02)
    np.testing.assert_allclose(found.total[0], np.array([one + both, two, both]) / whole, atol=0.02)


def test_a_group_of_numbers_counts_as_one_unknown() -> None:
    """Of a sum of independent numbers each has the share of its variance."""
    even = qmc.Sobol(4, rng=5).random(32)
    weights = np.array([3.0, 2.0, 1.0, 1.0])
    parts = unknowns(even)
    pair = Unknown("pair", np.hstack([parts[1].values, parts[2].values]), unit)
    found = sensitivity.shares([parts[0], pair, parts[3]], unit(even) @ weights)
    shares = np.array([9.0, 5.0, 1.0]) / 15.0
    np.testing.assert_allclose(found.first[0], shares, atol=0.01)
    np.testing.assert_allclose(found.total[0], shares, atol=0.01)
    low, high = sensitivity.interval(found.first).T
    assert ((low <= found.first[0] + 1e-3) & (found.first[0] - 1e-3 <= high)).all()
    twice = sensitivity.joined([found, found])
    np.testing.assert_allclose(twice.first, found.first)


def test_directions_together_have_the_indices_of_those_that_have_any() -> None:
    def part(explained: float, variance: float, index: float) -> sensitivity.Shares:
        indices = np.full((1 + sensitivity.REPLICATES, 1), index)
        return sensitivity.Shares(explained, variance, indices, indices)

    one, other = part(0.9, 3.0, 0.4), part(0.7, 1.0, 0.8)
    doubtful, untried = part(0.1, 4.0, np.nan), part(np.nan, np.nan, np.nan)
    found = sensitivity.joined([untried, doubtful, one, other])
    np.testing.assert_allclose(found.first, 0.5)  # (3 x 0.4 + 1 x 0.8) / 4
    assert found.explained == pytest.approx(0.475)  # (4 x 0.1 + 3 x 0.9 + 1 x 0.7) / 8
    found = sensitivity.joined([untried, doubtful])
    assert np.isnan(found.first).all()
    assert found.explained == pytest.approx(0.1)
    assert np.isnan(sensitivity.joined([untried, untried]).explained)


@pytest.mark.parametrize(
    ("draws", "seeds"), [(16, (3, 5)), pytest.param(32, range(20), marks=pytest.mark.slow)]
)
def test_a_signal_has_indices_and_noise_has_none(draws: int, seeds: Sequence[int]) -> None:
    """Noise knows of no unknown, though there are lengths that explain some afterwards."""
    claimed = []
    for seed in seeds:
        even = qmc.Sobol(7, rng=seed).random(draws)
        noise = np.random.default_rng(1000 + seed).normal(size=draws)
        signal = unit(even) @ np.array([1.0, 0.6, 0.0, 0.0, 0.0, 0.0, 0.0]) + 0.3 * noise
        found = [sensitivity.shares(unknowns(even), output) for output in (noise, signal)]
        claimed.append([bool(np.isfinite(one.first).all()) for one in found])
    assert claimed == [[False, True]] * len(seeds)


@pytest.mark.parametrize("kind", ["noise", "censored", "constant", "few"])
def test_no_index_without_support(kind: str) -> None:
    even = qmc.Sobol(5, rng=1).random(15 if kind == "few" else 32)
    output = np.random.default_rng(0).normal(size=len(even))
    special = {
        "censored": np.append(output[1:], np.inf),
        "constant": 0.0 * output,
        "few": even[:, 0],
    }
    output = special.get(kind, output)
    found = sensitivity.shares(unknowns(even), output)
    assert np.isnan(found.first).all()
    assert np.isnan(found.total).all()
    assert not found.explained >= sensitivity.SUPPORTED
