"""A prism that rolls from facet to facet down a slope: McGeer's rimless wheel, without a rebound.

It turns about an edge as a pendulum does until the next edge comes down. Angular momentum about
that edge is kept, as in Housner's block, so that the rate is multiplied by a number that only the
shape knows. What a step of the slope gives and an impact takes balance at one rate: each wheel has
a terminal speed, at which every step is like the last.

References
----------
McGeer (1990), Int. J. Robot. Res. 9(2), 62-82; Coleman, Chatterjee & Ruina (1997), Dyn. Stab.
Syst. 12(3), 139-159.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.integrate import quad

from vsr_core import GRAVITY
from vsr_core.rock.body import Rock
from vsr_core.scene import Contact
from vsr_core.verification.reference import REBOUNDS, Reference, case
from vsr_core.verification.reference._run import Path, run, scene, seen, slope, whole
from vsr_core.verification.rocks import GRIPPING, hull, upright

RADIUS, WIDTH = 0.5, 0.6
"""Distance of the edges from the axis, and their length [m]."""

STEPS = 12
"""Facets over which a wheel rolls."""


@dataclass(frozen=True)
class Wheel:
    """A uniform prism of regular section on a slope down +x.

    Attributes
    ----------
    angle : float [rad], of the slope
    """

    sides: int
    angle: float

    @property
    def half(self) -> float:
        """Half the angle between two edges [rad]."""
        return math.pi / self.sides

    @property
    def facet(self) -> float:
        """Width of a facet [m], rolled in a step."""
        return 2.0 * RADIUS * math.sin(self.half)

    @property
    def inertia(self) -> float:
        """Moment of inertia about an edge over mass [m^2]."""
        axis = RADIUS**2 / 6.0 * (1.0 + 2.0 * math.cos(self.half) ** 2)
        return axis + RADIUS**2

    @property
    def kept(self) -> float:
        """Share of the rate that an impact keeps."""
        return 1.0 - RADIUS**2 * (1.0 - math.cos(2.0 * self.half)) / self.inertia

    @property
    def terminal(self) -> float:
        """Rate just before an impact when every step is like the last [rad/s]."""
        given = 2.0 * GRAVITY * self.facet * math.sin(self.angle) / self.inertia
        return math.sqrt(given / (1.0 - self.kept**2))

    @property
    def period(self) -> float:
        """Time of a step then [s]."""
        low, high = self.angle - self.half, self.angle + self.half
        start = (self.kept * self.terminal) ** 2

        def slowness(lean: float) -> float:
            fallen = RADIUS * (math.cos(low) - math.cos(lean))
            return 1.0 / math.sqrt(start + 2.0 * GRAVITY * fallen / self.inertia)

        return float(quad(slowness, low, high)[0])


@cache
def prism(sides: int) -> Rock:
    """The wheel as a hull, standing on a facet, its axis across."""
    turns = 2.0 * math.pi * (np.arange(sides) + 0.5) / sides
    x, z = RADIUS * np.sin(turns), RADIUS * np.cos(turns)
    ends = [np.column_stack([x, np.full(sides, y), z]) for y in (-0.5 * WIDTH, 0.5 * WIDTH)]
    return hull(np.vstack(ends), as_scanned=True)


def rolled(wheel: Wheel, cell: float, cut: bool, engine: str, time_step: float) -> Path:
    """Roll over ``STEPS`` facets, from just after an impact at terminal speed.

    Parameters
    ----------
    cell : float [m], of the ground's squares
    cut : bool, whether these are convex parts, else triangles
    time_step : float [s]

    Returns
    -------
    Path
        In the slope's axes.
    """
    rate = wheel.kept * wheel.terminal
    apothem = RADIUS * math.cos(wheel.half)
    # It turns about the edge ahead of its lowest facet.
    velocity = (rate * apothem, 0.0, rate * (0.5 * wheel.facet))
    start = upright((0.0, 0.0, apothem), velocity, (0.0, rate, 0.0))
    number, step = whole(STEPS * wheel.period, time_step)
    ground = slope(wheel.angle, (-1.0, 7.0), 1.5, cell, cut)
    placed = scene(prism(wheel.sides), Contact(GRIPPING), ground, wheel.angle, start)
    return seen(run(engine, placed, step, np.zeros(number)), wheel.angle)


def distance(wheel: Wheel, cell: float, cut: bool, engine: str, time_step: float) -> float:
    """Error of the distance of twelve steps at terminal speed, relative to twelve facets."""
    path = rolled(wheel, cell, cut, engine, time_step)
    return abs(float(path.position[-1, 0]) / (STEPS * wheel.facet) - 1.0)


def straightness(wheel: Wheel, cell: float, cut: bool, engine: str, time_step: float) -> float:
    """How far it leaves its line in twelve steps, relative to twelve facets."""
    path = rolled(wheel, cell, cut, engine, time_step)
    return float(np.abs(path.position[:, 1]).max()) / (STEPS * wheel.facet)


WHEELS = (Wheel(8, math.radians(15.0)), Wheel(12, math.radians(10.0)))
"""Wheels that neither stop nor leave the ground."""


MCGEER = (
    "McGeer (1990): angular momentum about the new edge, energy between impacts. Bullet "
    "finds one end of a landing edge before the other, and the wheel veers"
)


def _wheel(
    wheel: Wheel, error: Callable[[Wheel, float, bool, str, float], float], cut: bool, most: float
) -> Reference:
    cell, kind = (1.0, "parts") if cut else (0.5, "triangles")
    name = f"rimless wheel of {wheel.sides} sides on {kind}, {error.__name__}"
    return case(name, MCGEER, most, error, wheel, cell, cut, engines=REBOUNDS)


CASES = (
    _wheel(WHEELS[0], distance, False, 0.2),
    _wheel(WHEELS[1], distance, True, 0.1),
    _wheel(WHEELS[1], straightness, True, 0.1),
)
