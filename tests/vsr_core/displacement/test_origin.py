"""The inverse on forward models whose inverse is known, and bounds on the shaking."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import stats

from vsr_core.displacement.correlation import lower_bound
from vsr_core.displacement.origin import REACH, Forward, ObservedBoulder, Origin, trace
from vsr_core.errors import InvalidInput

Array = NDArray[np.float64]

PGA, RATIO = np.linspace(0.1, 1.0, 10), np.linspace(0.1, 0.6, 6)


def grid(starts: int = 1, repeats: int = 1) -> tuple[NDArray[np.int64], Array, Array]:
    """Start, PGA and PGV/PGA of every cell, each repeated."""
    cells = np.meshgrid(np.arange(starts), RATIO, PGA, indexing="ij")
    start, ratio, pga = (np.repeat(axis.ravel(), repeats) for axis in cells)
    return start, pga, ratio


def linear(starts: int = 1, repeats: int = 1, noise: float = 0.0, seed: int = 0) -> Forward:
    """A rock that travels 10 m a g along x and 10 m a s along y, from starts 20 m apart."""
    start, pga, ratio = grid(starts, repeats)
    end = np.column_stack([10.0 * pga + 20.0 * start, 10.0 * ratio])
    end += np.random.default_rng(seed).normal(0.0, noise, end.shape)
    return Forward(start, pga, ratio, end)


def mean_pga(origin: Origin) -> float:
    return float(origin.of_motion.sum(axis=0) @ origin.pga)


def of_start(origin: Origin) -> Array:
    """Probability of each start, shape (s,)."""
    return np.asarray(origin.probability.sum(axis=(1, 2)))


def by_hand(forward: Forward, found: ObservedBoulder) -> Array:
    """Bayes' rule, cell after cell and run after run."""
    starts, ratios, pgas = map(np.unique, (forward.start, forward.pgv_pga, forward.pga))
    odds = np.zeros((len(starts), len(ratios), len(pgas)))
    for place in np.ndindex(odds.shape):
        runs = np.flatnonzero(
            (forward.start == starts[place[0]])
            & (forward.pgv_pga == ratios[place[1]])
            & (forward.pga == pgas[place[2]])
        )
        for run in runs:
            away = math.dist(forward.end[run], found.place)
            if away <= REACH * found.sigma:
                odds[place] += math.exp(-0.5 * (away / found.sigma) ** 2) / len(runs)
    return odds / odds.sum()


def test_fine_grid_gives_the_continuous_posterior() -> None:
    """Ends 10 a along x: PGA has mean x/10 and standard deviation sigma/10 but for the cut."""
    pga = np.linspace(0.0, 2.0, 2001)[1:]
    zeros = np.zeros(len(pga))
    forward = Forward(
        zeros.astype(int), pga, zeros + 0.3, np.column_stack([10.0 * pga, zeros])
    )  # fmt: skip
    origin = trace(forward, ObservedBoulder((8.0, 0.0), 0.5))
    probability = origin.of_motion[0]
    cut = stats.truncnorm(-REACH, REACH)
    middle = probability @ pga
    assert middle == pytest.approx(0.8, abs=1e-9)
    assert math.sqrt(probability @ (pga - middle) ** 2) == pytest.approx(0.05 * cut.std(), rel=2e-3)
    # equal weights that scatter as much: (integral of w)^2 over the integral of w^2
    z = np.linspace(-REACH, REACH, 20001)
    w = np.exp(-0.5 * z**2)
    expected = w.sum() ** 2 / (w**2).sum() * (z[1] - z[0]) * 0.05 / 1e-3
    assert origin.effective == pytest.approx(expected, rel=0.01)


