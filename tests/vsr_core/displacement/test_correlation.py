"""Means of ensembles on a line: by other formulas, published values, invariances, coverage."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import stats

from vsr_core.displacement.correlation import (
    REGRESSORS,
    STATISTICS,
    Correlation,
    correlate,
    correlations,
    ensembles,
    row,
)
from vsr_core.errors import InvalidInput

Array = NDArray[np.float64]

COLUMNS = (
    *("statistic", "regressor", "n_groups", "n_runs", "slope", "intercept", "r2", "p"),
    *("spearman", "spearman_p", "spearman_runs", "variance_between", "variance_within"),
)

TABLE_1 = (
    # R2, p and ensembles of Chen et al. (2024), Table 1 and Fig. 17
    (0.90, 2.3e-11, 22),
    (0.82, 5.5e-9, 22),
    (0.73, 3.5e-7, 22),
    (0.92, 3.2e-22, 39),
    (0.78, 1.0e-13, 39),
    (0.87, 3.9e-18, 39),
)


def scattered(seed: int, groups: int = 12, most: int = 9) -> tuple[Array, Array]:
    """Runs of ensembles of 1 to ``most`` runs, on a rising line with scatter."""
    rng = np.random.default_rng(seed)
    value = np.linspace(0.1, 1.0, groups)
    x = np.repeat(value, rng.integers(1, most + 1, groups))
    y = 2.0 + 5.0 * x + rng.normal(0.0, 1.0, len(x))
    order = rng.permutation(len(x))
    return x[order], y[order]


def numbers(found: Correlation) -> Array:
    """All that a correlation says, but for its names."""
    return np.array([value for value in row(found).values() if not isinstance(value, str)])


def with_r2(r2: float, n: int) -> tuple[Array, Array]:
    """Points of exactly this coefficient of determination."""
    x = np.linspace(0.02, 1.0, n)
    away = np.sin(17.0 * x)
    for part in (np.ones(n), x - x.mean()):
        away -= part * (away @ part) / (part @ part)
    u = (x - x.mean()) / np.linalg.norm(x - x.mean())
    return x, math.sqrt(r2) * u + math.sqrt(1.0 - r2) * away / np.linalg.norm(away) + 3.0


@pytest.mark.parametrize(
    ("values", "p"),
    [
        ([1, 2, 3], 1 / 3),  # in order, or in the opposite: 2 of 6
        ([1, 2, 3, 4], 1 / 12),
        ([1, 2, 4, 3], 1 / 3),  # Owen's table of n = 4: 4 of 24 at .8 or more, one-sided
        ([2, 2, 5], 2 / 3),  # of which two are alike
    ],
)
def test_ranks_of_few_ensembles_are_in_order_by_chance(values: list[float], p: float) -> None:
    found = correlate(np.arange(float(len(values))), np.array(values, dtype=float))
    assert found.spearman_p == pytest.approx(p)
    assert found.spearman == pytest.approx(stats.spearmanr(range(len(values)), values).statistic)


@pytest.mark.parametrize(("r2", "published", "n"), TABLE_1)
def test_published_p_follows_from_published_r2(r2: float, published: float, n: int) -> None:
    """The paper prints R2 to two figures: its p lies between those of the ends of the last one."""
    low, high = (correlate(*with_r2(r2 + end, n)).line for end in (0.005, -0.005))
    assert low.r2 == pytest.approx(r2 + 0.005)
    assert low.n_groups == n
    assert low.p < published < high.p


@pytest.mark.parametrize("seed", range(5))
def test_line_against_normal_equations(seed: int) -> None:
    x, y = scattered(seed)
    line = correlate(x, y).line
    value = np.unique(x)
    mean = np.array([y[x == v].mean() for v in value])
    design = np.column_stack([np.ones(len(value)), value])
    (intercept, slope), squares = np.linalg.lstsq(design, mean, rcond=None)[:2]
    assert line.slope == pytest.approx(slope)
    assert line.intercept == pytest.approx(intercept)
    assert line.r2 == pytest.approx(1.0 - squares[0] / ((mean - mean.mean()) ** 2).sum())
    assert line.residual**2 == pytest.approx(squares[0] / (len(value) - 2))
    # of one slope, the F test against the mean alone is the t test
    f = line.r2 / (1.0 - line.r2) * (len(value) - 2)
    assert line.p == pytest.approx(stats.f.sf(f, 1, len(value) - 2))
    # the variance of the line from the inverse of the normal matrix
    at = np.array([-0.3, 0.2, 0.55, 2.0])
    probe = np.column_stack([np.ones(4), at])
    variance = np.einsum("ij,jk,ik->i", probe, np.linalg.inv(design.T @ design), probe)
    half = stats.t.isf(0.025, len(value) - 2) * line.residual * np.sqrt(variance)
    low, high = line.band(at)
    np.testing.assert_allclose(low, line.mean(at) - half)
    np.testing.assert_allclose(high, line.mean(at) + half)


@pytest.mark.slow
def test_band_covers_the_truth_19_times_in_20() -> None:
    rng = np.random.default_rng(1)
    x, at, trials = np.linspace(0.1, 1.0, 9), np.array([0.1, 0.5, 1.4]), 400
    hits = np.zeros(3)
    for _ in range(trials):
        low, high = correlate(x, 1.0 + 3.0 * x + rng.normal(0.0, 0.7, 9)).line.band(at)
        hits += (low < 1.0 + 3.0 * at) & (1.0 + 3.0 * at < high)
    error = math.sqrt(0.95 * 0.05 / trials)
    np.testing.assert_allclose(hits / trials, 0.95, atol=4.0 * error)


def test_shares_of_variance_against_the_analysis_of_variance() -> None:
    """F of a one-way analysis of variance, from which eta squared follows."""
    x, y = scattered(3)
    groups = [y[x == v] for v in np.unique(x)]
    k, n = len(groups), len(y)
    f = stats.f_oneway(*groups).statistic
    found = correlate(x, y)
    assert found.between == pytest.approx(f * (k - 1) / (f * (k - 1) + n - k))
    assert found.between + found.within == 1.0


def test_shares_of_variance_at_their_ends() -> None:
    x = np.repeat([0.1, 0.2, 0.3], 4)
    assert correlate(x, 7.0 * x + 1.0).between == pytest.approx(1.0)
    same = correlate(x, np.tile([0.0, 1.0, 2.0, 3.0], 3) + 1e-6 * x)
    assert same.between == pytest.approx(0.0, abs=1e-9)


def test_rank_correlation_against_its_definition() -> None:
    """Pearson's coefficient of mid-ranks, counted pair by pair."""
    x, y = scattered(4)
    found = correlate(x, y)

    def ranks(values: Array) -> Array:
        less = (values[None, :] < values[:, None]).sum(axis=1)
        alike = (values[None, :] == values[:, None]).sum(axis=1)
        return less + 0.5 * (alike + 1.0)

    means = ensembles(x, y)
    assert found.spearman_runs == pytest.approx(np.corrcoef(ranks(x), ranks(y))[0, 1])
    expected = np.corrcoef(ranks(means.index.to_numpy()), ranks(means["mean"].to_numpy()))[0, 1]
    assert found.spearman == pytest.approx(expected)
    rising = correlate(np.arange(8.0), np.exp(np.arange(8.0)))
    assert (rising.spearman, rising.line.r2 < 0.9) == (1.0, True)


