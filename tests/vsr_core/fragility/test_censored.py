"""Fits to intervals of the first overturning: exact cases, simulated truth, no trace of a grid."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.optimize import minimize
from scipy.special import expit
from scipy.stats import logistic, norm
from support.suites import slow_but
from threadpoolctl import threadpool_limits

from vsr_core.fragility import fit_all
from vsr_core.fragility.bisection import Known, next_runs, of_grid
from vsr_core.fragility.censored import CensoredLogistic
from vsr_core.fragility.cross_validation import bootstrap
from vsr_core.fragility.lognormal import LognormalFragility
from vsr_core.fragility.spans import STEP, shares, thresholds

RATIO = np.geomspace(0.05, 1.0, 40)
TRUTH = np.array([6.0, 5.0, 2.0])


def drawn(seed: int, ratio: np.ndarray = RATIO) -> np.ndarray:
    """First overturning of each row, from a logistic surface."""
    noise = np.random.default_rng(seed).logistic(size=ratio.size)
    return np.exp((noise - TRUTH[0] - TRUTH[2] * np.log(ratio)) / TRUTH[1])


def resolved(
    first: np.ndarray,
    pga: np.ndarray,
    width: float = 0.005,
    bounds: tuple[float, float] = (0.01, 9),
) -> tuple[np.ndarray, Known]:
    """Outcomes on a grid, and all runs that a search between its cells adds."""
    grid = (pga >= first[:, None]).astype(np.int8)
    known = of_grid(pga, grid)
    while len((runs := next_runs(known, np.full(len(first), width), bounds))[0]):
        known = known.joined(*runs, runs[1] >= first[runs[0]])
    return grid, known


def fitted(known: Known, ratio: np.ndarray = RATIO) -> CensoredLogistic:
    return CensoredLogistic(shares(known, ratio), thresholds(known, ratio.size))


def test_the_likelihood_is_that_of_the_intervals() -> None:
    """As another program maximises it, with rows that never topple or do so from the start."""
    first = drawn(1)
    first[3], first[7], first[20] = 20.0, 12.0, 0.001
    known = resolved(first, np.linspace(0.1, 1.5, 8), 0.2)[1]
    own = thresholds(known, RATIO.size)
    assert np.isinf(own.upper[[3, 7]]).all()
    assert np.isnan(own.lower[20])

    def negative(beta: np.ndarray) -> float:
        line = beta[0] + beta[2] * np.log(RATIO)
        above = np.where(np.isinf(own.upper), 1.0, expit(line + beta[1] * np.minimum(own.upper, 9)))
        below = np.where(np.isnan(own.lower), 0.0, expit(line + beta[1] * np.nan_to_num(own.lower)))
        return -np.log(np.maximum(above - below, 1e-300)).sum()

    found = minimize(negative, TRUTH, method="Nelder-Mead",
                     options={"maxiter": 4000, "xatol": 1e-7, "fatol": 1e-10})  # fmt: skip
    model = fitted(known)
    assert not model.separated
    np.testing.assert_allclose(model.coefs[0], found.x, rtol=1e-3)


@pytest.mark.slow
def test_intervals_cover_the_surface_that_the_thresholds_came_from() -> None:
    n, covered, median_covered = 60, np.zeros(3), 0.0
    for seed in range(n):
        model = fitted(resolved(drawn(seed), np.linspace(0.1, 1.5, 8))[1])
        spread = bootstrap(model, 200, seed)
        covered += [
            low <= value <= high
            for (low, high), value in zip(spread.parameters.values(), TRUTH, strict=True)
        ]
        median = np.exp(-(TRUTH[0] + TRUTH[2] * np.log(RATIO)) / TRUTH[1])
        median_covered += ((spread.median[0] <= median) & (median <= spread.median[1])).mean() / n
    assert (covered / n >= 0.85).all()
    assert 0.87 <= median_covered <= 0.995


def resolved_ends(
    first: np.ndarray, width: float, ratio: np.ndarray = RATIO
) -> tuple[np.ndarray, ...]:
    """ln PGV/PGA of rows and the ends [ln g] of their intervals."""
    own = thresholds(resolved(first, np.linspace(0.1, 1.5, 8), width)[1], first.size)
    return np.log(ratio), own.lower, own.upper


def slope_of_its_own(ln_ratio: np.ndarray, low: np.ndarray, high: np.ndarray) -> float:
    """The likeliest b1 with its prior, as another program finds it.

    By ln b1 and by where the median lies in the first and the last interval, in widths of them; of
    a row that never toppled, above its last run.
    """
    steepest = 2.0 * np.pi / np.nanmedian(np.where(np.isinf(high), np.nan, high - low))
    width = np.nanmin(high - low)

    def negative(unknown: np.ndarray) -> float:
        medians = low[[0, -1]] + width * unknown[:2]
        line, slope = np.interp(ln_ratio, ln_ratio[[0, -1]], medians), np.exp(unknown[2])
        at_low, at_high = slope * (low - line), slope * (high - line)
        # P(upper) - P(lower) = P(upper) (1 - P(lower)) (1 - exp(lower - upper))
        parts = np.logaddexp(0.0, at_low) + np.logaddexp(0.0, -at_high)
        return float(
            (parts - np.log(-np.expm1(at_low - at_high))).sum() - unknown[2] + slope / steepest
        )

    tight = {"maxiter": 9000, "maxfev": 9000, "xatol": 1e-9, "fatol": 1e-13}
    unknown = np.array([0.5, 0.5, np.log(steepest)])
    for _ in range(4):
        unknown = minimize(negative, unknown, method="Nelder-Mead", options=tight).x
    return float(np.exp(unknown[2]))


@pytest.mark.parametrize("width", [0.005, 0.0005])
@pytest.mark.parametrize(
    "first", [[0.95, 0.35], [0.7536, 0.5462, 0.3958], [0.35, 20.0], [0.5, 20.0, 20.0]]
)
def test_rows_far_apart_with_narrow_intervals_reach_the_maximum(
    first: list[float], width: float
) -> None:
    """So steep that coefficients are thousands; the second of two may never topple."""
    ratio, pga = np.geomspace(0.1, 0.5, len(first)), np.linspace(0.1, 1.5, 8)
    ends = resolved_ends(np.array(first), width, ratio)
    model = fitted(resolved(np.array(first), pga, width)[1], ratio)
    assert model.separated
    assert model.coefs[0, 1] == pytest.approx(slope_of_its_own(*ends), rel=1e-3)
    spread = bootstrap(model, 200).parameters
    for (name, value), (low, high) in zip(
        model.named(model.coefs).items(), spread.values(), strict=True
    ):
        assert low <= value[0] <= high, name


def test_replicates_of_one_outcome_have_no_slope_either() -> None:
    first, ratio = np.array([0.5, 20.0, 20.0]), np.array([0.1, 0.2, 0.3])
    model = fitted(resolved(first, np.linspace(0.1, 1.5, 8))[1], ratio)
    found = model.refit(np.array([[0.0, 1.0, 2.0]]))
    np.testing.assert_allclose(found, [[np.log(0.5 / 3.5), 0.0, 0.0]], atol=1e-12)


def test_a_line_through_all_intervals_is_steep_and_finite() -> None:
    first = 0.3 * RATIO**-0.4
    model = fitted(resolved(first, np.linspace(0.1, 1.5, 8))[1])
    assert model.separated
    b0, b1, b2 = model.coefs[0]
    assert b2 / b1 == pytest.approx(0.4, rel=0.01)
    np.testing.assert_allclose(np.exp(-(b0 + b2 * np.log(RATIO)) / b1), first, rtol=0.005)
    assert np.pi / np.sqrt(3.0) / b1 < 0.005
    assert b1 == pytest.approx(slope_of_its_own(*resolved_ends(first, 0.005)), rel=1e-3)


@pytest.mark.parametrize("level", [0.001, 20.0])
def test_one_outcome_has_no_slope(level: float) -> None:
    pga = np.linspace(0.1, 1.5, 8)
    model = fitted(resolved(np.full(RATIO.size, level), pga)[1])
    assert model.coefs[0, 1:].tolist() == [0.0, 0.0]
    fell = RATIO.size if level < 1.0 else 0
    assert expit(model.coefs[0, 0]) == pytest.approx((fell + 0.5) / (RATIO.size + 1.0))
    assert "only one outcome" in model.method


def test_replicates_are_fits_of_their_rows() -> None:
    known = resolved(drawn(5), np.linspace(0.1, 1.5, 8))[1]
    model = fitted(known)
    weights = np.random.default_rng(0).integers(0, 3, RATIO.size)
    rows = np.repeat(np.arange(RATIO.size), weights)
    parts = [known.level == row for row in rows]
    level = np.concatenate([np.full(part.sum(), n) for n, part in enumerate(parts)])
    pga, side = (np.concatenate([of[part] for part in parts]) for of in (known.pga, known.side))
    alone = fitted(Known.of(level, pga, side), RATIO[rows])
    np.testing.assert_allclose(
        model.refit(weights[None].astype(float)), alone.coefs, rtol=2e-4, atol=2e-4
    )


def test_the_grid_leaves_no_trace() -> None:
    """From 12, 25 and 50 PGAs: boundaries within 1 %, models within each other's intervals."""
    first = drawn(3)
    found = []
    for number in (12, 25, 50):
        pga = np.linspace(0.02, 1.0, number)
        grid, known = resolved(first, pga)
        with threadpool_limits(1):
            found.append(fit_all(pga, RATIO, grid, known, n_bootstrap=60))
    for one in found[:2]:
        np.testing.assert_allclose(one.boundary.pga, found[2].boundary.pga, rtol=0.006)
        assert one.recommended == found[2].recommended
        for own, fine in zip(one.models, found[2].models, strict=True):
            known = np.isfinite(own.median) & np.isfinite(fine.median)
            assert known.mean() > 0.9
            np.testing.assert_allclose(own.median[known], fine.median[known], rtol=0.03)
            np.testing.assert_allclose(own.median_lower[known], fine.median_lower[known], rtol=0.05)
            np.testing.assert_allclose(own.median_upper[known], fine.median_upper[known], rtol=0.05)
            assert (own.median_lower <= fine.median_upper)[known].all()
            assert (fine.median_lower <= own.median_upper)[known].all()
            assert own.scores.log_loss == pytest.approx(fine.scores.log_loss, rel=0.1)
            for a, b in zip(own.parameters, fine.parameters, strict=True):
                if a.name == "beta":  # of an interval, whose width is as it comes
                    continue
                np.testing.assert_allclose(a.value, b.value, rtol=0.02)