@given(st.floats(0.5, 30.0), st.floats(0.5, 6.5), st.floats(0.3, 3.0), st.integers(0, 99))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_bayes_rule_by_hand(x: float, y: float, sigma: float, seed: int) -> None:
    forward = linear(2, 2, noise=0.4, seed=seed)
    some = np.random.default_rng(seed).random(len(forward.pga)) < 0.8  # cells of 0, 1 and 2 runs
    forward = Forward(*(getattr(forward, n)[some] for n in ("start", "pga", "pgv_pga", "end")))
    found = ObservedBoulder((x, y), sigma)
    away = np.hypot(*(forward.end - found.place).T)
    origin = trace(forward, found)
    assert origin.nearest == pytest.approx(away.min())
    assert origin.near == (away <= REACH * sigma).sum()
    assert origin.answered == (origin.near > 0)
    if origin.answered:
        np.testing.assert_allclose(origin.probability, by_hand(forward, found), atol=1e-12)
        assert origin.probability.sum() == pytest.approx(1.0)
        assert origin.weight.sum() == pytest.approx(1.0)
        assert 1.0 - 1e-9 <= origin.effective <= origin.near + 1e-9


def test_order_and_copies_of_runs_do_not_matter() -> None:
    forward, found = linear(2, 2, noise=0.5), ObservedBoulder((6.0, 3.0), 1.0)
    base = trace(forward, found)
    order = np.random.default_rng(5).permutation(len(forward.pga))
    names = ("start", "pga", "pgv_pga", "end")
    mixed = trace(Forward(*(getattr(forward, n)[order] for n in names)), found)
    np.testing.assert_allclose(mixed.probability, base.probability, atol=1e-14)
    np.testing.assert_allclose(mixed.weight, base.weight[order], atol=1e-14)
    assert mixed.effective == pytest.approx(base.effective)
    # one cell computed three times more often is not three times as likely
    again = np.concatenate([np.arange(len(order)), *[np.flatnonzero(forward.pga > 0.55)] * 3])
    copied = trace(Forward(*(getattr(forward, n)[again] for n in names)), found)
    np.testing.assert_allclose(copied.probability, base.probability, atol=1e-14)


def test_runs_that_stay_explain_only_where_they_stand() -> None:
    start, pga, ratio = grid()
    toppled = pga > 0.45
    end = np.where(toppled, 10.0 * pga, 0.0)[:, None] * [1.0, 0.0]
    forward = Forward(start, pga, ratio, end)
    moved = trace(forward, ObservedBoulder((7.0, 0.0), 0.5)).of_motion.sum(axis=0)
    assert (moved[PGA < 0.45] == 0.0).all()
    assert moved[np.isclose(PGA, 0.7)] == pytest.approx(moved.max())
    still = trace(forward, ObservedBoulder((0.2, 0.0), 0.5)).of_motion.sum(axis=0)
    np.testing.assert_allclose(still[PGA < 0.45], 1.0 / (PGA < 0.45).sum())
    assert (still[PGA > 0.45] == 0.0).all()


def test_no_answer_rather_than_a_wrong_one() -> None:
    forward = linear()
    for origin in (
        trace(forward, ObservedBoulder((20.0, 3.0), 1.0)),
        trace(Forward(forward.start, forward.pga, forward.pgv_pga, forward.end * np.nan),
              ObservedBoulder((5.0, 3.0), 1.0)),
    ):  # fmt: skip
        assert not origin.answered
        assert origin.near == 0
        assert origin.effective == 0.0
        assert origin.statement.startswith("No answer: no forward run ends within 3 sigma (3 m)")
        assert np.isnan(origin.probability).all()
        assert math.isnan(origin.association_probability)
        assert not origin.region(0.95).any()
    assert (
        "the nearest ends 10 m away" in trace(forward, ObservedBoulder((20.0, 3.0), 1.0)).statement
    )


def test_few_runs_are_said_to_be_few() -> None:
    forward = linear()
    sparse, rich = (
        trace(forward, ObservedBoulder((5.0, 3.0), 0.2)),
        trace(forward, ObservedBoulder((5.0, 3.0), 2.0)),
    )
    assert sparse.near == 1
    assert sparse.effective == pytest.approx(1.0)
    assert "few" in sparse.statement
    assert rich.effective > 10.0
    assert "few" not in rich.statement