@pytest.mark.slow
def test_rank_correlation_finds_nothing_in_noise() -> None:
    """Its p is uniform where nothing goes together: one in ten is below a tenth."""
    rng = np.random.default_rng(2)
    ps = [correlate(np.arange(12.0), rng.normal(size=12)) for _ in range(600)]
    for name in ("spearman_p", "spearman_runs_p"):
        below = np.mean([getattr(found, name) < 0.1 for found in ps])
        assert below == pytest.approx(0.1, abs=4.0 * math.sqrt(0.09 / 600))


def test_ensembles_by_hand() -> None:
    groups = ensembles(np.array([0.3, 0.1, 0.3, 0.2, 0.3]), np.array([1.0, 5.0, 3.0, 4.0, 8.0]))
    np.testing.assert_array_equal(groups.index, [0.1, 0.2, 0.3])
    np.testing.assert_array_equal(groups["n"], [1, 1, 3])
    np.testing.assert_allclose(groups["mean"], [5.0, 4.0, 4.0])
    np.testing.assert_allclose(groups["deviation"], [np.nan, np.nan, math.sqrt(13.0)])


@given(st.integers(0, 10**6), st.floats(0.01, 100.0), st.floats(0.01, 100.0), st.floats(-9.0, 9.0))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_units_and_order_do_not_matter(seed: int, by: float, of: float, shift: float) -> None:
    x, y = scattered(seed, groups=6)
    base, scaled = correlate(x, y), correlate(by * x, of * y + shift)
    order = np.random.default_rng(seed).permutation(len(x))
    np.testing.assert_allclose(numbers(correlate(x[order], y[order])), numbers(base), rtol=1e-9)
    for name in ("r2", "p"):
        assert getattr(scaled.line, name) == pytest.approx(getattr(base.line, name), rel=1e-6)
    assert scaled.line.slope == pytest.approx(base.line.slope * of / by, rel=1e-6)
    assert scaled.between == pytest.approx(base.between, rel=1e-6)
    for name in ("spearman", "spearman_p", "spearman_runs", "spearman_runs_p"):
        assert getattr(scaled, name) == pytest.approx(getattr(base, name))


