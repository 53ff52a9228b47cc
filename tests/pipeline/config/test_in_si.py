"""Units of a configuration and SI: the one place between them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.config import in_si
from pipeline.config.layers import load_site
from vsr_core import GRAVITY


def test_units_go_there_and_back() -> None:
    assert in_si.angle(30.0) == math.pi / 6.0
    assert in_si.in_degrees(in_si.angle(30.0)) == pytest.approx(30.0, rel=1e-15)
    pga = np.array([0.0, 0.25, 1.0])
    assert in_si.acceleration(pga).tolist() == [0.0, 0.25 * GRAVITY, GRAVITY]
    assert in_si.in_g(in_si.acceleration(0.7)) == pytest.approx(0.7, rel=1e-15)


def test_contact_and_servo_are_those_of_the_configuration() -> None:
    settings = (
        "contact={friction: [0.4, 0.6], restitution: 0.2, rolling_friction: 0.001}",
        "servo={mass: 1e4, kp: 2e6, ki: 3, kd: 4, period: 0.002, force_limit: 5e5}",
        "servo.command_rate=100",
    )
    config = load_site("cuboid_1x1x2", settings=settings).config
    pair = in_si.contact(config.contact, 0.6)
    assert (pair.friction, pair.restitution, pair.rolling_friction) == (0.6, 0.2, 0.001)
    servo = in_si.servo(config.servo)
    assert (servo.mass, servo.kp, servo.ki, servo.kd) == (1e4, 2e6, 3.0, 4.0)
    assert (servo.period, servo.force_limit, servo.hold) == (0.002, 5e5, 5)
    assert servo.command_period == pytest.approx(0.01)
