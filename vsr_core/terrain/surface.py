"""The ground that a rock stands on and travels over: an open sheet of triangles."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.rock.triangles import cells_of_boxes

_CELLS_A_FACE = 0.5  # cells of the lookup grid per triangle


@dataclass(frozen=True, eq=False)
class Terrain:
    """Ground in the site's frame.

    Its z is up, its origin vertically below the rock's centre of mass, at the height of the rock's
    lowest point as it stands.

    Attributes
    ----------
    vertices : ndarray, shape (n, 3) [m]
    faces : ndarray of int, shape (m, 3)
        Corners of each triangle, counter-clockwise seen from outside: normals leave the ground.
    parts : tuple of ndarray, each of shape (k, 3) [m]
        Corners of convex parts that stand for it in an engine that takes them; none if its
        triangles do.
    """

    vertices: Array
    faces: Indices
    parts: tuple[Array, ...] = ()

    def surfaces(self, x: float, y: float) -> tuple[Array, Mask]:
        """Heights at which a vertical meets the ground, ascending.

        Parameters
        ----------
        x, y : float [m]

        Returns
        -------
        height : ndarray, shape (k,) [m]
            Empty where there is no ground.
        upward : ndarray of bool, shape (k,)
            Whether the ground lies below there (its normal points up).
        """
        corners = self.vertices[self.faces[self.around(x, y)]]
        u, v = corners[:, :, 0] - x, corners[:, :, 1] - y
        # Twice the area between (x, y) and the side opposite each corner. Faces that share a side
        # get the same number with opposite signs: no vertical slips through between them.
        i, j = [1, 2, 0], [2, 0, 1]
        area = u[:, i] * v[:, j] - u[:, j] * v[:, i]
        twice = area.sum(axis=1)
        met = ((area >= 0.0).all(axis=1) | (area <= 0.0).all(axis=1)) & (twice != 0.0)
        height = (area[met] * corners[met, :, 2]).sum(axis=1) / twice[met]
        order = np.argsort(height)
        return height[order], (twice[met] > 0.0)[order]

    def around(self, x: float, y: float) -> Indices:
        """Faces near a vertical: all that it meets are among them.

        Parameters
        ----------
        x, y : float [m]

        Returns
        -------
        ndarray of int, shape (k,)
        """
        return self.lookup.at(x, y)

    def depth(self, point: Array) -> float | None:
        """How far a point is below the ground.

        Parameters
        ----------
        point : ndarray, shape (3,) [m]

        Returns
        -------
        float or None
            In metres, 0 above the ground; None beyond its border, where none is below or above.
        """
        height, upward = self.surfaces(float(point[0]), float(point[1]))
        if not len(height):
            return None
        above = int(np.searchsorted(height, point[2]))
        buried = above < len(height) and bool(upward[above])
        return float(height[above] - point[2]) if buried else 0.0

    @property
    def lowest(self) -> float:
        """Height of its lowest point [m]."""
        return float(self.vertices[:, 2].min())

    @cached_property
    def lookup(self) -> Grid:
        """Faces by the cells of a grid in the plane."""
        corners = self.vertices[self.faces][:, :, :2]
        return Grid.over(corners.min(axis=1), corners.max(axis=1))


@dataclass(frozen=True)
class Grid:
    """Which boxes in the plane reach into each cell of a regular grid."""

    origin: Array
    cell: float
    shape: tuple[int, int]
    first: Indices
    box: Indices

    @classmethod
    def over(cls, low: Array, high: Array) -> Grid:
        origin, extent = low.min(axis=0), high.max(axis=0) - low.min(axis=0)
        cell = float(np.sqrt(max(extent.prod(), 1e-12) / (_CELLS_A_FACE * len(low))))
        nx, ny = (int(n) for n in np.floor(extent / cell).astype(int) + 1)
        ends = (np.floor((end - origin) / cell).astype(np.int64) for end in (low, high))
        box, cells = cells_of_boxes(*ends)
        place = cells[:, 0] * ny + cells[:, 1]
        order = np.argsort(place, kind="stable")
        first = np.searchsorted(place[order], np.arange(nx * ny + 1))
        return cls(origin, cell, (nx, ny), first, box[order])

    def at(self, x: float, y: float) -> Indices:
        # Not by //, which rounds otherwise than what put the boxes into their cells.
        i = math.floor((x - self.origin[0]) / self.cell)
        j = math.floor((y - self.origin[1]) / self.cell)
        if not (0 <= i < self.shape[0] and 0 <= j < self.shape[1]):
            return self.box[:0]
        place = i * self.shape[1] + j
        return self.box[self.first[place] : self.first[place + 1]]
