"""What is learnt from tests is right: of made rocks with hidden bases, and in any order."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import norm

from vsr_core.arrays import Array
from vsr_core.observations import field_tests, weighing
from vsr_core.rock.body import Rock
from vsr_core.rock.tipping import tipping
from vsr_core.validation import priors
from vsr_core.validation.specimen import drawn, form

DIRECTIONS = np.radians(np.arange(0.0, 360.0, 30.0))

LIKELY = arrays(np.float64, (3, 20), elements=st.floats(-50.0, 0.0))

WEIGHTS = arrays(np.float64, 20, elements=st.floats(1e-6, 1.0))

TRUTHS, DRAWS = 100, 600


@pytest.fixture(scope="module")
def made() -> tuple[list[Rock], Array]:
    """Rocks with a drawn base and centre of mass, and their slopes; the last are the truths."""
    solid = trimesh.creation.cylinder(0.35, 1.2, sections=24)
    solid = trimesh.Trimesh(*trimesh.remesh.subdivide(solid.vertices, solid.faces))
    solid.vertices[:, 0] *= 0.8
    shape = form(solid, None, 0.004, 0.1)
    known = priors.Priors((0.0, 0.0), 0.0, (0.5, 0.9), centre=0.02)
    every = priors.draws(known, DRAWS + TRUTHS)
    order = np.random.default_rng(5).permutation(DRAWS + TRUTHS)
    rocks = [drawn(shape, every[number], 2600.0) for number in order.tolist()]
    return rocks, np.array([tipping(rock.hull, DIRECTIONS).overturning for rock in rocks])


def observed(rocks: list[Rock], slopes: Array, truth: int) -> Array:
    """Log likelihoods of a tilt test in the weak direction, one that stood, and a push."""
    rng = np.random.default_rng(truth)
    weak = int(slopes[:DRAWS].mean(axis=0).argmin())
    far = np.full(DRAWS, 90.0)
    angles = np.degrees(np.arctan(slopes))
    tipped = angles[truth, weak] + 0.4 * rng.normal()
    across = (weak + 3) % 12
    stood = float(np.quantile(angles[:DRAWS, across], 0.3))
    stands = stood < angles[truth, across] + 0.4 * rng.normal()
    forces = np.array(
        [
            field_tests.push_force(rock.mass, slope, 9.0, rock.height, 0.9).tips
            for rock, slope in zip(rocks, slopes[:, (weak + 6) % 12].tolist(), strict=True)
        ]
    )
    sd = 0.05 * float(forces.mean())
    pushed = forces[truth] + sd * rng.normal()
    own = weighing.of_threshold(stood, 0.4, angles[:DRAWS, across], far, moved=False)
    return np.array(
        [
            weighing.of_threshold(tipped, 0.4, angles[:DRAWS, weak], far, moved=True),
            own if stands else np.log(np.maximum(-np.expm1(own), 1e-30)),
            weighing.of_threshold(pushed, sd, forces[:DRAWS], np.full(DRAWS, 1e9), moved=True),
        ]
    )


@pytest.mark.slow
def test_the_band_holds_the_truth_of_made_rocks(made: tuple[list[Rock], Array]) -> None:
    """Of 100 rocks with hidden bases, 84 to 95 lie in the 90 % band, in the median direction."""
    rocks, slopes = made
    inside = []
    for truth in range(DRAWS, DRAWS + TRUTHS):
        weight = weighing.weights(observed(rocks, slopes, truth))
        low, _, high = weighing.quantiles(slopes[:DRAWS], weight)
        inside.append((low <= slopes[truth]) & (slopes[truth] <= high))
    assert 84 <= np.median(np.sum(inside, axis=0)) <= 95


@pytest.mark.slow
def test_one_tilt_test_in_the_weak_direction_halves_the_band_there(
    made: tuple[list[Rock], Array],
) -> None:
    rocks, slopes = made
    weak = int(slopes[:DRAWS].mean(axis=0).argmin())
    ln = np.log(slopes[:DRAWS])
    alike = np.full(DRAWS, 1.0 / DRAWS)
    before = weighing.width(ln, alike)[weak]
    after = [
        weighing.width(ln, weighing.weights(observed(rocks, slopes, truth)[:1]))[weak]
        for truth in range(DRAWS, DRAWS + TRUTHS)
    ]
    assert np.mean(np.array(after) <= 0.5 * before) > 0.95


@pytest.mark.slow
def test_what_a_test_is_expected_to_teach_is_what_it_teaches_on_average(
    made: tuple[list[Rock], Array],
) -> None:
    """Of the truths, drawn as the draws are, tilted with the same error."""
    _, slopes = made
    ln, angles = np.log(slopes), np.degrees(np.arctan(slopes))
    alike = np.full(DRAWS, 1.0 / DRAWS)
    expected = weighing.expected_widths(ln[:DRAWS], angles[:DRAWS], alike, 0.4)
    weak = int(slopes[:DRAWS].mean(axis=0).argmin())
    found = []
    for truth in range(DRAWS, DRAWS + TRUTHS):
        far = np.full(DRAWS, 90.0)
        own = weighing.of_threshold(angles[truth, weak], 0.4, angles[:DRAWS, weak], far, moved=True)
        found.append(weighing.width(ln[:DRAWS], weighing.weights(own[None])))
    now = weighing.width(ln[:DRAWS], alike)
    np.testing.assert_allclose(expected[weak] / now, np.mean(found, axis=0) / now, atol=0.08)


@given(LIKELY, st.permutations(range(3)))
def test_the_order_of_observations_does_not_matter(likely: Array, order: list[int]) -> None:
    np.testing.assert_array_equal(weighing.weights(likely), weighing.weights(likely[order]))


@given(WEIGHTS, st.integers(1, 50))
def test_draws_stand_for_their_weights_to_within_one(weight: Array, count: int) -> None:
    taken = np.bincount(weighing.resampled(weight, count), minlength=20)
    assert taken.sum() == count
    assert np.abs(taken - count * weight / weight.sum()).max() < 1.0 + 1e-9


@given(WEIGHTS)
def test_equal_weights_give_the_quantiles_of_the_values(values: Array) -> None:
    found = weighing.quantiles(values[:, None], np.full(20, 0.05))[:, 0]
    np.testing.assert_allclose(found, np.quantile(values, weighing.BAND, method="weibull"))


def test_a_normal_prior_and_test_give_the_product_of_both() -> None:
    """Conjugate: the mean is weighed by the inverse variances."""
    tips = 10.0 + 2.0 * norm.ppf((np.arange(20_000) + 0.5) / 20_000)
    likely = weighing.of_threshold(13.0, 1.0, tips, np.full(20_000, 1e3), moved=True)
    weight = weighing.weights(likely[None])
    mean = weight @ tips
    assert mean == pytest.approx(10.0 + 3.0 * 4.0 / 5.0, abs=0.01)
    assert math.sqrt(weight @ (tips - mean) ** 2) == pytest.approx(math.sqrt(0.8), rel=0.01)


def test_a_rock_that_slides_first_was_not_seen_to_tip() -> None:
    """At a friction below the tangent of the angle the draw is unlikely, whatever its base."""
    tips, slides = np.full(2, 20.0), np.array([15.0, 25.0])
    low, high = weighing.of_threshold(20.0, 1.0, tips, slides, moved=True)
    assert low < weighing.LEAST < high
