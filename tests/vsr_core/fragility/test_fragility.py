"""Fragility models against exact cases, independent computations and simulated truth."""

from __future__ import annotations

import itertools
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize, minimize_scalar
from scipy.special import expit, logit
from scipy.stats import norm
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import accuracy_score, brier_score_loss, log_loss
from sklearn.preprocessing import SplineTransformer

from vsr_core.errors import InvalidInput
from vsr_core.fragility import fit_all, lognormal, smooth
from vsr_core.fragility.boundary import Cells, counted, first_crossing, locate
from vsr_core.fragility.cross_validation import (
    CLIP,
    bootstrap,
    cross_validate,
    folds,
    held_out_probability,
    recommend,
)
from vsr_core.fragility.logistic import LogisticFragility, is_separated
from vsr_core.fragility.lognormal import LognormalFragility
from vsr_core.fragility.model import Scores, maxima, maximise
from vsr_core.fragility.smooth import N_KNOTS, SmoothFragility, _splines

AXIS = np.linspace(0.02, 1.0, 50)
MODELS = (LogisticFragility, LognormalFragility, SmoothFragility)


def flat(pga, ratio, grid):
    """Grid axes and outcomes as flat arrays, one element for each run."""
    columns, rows = np.meshgrid(pga, ratio)
    return columns.ravel(), rows.ravel(), np.asarray(grid, dtype=float).ravel()


def fitted_probability(model):
    return model.grid_probability(model.coefs)[0]


def weighted(cells, weights):
    """Cells with each row run so many times."""
    return replace(
        cells, toppled=weights[:, None] * cells.toppled, trials=weights[:, None] * cells.trials
    )


def logistic_grid(seed, coef=(6.0, 5.0, 2.0), n=20):
    """Outcomes drawn from a known logistic surface, with the axes."""
    axis = np.geomspace(0.05, 1.0, n)
    pga, ratio = np.meshgrid(axis, axis)
    prob = expit(coef[0] + coef[1] * np.log(pga) + coef[2] * np.log(ratio))
    return axis, (np.random.default_rng(seed).random(prob.shape) < prob).astype(float)


def line_grid(slope=0.4, level=0.45):
    """Deterministic 50 x 50 grid, separated by a line in ln PGA and ln PGV/PGA."""
    pga, ratio = np.meshgrid(AXIS, AXIS)
    return (np.log(pga) + slope * np.log(ratio) > np.log(level)).astype(float)


def island_grid():
    """A toppled island left of the main region, balanced cells between, as in Fig. 13f."""
    grid = np.zeros((50, 50))
    for row in range(50):
        grid[row, max(26, 45 - 2 * row) :] = 1
    grid[22:36, 15:20] = 1
    return grid


# --- the boundary off the grid -----------------------------------------------------------------


def test_boundary_of_a_grid_read_by_hand():
    grid = [
        [0, 0, 1, 1, 1],  # plain
        [1, 1, 1, 1, 1],  # topples from the first PGA on
        [0, 0, 0, 0, 0],  # never topples
        [0, 1, 0, 0, 1],  # two balanced cells above the first overturned
        [0, -1, np.nan, 1, 1],  # undecided cells widen the interval
        [-1, -1, -1, -1, -1],  # nothing known
    ]
    found = locate([0.1, 0.2, 0.3, 0.4, 0.5], grid)
    np.testing.assert_array_equal(found.lower, [0.2, np.nan, 0.5, 0.1, 0.1, np.nan])
    np.testing.assert_array_equal(found.upper, [0.3, 0.1, np.inf, 0.2, 0.4, np.nan])
    below_grid = np.sqrt(0.05 * 0.1)  # half a step below, as wide as the first one
    middle = [np.sqrt(0.06), below_grid, np.inf, np.sqrt(0.02), 0.2, np.nan]
    np.testing.assert_allclose(found.pga, middle)
    np.testing.assert_array_equal(found.censored, [0, 0, 1, 0, 0, 0])
    np.testing.assert_array_equal(found.islands, [0, 0, 0, 2, 0, 0])


@pytest.mark.parametrize(
    ("grid", "sizes"),
    [
        ([[0, 0], [0, 0]], []),
        ([[1, 0, 1], [1, 0, 1]], [2, 2]),
        ([[1, 0, 0], [0, 1, 1]], [3]),  # a staircase is one cluster
        ([[1, np.nan, 1], [0, 0, 0]], [2]),  # only balanced cells separate
        ([[np.nan, 0, 1], [0, 0, 1]], [2]),  # an undecided cell alone is no cluster
    ],
)
def test_toppled_clusters(grid, sizes):
    found = locate(np.arange(1, len(grid[0]) + 1), grid)
    assert found.cluster_sizes.tolist() == sizes