def test_cells_hold_what_topples_and_what_is_known_of_them() -> None:
    """A row that topples from 0.3 g to 0.5 g and from 0.9 g on, tested from 0.1 to 2 g."""
    ends = np.array([0.1, 0.2999, 0.3001, 0.4999, 0.5001, 0.8999, 0.9001, 2.0])
    cells = shares(Known.of(np.zeros(8, int), ends, [0, 0, 1, 1, 0, 0, 1, 1]), [0.2])
    toppled, known = STEP * cells.toppled.sum(), STEP * cells.trials.sum()
    inside = np.exp(cells.ln_pga[[0, -1]] + STEP * np.array([-0.5, 0.5]))
    low, high = max(inside[0], 0.1), min(inside[1], 2.0)
    assert known == pytest.approx(np.log(high / low))
    assert toppled == pytest.approx(np.log(0.5 / 0.3) + max(0.0, np.log(high / 0.9)), abs=1e-3)
    at = np.abs(cells.ln_pga - np.log(0.4)).argmin()
    assert cells.toppled[0, at] == pytest.approx(1.0)
    assert inside[0] <= 0.15
    assert inside[1] >= 0.6


def test_nothing_is_known_around_an_unresolved_run() -> None:
    pga, side = np.array([0.1, 0.2, 0.3, 0.4, 0.8]), [0, 0, -1, 0, 1]
    cells = shares(Known.of(np.zeros(5, int), pga, side), [0.2])
    inside = (cells.ln_pga > np.log(0.21)) & (cells.ln_pga < np.log(0.39))
    assert (cells.trials[0, inside] < 0.6).all()
    assert cells.trials[0, np.abs(cells.ln_pga - np.log(0.3)).argmin()] == 0.0


