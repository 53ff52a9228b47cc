"""Priors, specimens, runs, scores and calibration of the validation against shake-table tests."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from vsr_core import GRAVITY
from vsr_core.errors import InvalidInput
from vsr_core.judge.proofs import barrier
from vsr_core.motions.pulses import CosinePulse
from vsr_core.motions.records.trace import RecordedMotion, Trace
from vsr_core.outcome import Outcome, Response
from vsr_core.rock import solid
from vsr_core.run import cases, overturning, rocking_block
from vsr_core.validation import priors, regression, scores, specimen

Array = NDArray[np.float64]

TESTS = st.lists(st.tuples(st.booleans(), st.booleans()), min_size=1, max_size=60)


# ------------------------------------------------------------------- scores


@settings(max_examples=60, deadline=None)
@given(tests=TESTS)
def test_scores_from_the_four_counts(tests: list[tuple[bool, bool]]) -> None:
    happened, predicted = np.array(tests, dtype=bool).T
    found = scores.scored(happened, predicted, predicted.astype(float))
    assert found.n == len(tests)
    assert found.accuracy == pytest.approx((happened == predicted).mean())
    assert found.brier == pytest.approx((happened != predicted).mean())
    if len(set(happened.tolist())) == 2:
        recalls = [(predicted[happened == side] == side).mean() for side in (False, True)]
        assert found.balanced_accuracy == pytest.approx(np.mean(recalls))
        if len(set(predicted.tolist())) == 2:  # Matthews is the correlation of the two
            phi = np.corrcoef(happened, predicted)[0, 1]
            assert found.matthews == pytest.approx(phi, abs=1e-9)


def test_scores_of_nothing_are_no_numbers() -> None:
    none = np.zeros(0, dtype=bool)
    found = scores.scored(none, none)
    assert found.n == 0
    assert math.isnan(found.accuracy)


def test_log_loss_of_a_sure_mistake_is_finite() -> None:
    found = scores.scored(np.array([True]), np.array([False]), np.array([0.0]))
    assert found.log_loss == pytest.approx(-math.log(scores.SMALLEST_PROBABILITY))


def test_mcnemar_counts_the_tests_on_which_two_differ() -> None:
    happened = np.ones(20, dtype=bool)
    one, other = happened.copy(), happened.copy()
    one[:2] = False
    other[2:12] = False
    # two of twelve: 2 (1 + 12 + 66) / 2^12
    assert scores.mcnemar(happened, one, other) == pytest.approx(158 / 4096)
    assert scores.mcnemar(happened, one, one) == 1.0


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), count=st.integers(5, 200))
def test_the_limit_of_a_prediction_is_the_best_for_right_probabilities(
    seed: int, count: int
) -> None:
    """Expected balanced accuracy, computed for every limit, is largest at the mean."""
    probability = np.random.default_rng(seed).beta(0.6, 0.9, count)
    chosen = scores.predicted_to_overturn(probability)

    def expected(sides: NDArray[np.bool_]) -> float:
        right = probability[sides].sum() / probability.sum()
        return 0.5 * float(right + (1 - probability)[~sides].sum() / (1 - probability).sum())

    for limit in probability:
        assert expected(probability >= limit) <= expected(chosen) + 1e-12


@pytest.mark.parametrize("count", [1, 3, 5, 10])
@pytest.mark.parametrize(
    ("share", "overturns"), [(0.0, False), (0.1, False), (0.35, False), (0.7, True)]
)
def test_tests_that_are_all_alike_are_predicted_by_one_half(
    count: int, share: float, overturns: bool
) -> None:
    assert scores.predicted_to_overturn(np.full(count, share)).tolist() == [overturns] * count


def test_a_test_at_the_mean_is_not_predicted_to_overturn() -> None:
    chosen = scores.predicted_to_overturn(np.array([0.0, 0.25, 0.5]))
    assert chosen.tolist() == [False, False, True]


def test_reliability_has_every_test_once() -> None:
    rng = np.random.default_rng(3)
    probability = rng.uniform(size=4000)
    happened = rng.uniform(size=4000) < probability
    found = scores.reliability(happened, probability, 5)
    assert found.count.sum() == 4000
    assert float(found.count @ found.predicted) == pytest.approx(probability.sum())
    assert float(found.count @ found.observed) == pytest.approx(happened.sum())
    assert ((found.low < found.predicted) & (found.predicted < found.high)).all()


# ------------------------------------------------------------------- other predictors, calibration


def test_a_motion_is_predicted_without_its_own_tests() -> None:
    """Outcomes that only the motion's name tells cannot be predicted better than by chance."""
    rng = np.random.default_rng(0)
    motions = np.repeat([f"motion {k}" for k in range(60)], 10)
    happened = np.repeat(rng.uniform(size=60) < 0.5, 10)
    names = np.repeat(rng.normal(size=(60, 8)), 10, axis=0)  # eight numbers that know the motion
    probability = regression.logistic(names, happened, motions)
    assert np.mean((probability >= 0.5) == happened) < 0.65
    seen = happened[:, None] + 0.25 * rng.normal(size=(600, 1))
    told = regression.logistic(seen, happened, motions)
    assert np.mean((told >= 0.5) == happened) > 0.95