@pytest.mark.parametrize(
    ("x", "y", "words"),
    [
        ([], [], "no run overturned"),
        ([0.5], [3.0], "1 of the 3 ensembles"),
        ([0.5, 0.5, 0.6], [3.0, 4.0, 5.0], "2 of the 3 ensembles"),
        ([0.1, 0.2, 0.3, 0.3], [4.4, 4.4, 4.4, 4.4], "same mean"),
        ([0.1, 0.2, 0.3, 0.3, 0.3], [0.1, 0.1, 0.1, 0.2, 0.0], "same mean"),
    ],
)
def test_too_little_to_say(x: list[float], y: list[float], words: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = correlate(np.array(x), np.array(y))
        cells = row(found)
    assert words in found.reason
    assert (cells["n_groups"], cells["n_runs"]) == (len(set(x)), len(x))
    for name in COLUMNS[4:]:
        assert math.isnan(float(cells[name])), name


def test_every_statistic_against_every_regressor() -> None:
    rng = np.random.default_rng(8)
    pga, ratio = (rng.choice(np.linspace(0.2, 1.0, 9), 90) for _ in range(2))
    columns = (pga, ratio, 9.0 * pga, 4.0 + ratio, 3.0 - pga)
    runs = pd.DataFrame(dict(zip((*REGRESSORS, *STATISTICS), columns, strict=True)))
    found = correlations(runs)
    assert [(f.statistic, f.regressor) for f in found] == [
        (s, r) for s in STATISTICS for r in REGRESSORS
    ]
    rows = [row(f) for f in found]
    assert all(tuple(cells) == COLUMNS for cells in rows)
    assert all(cells["n_runs"] == 90 for cells in rows)
    by = {(cells["statistic"], cells["regressor"]): cells for cells in rows}
    for key, slope in (
        (("trajectory_length", "pga"), 9.0),
        (("largest_speed", "pgv_pga"), 1.0),
        (("terminal_distance", "pga"), -1.0),
    ):
        assert by[key]["slope"] == pytest.approx(slope)
        assert by[key]["r2"] == pytest.approx(1.0)
        assert by[key]["variance_between"] == pytest.approx(1.0)
    assert float(by["largest_speed", "pga"]["r2"]) < 0.9


def test_runs_without_a_trajectory_are_refused() -> None:
    runs = pd.DataFrame({name: np.linspace(0.1, 1.0, 4) for name in (*REGRESSORS, *STATISTICS)})
    runs.loc[1, "largest_speed"] = np.nan
    with pytest.raises(InvalidInput, match="1 values of largest_speed"):
        correlations(runs)