def test_first_crossing_interpolates_and_names_the_edges():
    margin = np.array([[-1.0, 3.0, -2.0, 1.0], [2.0, -1.0, 1.0, 1.0], [-2.0, -1.0, -1.0, -0.5]])
    np.testing.assert_allclose(
        first_crossing(np.arange(4.0), margin), [np.exp(0.25), 0.0, np.inf], rtol=1e-14
    )


def test_newton_halves_steps_that_overshoot():
    # -sqrt(1 + x^2): Newton's step from |x| > 1 goes beyond the mirror image and diverges
    def evaluate(beta, which):
        return -np.sqrt(1 + beta[:, 0] ** 2), -beta * (1 + beta**2)

    beta, converged = maximise(evaluate, np.array([[2.0], [-3.0], [0.5]]))
    assert converged.all()
    np.testing.assert_allclose(beta, 0.0, atol=1e-8)


# --- logistic ----------------------------------------------------------------------------------


def test_logistic_is_the_unpenalised_maximum_likelihood_of_scikit_learn():
    axis, grid = logistic_grid(1)
    pga, ratio, fell = flat(axis, axis, grid)
    model = LogisticFragility(counted(axis, axis, grid))
    other = LogisticRegression(C=np.inf, tol=1e-10, max_iter=1000).fit(
        np.log(np.column_stack([pga, ratio])), fell
    )
    assert not model.separated
    assert model.method == "maximum likelihood"
    np.testing.assert_allclose(
        model.coefs[0], [*other.intercept_, *other.coef_[0]], rtol=1e-4, atol=1e-4
    )


@pytest.mark.slow
def test_logistic_intervals_cover_the_curve_that_the_data_came_from():
    truth, n = np.array([6.0, 5.0, 2.0]), 60
    covered, median_covered = np.zeros(3), 0.0
    for seed in range(n):
        axis, grid = logistic_grid(seed, truth)
        model = LogisticFragility(counted(axis, axis, grid))
        spread = bootstrap(model, 200, seed)
        covered += [
            low <= value <= high
            for (low, high), value in zip(spread.parameters.values(), truth, strict=True)
        ]
        median = np.exp(-(truth[0] + truth[2] * np.log(axis)) / truth[1])
        inside = (spread.median[0] <= median) & (median <= spread.median[1])
        median_covered += inside.mean() / n
    # 95 % nominal; percentile intervals of 20 rows run a little short
    assert (covered / n >= 0.85).all()
    assert 0.87 <= median_covered <= 0.995


def test_firth_of_a_saturated_table_adds_half_to_each_cell():
    # 0 of 12 toppled at 0.2 g and 5 of 9 at 0.4 g: separated, maximum likelihood has b1 = inf
    counts = np.array([[0.0, 5.0]]), np.array([[12.0, 9.0]])
    model = LogisticFragility(Cells(np.log([0.2, 0.4]), np.log([0.3]), *counts))
    assert model.separated
    np.testing.assert_allclose(fitted_probability(model), [[0.5 / 13, 5.5 / 10]], rtol=1e-6)


def test_firth_maximises_the_penalised_likelihood():
    grid = [0.1, 0.2, 0.3, 0.4], [0.1, 0.3, 0.5], np.tri(3, 4, -1)[:, ::-1]
    model = LogisticFragility(counted(*grid))
    pga, ratio, fell = flat(*grid)
    design = np.column_stack([np.ones(12), np.log(pga), np.log(ratio)])

    def negative(beta):
        prob = expit(design @ beta)
        fisher = design.T @ (design * (prob * (1 - prob))[:, None])
        likelihood = np.log(np.where(fell == 1, prob, 1 - prob)).sum()
        return -likelihood - 0.5 * np.log(np.linalg.det(fisher))

    found = minimize(negative, np.zeros(3), method="Nelder-Mead", options={"maxiter": 4000})
    assert model.separated
    np.testing.assert_allclose(model.coefs[0], found.x, rtol=2e-3)


def test_separated_grid_gives_a_steep_finite_curve_inside_the_gap():
    grid = line_grid()
    model = LogisticFragility(counted(AXIS, AXIS, grid))
    assert model.separated
    assert "Firth" in model.method
    b0, b1, b2 = model.coefs[0]
    assert np.isfinite(model.coefs).all()
    assert b2 / b1 == pytest.approx(0.4, abs=0.02)
    median, high = (model.grid_contour(model.coefs, level)[0] for level in (0.5, 0.975))
    np.testing.assert_allclose(median[np.argmin(np.abs(AXIS - 0.5))], 0.45 * 0.5**-0.4, rtol=0.01)
    np.testing.assert_allclose(expit(b0 + b1 * np.log(high) + b2 * np.log(AXIS)), 0.975, rtol=1e-9)
    grid[30, 2] = 1  # one stray cell and no line separates any more
    assert not LogisticFragility(counted(AXIS, AXIS, grid)).separated