@pytest.mark.parametrize("cut", [0.15, 0.45, 0.85])
def test_outcomes_that_are_divided_have_no_regression(cut: float) -> None:
    """The likelihood rises without end with the slope: wherever a solver stops says nothing."""
    share = np.tile(np.arange(11) / 10, 3)
    motions, count = np.array([f"m{k}" for k in range(33)]), np.full(33, 10.0)
    divided, mixed = share > cut, (share > cut) != (np.arange(33) < 11)
    for happened, known in ((divided, False), (mixed, True)):
        found = scores.scored(happened, share > 0.5, share)
        assert [math.isfinite(found.intercept), math.isfinite(found.slope)] == [known] * 2
        assert regression.calibrate(10.0 * share, count, happened).known == known
        told = regression.logistic(share[:, None], happened, motions)
        assert np.isfinite(told).all() == known
    level = np.full(33, 0.3)  # of one probability there is no slope
    assert math.isnan(scores.scored(divided, level > 0.5, level).slope)


def test_a_motion_is_on_one_half_whatever_its_tests() -> None:
    names = np.array([f"RSN{k}" for k in range(400)])
    half = regression.first_half(names)
    order = np.random.default_rng(1).permutation(400)
    np.testing.assert_array_equal(regression.first_half(names[order]), half[order])
    assert 0.4 < half.mean() < 0.6


def test_calibration_finds_what_made_the_outcomes() -> None:
    rng = np.random.default_rng(5)
    members = np.full(20_000, 20.0)
    overturned = rng.integers(0, 21, 20_000).astype(float)
    true = regression.Calibration(0.8, 0.6, 0)
    happened = rng.uniform(size=20_000) < true.probability(overturned, members)
    found = regression.calibrate(overturned, members, happened)
    assert found.intercept == pytest.approx(0.8, abs=0.08)
    assert found.slope == pytest.approx(0.6, abs=0.04)
    assert found.tests == 20_000


@pytest.mark.parametrize("spread", [2.0, 0.5, 0.03, 0.001])
def test_a_regression_is_the_likeliest_however_little_its_score_varies(spread: float) -> None:
    """As Newton's method finds it on the score less its mean, in units of its spread."""
    rng = np.random.default_rng(11)
    unit = rng.normal(size=60)
    unit = (unit - unit.mean()) / unit.std()
    happened = rng.uniform(size=60) < 1.0 / (1.0 + np.exp(-0.5 - 2.0 * unit))
    design, beta = np.column_stack([np.ones(60), unit]), np.zeros(2)
    for _ in range(30):
        chance = 1.0 / (1.0 + np.exp(-design @ beta))
        information = design.T @ (design * (chance * (1.0 - chance))[:, None])
        beta += np.linalg.solve(information, design.T @ (happened - chance))
    intercept, slope = regression.regressed(3.0 + spread * unit, happened)
    assert slope * spread == pytest.approx(beta[1], rel=1e-6)
    assert intercept + 3.0 * slope == pytest.approx(beta[0], rel=1e-6)


