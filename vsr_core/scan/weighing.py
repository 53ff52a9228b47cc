"""What each step from scan to solid changed: weighed before and after."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import trimesh

from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.rock.hull import convex_hull
from vsr_core.rock.solid import LARGEST_LEVELLING
from vsr_core.rock.tipping import settle, tipping

DIRECTIONS = np.radians(np.arange(0.0, 360.0, 5.0))
"""Directions [rad] in which tipping is compared."""


Tell = Callable[[str], None]
"""Takes what is being done, in a few words: scans of millions of faces take minutes."""


@dataclass(frozen=True)
class Measure:
    """A mesh in figures.

    Attributes
    ----------
    volume : float [m^3], nan if open, as are the next ones
    mass : float [kg]
    centre_of_mass : ndarray, shape (3,) [m]
    inertia : ndarray, shape (3, 3) [kg m^2], about the centre of mass
    tipping : ndarray, shape (72,) [rad], static tipping angles in ``DIRECTIONS``; nan where the
        solid does not stand
    """

    faces: int
    vertices: int
    watertight: bool
    volume: float
    mass: float
    centre_of_mass: Array
    inertia: Array
    tipping: Array


@dataclass(frozen=True)
class Step:
    """A step from scan to solid.

    Attributes
    ----------
    hausdorff : float [m], largest distance between the two surfaces, sampled; nan if not compared
    """

    name: str
    before: Measure
    after: Measure
    hausdorff: float
    notes: tuple[str, ...]

    @property
    def tipping_change(self) -> float:
        """Largest change of a static tipping angle [rad]; nan where one of the two is open."""
        return largest_change(self.before, self.after)


@dataclass(frozen=True)
class Trial:
    """Another closing, to see what an unseen underside does to the result.

    Attributes
    ----------
    moved : float [m], of the centre of mass from that of the closing chosen
    tipping_change : float [rad], largest change of a static tipping angle against it
    """

    closing: str
    measure: Measure | None
    moved: float
    tipping_change: float
    reason: str


def tried(
    closing: str, make: Callable[[], trimesh.Trimesh], chosen: Measure, density: float
) -> Trial:
    """Another closing weighed against the one chosen.

    Parameters
    ----------
    density : float [kg/m^3]
    """
    try:
        other = measured(make(), density)
    except InvalidInput as error:
        return Trial(closing, None, np.nan, np.nan, error.given)
    moved = float(np.linalg.norm(other.centre_of_mass - chosen.centre_of_mass))
    return Trial(closing, other, moved, largest_change(chosen, other), "")


def measured(mesh: trimesh.Trimesh, density: float) -> Measure:
    """Figures of a mesh of uniform density.

    Parameters
    ----------
    mesh : trimesh.Trimesh [m]
    density : float [kg/m^3]

    Examples
    --------
    >>> measured(trimesh.creation.box((1.0, 1.0, 2.0)), 2000.0).mass
    4000.0
    """
    nothing = np.full(3, np.nan), np.full((3, 3), np.nan), np.full(len(DIRECTIONS), np.nan)
    counts = len(mesh.faces), len(mesh.vertices)
    if not mesh.is_watertight:
        return Measure(*counts, False, np.nan, np.nan, *nothing)
    centre = np.array(mesh.center_mass)
    volume = float(mesh.volume)
    inertia = density * np.array(mesh.moment_inertia)
    tipping = tipping_angles(np.array(mesh.vertices) - centre)
    return Measure(*counts, True, volume, density * volume, centre, inertia, tipping)


def tipping_angles(points: Array) -> Array:
    """Static tipping angles of the hull of points, set on a level plane.

    Parameters
    ----------
    points : ndarray, shape (n, 3) [m], about the centre of mass

    Returns
    -------
    ndarray, shape (72,) [rad], in ``DIRECTIONS``; nan where it does not stand
    """
    try:
        hull = convex_hull(points)
        return np.asarray(
            tipping(hull.turned(settle(hull, LARGEST_LEVELLING)[0]), DIRECTIONS).angle
        )
    except InvalidInput:
        return np.full(len(DIRECTIONS), np.nan)


def largest_change(one: Measure, other: Measure) -> float:
    """Largest difference of static tipping angles of two solids.

    Returns
    -------
    float [rad]
    """
    return float(np.abs(one.tipping - other.tipping).max())
