"""Tests of a standing rock against Housner's equation, and against a rock that is run."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from vsr_core import GRAVITY
from vsr_core.observations.field_tests import push_force, rocking_frequency, tilt_angle
from vsr_core.rock.solid import block
from vsr_core.rock.tipping import tipping


def quarter(alpha: float, p: float, tilt: float) -> float:
    """Time in which a block falls from a tilt onto its base (Housner 1963, eq. 2, integrated)."""

    def lands(_: float, state: np.ndarray) -> float:
        return float(state[0])

    lands.terminal = True  # type: ignore[attr-defined]
    fall = solve_ivp(
        lambda _, s: [s[1], -(p**2) * math.sin(alpha - s[0])],
        (0.0, 20.0),
        [tilt, 0.0],
        events=lands,
        rtol=1e-10,
        atol=1e-12,
    )
    return float(fall.t_events[0][0])


@pytest.mark.parametrize("share", [0.05, 0.3, 0.7])
def test_a_slender_block_rocks_as_housner_has_it(share: float) -> None:
    """The closed form is that of small angles: alpha of 0.1 rad differs by its square."""
    rock = block((0.2, 0.5, 2.0), 2700.0)
    alpha = math.atan(0.1)
    p = math.sqrt(0.75 * GRAVITY / math.hypot(0.1, 1.0))
    found = rocking_frequency(rock, 1.0, 0.0, (0.1, 0.1), share * alpha)
    assert found == pytest.approx(0.25 / quarter(alpha, p, share * alpha), rel=0.005)


def test_a_block_rocks_alike_from_either_side() -> None:
    """Released from either side at one energy, a rock with unlike edges has one frequency."""
    rock = block((0.4, 0.5, 2.0), 2700.0)
    slopes = (0.05, 0.2)
    first, second = (math.atan(slope) for slope in slopes)
    tilt = 0.5 * first
    energy = slopes[0] * tilt * (1.0 - tilt / (2.0 * first))
    other = second * (1.0 - math.sqrt(1.0 - 2.0 * energy / (slopes[1] * second)))
    one = rocking_frequency(rock, 1.0, 0.0, slopes, tilt)
    assert one == pytest.approx(rocking_frequency(rock, 1.0, math.pi, slopes[::-1], other))


@pytest.mark.parametrize(("slopes", "tilt"), [((0.1, 0.1), 0.11), ((0.3, 0.05), 0.2)])
def test_a_rock_that_does_not_come_back_has_no_frequency(
    slopes: tuple[float, float], tilt: float
) -> None:
    rock = block((0.2, 0.5, 2.0), 2700.0)
    assert rocking_frequency(rock, 1.0, 0.0, slopes, tilt) == 0.0


def test_a_block_tips_and_lifts_by_its_moments() -> None:
    """Toward a corner at 45 deg a block of 1 x 1 x 2 m tips about an edge: b / cos 45."""
    rock = block((1.0, 1.0, 2.0), 1000.0)
    (along, aslant) = tipping(rock.hull, np.radians([0.0, 45.0])).overturning.tolist()
    assert math.degrees(tilt_angle(along, 9.0).tips) == pytest.approx(math.degrees(math.atan(0.5)))
    weight = rock.mass * GRAVITY
    force = push_force(weight, along, 9.0, rock.height, 1.6)
    assert force.tips * 1.6 == pytest.approx(weight * 0.5)
    assert aslant == pytest.approx(0.5 * math.sqrt(2.0))