def test_of_outcomes_that_are_all_alike_there_is_no_calibrated_probability() -> None:
    counts, members = np.array([1.0, 5.0, 9.0]), np.full(3, 10.0)
    found = regression.calibrate(counts, members, np.ones(3, dtype=bool))
    assert not found.known
    assert np.isnan(found.probability(counts, members)).all()


@pytest.mark.slow
def test_curve_finds_the_fragility_that_made_the_outcomes() -> None:
    rng = np.random.default_rng(2)
    intensity = rng.uniform(0.05, 1.0, 4000)
    from scipy.stats import norm

    happened = rng.uniform(size=4000) < norm.cdf(np.log(intensity / 0.3) / 0.4)
    motions = np.array([f"m{k % 40}" for k in range(4000)])
    at = np.array([0.15, 0.3, 0.6])
    found = scores.curve(intensity, happened.astype(float), motions, at)
    assert found.median == pytest.approx(0.3, rel=0.05)
    exact = norm.cdf(np.log(at / 0.3) / 0.4)
    assert ((found.low <= exact + 0.02) & (exact - 0.02 <= found.high)).all()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("first", "tests"),
    [
        *((k, [0.1, 0.14, 0.18, 0.22, 0.24, 0.26, 0.3, 0.35, 0.4, 0.5]) for k in range(1, 10)),
        (9, [0.05] * 8 + [0.8, 0.9, 1.0, 1.1, 1.2]),
        (6, [0.02, 0.03, 0.04, 0.05, 0.06, 0.9, 1.0, 1.1]),
        (3, [0.001, 0.0011, 0.0012, 1.0, 1.1, 30.0, 31.0]),
    ],
)
def test_the_median_of_separated_outcomes_is_between_them(first: int, tests: list[float]) -> None:
    """All tests from one intensity on overturned: the curve is a step between it and the last."""
    intensity = np.array(tests)
    happened = (np.arange(len(tests)) >= first).astype(float)
    motions = np.arange(len(tests)).astype(str)
    found = scores.curve(intensity, happened, motions, intensity)
    assert intensity[first - 1] < found.median < intensity[first]
    np.testing.assert_array_equal(found.probability > 0.5, happened == 1)


def test_a_curve_does_not_fall_and_is_level_at_the_share_that_overturned() -> None:
    intensity = np.geomspace(0.1, 0.5, 10)
    happened = (np.arange(10) < 3).astype(float)
    found = scores.curve(intensity, happened, intensity.astype(str), intensity)
    assert (np.diff(found.probability) > 0).all()
    np.testing.assert_allclose(found.probability, 0.3, atol=0.03)


# ------------------------------------------------------------------- priors


def test_draws_fill_the_priors() -> None:
    """An azimuth known to 100 degrees: many draws turn far about, few of them are reversed."""
    given = priors.Priors((0.3, math.radians(100.0)), 0.25, restitution=(0.1, 0.4))
    members = priors.draws(given, 256)
    assert np.mean([m.reversed for m in members]) == pytest.approx(
        given.polarity_reversal_probability, abs=0.01
    )
    azimuth = [m.azimuth for m in members]
    back = [abs(m.direction - m.azimuth) > 3.0 for m in members]
    assert back == [m.reversed for m in members]
    assert np.mean(azimuth) == pytest.approx(given.azimuth[0], abs=0.01)
    assert np.std(azimuth) == pytest.approx(given.azimuth[1], rel=0.05)
    for name in ("friction", "restitution", "mixing"):
        low, high = getattr(given, name)
        values = np.array([getattr(m, name) for m in members])
        assert ((low <= values) & (values <= high)).all()
        assert values.mean() == pytest.approx(0.5 * (low + high), abs=0.01)
    centre = np.array([m.centre for m in members])
    np.testing.assert_allclose(centre.std(axis=0), given.centre, rtol=0.05)
    assert len({m.seed for m in members}) == 256


