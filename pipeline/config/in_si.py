"""From the units of a configuration, degrees, g and seconds, to SI, and back for products."""

from __future__ import annotations

import math
from typing import TypeVar

from pipeline.config.scene_schema import ContactConfig, ServoConfig
from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.scene import Contact
from vsr_core.table.servo import Servo

Values = TypeVar("Values", float, Array)
"""A number or an array of them."""


def angle(degrees: float) -> float:
    """Convert an angle from degrees.

    Parameters
    ----------
    degrees : float [degree]

    Returns
    -------
    float [rad]

    >>> angle(180.0) == math.pi
    True
    """
    return math.radians(degrees)


def in_degrees(radians: float) -> float:
    """Convert an angle to degrees.

    Parameters
    ----------
    radians : float [rad]

    Returns
    -------
    float [degree]

    >>> in_degrees(angle(90.0))
    90.0
    """
    return math.degrees(radians)


def acceleration(pga: Values) -> Values:
    """Convert accelerations from g.

    Parameters
    ----------
    pga : float or ndarray [g]

    Returns
    -------
    float or ndarray [m/s^2]

    >>> acceleration(1.0)
    9.80665
    """
    return pga * GRAVITY


def in_g(acceleration: Values) -> Values:
    """Convert accelerations to g.

    Parameters
    ----------
    acceleration : float or ndarray [m/s^2]

    Returns
    -------
    float or ndarray [g]

    >>> in_g(acceleration(0.5))
    0.5
    """
    return acceleration / GRAVITY


def contact(config: ContactConfig, friction: float) -> Contact:
    """Contact of the pair rock-pedestal at one of its frictions.

    Parameters
    ----------
    friction : float [1]
    """
    return Contact(
        friction,
        config.restitution,
        config.rolling_friction,
        energetic=config.restitution_law == "energetic",
    )


def servo(config: ServoConfig) -> Servo:
    """Servo of a driven table, its command rate [Hz] as the control periods that one holds."""
    limit = math.inf if config.force_limit is None else config.force_limit
    rate = config.command_rate
    hold = 1 if rate is None else round(1.0 / (rate * config.period))
    return Servo(config.mass, config.kp, config.ki, config.kd, config.period, limit, hold)
