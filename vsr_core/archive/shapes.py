"""Rocks drawn at random, from which the equations are made: boxes, profiles in depth, and hulls."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from vsr_core.arrays import Array
from vsr_core.rock import solid
from vsr_core.rock.body import Rock
from vsr_core.rock.tipping import base_polygon

DENSITY = 2500.0
"""Density [kg/m^3]; no outcome depends on it."""

ARC = 2.0 * math.pi / 32.0
"""Angle between the facets of a rounded edge [rad]."""

Random = np.random.Generator


@dataclass(frozen=True, eq=False)
class Drawn:
    """A rock that is shaken along x, and the radius of the edges of its base [m]."""

    rock: Rock
    edge: float = 0.0


def box(random: Random) -> Drawn:
    """Box on its face, of 0.3 to 4 m and a slenderness of 1:10 to 0.75."""
    height = _size(random)
    width = height * math.exp(random.uniform(math.log(0.1), math.log(0.75)))
    return Drawn(solid.block((width, height * random.uniform(0.3, 1.5), height), DENSITY))


def prism(random: Random) -> Drawn:
    """A profile on a flat base, with sharp or round edges, the same through all its depth."""
    base = math.exp(random.uniform(math.log(0.1), math.log(0.7)))
    wide = 0.5 * base + random.uniform(0.0, 0.35, 2)
    level, top = random.uniform(0.2, 0.8, 2), wide * random.uniform(0.3, 1.0, 2)
    left, right = (
        [(way * 0.5 * base, 0.0), (way * wide[n], level[n]), (way * top[n], 1.0)]
        for n, way in enumerate((-1.0, 1.0))
    )
    edge = _edge(random)
    turn = np.arange(-math.pi, 1e-9, ARC)
    arc = edge * np.column_stack([np.cos(turn), np.sin(turn)])
    outline = (np.array(left + right)[:, None] + (arc if edge else 0.0)).reshape(-1, 2)
    depth = random.uniform(0.3, 1.2)
    corners = np.vstack([np.insert(outline, 1, y, axis=1) for y in (-0.5 * depth, 0.5 * depth)])
    return _standing(corners, edge, random)


def hull(random: Random) -> Drawn:
    """Points of an ellipsoid above a flat base of three to eight corners, sharp or round.

    It is shaken across the edge of its base that is nearest to its centre of mass, which is how
    rocks are photographed: to its weakest side.
    """
    number = int(random.integers(3, 9))
    around = np.sort(random.uniform(0.0, 2.0 * math.pi, number))
    base = math.exp(random.uniform(math.log(0.08), math.log(0.4))) * random.uniform(
        0.7, 1.3, number
    )
    foot = np.column_stack([base * np.cos(around), base * np.sin(around), np.zeros(number)])
    if edge := _edge(random):
        foot = (foot[:, None] + edge * _BOWL).reshape(-1, 3)
    ways = random.normal(size=(30, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    axes = np.array([*random.uniform(0.2, 0.55, 2), 0.5])
    body = axes * ways + [*random.uniform(-0.08, 0.08, 2), 0.5 + random.uniform(0.0, 0.15)]
    drawn = _standing(np.vstack([foot, body[body[:, 2] > 0.05]]), edge, random)
    return replace(drawn, rock=turned(drawn.rock, -weakest(drawn.rock)))


FAMILIES: dict[str, Callable[[Random], Drawn]] = {"box": box, "prism": prism, "hull": hull}
"""By their names."""

_BOWL = np.array(
    [[0.0, 0.0, -1.0]]
    + [
        [math.cos(turn) * math.sin(dip), math.sin(turn) * math.sin(dip), -math.cos(dip)]
        for dip in np.arange(1, 6) * ARC
        for turn in np.arange(8) * math.pi / 4.0
    ]
)
"""Lower part of a sphere, by facets."""


def _size(random: Random) -> float:
    return math.exp(random.uniform(math.log(0.3), math.log(4.0)))


def _edge(random: Random) -> float:
    """Radius of the edges of a base, as a share of about the height; none in two of five."""
    return float(max(random.uniform(-0.1, 0.15), 0.0))


def _standing(corners: Array, edge: float, random: Random) -> Drawn:
    """The hull of some corners, on its base, in one of the sizes that rocks have."""
    from trimesh.convex import convex_hull

    size = _size(random)
    return Drawn(solid.from_mesh(convex_hull(size * corners), DENSITY).rock, size * edge)


def turned(rock: Rock, angle: float) -> Rock:
    """A rock turned about the vertical.

    Parameters
    ----------
    angle : float [rad], counter-clockwise seen from above
    """
    cos, sin = math.cos(angle), math.sin(angle)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return Rock("hull", rock.vertices @ turn.T, rock.mass, rock.inertia, turn @ rock.axes)


def weakest(rock: Rock) -> float:
    """Direction across the edge of the base that is nearest to the centre of mass [rad]."""
    corners = base_polygon(rock.vertices, 1e-6 * rock.radius)
    edges = np.roll(corners, -1, axis=0) - corners
    outward = np.column_stack([edges[:, 1], -edges[:, 0]])
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    nearest = outward[int(np.argmin((outward * corners).sum(axis=1)))]
    return math.atan2(nearest[1], nearest[0])