@pytest.mark.parametrize("replica", [False, True])
def test_an_extreme_changes_one_unknown(replica: bool) -> None:
    pairs = priors.extremes(priors.Priors(), replica=replica)
    assert "restitution" not in pairs  # it has no range
    assert ("mixing of the scans" in pairs, "error of the base" in pairs) == (replica, not replica)
    changed = []
    for low, high in pairs.values():
        names = [k for k, value in vars(low).items() if not np.array_equal(value, vars(high)[k])]
        assert len(names) == 1
        changed += names
    expected = {
        "azimuth",
        "reversed",
        "friction",
        "amplitude",
        "centre",
        "mixing" if replica else "seed",
    }
    assert set(changed) == expected


# ------------------------------------------------------------------- specimens


@cache
def rough() -> trimesh.Trimesh:
    """A rough boulder that stands on three points."""
    body = trimesh.creation.icosphere(subdivisions=3, radius=0.35)
    vertices = np.array(body.vertices) * [1.0, 0.8, 1.1]
    vertices[:, 2] = np.maximum(vertices[:, 2], -0.25)
    vertices *= 1.0 + 0.02 * np.sin(vertices @ [[9.0], [7.0], [11.0]])
    return trimesh.Trimesh(vertices, body.faces, process=False)


def plain(**changes: object) -> priors.Member:
    """A member with nothing uncertain."""
    member = replace(priors.best_guess(priors.Priors()), mixing=0.0, azimuth=0.0)
    return replace(member, **changes)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("origin", "turned"),
    [
        pytest.param((0.004, -0.003, 0.002), 0.01, marks=pytest.mark.slow),
        pytest.param((40.0, -25.0, 10.0), 0.01, marks=pytest.mark.slow),
        ((-20.0, 30.0, 5.0), 2.5),
    ],
)
def test_a_form_scanned_twice_is_known_as_such(
    origin: tuple[float, float, float], turned: float
) -> None:
    other, noise = rough().copy(), 0.001
    other.vertices = other.vertices + noise * np.random.default_rng(3).normal(
        size=(len(other.vertices), 3)
    )
    other.apply_transform(trimesh.transformations.rotation_matrix(turned, [0, 0, 1]))
    other.apply_translation(origin)
    found = specimen.form(rough(), other)
    assert found.replica
    assert found.error == pytest.approx(noise / np.sqrt(2.0), rel=0.3)
    assert found.spread == 0.0
    alone = specimen.form(rough(), None)
    assert not alone.replica
    assert alone.spread == specimen.SCAN_ERROR
    assert not specimen.form(rough(), trimesh.creation.box([0.5, 0.5, 1.0])).replica


def test_one_scan_saved_twice_is_no_replica() -> None:
    scan = rough()
    order = np.random.default_rng(4).permutation(len(scan.vertices))
    turned = trimesh.Trimesh(
        scan.vertices[order].astype(np.float32), np.argsort(order)[scan.faces], process=False
    )
    moved = scan.copy()
    moved.apply_transform(trimesh.transformations.rotation_matrix(0.5, [0, 0, 1]))
    moved.apply_translation([0.004, -0.003, 0.002])
    for other in (scan, turned, moved):
        found = specimen.form(scan, other)
        assert not found.replica
        assert found.spread == specimen.SCAN_ERROR


def test_error_of_two_scans_is_the_noise_of_each() -> None:
    rng = np.random.default_rng(4)
    noise = 0.002
    scans = []
    for _ in range(2):
        normals = np.array(rough().vertex_normals)
        moved = np.array(rough().vertices) + noise * rng.normal(size=(len(normals), 1)) * normals
        scans.append(trimesh.Trimesh(moved, rough().faces, process=False))
    assert specimen.form(*scans).error == pytest.approx(noise, rel=0.3)