@pytest.mark.parametrize(
    ("pga", "sides", "status"),
    [
        ([0.5], [[1], [1]], ("below", "below")),
        ([0.5], [[0], [1]], ("above", "below")),
        ([0.4, 0.5, 0.6], [[0, -1, 1], [-1, 0, -1]], ("interval", "above")),
    ],
)
def test_rows_without_two_runs_beside_each_other_have_their_own_interval(
    pga: list[float], sides: list[list[int]], status: tuple[str, ...]
) -> None:
    """One PGA, at an end of the search; or unresolved runs between all others."""
    grid, ratio = np.array(sides), np.array([0.2, 0.3])
    known = Known.of(np.repeat([0, 1], len(pga)), np.tile(pga, 2), grid.ravel())
    model = LognormalFragility(shares(known, ratio), thresholds(known, 2))
    assert model.status == status
    for theta, one in zip(np.exp(model.coefs[0, :, 0]), status, strict=True):
        low, high = {"below": (0.2, 0.5), "interval": (0.4, 0.6), "above": (0.5, 1.2)}[one]
        assert low < theta < high
    found = fit_all(pga, ratio, grid, known, n_bootstrap=5)
    assert all(np.isfinite(one.probability).all() for one in found.models)


def test_lognormal_rows_are_told_by_all_runs() -> None:
    """Known to half a per cent, never toppled, toppled at the bound, and more than one change."""
    first = np.array([0.33, 20.0, 0.001, 0.4])
    pga = np.linspace(0.1, 1.5, 8)
    known = resolved(first, pga)[1]
    known = known.joined(np.array([3, 3, 3]), np.array([0.45, 0.5, 0.52]), [1, 0, 1])
    own = thresholds(known, 4)
    model = LognormalFragility(shares(known, [0.1, 0.2, 0.3, 0.4]), own)
    assert model.status == ("interval", "above", "below", "probit")
    theta, beta = np.exp(model.coefs[0].T)
    assert theta[0] == pytest.approx(0.33, rel=0.003)
    assert beta[0] == pytest.approx((own.upper[0] - own.lower[0]) / np.sqrt(12.0))
    assert theta[1] > 9.0
    assert theta[2] < 0.01
    assert 0.38 < theta[3] < 0.55


