"""A sphere on a slope of triangles and of convex parts: it rolls, or slips and turns.

It rolls with (5/7) g sin(b) where friction is at least (2/7) tan(b), and slips with
g (sin(b) - mu cos(b)) below. No border inside the slope may be felt.

References
----------
Goldstein, Poole & Safko (2002), Classical Mechanics, 3rd ed., 1.6 and 5: I / (m r^2) = 2/5.
"""

from __future__ import annotations

import math

import numpy as np

from vsr_core import GRAVITY
from vsr_core.scene import Contact
from vsr_core.terrain.surface import Terrain
from vsr_core.verification.reference import REBOUNDS, Reference, case
from vsr_core.verification.reference._run import run, scene, seen, slope, whole
from vsr_core.verification.rocks import sphere, upright

RADIUS = 0.5
"""Of the sphere [m]."""

LENGTH = 6.0
"""Distance rolled on the slope [m]."""


def acceleration(angle: float, friction: float) -> tuple[float, float]:
    """Acceleration of a uniform sphere on a slope.

    Parameters
    ----------
    angle : float [rad]

    Returns
    -------
    tuple of float [m/s^2]
        Downhill, and that of its turning times the radius.
    """
    if friction >= 2.0 / 7.0 * math.tan(angle):
        rolls = 5.0 / 7.0 * GRAVITY * math.sin(angle)
        return rolls, rolls
    slides = GRAVITY * (math.sin(angle) - friction * math.cos(angle))
    return slides, 2.5 * friction * GRAVITY * math.cos(angle)


def ground(angle: float, cell: float, cut: bool) -> Terrain:
    """Slope long enough to roll down.

    Parameters
    ----------
    angle : float [rad]
    cell : float [m], of its squares
    cut : bool, whether these are convex parts, else triangles
    """
    return slope(angle, (-1.0, LENGTH + 1.0), 1.0, cell, cut)


def descend(
    terrain: Terrain, angle: float, contact: Contact, engine: str, time_step: float
) -> tuple[float, float]:
    """Mean acceleration over ``LENGTH`` from rest.

    Parameters
    ----------
    angle : float [rad]
    time_step : float [s]

    Returns
    -------
    tuple of float [m/s^2]
        Downhill, and that of the turning times the radius.
    """
    exact, _ = acceleration(angle, contact.friction)
    number, step = whole(math.sqrt(2.0 * LENGTH / exact), time_step)
    world = scene(sphere(RADIUS), contact, terrain, angle, upright((0.0, 0.0, RADIUS)))
    path = seen(run(engine, world, step, np.zeros(number)), angle)
    time, moved, turning = number * step, path.position[-1, 0], path.angular_velocity[-1, 1]
    return 2.0 * float(moved) / time**2, RADIUS * float(turning) / time


def rolling(
    angle: float, friction: float, cell: float, cut: bool, engine: str, time_step: float
) -> float:
    """Error of the distance and of the angular velocity, the larger, each relative to itself.

    Parameters
    ----------
    angle : float [rad]
    cell : float [m], of the ground's squares
    cut : bool, whether these are convex parts, else triangles
    time_step : float [s]
    """
    contact = Contact(friction)
    found = descend(ground(angle, cell, cut), angle, contact, engine, time_step)
    exact = acceleration(angle, friction)
    return max(abs(a / b - 1.0) for a, b in zip(found, exact, strict=True))


def _incline(name: str, angle: float, friction: float, cut: bool, tolerance: float) -> Reference:
    cell, kind = (1.0, "parts of 1 m") if cut else (0.5, "triangles of 0.5 m")
    answer = (
        f"{angle:g} deg, friction {friction:g}: (5/7) g sin(b) from a friction of (2/7) tan(b) "
        "on, g (sin(b) - mu cos(b)) below"
    )
    return case(f"{name} sphere on a slope of {kind}", answer, tolerance,
                rolling, math.radians(angle), friction, cell, cut, engines=REBOUNDS)  # fmt: skip


CASES = (
    _incline("rolling", 20.0, 0.6, False, 0.02),
    _incline("rolling", 20.0, 0.6, True, 2e-3),
    _incline("slipping", 40.0, 0.15, True, 0.02),
)