@pytest.mark.slow
def test_separation_agrees_with_trying_every_line():
    rng = np.random.default_rng(3)
    axis = np.array([0.1, 0.2, 0.4, 0.8])
    verdicts = []
    for _ in range(150):
        tilt, cut, noise = rng.normal(size=3)
        pga, ratio = np.meshgrid(np.log(axis), np.log(axis))
        score = pga - cut + tilt * ratio + 0.8 * noise * rng.normal(size=pga.shape)
        fell = (score > np.median(score)).ravel()
        points = np.column_stack([np.ones(16), pga.ravel(), ratio.ravel()])
        signed = np.where(fell, 1, -1)[:, None] * points
        # the cone of separating lines is spanned by lines through two of the points
        lines = np.array([np.cross(a, b) for a, b in itertools.combinations(points, 2)])
        sides = np.concatenate([lines, -lines]) @ signed.T
        expected = ((sides >= -1e-9).all(axis=1) & (sides > 1e-9).any(axis=1)).any()
        assert is_separated(points, fell, ~fell) == expected
        verdicts.append(expected)
    assert 20 < sum(verdicts) < 130


def test_replicate_that_separates_is_refitted_by_firth():
    grid = line_grid()[::5]
    grid[3, 4] = 1  # this row alone makes the outcomes overlap
    model = LogisticFragility(counted(AXIS, AXIS[::5], grid))
    kept = np.arange(10) != 3
    alone = LogisticFragility(counted(AXIS, AXIS[::5][kept], grid[kept]))
    assert not model.separated
    assert alone.separated
    np.testing.assert_allclose(model.refit(kept[None].astype(float)), alone.coefs, rtol=1e-5)


def test_firth_settles_where_each_cell_fits_itself():
    """Half a run more on either side of one (0.5, 1.5): odds of 3, to all digits."""
    model = LogisticFragility(Cells(np.zeros(1), np.zeros(1), np.zeros((1, 1)), np.ones((1, 1))))
    np.testing.assert_allclose(model.coefs[0], [-np.log(3.0), 0.0, 0.0], rtol=1e-7)


# --- lognormal ---------------------------------------------------------------------------------


def test_lognormal_row_that_overlaps_on_a_fine_grid_is_not_flat():
    pga = 0.5 * (1 + 1e-4 * np.arange(-40, 40))
    fell = (pga > 0.5).astype(float)
    fell[[38, 43]], fell[[39, 42]] = 1.0, 0.0
    model = LognormalFragility(counted(pga, [0.2], fell[None]))

    def negative(unknown):  # Baker 2015, eq. 11, in units of the grid's step
        prob = norm.cdf((np.log(pga / 0.5) - 1e-4 * unknown[0]) / (1e-4 * unknown[1]))
        return -np.log(np.where(fell == 1, prob, 1 - prob)).sum()

    found = minimize(negative, [0.5, 3.0], method="Nelder-Mead", options={"xatol": 1e-8}).x
    assert model.status == ("probit",)
    np.testing.assert_allclose(
        np.exp(model.coefs[0, 0]), [0.5 * np.exp(1e-4 * found[0]), 1e-4 * found[1]], rtol=1e-5
    )


def test_a_fit_that_comes_to_no_maximum_is_an_error():
    def evaluate(beta, which):
        return beta[:, 0], np.ones_like(beta)

    with pytest.raises(ArithmeticError, match="2 of 2 fits came to no maximum"):
        maxima(evaluate, np.zeros((2, 1)), tolerance=1e-8)


