"""A rock as a rigid body in its rest pose."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from vsr_core.arrays import Array
from vsr_core.rock.hull import Hull, convex_hull


@dataclass(frozen=True, eq=False)
class Rock:
    """A rigid rock in its rest pose: origin at the centre of mass, z up, yaw 0.

    Attributes
    ----------
    shape : "box", "hull" or "sphere"
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