def test_rocks_that_leave_the_terrain_count_against_their_cell() -> None:
    """Two cells, each with four runs; all of one end at the place, half of the other leave."""
    zeros = np.zeros(8)
    end = zeros[:, None] * [1.0, 1.0]
    end[6:] = np.nan
    pga = np.repeat([0.4, 0.8], 4)
    origin = trace(
        Forward(zeros.astype(int), pga, zeros + 0.3, end), ObservedBoulder((0.1, 0.0), 0.5)
    )
    np.testing.assert_allclose(origin.of_motion[0], [2.0 / 3.0, 1.0 / 3.0])
    assert origin.nearest == pytest.approx(0.1)


def test_prior_multiplies() -> None:
    forward, found = linear(2), ObservedBoulder((14.0, 3.0), 4.0)
    plain = trace(forward, found)
    prior = np.random.default_rng(7).random(plain.probability.shape)
    weighed = trace(forward, found, 42.0 * prior)
    expected = plain.probability * prior
    np.testing.assert_allclose(weighed.probability, expected / expected.sum(), atol=1e-14)
    only = np.zeros(prior.shape)
    only[1] = 1.0
    np.testing.assert_allclose(of_start(trace(forward, found, only)), [0.0, 1.0])


def test_prior_that_forbids_what_is_near_gets_no_answer() -> None:
    forward = linear(2)
    prior = np.ones((2, len(RATIO), len(PGA)))
    prior[0] = 0.0
    origin = trace(forward, ObservedBoulder((5.0, 3.0), 1.0), prior)
    assert origin.near > 0
    assert not origin.answered
    assert "no prior probability" in origin.statement
    for bad in (prior[0], -prior, 0.0 * prior):
        with pytest.raises(InvalidInput, match="prior"):
            trace(forward, ObservedBoulder((5.0, 3.0), 1.0), bad)


def test_several_starts_are_told_apart() -> None:
    forward = linear(3)
    for start in range(3):
        origin = trace(forward, ObservedBoulder((20.0 * start + 5.0, 3.0), 1.0))
        assert of_start(origin)[start] == pytest.approx(1.0)
    # halfway between ends of two starts: mirror images, even odds
    zeros = np.zeros(2)
    pair = Forward(np.array([4, 9]), zeros + 0.5, zeros + 0.3, np.array([[-1.0, 0.0], [1.0, 0.0]]))
    origin = trace(pair, ObservedBoulder((0.0, 0.7), 1.0))
    np.testing.assert_array_equal(origin.start, [4, 9])
    np.testing.assert_allclose(of_start(origin), 0.5)


def test_uncertain_identity() -> None:
    """Odds of ours to another: the prior odds times the ratio of the densities at the place."""
    forward, area, before = linear(), 400.0, 0.3
    certain = trace(forward, ObservedBoulder((5.0, 3.0), 1.0))
    origin = trace(forward, ObservedBoulder((5.0, 3.0), 1.0, before, area))
    odds = before / (1.0 - before) * certain.evidence * area
    assert origin.association_probability == pytest.approx(odds / (1.0 + odds))
    flat = np.full(certain.probability.shape, 1.0 / certain.probability.size)
    np.testing.assert_allclose(
        origin.probability,
        origin.association_probability * certain.probability
        + (1.0 - origin.association_probability) * flat,
    )
    assert certain.association_probability == 1.0
    far = trace(forward, ObservedBoulder((50.0, 3.0), 1.0, before, area))
    assert not far.answered
    assert far.association_probability == 0.0


def test_evidence_is_a_density_over_the_ground() -> None:
    """Its integral over all places is 1, whatever the noise of the ends and the cut."""
    forward = linear(1, 2, noise=0.3)
    x, y = np.arange(-4.0, 15.0, 0.3), np.arange(-4.0, 11.0, 0.3)
    total = sum(trace(forward, ObservedBoulder((a, b), 0.8)).evidence for a in x for b in y) * 0.09
    assert total == pytest.approx(1.0, abs=0.005)


def test_smallest_region() -> None:
    forward = linear()
    origin = trace(forward, ObservedBoulder((5.2, 3.1), 1.0))
    region, motion = origin.region(0.8), origin.of_motion
    held = motion[region].sum()
    assert held >= 0.8
    assert held - motion[region].min() < 0.8
    assert motion[region].min() >= motion[~region].max()
    assert trace(forward, ObservedBoulder((20.0, 3.0), 1.0)).region(0.8).sum() == 0