def test_lognormal_row_is_probit_regression():
    pga = np.geomspace(0.1, 1.0, 60)
    fell = (np.random.default_rng(5).random(60) < norm.cdf(np.log(pga / 0.4) / 0.35)).astype(float)
    model = LognormalFragility(counted(pga, [0.2], fell[None]))

    def negative(parameters):  # Baker 2015, eq. 11, in theta and beta themselves
        prob = norm.cdf(np.log(pga / parameters[0]) / parameters[1])
        return -np.log(np.where(fell == 1, prob, 1 - prob)).sum()

    found = minimize(negative, [0.3, 0.5], method="Nelder-Mead", options={"xatol": 1e-8})
    assert model.status == ("probit",)
    np.testing.assert_allclose(np.exp(model.coefs[0, 0]), found.x, rtol=1e-4)
    level = model.grid_contour(model.coefs, 0.9)[0, 0]
    assert norm.cdf(np.log(level / found.x[0]) / found.x[1]) == pytest.approx(0.9, rel=1e-4)

    # the replicates of the row scatter by the curvature of that likelihood
    replicates = model.resample(np.ones((4000, 1)), np.random.default_rng(0))[:, 0, 0]
    step = 1e-3
    moved = [
        [negative([found.x[0] * np.exp(i * step), found.x[1] + j * step]) for j in (-1, 0, 1)]
        for i in (-1, 0, 1)
    ]
    (a, b, c), (d, e, f), (g, h, i) = moved
    hessian = np.array([[b - 2 * e + h, (a + i - c - g) / 4], [0, d - 2 * e + f]]) / step**2
    hessian[1, 0] = hessian[0, 1]
    error = np.sqrt(np.linalg.inv(hessian)[0, 0])
    assert replicates.std() == pytest.approx(error, rel=0.1)


def test_lognormal_intervals_cover_theta_of_simulated_rows():
    rng = np.random.default_rng(8)
    pga, ratio, theta = np.geomspace(0.1, 1.5, 60), np.geomspace(0.1, 1.0, 40), 0.4
    prob = norm.cdf(np.log(pga / theta) / 0.4)
    model = LognormalFragility(counted(pga, ratio, rng.random((40, 60)) < prob))
    low, high = bootstrap(model, 400, 1).parameters["theta"]
    assert ((low <= theta) & (theta <= high)).mean() >= 0.85
    assert (high / low < 2).all()
    assert np.exp(model.coefs[0, :, 0].mean()) == pytest.approx(theta, rel=0.04)


def test_lognormal_separated_rows_say_what_the_grid_allows():
    pga = np.array([0.1, 0.2, 0.4, 0.8])
    grid = [[0, 0, 0, 0], [0, 0, 1, 1], [np.nan] * 4, [0, np.nan, 1, 1], [1, 1, 1, 1]]
    between = 0.2**0.75 * 0.8**0.25  # a quarter of the way in ln ratio between rows that know theta
    model = LognormalFragility(counted(pga, [0.1, 0.2, between, 0.8, 1.6], grid))
    assert model.status == ("above", "interval", "undecided", "interval", "below")
    assert model.separated
    theta, beta = np.exp(model.coefs[0].T)
    np.testing.assert_allclose(
        theta, np.sqrt([0.8 * 1.6, 0.2 * 0.4, 0.08**0.75 * 0.04**0.25, 0.1 * 0.4, 0.05 * 0.1])
    )
    np.testing.assert_allclose(beta[[0, 1, 3]], np.log([2.0, 2.0, 4.0]) / np.sqrt(12.0), rtol=1e-12)
    np.testing.assert_array_equal(model.grid_contour(model.coefs, 0.5)[0, [0, 4]], [np.inf, 0.0])


def test_theta_of_rows_of_one_outcome_has_no_end_that_no_run_gives():
    """Nor has that of an undecided row beside them; of all others a run gives both ends."""
    pga = np.array([0.1, 0.2, 0.4, 0.8])
    one, none = [0, 0, 1, 1], [np.nan] * 4
    grid = [[0] * 4, none, *[one] * 4, none, *[one] * 4, none, [1] * 4]
    model = fit_all(pga, 0.1 * np.arange(1, 14), grid).model("lognormal")
    theta = model.parameters[0]
    for median in (model.median, model.median_lower, model.median_upper):
        assert (median[0], median[-1]) == (np.inf, 0.0)
    np.testing.assert_array_equal(theta.upper == np.inf, np.arange(13) < 2)
    np.testing.assert_array_equal(theta.lower == 0.0, np.arange(13) > 10)
    assert (theta.lower[0], theta.upper[-1]) == pytest.approx((0.8, 0.1))
    assert (theta.lower[1:-2] >= 0.2).all()
    assert (theta.upper[2:-1] <= 0.4).all()
    assert np.isfinite(theta.value).all()


@pytest.mark.parametrize("order", [slice(None), slice(None, None, -1)])
def test_of_records_of_one_ratio_each_keeps_its_own_open_end(order):
    """As a record and its mirror image: which of them comes first changes nothing."""
    pga = np.array([0.1, 0.2, 0.4, 0.8])
    pairs = [[0, 0, 1, 1], [0, 0, 0, 0]][order]
    theta = (
        fit_all(pga, np.repeat([0.1, 0.2, 0.4, 0.8], 2), pairs * 4).model("lognormal").parameters[0]
    )
    toppled = np.tile([True, False][order], 4)
    np.testing.assert_array_equal(theta.upper[~toppled], np.inf)
    np.testing.assert_array_equal(theta.lower[~toppled], 0.8)
    np.testing.assert_allclose(theta.value[toppled], np.sqrt(0.08))