@pytest.mark.parametrize("last", [0.612, 0.66])
def test_changes_that_tell_no_slope_bound_the_median_of_their_row(last: float) -> None:
    """The second row topples, stands and topples again, so that outcomes overlap in one cell."""
    ratio = [0.2, 0.3, 0.4]
    known = resolved(np.array([0.5, 0.6, 0.7]), np.linspace(0.1, 1.5, 8))[1]
    known = known.joined(np.array([1, 1, 1]), np.array([0.606, 0.607, last]), [1, 0, 1])
    first = thresholds(known, 3)
    assert not first.single[1]
    model = LognormalFragility(shares(known, ratio), first)
    assert 0.59 < np.exp(model.coefs[0, 1, 0]) < last
    low, high = bootstrap(model, 400).parameters["theta"]
    # rows that a replicate leaves out lie between their neighbours, of 0.5 and 0.7 g
    assert (low > 0.49).all()
    assert (high < 0.71).all()


@pytest.mark.parametrize(
    ("pga", "sides"),
    [
        ([0.039, 0.056, 0.064, 0.085, 0.0997, 0.169], [1, -1, 0, 0, 1, 1]),
        ([1.897, 1.950, 1.971, 1.996, 2.994, 6.098], [1, 1, 0, -1, 1, 1]),
    ],
)
def test_outcomes_that_mix_in_one_cell_alone_tell_no_slope(
    pga: list[float], sides: list[int]
) -> None:
    """The likelihood rises with the slope without end: theta is below the first to topple."""
    known = Known.of([0] * len(pga), pga, sides)
    model = LognormalFragility(shares(known, [0.5]), thresholds(known, 1))
    assert model.status == ("below",)
    draws = model.resample(np.ones((200, 1)), np.random.default_rng(0))
    theta = np.exp(draws[:, 0, 0])
    assert theta.max() <= pga[0]
    assert theta.min() > 0.2 * pga[0]