def test_a_draw_without_doubt_is_the_scan() -> None:
    drawn = specimen.drawn(specimen.form(rough(), None), plain(), 2700.0)
    exact = solid.from_mesh(rough(), 2700.0).rock
    assert drawn.mass == pytest.approx(exact.mass)
    np.testing.assert_allclose(drawn.inertia, exact.inertia)
    np.testing.assert_allclose(drawn.vertices, exact.vertices)


def test_a_base_drawn_in_to_nothing_is_the_fault_of_the_inset() -> None:
    """Unless the scan lies on its side: then it does not stand without the inset either."""
    form = specimen.form(rough(), None)
    with pytest.raises(InvalidInput, match=r"drawn in by 0\.9 .*; reduce inset \(uncertainty"):
        specimen.drawn(form, plain(inset=0.9), 2700.0)
    edge = trimesh.creation.box([0.4, 0.4, 0.9])
    edge.apply_transform(trimesh.transformations.rotation_matrix(0.7, [1, 0, 0]))
    for inset in (0.0, 0.5):
        with pytest.raises(InvalidInput, match="turn the scan"):
            specimen.drawn(specimen.form(edge, None), plain(inset=inset), 2700.0)


def test_a_centre_of_mass_out_of_the_rock_or_its_base_is_told() -> None:
    form = specimen.form(rough(), None)
    for centre in (10.0, 0.9 * np.abs(form.vertices[:, 0]).max()):
        with pytest.raises(
            InvalidInput, match=r"does not stand in any .* or reduce centre_of_mass"
        ):
            specimen.drawn(form, plain(centre=np.array([centre, 0.0, 0.0])), 2700.0)


def test_a_shift_of_the_centre_moves_the_base_against_it() -> None:
    form = specimen.form(rough(), None)
    high = specimen.drawn(form, plain(centre=np.array([0.0, 0.0, 0.01])), 2700.0)
    assert high.height - specimen.drawn(form, plain(), 2700.0).height == pytest.approx(
        0.01, abs=1e-3
    )


# ------------------------------------------------------------------- runs


@cache
def block() -> trimesh.Trimesh:
    return trimesh.creation.box([0.25, 0.4, 0.75])


def pulse(pga: float, ratio: float, interval: float = 0.005) -> Array:
    """Acceleration of a cosine pulse, sampled."""
    motion = CosinePulse.from_g(pga, ratio)
    return motion.acceleration(np.arange(0.0, motion.duration + interval, interval))


def recorded(acceleration: Array) -> RecordedMotion:
    return RecordedMotion(Trace(acceleration, 0.005))


def test_a_rock_that_is_one_of_its_ensemble_is_rarely_found_uncalibrated() -> None:
    """Rocks with limits of their own in 40 tests; one far weaker than the ensemble is found."""
    rng = np.random.default_rng(8)
    pga = np.linspace(0.2, 0.8, 40)
    p, independent = [], []
    for _ in range(200):
        limits = rng.normal(0.5, 0.08, 65)
        sides = (pga >= limits[:, None]).astype(np.int64)
        truth, members = sides[0] == 1, sides[1:]
        p.append(scores.chance_of_z(truth, members))
        share = np.clip(members.mean(axis=0), 0.01, 0.99)
        independent.append(abs(scores.spiegelhalter(truth, share)) > 1.96)
    assert np.mean(np.array(p) <= 0.05) < 0.1
    assert np.mean(np.array(p) <= 0.5) == pytest.approx(0.5, abs=0.15)
    assert np.mean(independent) > 0.1  # tests of one rock are not independent
    weak = (pga >= rng.normal(0.6, 0.02, (64, 1))).astype(np.int64)
    assert scores.chance_of_z(pga >= 0.4, weak) <= 0.05