def test_lognormal_row_that_falls_with_pga_is_flat():
    model = LognormalFragility(counted(AXIS, [0.3], [AXIS < 0.3]))
    ln_theta, ln_beta = model.coefs[0, 0]
    assert model.status == ("flat",)
    assert np.exp(ln_beta) == pytest.approx(lognormal.MAX_BETA)

    def negative(ln_theta):  # beta is held, the likelihood still sets theta
        score = (np.log(AXIS) - ln_theta) / lognormal.MAX_BETA
        return -norm.logcdf(np.where(AXIS < 0.3, score, -score)).sum()

    found = minimize_scalar(negative)
    assert ln_theta == pytest.approx(found.x, abs=1e-4)


def test_lognormal_interval_is_the_grid_interval_when_rows_agree():
    grid = np.tile((AXIS > 0.41).astype(float), (30, 1))
    model = LognormalFragility(counted(AXIS, AXIS[:30], grid))
    low, high = bootstrap(model, 500, 0).median
    lower, upper = AXIS[AXIS < 0.41][-1], AXIS[AXIS > 0.41][0]
    assert (lower <= low).all()
    assert (high <= upper).all()
    held = np.log(high / low) / np.log(upper / lower)
    assert held.mean() == pytest.approx(0.95, abs=0.01)


def test_a_row_with_both_outcomes_is_known_by_its_own_runs():
    """Whatever its neighbours are, as of those that never topple theta is an assumption."""
    pga = np.array([0.1, 0.2, 0.4, 0.8])
    grid = [[0, 0, 0, 0], [0, 0, 1, 1], [0, 0, 0, 0], [0, 0, 0, 1]]
    model = fit_all(pga, [0.1, 0.2, 0.3, 0.4], grid).model("lognormal")
    theta = model.parameters[0]
    for lower, upper in ((theta.lower, theta.upper), (model.median_lower, model.median_upper)):
        assert 0.2 <= lower[1] < upper[1] <= 0.4 <= lower[3] < upper[3] <= 0.8


def test_a_single_row_is_known_by_its_own_runs():
    found = fit_all([0.1, 0.2, 0.4, 0.8], [0.1, 0.2], [[0, 0, 1, 1], [np.nan] * 4])
    theta = found.model("lognormal").parameters[0]
    assert 0.2 <= theta.lower[0] < theta.value[0] < theta.upper[0] <= 0.4
    assert np.isnan(found.model("logistic").median_lower).all()


def test_a_row_without_a_verdict_has_the_median_of_its_interval():
    """Beside a row that never topples, whose theta is an assumption, and one that always does."""
    grid = [[0] * 4, [np.nan] * 4, [0, 0, 1, 1], [np.nan] * 4, [1] * 4]
    model = fit_all([0.1, 0.2, 0.4, 0.8], 0.1 * np.arange(1, 6), grid).model("lognormal")
    assert (model.median_lower <= model.median).all()
    assert (model.median <= model.median_upper).all()
    assert (model.median_upper[1], model.median_lower[3]) == (np.inf, 0.0)
    np.testing.assert_allclose(model.median[[1, 3]], np.sqrt(0.08))


def test_the_median_of_a_row_of_one_outcome_is_bounded_by_its_last_run():
    """Cells without a verdict lie beyond it."""
    none = np.nan
    grid = [[0, 0, none, none], [0, 0, 1, 1], [none, none, 1, 1], [0] * 4, [1] * 4]
    model = fit_all([0.1, 0.2, 0.4, 0.8], 0.1 * np.arange(1, 6), grid).model("lognormal")
    np.testing.assert_allclose(model.median_lower[[0, 2, 3, 4]], [0.2, 0.0, np.inf, 0.0])
    np.testing.assert_allclose(model.median_upper[[0, 2, 3, 4]], [np.inf, 0.4, np.inf, 0.0])


# --- smooth ------------------------------------------------------------------------------------


def test_island_is_held_by_the_smooth_model_and_not_by_the_logistic():
    grid = island_grid()
    result = fit_all(AXIS, AXIS, grid, n_bootstrap=20)
    assert sorted(result.boundary.cluster_sizes.tolist())[0] == 14 * 5
    island, between = np.s_[24:34, 16:19], np.s_[24:34, 22:24]
    smooth, logistic = result.model("smooth"), result.model("logistic")
    assert smooth.probability[island].min() > 0.8
    assert smooth.probability[between].max() < 0.2
    assert logistic.probability[island].mean() < logistic.probability[between].mean()
    assert smooth.scores.accuracy > 0.97
    assert result.recommended == "smooth"
    assert "toppled clusters: 2;" in result.reason
    # the median is the first crossing: the island where there is one, the main region elsewhere
    assert AXIS[13] < smooth.median[28] < AXIS[16]
    assert AXIS[24] < smooth.median[45] < AXIS[27]