def test_a_row_of_which_no_two_runs_beside_each_other_are_decided() -> None:
    known = Known.of([0] * 6, [0.05, 0.1, 0.2, 0.3, 0.42, 0.437], [0, 0, -1, -1, -1, 1])
    found = fit_all([0.05, 0.1, 0.437], [0.136], [[0, 0, 1]], known)
    theta = found.model("lognormal").parameters[0]
    assert 0.1 < theta.value[0] < 0.437


def test_an_island_is_no_step() -> None:
    """The second row topples between 0.3 and 0.32 g, and stands up to 1 g."""
    pga = np.array([0.1, 0.3, 0.305, 0.315, 0.32, 0.4, 0.5, 0.6, 0.8, 1.0])
    sides = [[0, 0, 0, 0, 0, 0, 1, 1, 1, 1], [0, 0, 1, 1, 0, 0, 0, 0, 0, 0]]
    known = Known.of(np.repeat([0, 1], pga.size), np.tile(pga, 2), np.ravel(sides))
    model = LognormalFragility(shares(known, [0.2, 0.3]), thresholds(known, 2))
    assert model.status[1] not in ("interval", "above", "below")
    assert model.probability(model.coefs[:, 1:], np.log([[0.5]])).item() < 0.5


@pytest.mark.parametrize("place", [0.2, np.exp(-20.5 * STEP)])
@pytest.mark.parametrize("beyond", [[0, 0], [0, 1]])
def test_changes_beyond_the_cells_do_not_move_the_median(beyond: list[int], place: float) -> None:
    """The rock topples from 0.2 to 0.5 g, stands again, and may topple above 1 g.

    Or from another PGA, on a border of cells.
    """
    pga = (place / 0.2) * np.array([0.05, 0.1, 0.199, 0.201, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 2.0])
    side = [0, 0, 0, 1, 1, 1, 1, 0, 0, *beyond]
    known = Known.of(np.repeat([0, 1], pga.size), np.tile(pga, 2), side * 2)
    model = LognormalFragility(shares(known, [0.2, 0.3]), thresholds(known, 2))
    low, high = bootstrap(model, 50).parameters["theta"]
    np.testing.assert_allclose(np.exp(model.coefs[0, :, 0]), place, rtol=0.006)
    assert (low > 0.99 * place).all()
    assert (high < 1.01 * place).all()


def test_a_row_that_stands_beyond_its_cells_alone_topples_from_its_first_pga_on() -> None:
    pga, side = np.array([0.1, 0.3, 0.5, 0.51, 0.8]), [1, 1, 0, 1, 1]
    known = Known.of(np.repeat([0, 1], pga.size), np.tile(pga, 2), side * 2)
    model = LognormalFragility(shares(known, [0.2, 0.3]), thresholds(known, 2))
    assert model.status == ("below", "below")
    theta = np.exp(model.coefs[0, :, 0])
    assert ((theta > 0.05) & (theta < 0.1)).all()


@pytest.mark.parametrize("noise", slow_but([1.0], [0.0, 1.0]))
def test_probabilities_are_those_of_the_parameters(noise: float) -> None:
    """At each PGA of the grid, which is not that of the models' own cells."""
    scatter = np.random.default_rng(3).logistic(scale=0.1, size=RATIO.size)
    pga = np.linspace(0.02, 4.0, 30)
    grid, known = resolved(0.3 * RATIO**-0.3 * np.exp(noise * scatter), pga)
    found = fit_all(pga, RATIO, grid, known, n_bootstrap=2)
    theta, beta = (one.value[:, None] for one in found.model("lognormal").parameters)
    exact = norm.cdf(np.log(pga / theta) / beta)
    np.testing.assert_allclose(found.model("lognormal").probability, exact, rtol=1e-9, atol=1e-300)
    b0, b1, b2 = (float(one.value) for one in found.model("logistic").parameters)
    exact = logistic.cdf(b0 + b1 * np.log(pga) + b2 * np.log(RATIO)[:, None])
    np.testing.assert_allclose(found.model("logistic").probability, exact, rtol=1e-9, atol=1e-300)


