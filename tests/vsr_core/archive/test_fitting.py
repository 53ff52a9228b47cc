"""The fit of the equations: known coefficients come back, what is beyond all tried is no aim."""

from __future__ import annotations

import numpy as np
import pytest

from vsr_core.archive.equations import HIGHEST, OPEN, Equations, Error
from vsr_core.archive.fitting import CLASSES, KNOTS, Boundaries, error_of, fit, left_out, missed
from vsr_core.archive.profiles import Profiles

NAMES = ("1", "slenderness")


def drawn(number: int, scatter: float) -> tuple[Boundaries, Equations]:
    """Boundaries after known equations, with scatter of ln PGA."""
    random = np.random.default_rng(1)
    tan_alpha = np.repeat(random.uniform(0.1, 0.5, (number, 1)), 2, axis=1)
    radius = np.ones((number, 2))
    rocks = Profiles(
        tan_alpha, radius, np.full(number, 0.3), np.zeros(number), np.full(number, 0.8)
    )
    coefficients = np.zeros((len(KNOTS), 2))
    coefficients[0], coefficients[1] = (-3.0, 0.6), (1.0, 0.2)
    nothing = Error(CLASSES, *np.ones((4, 1, 1)))
    true = Equations(KNOTS, NAMES, coefficients, np.eye(coefficients.size), nothing)
    ratio = np.exp(random.uniform(np.log(0.04), np.log(1.5), (number, 10)))
    pga = true.boundary(rocks, ratio) * np.exp(scatter * random.normal(size=ratio.shape))
    pga[pga > HIGHEST * rocks.weakest[:, None]] = np.nan
    assert 0.02 < np.isnan(pga).mean() < 0.5
    return Boundaries(np.arange(number), rocks, ratio, pga), true


def test_boundaries_after_known_equations_give_them_back() -> None:
    given, true = drawn(300, 0.0)
    found = fit(given, NAMES)
    ratio = np.geomspace(0.08, 1.0, 8)
    known = true.boundary(given.rocks, ratio)
    inside = known < 5.0 * given.rocks.weakest[:, None]
    assert found.boundary(given.rocks, ratio)[inside] == pytest.approx(known[inside], rel=0.01)
    assert found.error.most[:4].max() < 0.02


def test_the_covariance_holds_the_scatter_of_fits() -> None:
    given, true = drawn(300, 0.03)
    found = fit(given, NAMES)
    ratio = np.array([0.3])
    off = np.log(found.boundary(given.rocks, ratio) / true.boundary(given.rocks, ratio))
    sd = found.coefficient_sd(given.rocks, ratio)
    assert np.abs(off / sd).mean() < 3.0
    assert sd.mean() < 0.03 / np.sqrt(300)


def test_beyond_all_tried_the_equations_say_so() -> None:
    given, _ = drawn(300, 0.0)
    beyond = np.isnan(given.pga)
    assert (left_out(given, NAMES)[beyond] > 0.9 * HIGHEST).mean() > 0.95


def test_errors_are_told_by_what_the_equations_give_and_to_what() -> None:
    size, u = np.repeat([1.05, 1.2, 1.5, 2.0, 3.0, 6.0], 400), np.tile([0.5, 2.0], 1200)
    off = np.tile(np.repeat(np.linspace(-0.1, 0.1, 200), 2), 6) * size * u
    error = error_of(size, u, off)
    for column, factor in ((0, 0.5), (2, 2.0)):
        assert error.median[:, column] == pytest.approx(0.05 * factor * np.unique(size), rel=0.03)
        assert error.most[:, column] == pytest.approx(0.095 * factor * np.unique(size), rel=0.03)
    assert (error.most[:, 1] > error.most[:, 0]).all()  # of all u, as there is no other
    found, none = error.of(np.array([1.2, 6.0]), np.array([0.5, 2.2]))
    assert found == pytest.approx([error.most[1, 0], error.most[5, 2]])
    assert (none == 0.0).all()


@pytest.mark.parametrize(("share", "most"), [(0.02, 0.97), (0.2, 0.95)])
def test_what_only_the_equations_topple_counts_among_their_errors(
    share: float, most: float
) -> None:
    """Few are their largest errors; of many the share is told, and the error of the others."""
    size = np.full(5000, 3.0)
    run = size * np.exp(np.linspace(0.0, 1.0, len(size)))
    run[np.random.default_rng(1).permutation(len(size))[: int(share * len(size))]] = np.nan
    others = [np.full(100, one) for one in CLASSES if one != 2.5]
    size, run = np.concatenate([size, *others]), np.concatenate([run, *others])
    error = error_of(size, np.ones(len(size)), missed(size, run))
    assert error.none[4] == pytest.approx(share)
    assert error.most[4] == pytest.approx(most, abs=0.01)
    assert (np.delete(error.none, 4, axis=0) == 0.0).all()
    assert (share >= OPEN) == (most < 0.96)


def test_where_neither_topples_a_rock_nothing_is_missed() -> None:
    off = missed(np.array([3.0, HIGHEST, 20.0, 4.0]), np.array([np.nan, np.nan, 8.0, 2.0]))
    assert off == pytest.approx([-np.inf, np.nan, np.log(2.5), np.log(2.0)], nan_ok=True)