def test_smooth_model_finds_a_line_and_a_stronger_ridge_spends_less(monkeypatch):
    cells = counted(AXIS, AXIS, line_grid())
    model = SmoothFragility(cells)
    median = model.grid_contour(model.coefs, 0.5)[0]
    np.testing.assert_allclose(median[np.argmin(np.abs(AXIS - 0.5))], 0.45 * 0.5**-0.4, rtol=0.02)
    monkeypatch.setattr(smooth, "PENALTIES", (10.0,))
    assert SmoothFragility(cells).effective_parameters < 0.5 * model.effective_parameters


# --- scores ------------------------------------------------------------------------------------


def test_cross_validation_is_refitting_without_the_rows():
    axis, grid = logistic_grid(4)
    grid[:, 3] = np.nan
    _, ratio, fell = flat(axis, axis, grid)
    model = LogisticFragility(counted(axis, axis, grid))
    row, decided = np.searchsorted(axis, ratio), ~np.isnan(fell)
    predicted = np.empty_like(fell)
    inner = (row > 0) & (row < axis.size - 1)  # the end rows stay: models do not extrapolate
    decided &= inner
    for fold in range(10):
        held = ((row - 1) % 10 == fold) & inner
        left_out = np.where(held.reshape(grid.shape), np.nan, grid)
        other = LogisticFragility(counted(axis, axis, left_out))
        predicted[held] = fitted_probability(other).ravel()[held]
    held_out = held_out_probability(model).ravel()
    np.testing.assert_allclose(held_out[inner], predicted[inner], atol=1e-6)
    scores, y, p = cross_validate(model), fell[decided], predicted[decided]
    assert scores.log_loss == pytest.approx(log_loss(y, np.clip(p, CLIP, 1 - CLIP)), rel=1e-5)
    assert scores.brier == pytest.approx(brier_score_loss(y, p), rel=1e-5)
    assert scores.accuracy == pytest.approx(accuracy_score(y, p >= 0.5))
    sizes = np.bincount(folds(model.cells)[1:-1])
    assert sizes.tolist() == [2] * 8 + [1] * 2
    assert np.average(scores.fold_log_loss, weights=sizes) == pytest.approx(scores.log_loss)


@pytest.mark.parametrize("noisy", [True, False])
@pytest.mark.parametrize("kind", [LogisticFragility, SmoothFragility])
def test_row_weights_are_repeated_rows(kind, noisy, monkeypatch):
    monkeypatch.setattr(smooth, "PENALTIES", (0.1,))
    axis, grid = logistic_grid(2) if noisy else (AXIS, line_grid())
    weights = np.random.default_rng(0).integers(0, 3, axis.size).astype(float)
    cells = counted(axis, axis, grid)
    model = kind(cells)
    refitted = model.grid_probability(model.refit(weights[None]))[0]
    repeated = kind(weighted(cells, weights))
    np.testing.assert_allclose(refitted, fitted_probability(repeated), atol=2e-3)


@pytest.mark.parametrize("kind", MODELS)
def test_two_records_may_have_one_ratio(kind, monkeypatch):
    """A record and its mirror image: rows that are alike count twice, and each has its own."""
    monkeypatch.setattr(smooth, "PENALTIES", (0.1,))
    axis, grid = AXIS, line_grid()
    once = kind(weighted(counted(axis, axis, grid), np.full(axis.size, 2.0)))
    twice = kind(counted(axis, np.repeat(axis, 2), np.repeat(grid, 2, axis=0)))
    expected = np.repeat(fitted_probability(once), 2, axis=0)
    np.testing.assert_allclose(fitted_probability(twice), expected, atol=2e-3)


def test_each_of_two_records_of_one_ratio_has_its_own_median():
    pga, grid = np.array([0.1, 0.2, 0.4, 0.8]), [[0, 0, 1, 1], [0, 0, 0, 1]]
    model = LognormalFragility(counted(pga, [0.3, 0.3], grid))
    median = model.grid_contour(model.coefs, 0.5)[0]
    np.testing.assert_allclose(median, [0.08**0.5, 0.32**0.5], rtol=0.05)