def test_a_cell_that_stands_above_a_run_between_cells_is_an_island() -> None:
    """The second row topples at 0.45 and 0.46 g already, between cells that stand."""
    pga, ratio = np.array([0.1, 0.4, 0.5, 0.6, 0.7]), [0.2, 0.3]
    grid, known = resolved(np.array([0.55, 0.65]), pga)
    known = known.joined(np.array([1, 1]), np.array([0.45, 0.46]), [1, 1])
    assert fit_all(pga, ratio, grid, known, n_bootstrap=2).boundary.islands.tolist() == [0, 2]


@st.composite
def changing_rows(draw: st.DrawFn) -> list[list[float]]:
    """PGAs at which the outcome of rows changes, from standing: none, one or three of them."""
    change = st.floats(0.02, 3.5)
    row = st.one_of(
        st.just([]),
        st.lists(change, min_size=1, max_size=1),
        st.lists(change, min_size=3, max_size=3),
    )
    return draw(st.lists(row.map(sorted), min_size=2, max_size=4))


def runs_of(rows: list[list[float]]) -> Known:
    """What a grid from 0.3 to 1.5 g, and a search beside each change and up to 4 g, would run."""
    runs = [
        (number, pga, np.searchsorted(ends, pga) % 2)
        for number, ends in enumerate(rows)
        for pga in {
            0.3,
            0.6,
            1.5,
            *([] if ends else [4.0]),
            *np.outer(ends, [0.997, 1.003]).ravel(),
        }
    ]
    return Known.of(*zip(*runs, strict=True))


@given(changing_rows())
@example([[], [0.073]])  # below half of the lowest PGA of the grid
@example([[0.5, 0.8, 0.85], [1.6]])  # an island that only the other row reaches to
@example([[0.0234375], [1.59375, 2.328125, 3.328125]])  # of which ln beta is 0.0006
def test_a_row_has_the_curve_that_it_has_alone(rows: list[list[float]]) -> None:
    known = runs_of(rows)
    ratio = 0.1 * np.arange(1.0, len(rows) + 1)
    every = LognormalFragility(shares(known, ratio), thresholds(known, len(rows)))
    for number, ends in enumerate(rows):
        alone = runs_of([ends])
        one = LognormalFragility(shares(alone, ratio[:1]), thresholds(alone, 1))
        assert every.status[number] == one.status[0]
        theta_and_beta = np.exp(every.coefs[0, number]), np.exp(one.coefs[0, 0])
        np.testing.assert_allclose(*theta_and_beta, rtol=1e-6)  # their logarithms may be near 0
        if not ends:
            assert every.coefs[0, number, 0] > np.log(4.0)


def test_a_surface_knows_of_rows_that_stand_far_above_where_others_topple() -> None:
    known = runs_of([[], [0.073]])
    grid = np.array([[0, 0, 0], [1, 1, 1]])
    for model in fit_all([0.3, 0.6, 1.5], [0.005, 4.0], grid, known, n_bootstrap=5).models:
        assert (np.abs(model.probability - grid) < 0.1).all(), model.name


def test_a_row_is_known_where_it_was_tried_though_unresolved_runs_lie_around_its_change() -> None:
    pga, sides = np.array([0.1, 0.2, 0.3, 0.5, 0.7, 0.9]), np.array([0, 0, -1, -1, -1, 1])
    known = Known.of(np.zeros(6, int), pga, sides)
    assert shares(known, [0.1]).usable.all()
    (fit,) = (
        one
        for one in fit_all(pga, [0.1], sides[None], known, n_bootstrap=20).models
        if one.name == "lognormal"
    )
    assert 0.2 <= fit.median_lower[0] <= fit.median[0] <= fit.median_upper[0] <= 0.9


def test_a_row_that_is_known_to_stand_only_between_unresolved_runs_has_its_first_overturning() -> (
    None
):
    pga, sides = np.array([0.5, 1.0, 1.2, 1.4, 1.6, 2.0, 2.5]), np.array([-1, 1, -1, 0, 0, -1, 1])
    known = Known.of(np.zeros(7, int), pga, sides)
    found = fit_all(pga, [0.1], sides[None], known, n_bootstrap=5)
    assert found.boundary.upper[0] == 1.0
    model = LognormalFragility(shares(known, [0.1]), thresholds(known, 1))
    assert model.status == ("below",)
    assert model.coefs[0, 0, 0] < 0.0


