"""What a table with a stepper makes of a commanded pulse."""

from __future__ import annotations

import numpy as np
import pytest

from vsr_core.motions.pulses import CosinePulse
from vsr_core.table.stepper import SteppedPulse, Stepper

PULSE = CosinePulse.from_g(0.2, 0.2)
STEP = 4e-5


def test_a_perfect_motor_follows_the_pulse() -> None:
    """Its velocity is the commanded one at each command, and its travel that of the pulse."""
    made = SteppedPulse(PULSE, Stepper(1000.0, STEP, 0.0))
    times = np.arange(0.0, PULSE.duration, 1e-3)
    np.testing.assert_allclose(made.velocity(times), PULSE.velocity(times), atol=1e-12)
    fine = np.linspace(0.0, made.duration, 200_001)
    travel = np.cumsum(made.velocity(fine))[len(fine) // 2] * (fine[1] - fine[0])
    assert travel == pytest.approx(2.0 * PULSE.pga * 0.2**2, rel=2e-3)
    inside = (times + 5e-4)[1:-1]
    np.testing.assert_allclose(
        made.acceleration(inside), PULSE.acceleration(inside), atol=1e-3 * PULSE.pga
    )


def test_a_step_that_takes_as_long_again_halves_the_velocity() -> None:
    """At a velocity v a step is to take step / v: there the table moves at half of it."""
    pgv = PULSE.pga * PULSE.pgv_pga
    made = SteppedPulse(PULSE, Stepper(200.0, STEP, STEP / pgv), gain=1.8)
    assert np.abs(made.velocities).max() == pytest.approx(0.9 * pgv, rel=1e-3)
    # where it turns it is slow, and its acceleration the commanded one times the gain
    first = made.acceleration(np.array([1e-4]))[0]
    assert first == pytest.approx(1.8 * PULSE.pga, rel=0.04)
    assert made.peak_acceleration == pytest.approx(1.8 * PULSE.pga, rel=0.04)


def test_it_starts_and_ends_at_rest() -> None:
    made = SteppedPulse(PULSE, Stepper(200.0, STEP, 1e-4))
    ends = np.array([-0.01, 0.0, made.duration, made.duration + 0.01])
    np.testing.assert_array_equal(made.velocity(ends), 0.0)
    assert made.acceleration(ends[[0, 3]]).tolist() == [0.0, 0.0]
    steps = (np.arange(len(made.velocities) - 1) + 0.5) / 200.0
    assert made.acceleration(steps).sum() == pytest.approx(0.0, abs=1e-9)