@pytest.mark.parametrize("kind", MODELS)
def test_bootstrap_is_reproducible(kind):
    axis, grid = logistic_grid(6, n=12)
    model = kind(counted(axis, axis, grid))
    first, again, other = bootstrap(model, 50, 1), bootstrap(model, 50, 1), bootstrap(model, 50, 2)
    np.testing.assert_array_equal(first.median, again.median)
    assert not np.array_equal(first.median, other.median)
    assert first.parameters.keys() == again.parameters.keys()
    for name, pair in first.parameters.items():
        np.testing.assert_array_equal(pair, again.parameters[name])
        assert (pair[0] <= pair[1]).all()


# --- which is recommended ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("lognormal", "smooth", "named"),
    [
        ([0.20, 0.21, 0.19, 0.20], [0.10, 0.11, 0.09, 0.10], "smooth"),
        ([0.10, 0.11, 0.09, 0.10], [0.20, 0.21, 0.19, 0.20], "lognormal"),
        ([0.40, 0.41, 0.39, 0.40], [0.50, 0.51, 0.49, 0.50], "logistic"),
        # better by 0.015 on the mean, with a standard error of 0.029
        ([0.40, 0.41, 0.39, 0.40], [0.32, 0.33, 0.29, 0.20], "logistic"),
        # better in each fold, by less than is material
        ([0.40, 0.41, 0.39, 0.40], [0.296, 0.306, 0.286, 0.296], "logistic"),
        ([0.40, 0.41, 0.39, 0.40], [0.294, 0.304, 0.284, 0.294], "smooth"),
    ],
)
def test_another_than_the_simplest_is_named_only_where_it_is_clearly_better(
    lognormal, smooth, named
):
    losses = {"logistic": [0.30, 0.31, 0.29, 0.30], "lognormal": lognormal, "smooth": smooth}
    scores = {
        name: Scores(float(np.mean(folds)), 0.0, 0.0, 0.0, np.array(folds))
        for name, folds in losses.items()
    }
    boundary = locate([0.1, 0.2, 0.3], [[0, 0, 1], [0, 1, 1]])
    assert recommend(scores, boundary, separated=False)[0] == named


# --- all together ------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def fitted():
    """All models of outcomes drawn from a logistic surface."""
    axis, grid = logistic_grid(3)
    return fit_all(axis, axis, grid, n_bootstrap=50)


def test_logistic_is_recommended_for_logistic_data(fitted):
    assert fitted.recommended == "logistic"
    assert fitted.model("logistic").scores.log_loss == pytest.approx(
        fitted.model("smooth").scores.log_loss, abs=0.05
    )
    for model in fitted.models:
        assert (model.median_lower <= model.median_upper).all()
        assert (model.median_lower < model.median_upper).any()
        for one in model.parameters:
            assert (one.lower <= one.value).all()
            assert (one.value <= one.upper).all()
            assert (one.lower < one.upper).any()


def test_the_band_of_a_curve_leaves_a_fortieth_on_either_side(fitted):
    axis, _ = logistic_grid(3)
    logistic, lognormal, smooth = fitted.models
    b0, b1, b2 = (one.value for one in logistic.parameters)
    theta, beta = (one.value for one in lognormal.parameters)
    for share, end in ((0.025, "band_low"), (0.975, "band_high")):
        line = np.exp((logit(share) - b0 - b2 * np.log(axis)) / b1)
        np.testing.assert_allclose(getattr(logistic, end), line)
        edge = getattr(lognormal, end)
        on = (edge > 0.0) & np.isfinite(edge)
        assert on.sum() >= 5
        np.testing.assert_allclose(norm.cdf(np.log(edge / theta) / beta)[on], share, rtol=1e-6)
        edge = getattr(smooth, end)
        on = (edge > 0.0) & np.isfinite(edge)
        assert on.sum() >= 5
        for row, level in zip(smooth.probability[on], edge[on], strict=True):
            after = np.searchsorted(axis, level)
            assert row[after - 1] <= share <= row[after]


def test_unit_of_pga_moves_b0_and_theta_only():
    axis, grid = logistic_grid(9, n=12)
    scale = 9.80665
    both = {
        kind: [kind(counted(unit * axis, axis, grid)) for unit in (1.0, scale)] for kind in MODELS
    }
    for one, two in both.values():
        np.testing.assert_allclose(fitted_probability(one), fitted_probability(two), atol=1e-6)
    (b0, *slopes), (scaled_b0, *scaled_slopes) = (m.coefs[0] for m in both[LogisticFragility])
    np.testing.assert_allclose(scaled_slopes, slopes, rtol=1e-7)
    assert scaled_b0 == pytest.approx(b0 - slopes[0] * np.log(scale), rel=1e-7)
    theta, scaled_theta = (np.exp(m.coefs[0, :, 0]) for m in both[LognormalFragility])
    np.testing.assert_allclose(scaled_theta, scale * theta)