@pytest.mark.parametrize("other", slow_but([2.0], [0.02, 2.0, 4.0]))
def test_a_row_whose_slope_is_held_has_the_interval_that_it_has_alone(other: float) -> None:
    """Toppling falls with its PGA: only b0 is estimated, to 1 / root of the sum of information."""
    ratio, sides = np.array([0.1, 0.2]), np.array([1, 1, 0, 1, 0, 1, 0])
    pga = np.array([0.3, 0.35, 0.4, 0.45, 0.5, 0.55, 0.6])
    alone = Known.of(np.zeros(7, int), pga, sides)
    beside = alone.joined(np.ones(3, int), other * np.array([1.0, 1.01, 2.0]), [0, 1, 1])
    spread = [
        LognormalFragility(shares(known, ratio[:rows]), thresholds(known, rows))
        .resample(np.ones((20_000, rows)), np.random.default_rng(0))[:, 0]
        .std(axis=0)
        for known, rows in ((alone, 1), (beside, 2))
    ]
    np.testing.assert_allclose(spread[1], spread[0], rtol=0.03)
    assert spread[0][1] < 1e-9
    # 0.69 / 0.08 cells known at most, each with no more information than 2 / pi
    assert 2.0 / np.sqrt(np.log(2.0) / STEP * 2.0 / np.pi) <= spread[0][0] < 1.5


@pytest.mark.parametrize("seed", slow_but([0, 1], range(6)))
@pytest.mark.parametrize("beta", [0.2, 0.3])
def test_draws_of_a_row_are_where_its_runs_let_theta_and_beta_be(beta: float, seed: int) -> None:
    """Median and ends of 95 % by the likelihood on a grid, flat in ln theta and ln beta."""
    rng = np.random.default_rng(seed)
    pga = np.exp(np.sort(rng.uniform(-1.0, 1.0, 60)))
    known = Known.of(np.zeros(60, int), pga, (rng.normal(size=60) < np.log(pga) / beta).astype(int))
    model = LognormalFragility(shares(known, [0.2]), thresholds(known, 1))
    assert model.status == ("probit",)
    toppled, trials = model._own.toppled[0], model._own.trials[0]
    sides = np.log([0.08 / np.sqrt(12.0), 2.0])
    axes = np.linspace(-3.0, 3.0, 301), np.linspace(*sides, 151)
    eta = (model.cells.ln_pga - axes[0][:, None, None]) / np.exp(axes[1])[:, None]
    likely = (toppled * norm.logcdf(eta) + (trials - toppled) * norm.logcdf(-eta)).sum(axis=-1)
    weight = np.exp(likely - likely.max())
    draws = model.resample(np.ones((20_000, 1)), np.random.default_rng(0))[:, 0].T
    off, levels = [], [0.025, 0.5, 0.975]
    for drawn, at, share in zip(draws, axes, (weight.sum(axis=1), weight.sum(axis=0)), strict=True):
        places = np.interp(levels, (np.cumsum(share) - 0.5 * share) / share.sum(), at)
        off.append(np.abs(np.quantile(drawn, levels) - places) / np.ptp(places))
    assert np.max(off[0]) < 0.1  # the level is drawn as normal
    assert np.max(off[1]) < 0.03


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("other", slow_but([0.3], [0.3, 1.0, 3.5]))
def test_draws_of_a_row_hang_on_no_row_beside_it(other: float) -> None:
    """Steep slopes put all other PGAs far beyond what the normal distribution tells apart."""
    pga = np.array([0.05, 0.1, 0.12, 0.125, 0.15, 0.17, 0.18, 0.25, 0.5, 1.0])
    alone = Known.of(np.zeros(10, int), pga, [0, 0, 0, 1, 1, 0, 1, 1, 1, 1])
    beside = alone.joined(np.ones(3, int), other * np.array([0.99, 1.01, 1.2]), [0, 1, 1])
    ends = []
    for known, rows in ((alone, 1), (beside, 2)):
        model = LognormalFragility(shares(known, [0.1, 0.2][:rows]), thresholds(known, rows))
        draws = model.resample(np.ones((20_000, rows)), np.random.default_rng(0))[:, 0]
        ends.append(np.quantile(draws, [0.025, 0.975], axis=0))
    np.testing.assert_allclose(*ends, atol=0.1)
