"""One earthquake and a rock: closed forms for a rock that topples from a PGA on, and draws."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import norm

from vsr_core.arrays import Array
from vsr_core.hazard import scenarios
from vsr_core.hazard.ratio import PGA, PGV

RATIOS = np.geomspace(0.03, 0.5, 9)
LIMIT = 2.5
BORDERS = np.geomspace(LIMIT / 100.0, LIMIT * 100.0, 401)  # the limit is the middle one
MAGNITUDES, DISTANCES = np.array([5.2, 6.5, 7.4]), np.array([4.0, 15.0, 60.0])


def brittle(level: Array) -> Array:
    """Topples from one PGA on, whatever PGV."""
    return np.tile(level > LIMIT, (len(RATIOS), 1)).astype(float)


def slow(level: Array) -> Array:
    """Topples where PGA and PGV are both large, straight in logarithms."""
    return norm.cdf(np.log(level / 2.0) + 0.8 * np.log(RATIOS[:, None] / 0.1))


def test_a_rock_that_topples_from_a_pga_on_has_the_tail_of_the_ground_motion() -> None:
    shaking = scenarios.of_equations(MAGNITUDES, DISTANCES)
    (found,) = scenarios.toppling_chance(shaking, RATIOS, [brittle], BORDERS)
    wanted = norm.sf(np.log(LIMIT), PGA.log_median(MAGNITUDES, DISTANCES), PGA.log_sd)
    np.testing.assert_allclose(found, wanted, rtol=1e-12)


def test_all_shaking_is_in_one_row_and_part() -> None:
    shaking = scenarios.of_equations(MAGNITUDES, DISTANCES)
    levels, share = scenarios.shares(shaking, RATIOS, BORDERS)
    assert share.shape == (3, len(RATIOS), len(levels))
    np.testing.assert_allclose(share.sum(axis=(1, 2)), 1.0, rtol=1e-12)


def test_peaks_drawn_together_topple_as_often() -> None:
    rng, number, rho = np.random.default_rng(3), 400_000, scenarios.CORRELATION
    shaking = scenarios.of_equations(MAGNITUDES, DISTANCES)
    (found,) = scenarios.toppling_chance(shaking, RATIOS, [slow], scenarios.parts_between(0.01, 99))
    for i, (magnitude, distance) in enumerate(zip(MAGNITUDES, DISTANCES, strict=True)):
        own = np.array([magnitude]), np.array([distance])
        residual = rng.multivariate_normal([0.0, 0.0], [[1.0, rho], [rho, 1.0]], number)
        pga = np.exp(PGA.log_median(*own) + PGA.log_sd * residual[:, 0])
        pgv = np.exp(PGV.log_median(*own) + PGV.log_sd * residual[:, 1])
        row = np.abs(np.log(pgv / pga)[:, None] - np.log(RATIOS)).argmin(axis=1)
        chance = norm.cdf(np.log(pga / 2.0) + 0.8 * np.log(RATIOS[row] / 0.1))
        assert found[i] == pytest.approx(
            chance.mean(), abs=4.0 * chance.std() / np.sqrt(number) + 1e-4 * chance.mean()
        )


def test_the_nearest_earthquake_is_where_the_median_is_the_limit() -> None:
    distances = np.geomspace(1.0, 200.0, 300)
    magnitudes = np.array([4.0, 6.0, 7.0])
    toppled = np.array(
        [
            scenarios.toppling_chance(
                scenarios.of_equations(np.full(300, one), distances), RATIOS, [brittle], BORDERS
            )[0]
            for one in magnitudes
        ]
    )

    def excess(distance: float, magnitude: float) -> float:
        own = np.array([magnitude]), np.array([distance])
        return float(PGA.log_median(*own)[0] - np.log(LIMIT))

    found = scenarios.nearest(distances, toppled, 0.5)
    assert found[0] == 0.0  # its median is below the limit at any distance
    for one, near in zip(magnitudes[1:], found[1:], strict=True):
        assert near == pytest.approx(brentq(excess, 1.0, 200.0, (one,)), rel=1e-3)
    assert scenarios.nearest(distances[:5], toppled[2:, :5], 0.5).tolist() == [np.inf]


def test_a_table_of_the_equations_is_them_at_its_places_and_its_ends_beyond() -> None:
    magnitudes, distances = np.array([5.0, 6.0, 7.5]), np.array([2.0, 10.0, 90.0])
    m, r = (one.ravel() for one in np.meshgrid(magnitudes, distances, indexing="ij"))
    wanted = scenarios.of_equations(m, r)
    columns = [wanted.pga, wanted.pga_sd, wanted.pgv, wanted.pgv_sd]
    table = scenarios.GroundMotionTable(
        magnitudes, distances, np.stack(columns, axis=1).reshape(3, 3, 4)
    )
    found = table.at(m, r)
    np.testing.assert_allclose(found.pga, wanted.pga, rtol=1e-12)
    np.testing.assert_allclose(found.pgv, wanted.pgv, rtol=1e-12)
    beyond, end = (
        table.at(np.array([8.0]), np.array([0.0])),
        table.at(np.array([7.5]), np.array([2.0])),
    )
    assert (beyond.pga[0], beyond.pgv_sd[0]) == (end.pga[0], end.pgv_sd[0])
    middle = table.at(np.array([5.5]), np.array([np.sqrt(20.0)]))
    corners = wanted.pga.reshape(3, 3)[:2, :2]
    assert middle.pga[0] == pytest.approx(corners.mean(), rel=1e-12)


def test_what_is_unknown_of_a_rock_stays_as_it_is() -> None:
    chances, rates = np.array([[0.5, 0.2], [0.1, 0.0]]), np.array([0.001, 0.01])
    found = scenarios.survival(chances, rates, np.array([1000.0]))
    np.testing.assert_allclose(found, np.exp([-0.5 - 2.0, -0.1]), rtol=1e-12)
    ages = np.array([500.0, 1500.0])
    two = scenarios.survival(chances[1:], rates, ages)
    assert two[0] == pytest.approx((np.exp(-0.05) + np.exp(-0.15)) / 2.0, rel=1e-12)
