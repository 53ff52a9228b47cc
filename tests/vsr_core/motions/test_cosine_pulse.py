"""The cosine pulse against its definition, quadrature and finite differences."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import cumulative_simpson

from vsr_core import GRAVITY
from vsr_core.motions.pulses import CosinePulse

PGA = st.floats(0.01, 3.0)
RATIO = st.floats(0.005, 2.0)


def at(function, time: float) -> float:  # type: ignore[no-untyped-def]
    return float(function(np.array([time]))[0])


@given(PGA, RATIO)
@settings(max_examples=50, deadline=None, derandomize=True)
def test_acceleration_integrates_to_velocity_and_velocity_to_displacement(
    pga: float, ratio: float
) -> None:
    pulse = CosinePulse.from_g(pga, ratio)
    t = np.linspace(0.0, pulse.duration, 2001)
    velocity = cumulative_simpson(pulse.acceleration(t), x=t, initial=0.0)
    displacement = cumulative_simpson(pulse.velocity(t), x=t, initial=0.0)
    pgv = pga * GRAVITY * ratio
    # Simpson's error is (3e-3 rad)^4 / 180.
    np.testing.assert_allclose(pulse.velocity(t), velocity, atol=1e-10 * pgv)
    np.testing.assert_allclose(pulse.displacement(t), displacement, atol=1e-10 * pgv * ratio)


@given(PGA, RATIO, st.floats(0.01, 0.99))
@settings(max_examples=50, deadline=None, derandomize=True)
def test_derivatives(pga: float, ratio: float, share: float) -> None:
    pulse = CosinePulse.from_g(pga, ratio)
    t, h = share * pulse.duration, 1e-3 * ratio
    slope = (at(pulse.displacement, t + h) - at(pulse.displacement, t - h)) / (2 * h)
    assert slope == pytest.approx(at(pulse.velocity, t), abs=1e-6 * pulse.pga * ratio)
    slope = (at(pulse.velocity, t + h) - at(pulse.velocity, t - h)) / (2 * h)
    assert slope == pytest.approx(at(pulse.acceleration, t), abs=1e-6 * pulse.pga)


@given(PGA, RATIO)
@settings(deadline=None, derandomize=True)
def test_published_parameters(pga: float, ratio: float) -> None:
    """Equations 7 to 10 of the paper: d = A - A cos(2 pi f t), written with f and A."""
    pulse = CosinePulse.from_g(pga, ratio)
    f = 1.0 / (2.0 * math.pi * ratio)
    amplitude = pga * GRAVITY / (4.0 * math.pi**2 * f**2)
    assert pulse.duration == pytest.approx(1.0 / f)
    assert pulse.peak_acceleration == pytest.approx(pga * GRAVITY)
    t = np.linspace(0.0, pulse.duration, 1001)  # holds the quarters of the pulse
    assert pulse.velocity(t).max() == pytest.approx(pga * GRAVITY * ratio)
    assert pulse.velocity(t).min() == pytest.approx(-pga * GRAVITY * ratio)
    assert pulse.displacement(t).max() == pytest.approx(2.0 * amplitude)
    np.testing.assert_allclose(
        pulse.displacement(t), amplitude * (1 - np.cos(2 * math.pi * f * t)), atol=1e-9 * amplitude
    )
    assert at(pulse.displacement, pulse.duration) == pytest.approx(0.0, abs=1e-12 * amplitude)


@given(PGA, RATIO)
@settings(deadline=None, derandomize=True)
def test_acceleration_jumps_at_both_ends(pga: float, ratio: float) -> None:
    """Unsmeared: the full PGA on both ends, nothing a rounding away from them."""
    pulse = CosinePulse.from_g(pga, ratio)
    before, after = math.nextafter(0.0, -1.0), math.nextafter(pulse.duration, math.inf)
    assert at(pulse.acceleration, 0.0) == pulse.pga
    assert at(pulse.acceleration, pulse.duration) == pytest.approx(pulse.pga)
    for outside in (before, after, -1.0, 1e9):
        for quantity in (pulse.acceleration, pulse.velocity, pulse.displacement):
            assert at(quantity, outside) == 0.0


@given(PGA, RATIO)
@settings(deadline=None, derandomize=True)
def test_mirrored_pulse(pga: float, ratio: float) -> None:
    one, other = CosinePulse.from_g(pga, ratio), CosinePulse.from_g(-pga, ratio)
    t = np.linspace(-0.1, 1.1, 97) * one.duration
    for quantity in ("acceleration", "velocity", "displacement"):
        np.testing.assert_array_equal(getattr(one, quantity)(t), -getattr(other, quantity)(t))
    assert one.peak_acceleration == other.peak_acceleration
    assert (one.duration, one.shortest_time) == (other.duration, other.shortest_time)