def test_region_does_not_choose_among_equals() -> None:
    """One certain motion of two in three, else any of the four: all hold 95 %, one holds half."""
    zeros = np.zeros(4)
    pga, ratio = np.array([0.4, 0.8, 0.4, 0.8]), np.array([0.2, 0.2, 0.6, 0.6])
    end = np.array([[0.0, 0.0], [9.0, 0.0], [0.0, 9.0], [9.0, 9.0]])
    forward = Forward(zeros.astype(int), pga, ratio, end)
    certain = trace(forward, ObservedBoulder((0.0, 0.0), 1.0))
    area = 2.0 / certain.evidence  # as probable as another rock at even odds times two
    origin = trace(forward, ObservedBoulder((0.0, 0.0), 1.0, 0.5, area))
    np.testing.assert_allclose(origin.of_motion, [[0.75, 1 / 12], [1 / 12, 1 / 12]])
    np.testing.assert_array_equal(origin.region(0.5), [[True, False], [False, False]])
    assert origin.region(0.8).all()


def test_calibrated_by_simulation() -> None:
    """Truths drawn from the prior lie at uniform ranks of their posteriors (Talts et al. 2018).

    The forward model has its own scatter; its runs are a second draw, not the truths themselves.
    """
    sigma, bounce = 0.8, 1.2
    forward = linear(1, 40, noise=bounce, seed=1)
    rng = np.random.default_rng(2)
    ranks = []
    for _ in range(400):
        a, b = rng.integers(len(PGA)), rng.integers(len(RATIO))
        end = np.array([10.0 * PGA[a], 10.0 * RATIO[b]]) + rng.normal(0.0, bounce, 2)
        place = end + rng.normal(0.0, sigma, 2)
        origin = trace(forward, ObservedBoulder((float(place[0]), float(place[1])), sigma))
        if origin.answered:
            marginal = origin.of_motion.sum(axis=0)
            ranks.append(marginal[:a].sum() + rng.random() * marginal[a])
    assert len(ranks) > 390
    assert stats.kstest(ranks, "uniform").pvalue > 0.01
    # and the same runs taken as exact, without their scatter, would not pass
    sure = linear()
    proud = []
    for _ in range(400):
        a, b = rng.integers(len(PGA)), rng.integers(len(RATIO))
        place = np.array([10.0 * PGA[a], 10.0 * RATIO[b]]) + rng.normal(0.0, 1.44, 2)
        origin = trace(sure, ObservedBoulder((float(place[0]), float(place[1])), sigma))
        if origin.answered:
            marginal = origin.of_motion.sum(axis=0)
            proud.append(marginal[:a].sum() + rng.random() * marginal[a])
    assert stats.kstest(proud, "uniform").pvalue < 0.01


def test_posterior_mean_of_the_linear_model_follows_the_place() -> None:
    forward = linear(1, 60, noise=0.5, seed=3)
    for x in (3.0, 5.0, 8.0):
        assert mean_pga(trace(forward, ObservedBoulder((x, 3.5), 0.6))) == pytest.approx(
            x / 10.0, abs=0.015
        )


@pytest.mark.parametrize(
    ("found", "words"),
    [
        ({"place": (0.0, math.nan), "sigma": 1.0}, "finite"),
        ({"place": (0.0, 0.0), "sigma": 0.0}, "above 0"),
        (
            {"place": (0.0, 0.0), "sigma": 1.0, "association_probability": 1.5, "area": 9.0},
            "probability",
        ),
        ({"place": (0.0, 0.0), "sigma": 1.0, "association_probability": 0.5}, "plan area"),
    ],
)
def test_impossible_finds_are_refused(found: dict[str, object], words: str) -> None:
    with pytest.raises(InvalidInput, match=words):
        ObservedBoulder(**found)  # type: ignore[arg-type]


def test_forward_runs_that_are_none_are_refused() -> None:
    one = np.ones(1)
    with pytest.raises(InvalidInput, match="two coordinates"):
        Forward(one.astype(int), one, one, one)
    with pytest.raises(InvalidInput, match="no forward run"):
        Forward(one[:0].astype(int), one[:0], one[:0], np.empty((0, 2)))


