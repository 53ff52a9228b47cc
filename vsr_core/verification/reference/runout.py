"""How far a flat block slides: Coulomb's energy line, and what a bend of the slope takes off it.

On an even slope the friction of a block that neither tips nor leaves the ground takes mu m g for
each metre of horizontal distance, whatever its mass and the slope: from its energy head to where it
stops the line falls by mu. In a bend of radius R the ground also turns the block, which presses it
on by v^2 / R more: the energy line falls short, and by a share exp(-2 mu b) of a fast block's
energy in a bend by b.

References
----------
Heim (1932), Bergsturz und Menschenleben; Scheidegger (1973), Rock Mech. 5, 231-236.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
import trimesh

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.rock import solid
from vsr_core.rock.body import Rock
from vsr_core.scene import Contact, State
from vsr_core.terrain.surface import Terrain
from vsr_core.verification.reference import REBOUNDS, case
from vsr_core.verification.reference._run import axes, in_parts, run, scene, sheet, slope, whole
from vsr_core.verification.rocks import DENSITY, upright

SIZE = (0.4, 0.4, 0.1)
"""Sides of the block [m]; a friction of 4 would tip it."""

SPEED = 4.0
"""At the start of a slide to rest [m/s]."""

LATER = 1.5
"""Time until the end of a run, in units of that of the slide in theory."""

ABOVE = 1e-4
"""Height above the ground at the start [m]: what overlaps is pushed apart in any direction."""

LONGEST = 6.0
"""Time of a run through a bend [s]."""

LEVEL = 30.0
"""Length of the level ground behind a bend [m]."""


@cache
def block(density: float = DENSITY) -> Rock:
    """The block as a hull.

    Parameters
    ----------
    density : float [kg/m^3]
    """
    return solid.from_mesh(trimesh.creation.box(SIZE), density, as_scanned=True).rock


def energy_line(
    rock: Rock, angle: float, contact: Contact, ground: Terrain, engine: str, time_step: float
) -> float:
    """Fall of the energy line of a block that slides to rest: loss over horizontal distance.

    Parameters
    ----------
    angle : float [rad], flatter than friction
    ground : Terrain, a slope through the origin
    time_step : float [s]
    """
    slowing = GRAVITY * (contact.friction * math.cos(angle) - math.sin(angle))
    flat = upright((0.0, 0.0, 0.5 * SIZE[2] + ABOVE), (SPEED, 0.0, 0.0))
    number, step = whole(LATER * SPEED / slowing, time_step)
    path = run(engine, scene(rock, contact, ground, angle, flat), step, np.zeros(number))
    moved = path.position[-1] - path.position[0]
    return (SPEED**2 / (2.0 * GRAVITY) - float(moved[2])) / float(np.hypot(moved[0], moved[1]))


def sliding(
    angle: float, contact: Contact, cell: float, cut: bool, engine: str, time_step: float
) -> float:
    """Error of the energy line of a slide to rest, relative to friction.

    Parameters
    ----------
    angle : float [rad], of the slope
    cell : float [m], of the ground's squares
    cut : bool, whether these are convex parts, else triangles
    time_step : float [s]
    """
    ground = slope(angle, (-1.0, 11.0), 3.0, cell, cut)
    found = energy_line(block(), angle, contact, ground, engine, time_step)
    return abs(found / contact.friction - 1.0)


@dataclass(frozen=True)
class Bend:
    """A slope that bends into level ground; the bend ends at the origin.

    Attributes
    ----------
    angle : float [rad], of the slope
    radius : float [m], of the bend
    length : float [m], of the slope above the bend
    """

    angle: float = math.radians(35.0)
    radius: float = 8.0
    length: float = 6.0

    @property
    def foot(self) -> Array:
        """Where the slope ends and the bend begins, x and z [m]."""
        return self.radius * np.array([-math.sin(self.angle), 1.0 - math.cos(self.angle)])

    @property
    def top(self) -> Array:
        """Where the block starts, x and z [m]."""
        return self.foot + self.length * np.array([-math.cos(self.angle), math.sin(self.angle)])

    def run_out(self, friction: float) -> float:
        """Run-out [m] of a point mass on the level, from rest; 0 if it does not get there.

        With E = v^2 / 2 and the ground's lean t, dE/dt = -R g (sin t - mu cos t) + 2 mu E: linear,
        so that E = A exp(2 mu t) + B cos t + C sin t.
        """
        g, mu, end = GRAVITY, friction, self.angle
        start = g * self.length * (math.sin(end) - mu * math.cos(end))
        scale = self.radius * g / (1.0 + 4.0 * mu**2)
        b, c = scale * (1.0 - 2.0 * mu**2), 3.0 * mu * scale
        grown = (start - b * math.cos(end) - c * math.sin(end)) * math.exp(-2.0 * mu * end)
        return max(grown + b, 0.0) / (mu * g)


@cache
def _bent(bend: Bend, facets: int, cut: bool) -> Terrain:
    """Ground of a bend whose arc is ``facets`` chords."""
    leans = np.linspace(bend.angle, 0.0, facets + 1)
    arc = bend.radius * np.column_stack([-np.sin(leans), 1.0 - np.cos(leans)])
    behind = bend.top + (bend.top - bend.foot) / bend.length
    profile = np.vstack([behind, arc, [LEVEL, 0.0]])
    whole_sheet = Terrain(*sheet(profile[:, 0], profile[:, 1], np.array([-3.0, 3.0])))
    if not cut:
        return whole_sheet
    return Terrain(whole_sheet.vertices, whole_sheet.faces, in_parts(whole_sheet))


def bending(
    bend: Bend, contact: Contact, facets: int, cut: bool, engine: str, time_step: float
) -> float:
    """Run-out of the block on the level, from rest.

    Parameters
    ----------
    cut : bool, whether the ground is convex parts, else triangles
    time_step : float [s]

    Returns
    -------
    float [m]
    """
    turn = axes(bend.angle)
    place = turn.T @ np.array([bend.top[0], 0.0, bend.top[1]])
    place[2] += 0.5 * SIZE[2] + ABOVE
    start = State(place, np.eye(3), np.zeros(3), np.zeros(3))
    number, step = whole(LONGEST, time_step)
    placed = scene(block(), contact, _bent(bend, facets, cut), bend.angle, start)
    path = run(engine, placed, step, np.zeros(number))
    return float(path.position[-1, 0])


ENERGY_LINE = (
    "25 deg, friction 0.6: the energy line falls by the friction, Coulomb. On one convex part: at "
    "borders inside the ground Bullet's hulls catch, and stop"
)

CASES = tuple(
    case(f"slide to rest on a slope, e = {e:g}", ENERGY_LINE, tolerance,
         sliding, math.radians(25.0), Contact(0.6, e), 12.0, True, engines=REBOUNDS)
    for e, tolerance in ((0.0, 0.05), (0.38, 0.02))
)  # fmt: skip