def test_probabilities_that_come_true_are_found_calibrated() -> None:
    """Spiegelhalter's z is a standard normal number; with bolder probabilities it is not."""
    rng = np.random.default_rng(3)
    true = rng.uniform(0.02, 0.98, 400)
    outcomes = [rng.random(400) < true for _ in range(400)]
    z = np.array([scores.spiegelhalter(one, true) for one in outcomes])
    assert abs(z.mean()) < 4.0 / math.sqrt(len(z))
    assert z.std() == pytest.approx(1.0, abs=0.15)
    odds = np.log(true / (1.0 - true))
    bold = 1.0 / (1.0 + np.exp(-2.0 * odds))
    assert np.mean([abs(scores.spiegelhalter(one, bold)) > 1.96 for one in outcomes]) > 0.9
    found = scores.scored(np.concatenate(outcomes), np.tile(true > 0.5, 400), np.tile(bold, 400))
    assert found.slope == pytest.approx(0.5, abs=0.01)
    assert found.intercept == pytest.approx(0.0, abs=0.02)


@cache
def housner() -> float:
    """First overturning PGA [g] of the block."""
    rigid = rocking_block.Block(0.125, 0.375)
    return rocking_block.first_overturning_pga(rigid, 0.3, 2.0 * GRAVITY, 0.02 * GRAVITY) / GRAVITY


def shake_block(pga: float, azimuth: float = 0.0, turn: float = 0.0) -> bool:
    mesh = block().copy()
    mesh.apply_transform(trimesh.transformations.rotation_matrix(turn, [0, 0, 1]))
    member = plain(azimuth=azimuth, friction=2.0)
    rock = specimen.drawn(specimen.form(mesh, None), member, 2700.0)
    case = specimen.standing_case(rock, barrier(rock), member)
    (found,) = specimen.shaken(case, [recorded(pulse(pga, 0.3))])
    return found.outcome.overturned == 1


def test_a_block_topples_where_housner_says() -> None:
    limit = housner()
    assert not shake_block(0.97 * limit)
    assert shake_block(1.03 * limit)


@pytest.mark.parametrize("turn", [0.4, 2.0])
def test_a_turned_specimen_under_a_turned_drive(turn: float) -> None:
    limit = housner()
    for share, side in ((0.96, False), (1.04, True)):
        assert shake_block(share * limit, azimuth=turn, turn=turn) is side


def test_amplitude_scales_the_motion() -> None:
    member = plain(friction=2.0)
    rock = specimen.drawn(specimen.form(block(), None), member, 2700.0)
    case = specimen.standing_case(rock, barrier(rock), member)
    weak, strong = recorded(pulse(0.3, 0.1)), recorded(2.5 * pulse(0.3, 0.1))
    (one,) = specimen.shaken(case, [specimen.amplified(weak, 2.5)])
    (other,) = specimen.shaken(case, [strong])
    assert one.peak_tilt == pytest.approx(other.peak_tilt, rel=1e-6)
    assert one.peak_tilt > 0.0


def test_rests_are_passed_over_without_a_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pulses with rests between them: tilts within those of whole runs, in far fewer steps.

    The tilt after a rest hangs on where in its steps the engine is when the push comes, so that
    whole runs with longer and shorter rests differ by some percent from each other.
    """
    member = plain(friction=2.0)
    rock = specimen.drawn(specimen.form(block(), None), member, 2700.0)
    case = specimen.standing_case(rock, barrier(rock), member)
    chosen = cases.Settings(5e-4)

    def runs() -> list[Response]:
        found = []
        for count in (400, 800, 1600):
            rest = np.zeros(count)
            parts = [pulse(0.5, 0.05), rest, pulse(0.6, 0.05), rest, pulse(0.4, 0.08)]
            motion = RecordedMotion(Trace(np.concatenate(parts), 0.005))
            found.append(overturning.simulate(case, motion, chosen))
        return found

    short = runs()
    monkeypatch.setattr(overturning, "_pass_over_rest", lambda run: None)
    whole = runs()
    tilts = [run.peak_tilt for run in whole]
    for run in short:
        assert 0.98 * min(tilts) <= run.peak_tilt <= 1.02 * max(tilts)
    assert min(tilts) > 0.05
    assert {run.outcome for run in (*short, *whole)} == {Outcome.BALANCED}
    assert sum(run.steps for run in short) < 0.5 * sum(run.steps for run in whole)
