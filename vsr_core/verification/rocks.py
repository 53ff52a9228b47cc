"""Rocks and states of rocks that the reference suite and the stability suite share."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import trimesh

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.rock import solid
from vsr_core.rock.body import Rock
from vsr_core.scene import State

DENSITY = 2110.0
"""Density of the rocks [kg/m^3], that of chert in the paper; hardly an answer depends on it."""

GRIPPING = 10.0
"""Coefficient of friction with which nothing slides."""

Triple = tuple[float, float, float]

STILL: Triple = (0.0, 0.0, 0.0)
"""No velocity."""


@cache
def box(width: float, depth: float, height: float) -> Rock:
    """Box on its face.

    Parameters
    ----------
    width, depth, height : float [m], sides along x, y and z
    """
    return solid.box((width, depth, height), DENSITY).rock


@cache
def sphere(radius: float) -> Rock:
    """Uniform sphere.

    Parameters
    ----------
    radius : float [m]
    """
    mass = DENSITY * 4.0 / 3.0 * math.pi * radius**3
    poles = radius * np.vstack([np.eye(3), -np.eye(3)])
    return Rock("sphere", poles, mass, np.full(3, 0.4 * mass * radius**2), np.eye(3))


@cache
def frustum(base: tuple[float, float], top: tuple[float, float], height: float) -> Rock:
    """Hull with a rectangular base and top.

    Parameters
    ----------
    base, top : tuple of float [m], sides along x and y
    height : float [m]
    """
    corners = [
        (0.5 * sides[0] * x, 0.5 * sides[1] * y, level)
        for sides, level in ((base, 0.0), (top, height))
        for x in (-1.0, 1.0)
        for y in (-1.0, 1.0)
    ]
    return hull(np.array(corners))


def hull(corners: Array, *, as_scanned: bool = False) -> Rock:
    """Convex hull of some corners.

    Parameters
    ----------
    corners : ndarray, shape (n, 3) [m]
    as_scanned : bool, whether it keeps its pose or is set on its base
    """
    mesh = trimesh.convex.convex_hull(corners)
    return solid.from_mesh(mesh, DENSITY, as_scanned=as_scanned).rock


def unit(rock: Rock) -> float:
    """Time scale of a rock, sqrt(radius / g) [s].

    Returns
    -------
    float [s]
    """
    return math.sqrt(rock.radius / GRAVITY)


def upright(position: Triple, velocity: Triple = STILL, angular_velocity: Triple = STILL) -> State:
    """State of a rock turned as in its rest pose.

    Parameters
    ----------
    position : tuple of float [m], of the centre of mass
    velocity : tuple of float [m/s]
    angular_velocity : tuple of float [rad/s]
    """
    return State(np.array(position), np.eye(3), np.array(velocity), np.array(angular_velocity))


def leaning(rock: Rock, lean: float) -> State:
    """State at rest of a box tilted about its lower edge towards +x.

    Parameters
    ----------
    lean : float [rad]
    """
    half = float(np.abs(rock.vertices[:, 0]).max())
    cos, sin = math.cos(lean), math.sin(lean)
    turn = np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
    place = np.array([half, 0.0, 0.0]) - turn @ np.array([half, 0.0, -rock.height])
    return State(place, turn, np.zeros(3), np.zeros(3))