def test_undecided_cells_change_nothing():
    axis, grid = logistic_grid(7, n=10)
    holes = np.random.default_rng(0).random(grid.shape) < 0.1
    as_nan, as_code = np.where(holes, np.nan, grid), np.where(holes, -1, grid)
    one = fit_all(axis, axis, as_nan, n_bootstrap=10)
    two = fit_all(axis, axis, as_code.astype(np.int8), n_bootstrap=10)
    for fitted, same in zip(one.models, two.models, strict=True):
        np.testing.assert_array_equal(fitted.probability, same.probability)
    # the decided runs alone, by another program
    pga, ratio, fell = flat(axis, axis, as_nan)
    both = np.log(np.column_stack([pga, ratio]))
    other = LogisticRegression(C=np.inf, tol=1e-10, max_iter=1000)
    other.fit(both[~np.isnan(fell)], fell[~np.isnan(fell)])
    np.testing.assert_allclose(
        one.model("logistic").probability.ravel(), other.predict_proba(both)[:, 1], atol=1e-4
    )


@pytest.mark.parametrize(
    ("grid", "recommended", "says"),
    [
        (np.zeros((6, 8)), "none", "Nothing toppled"),
        (np.ones((6, 8)), "none", "Every decided run toppled"),
        (np.tile([0, 0, 1, 1], (1, 1)), "logistic", "Too few"),
        (np.array([[0], [0], [1], [1]]), None, ""),
        (np.array([[0]]), "none", "Nothing toppled"),
        (np.array([[1]]), "none", "Every decided run toppled"),
        (np.array([[0, 1]]), "logistic", "Too few"),
        (np.array([[0, 1], [0, 1]]), None, ""),
        (np.array([[np.nan, np.nan], [0, 1]]), "logistic", "Too few"),
        (np.array([[1, 0, 1], [np.nan, 1, 0]]), None, ""),
    ],
    ids=lambda value: f"{value.shape}" if isinstance(value, np.ndarray) else None,
)
@pytest.mark.filterwarnings("error")
def test_degenerate_grids(grid, recommended, says):
    pga, ratio = (np.linspace(0.1, 0.8, n) for n in grid.shape[::-1])
    result = fit_all(pga, ratio, grid, n_bootstrap=20)
    if recommended:
        assert result.recommended == recommended
        assert result.reason.startswith(says)
    for fitted in result.models:
        assert np.isfinite(fitted.probability).all()
        assert ((fitted.probability >= 0) & (fitted.probability <= 1)).all()
        assert not np.isnan(fitted.median).any()
        if says.startswith("Nothing"):
            assert (fitted.probability < 0.5).all()
            assert np.isinf(fitted.median).all()
        if says.startswith("Every"):
            assert (fitted.probability > 0.5).all()
            assert (fitted.median == 0).all()
    if not says:
        assert np.isfinite(result.model("smooth").scores.log_loss)
    else:
        assert np.isnan(result.model("logistic").median_lower).all() == (grid.shape[0] < 3)


@pytest.mark.parametrize(
    ("pga", "ratio", "grid", "says"),
    [
        ([0.1, 0.2], [0.1], [[0, 2]], "values other than"),
        ([0.1, 0.2], [0.1], [[np.nan, -1]], "no decided run"),
        ([0.0, 0.2], [0.1], [[0, 1]], "pga holds values"),
        ([0.2, 0.1], [0.1], [[0, 1]], "increasing"),
        ([0.1, 0.2], [0.1], [[0], [1]], "shape"),
    ],
)
def test_unusable_input_is_refused(pga, ratio, grid, says):
    with pytest.raises(InvalidInput, match=says):
        fit_all(pga, ratio, grid)


def test_fitting_leaves_scikit_learn_out():
    code = (
        "import sys; from vsr_core.fragility import fit_all;"
        "fit_all([0.1, 0.2, 0.3], [0.1, 0.2, 0.3], [[0, 1, 1]] * 3);"
        "print('sklearn' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False"]


@pytest.mark.parametrize("size", [2, 3, 4, 7, 12, 50])
def test_splines_are_those_of_scikit_learn(size):
    values = np.sort(np.random.default_rng(size).normal(size=size))
    degree = min(3, size - 1)
    n_knots = min(N_KNOTS, max(size - degree + 1, 2))
    theirs = SplineTransformer(n_knots, degree=degree, knots="quantile")
    assert np.array_equal(_splines(values, values), theirs.fit_transform(values[:, None]))


def test_spline_through_one_value_is_a_constant():
    assert np.array_equal(_splines(np.array([0.3]), np.array([0.3])), [[1.0]])
