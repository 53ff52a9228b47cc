"""A rock as a rigid body in its rest pose."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.rock.hull import Hull, convex_hull

LARGEST_SIZE = 30.0
"""A rock with a longer side than this [m] was probably not given in metres."""

SMALLEST_SIZE = 0.005
"""The same for one whose longest side is shorter [m]."""

THINNEST = 0.001
"""Shortest side of a block, as a share of its longest: engines take a thinner base for a point."""


def check_size(size: float) -> None:
    """Refuse a size that no rock has here.

    Parameters
    ----------
    size : float [m], its longest side

    Raises
    ------
    InvalidInput
        If it is too large or too small.
    """
    if not SMALLEST_SIZE <= size <= LARGEST_SIZE:
        raise InvalidInput(
            f"a rock {size:.3g} m large",
            f"rocks here are {SMALLEST_SIZE} to {LARGEST_SIZE:.0f} m",
            "scale? lengths are in metres; rock.scale is 0.001 for a mesh in millimetres",
        )


@dataclass(frozen=True, eq=False)
class Rock:
    """A rigid rock in its rest pose: origin at the centre of mass, z up, yaw 0.

    Attributes
    ----------
    vertices : ndarray, shape (n, 3) [m], corners of its convex hull; six poles of a sphere
    mass : float [kg]
    inertia : ndarray, shape (3,) [kg m^2], principal moments
    axes : ndarray, shape (3, 3), principal axes as columns, right-handed
    """

    shape: Literal["box", "hull", "sphere"]
    vertices: Array
    mass: float
    inertia: Array
    axes: Array

    @cached_property
    def radius(self) -> float:
        """Largest distance of a vertex from the centre of mass [m]."""
        return float(np.linalg.norm(self.vertices, axis=1).max())

    @cached_property
    def height(self) -> float:
        """Height of the centre of mass above the pedestal at rest [m]."""
        return float(-self.vertices[:, 2].min())

    @cached_property
    def hull(self) -> Hull:
        """Its convex hull."""
        return convex_hull(self.vertices)
