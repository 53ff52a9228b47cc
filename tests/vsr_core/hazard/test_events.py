"""Simulated earthquakes: how often, from how far, and how PGA and PGV of them go together."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.support.event_sets import SITE, EventSet
from vsr_core import GRAVITY
from vsr_core.hazard.events import Events, Ruptures, distance_of, table_of
from vsr_core.hazard.ratio import CORRELATION, PGA, PGV, RatioTable


def drawn(correlation: float) -> Events:
    """Some 55,000 events in three branches, PGA and PGV of them jointly lognormal."""
    rupture, event = EventSet(260_000.0, correlation=correlation).drawn()
    east = (SITE[0] - rupture["centroid_lon"]) * math.cos(math.radians(SITE[1]))
    north = SITE[1] - rupture["centroid_lat"]
    distance = distance_of(rupture["mag"], east, north, rupture["strike"], rupture["dip"])
    return Events(
        GRAVITY * event["pga"],
        0.01 * event["pgv"],
        event["rlz"],
        event["rup"],
        260_000.0,
        Ruptures(rupture["mag"], distance),
    )


def test_levels_are_exceeded_as_often_as_events_are_stronger() -> None:
    pga, branch = np.array([1.0, 2.0, 3.0, 1.5, 2.5]), np.array([0, 0, 0, 1, 1])
    events = Events(pga, None, branch, np.arange(5), 100.0, None)
    found = events.rates(pga, np.array([0.5, 1.0, 2.0, 3.0]), 2)
    np.testing.assert_allclose(found, [[0.03, 0.02, 0.01, 0.0], [0.02, 0.02, 0.01, 0.0]])


def test_distance_is_from_the_rectangle_of_a_rupture() -> None:
    """Of M 7 it is 49.0 km long and 17.0 km wide, of which cos(60 deg) in plan."""
    length, width = 10.0 ** (-2.44 + 0.59 * 7.0), 10.0 ** (-1.01 + 0.32 * 7.0)
    degree = 111.195
    north = np.array([0.0, 60.0, 0.0, 60.0]) / degree
    east = np.array([30.0, 0.0, 3.0, 30.0]) / degree
    strike, dip = np.zeros(4), np.array([90.0, 90.0, 60.0, 60.0])
    found = distance_of(np.full(4, 7.0), east, north, strike, dip)
    beyond, beside = 60.0 - 0.5 * length, 30.0 - 0.25 * width
    np.testing.assert_allclose(found, [30.0, beyond, 0.0, math.hypot(beyond, beside)], rtol=1e-9)
    turned = distance_of(np.full(4, 7.0), -north, east, strike + 270.0, dip)
    np.testing.assert_allclose(turned, found, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("correlation", [0.0, 0.4, CORRELATION])
def test_the_correlation_of_residuals_is_measured(correlation: float) -> None:
    """Not that of the peaks themselves, which magnitude and distance join."""
    events = drawn(correlation)
    assert events.pgv is not None
    number = len(events.pga)
    error = (1.0 - correlation**2) / math.sqrt(number)
    assert events.correlation() == pytest.approx(correlation, abs=4.0 * error)
    assert np.corrcoef(np.log(events.pga), np.log(events.pgv))[0, 1] > 0.5


def test_pgv_drawn_anew_goes_with_pga_as_in_earthquakes() -> None:
    """Whatever it was; its residuals have the spread of the equation."""
    events = drawn(0.0)
    assert events.ruptures is not None
    pgv = events.ratio_anew() * events.pga
    own = events.ruptures.magnitudes[events.rupture], events.ruptures.distances[events.rupture]
    left = (np.log(events.pga) - PGA.log_median(*own)) / PGA.log_sd
    right = (np.log(pgv) - PGV.log_median(*own)) / PGV.log_sd
    error = 4.0 / math.sqrt(len(pgv))
    assert np.corrcoef(left, right)[0, 1] == pytest.approx(CORRELATION, abs=error)
    assert (right.mean(), right.std()) == pytest.approx((0.0, 1.0), abs=error)


def test_a_table_is_drawn_and_found_again() -> None:
    """PGV/PGA of 0.1 s (1 m/s^2 / PGA)^0.3, with a deviation of 0.4; half of the events weigh 0."""
    rng, number = np.random.default_rng(2), 40_000
    pga = 0.05 * rng.uniform(size=number) ** -0.5
    levels = np.geomspace(0.01, 100.0, 50)
    given = RatioTable(levels, 0.1 * levels**-0.3, np.full(50, 0.4))
    events = Events(pga, None, np.zeros(number, int), np.arange(number), 1.0, None)
    ratio = events.ratio_of_table(given)
    weight = np.repeat([1.0, 0.0], number // 2)
    ratio[weight == 0.0] = 3.0
    found = table_of(pga, ratio, weight)
    median, log_sd = found.at(np.array([0.07, 0.3]))
    np.testing.assert_allclose(median, 0.1 * np.array([0.07, 0.3]) ** -0.3, rtol=0.06)
    np.testing.assert_allclose(log_sd, 0.4, rtol=0.12)
