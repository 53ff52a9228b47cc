"""PGV/PGA at a PGA: from two curves, and from earthquakes drawn with both measures."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vsr_core import GRAVITY
from vsr_core.errors import InvalidInput
from vsr_core.hazard import ratio
from vsr_core.hazard.curve import HazardCurve
from vsr_core.hazard.ratio import (
    CORRELATION,
    PGA,
    PGV,
    RatioTable,
    ratio_of_curves,
    ratios_of_scenarios,
)


def test_the_ratio_of_curves_is_where_both_are_as_rare() -> None:
    a = np.geomspace(0.01, 20.0, 30)
    pga, pgv = HazardCurve(a, 1e-3 * a**-2.0), HazardCurve(0.1 * a, 1e-3 * a**-2.0)
    medians, log_sds = ratio_of_curves(pga, pgv, 0.4).at(np.array([1e-3, 1.0, 99.0]))
    np.testing.assert_allclose(medians, 0.1)
    np.testing.assert_allclose(log_sds, 0.4)
    steeper = HazardCurve(0.1 * a, 1e-3 * a**-4.0)
    # 0.1 a' with a'^-4 = a^-2, so that the ratio is 0.1 a^-1/2.
    found, _ = ratio_of_curves(pga, steeper, 0.4).at(np.array([0.5, 2.0]))
    np.testing.assert_allclose(found, 0.1 * np.array([0.5, 2.0]) ** -0.5, rtol=1e-3)


def test_medians_are_those_of_openquake() -> None:
    """Of AkkarBommer2010 in OpenQuake 3.26.2, on rock and for strike-slip [g] and [cm/s]."""
    m, r = np.array([6.5, 5.25, 7.25]), np.array([10.0, 25.0, 60.0])
    pga = [0.22282695103348046, 0.03787513516251964, 0.06738073066366443]
    pgv = [17.182547858133532, 1.496646376443136, 7.721197061783773]
    np.testing.assert_allclose(np.exp(PGA.log_median(m, r)) / GRAVITY, pga, rtol=1e-9)
    np.testing.assert_allclose(100.0 * np.exp(PGV.log_median(m, r)), pgv, rtol=1e-9)
    assert (PGA.log_sd, PGV.log_sd) == pytest.approx((0.64851429, 0.64046366), rel=1e-6)


def test_ratios_are_those_of_earthquakes_drawn_with_both_measures() -> None:
    """Draw magnitude, then PGA and PGV together, and keep those near a PGA.

    The shares at that PGA are Bayes': the prior times the density of the PGA.
    """
    rng, number = np.random.default_rng(7), 2_000_000
    m, r, prior = np.array([5.5, 7.2]), np.array([8.0, 25.0]), np.array([0.8, 0.2])
    which = rng.choice(2, size=number, p=prior)
    z = rng.standard_normal((2, number))
    ln_pga = PGA.log_median(m, r)[which] + PGA.log_sd * z[0]
    together = CORRELATION * z[0] + math.sqrt(1.0 - CORRELATION**2) * z[1]
    ln_pgv = PGV.log_median(m, r)[which] + PGV.log_sd * together
    for level in (1.0, 4.0):
        density = np.exp(-0.5 * ((np.log(level) - PGA.log_median(m, r)) / PGA.log_sd) ** 2)
        share = (prior * density / (prior * density).sum())[None]
        near = np.abs(ln_pga - np.log(level)) < 0.02
        drawn = (ln_pgv - ln_pga)[near]
        table = ratios_of_scenarios(m, r, np.array([level]), share, np.array([level]))
        error = drawn.std() / math.sqrt(len(drawn))
        assert np.log(table.medians[0]) == pytest.approx(drawn.mean(), abs=4.0 * error)
        assert table.log_sds[0] == pytest.approx(drawn.std(), abs=4.0 * error)


def test_one_earthquake_has_the_spread_that_its_pga_leaves() -> None:
    one = ratios_of_scenarios(
        np.array([6.0]), np.array([9.0]), np.array([1.0]), np.ones((1, 1)), np.array([0.5, 5.0])
    )
    np.testing.assert_allclose(one.log_sds, ratio.LOG_SD)
    slope = np.diff(np.log(one.medians))[0] / np.log(10.0)
    assert slope == pytest.approx(CORRELATION * PGV.log_sd / PGA.log_sd - 1.0)


@pytest.mark.parametrize(
    ("levels", "medians", "words"),
    [([1.0, 0.5], [0.1, 0.1], "ascend"), ([1.0], [-0.1], "positive"), ([1.0], [], "each PGA")],
)
def test_what_is_no_table_is_refused(levels: list[float], medians: list[float], words: str) -> None:
    with pytest.raises(InvalidInput, match=words):
        RatioTable(np.array(levels), np.array(medians), np.full(len(levels), 0.5))
