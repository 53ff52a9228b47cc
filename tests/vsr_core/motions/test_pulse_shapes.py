"""The sine and Ricker pulses against calculus, and in the engines."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import cumulative_simpson

from vsr_core.judge.proofs import barrier
from vsr_core.motions.pulses import REACH, RickerPulse, SinePulse
from vsr_core.outcome import Outcome
from vsr_core.rock.solid import block
from vsr_core.run.cases import Settings, prepare
from vsr_core.run.overturning import simulate
from vsr_core.scene import Contact, Scene

Pulse = type[SinePulse] | type[RickerPulse]

SHAPES = pytest.mark.parametrize("shape", [SinePulse, RickerPulse])
PGA = st.floats(0.1, 30.0)
RATIO = st.floats(0.005, 2.0)


def at(function, time: float) -> float:  # type: ignore[no-untyped-def]
    return float(function(np.array([time]))[0])


@SHAPES
@given(PGA, RATIO)
@settings(max_examples=25, deadline=None, derandomize=True)
def test_integrals(shape: Pulse, pga: float, ratio: float) -> None:
    pulse = shape(pga, ratio)
    t = np.linspace(0.0, pulse.duration, 8001)
    velocity = cumulative_simpson(pulse.acceleration(t), x=t, initial=0.0)
    displacement = cumulative_simpson(pulse.velocity(t), x=t, initial=0.0)
    pgv, tail = pga * ratio, REACH**2 * math.exp(-0.5 * REACH**2)  # where a Ricker pulse is cut off
    np.testing.assert_allclose(pulse.velocity(t), velocity, atol=2.0 * tail * pgv)
    travelled = pulse.displacement(t) - pulse.displacement(t)[0]
    np.testing.assert_allclose(travelled, displacement, atol=2.0 * tail * pgv * pulse.duration)


@SHAPES
@given(PGA, RATIO)
@settings(deadline=None, derandomize=True)
def test_peaks_are_those_asked_for(shape: Pulse, pga: float, ratio: float) -> None:
    """The samples hold the quarters of a sine, and x = -1, 0, 1 of a Ricker pulse."""
    pulse = shape(pga, ratio)
    t = np.linspace(0.0, pulse.duration, 12 * 80 + 1)
    assert pulse.peak_acceleration == pga
    assert np.abs(pulse.acceleration(t)).max() == pytest.approx(pga, rel=1e-12)
    assert np.abs(pulse.velocity(t)).max() == pytest.approx(pga * ratio, rel=1e-12)
    rest = 3e-7 * pga * ratio
    assert at(pulse.velocity, 0.0) == pytest.approx(0.0, abs=rest)
    assert at(pulse.velocity, pulse.duration) == pytest.approx(0.0, abs=rest)


@SHAPES
def test_published_form(shape: Pulse) -> None:
    """A sine of period T has PGV = PGA T / pi; a Ricker pulse peaks in its spectrum at 1/T."""
    pulse = shape(3.0, 0.2)
    if isinstance(pulse, SinePulse):
        assert at(pulse.displacement, 9.9) == pytest.approx(0.5 * pulse.duration * 3.0 * 0.2)
        t = 0.3 * pulse.duration
        expected = 3.0 * math.sin(2.0 * math.pi * 0.3)
    else:
        frequency, t = 1.0 / (2.0 * math.pi * pulse.shortest_time), 0.46 * pulse.duration
        spans = (math.pi * frequency * (t - 0.5 * pulse.duration)) ** 2
        expected = 3.0 * (1.0 - 2.0 * spans) * math.exp(-spans)
        samples = pulse.acceleration(np.linspace(0.0, pulse.duration, 4001)[:-1])
        spectrum = np.abs(np.fft.rfft(samples, 1 << 20))
        step = pulse.duration / 4000
        peak = np.fft.rfftfreq(1 << 20, step)[spectrum.argmax()]
        assert peak == pytest.approx(frequency, rel=5e-3)
    assert at(pulse.acceleration, t) == pytest.approx(expected, rel=1e-12)


@SHAPES
def test_mirrored_pulse(shape: Pulse) -> None:
    one, other = shape(2.0, 0.3), shape(-2.0, 0.3)
    t = np.linspace(-0.1, 1.1, 97) * one.duration
    for quantity in ("acceleration", "velocity", "displacement"):
        np.testing.assert_array_equal(getattr(one, quantity)(t), -getattr(other, quantity)(t))
    assert one.peak_acceleration == other.peak_acceleration


@SHAPES
@pytest.mark.parametrize("engine", ["nonsmooth", "bullet"])
def test_engines_topple_a_block_by_it_or_not(shape: Pulse, engine: str) -> None:
    """A block of 1:5 stands what is weaker than width over height, and a long push topples it."""
    rock = block((0.2, 1.0, 1.0), 2000.0)
    case = prepare(Scene(rock, Contact(0.8)), barrier(rock), reduce=False)
    runs = Settings(0.001, False, engine)
    found = [simulate(case, shape(9.80665 * pga, 0.3), runs).outcome for pga in (0.19, 0.6)]
    assert found == [Outcome.BALANCED, Outcome.OVERTURNED]