def test_bounds_by_hand() -> None:
    """40 runs a PGA: none of 0.1 g come 5 m, one of 0.2 g (2.5 %), two of 0.3 g (5 %), then all."""
    value = np.repeat([0.1, 0.2, 0.3, 0.4], 40)
    distance = np.ones(160)
    distance[40] = distance[80] = distance[81] = 5.0
    distance[120:] = 6.0
    bound = lower_bound(value, distance, 5.0, "pga")
    assert bound.reached == 43
    assert bound.first_run == 0.2
    assert bound.first_ensemble == 0.3
    nothing = lower_bound(value, distance, 6.5, "pga")
    assert nothing.reached == 0
    assert math.isnan(nothing.first_run)
    assert "no run went as far" in nothing.reason


def test_line_is_read_backwards() -> None:
    x = np.repeat(np.linspace(0.2, 1.0, 9), 6)
    exact = lower_bound(x, 10.0 * x - 1.0, 5.0, "pga")
    assert exact.regression == pytest.approx(0.6)
    np.testing.assert_allclose([*exact.of_mean, *exact.of_run], 0.6, atol=1e-6)
    assert exact.reason == ""
    assert "beyond" in lower_bound(x, 10.0 * x - 1.0, 12.0, "pga").reason
    assert "falls" in lower_bound(x, 11.0 - 10.0 * x, 5.0, "pga").reason


def test_interval_holds_what_its_prediction_interval_holds() -> None:
    """At its ends, and only there, the distance is an end of the line's prediction interval."""
    rng = np.random.default_rng(6)
    x = np.repeat(np.linspace(0.2, 1.0, 9), 6)
    y = 10.0 * x + rng.normal(0.0, 1.0, len(x))
    value = np.unique(x)
    mean = np.array([y[x == v].mean() for v in value])
    fit = stats.linregress(value, mean)
    s2 = ((mean - fit.intercept - fit.slope * value) ** 2).sum() / 7
    run2 = ((y - fit.intercept - fit.slope * x) ** 2).sum() / (len(x) - 2)
    bound = lower_bound(x, y, 5.0, "pga")
    for ends, variance in ((bound.of_mean, s2), (bound.of_run, run2)):
        for end in ends:
            leverage = 1.0 / 9.0 + (end - value.mean()) ** 2 / ((value - value.mean()) ** 2).sum()
            half = stats.t.isf(0.025, 7) * math.sqrt(variance + s2 * leverage)
            assert abs(5.0 - fit.intercept - fit.slope * end) == pytest.approx(half)
        assert ends[0] < bound.regression < ends[1]
    assert bound.of_run[0] < bound.of_mean[0]


@pytest.mark.slow
def test_interval_of_a_run_holds_its_shaking_19_times_in_20() -> None:
    rng = np.random.default_rng(9)
    x = np.repeat(np.linspace(0.2, 1.0, 9), 20)
    trials, hits = 800, 0
    for _ in range(trials):
        truth = rng.uniform(0.3, 0.9)
        y = 10.0 * x + rng.normal(0.0, 1.0, len(x))
        bound = lower_bound(x, y, 10.0 * truth + rng.normal(0.0, 1.0), "pga")
        hits += bound.of_run[0] <= truth <= bound.of_run[1]
    # t of few ensembles on a variance of many runs: wider than need be, never narrower
    assert 0.95 - 3.0 * math.sqrt(0.0475 / trials) < hits / trials < 0.995


def test_bounds_that_the_line_does_not_give() -> None:
    x, rng = np.repeat(np.linspace(0.2, 1.0, 9), 6), np.random.default_rng(4)
    flat = lower_bound(x, 5.0 + rng.normal(0.0, 1.0, len(x)), 5.0, "pga")
    assert "slope may be zero" in flat.reason
    assert flat.of_run == (-math.inf, math.inf)
    assert math.isnan(flat.regression)
    few = lower_bound(x[:12], 5.0 + x[:12], 5.2, "pga")
    assert "2 of the 3 ensembles" in few.reason
    assert few.first_run == pytest.approx(0.2)
