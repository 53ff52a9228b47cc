"""Where the eye stands and what its picture covers: a view without perspective.

A metre is as long in front as behind, and one scale bar holds for all of the picture.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vsr_core.arrays import Array, Indices


@dataclass(frozen=True, eq=False)
class View:
    """Where the eye is and what its picture covers.

    Attributes
    ----------
    axes : ndarray, shape (3, 3), unit vectors to the right, up and towards the eye, as rows
    middle : ndarray, shape (3,) [m], point in the middle of the picture
    pixel : float [m], side of a pixel
    shape : (int, int), rows and columns
    """

    axes: Array
    middle: Array
    pixel: float
    shape: tuple[int, int]

    def project(self, points: Array) -> Array:
        """Column, row [pixel] from the upper left corner and depth [m] towards the eye.

        Parameters
        ----------
        points : ndarray, shape (..., 3) [m]

        Returns
        -------
        ndarray, shape (..., 3)
        """
        # Not ``@``: on a busy machine its threads wait for each other, many times as long.
        placed = np.einsum("...j,ij->...i", points - self.middle, self.axes)
        right, up, depth = np.moveaxis(placed, -1, 0)
        rows, columns = self.shape
        return np.stack(
            [0.5 * columns + right / self.pixel, 0.5 * rows - up / self.pixel, depth], axis=-1
        )

    def points(self, pixels: Indices, depths: Array) -> Array:
        """Points in the middle of pixels at given depths.

        Parameters
        ----------
        pixels : ndarray of int, shape (n,), numbered row by row
        depths : ndarray, shape (n,) [m]

        Returns
        -------
        ndarray, shape (n, 3) [m]
        """
        rows, columns = self.shape
        right = (pixels % columns + 0.5 - 0.5 * columns) * self.pixel
        up = (0.5 * rows - 0.5 - pixels // columns) * self.pixel
        placed = np.stack([right, up, depths], axis=-1)
        return np.einsum("ni,ij->nj", placed, self.axes) + self.middle


def axes_of(azimuth: float, elevation: float) -> Array:
    """Axes of a view from where the eye stands.

    Parameters
    ----------
    azimuth : float [rad], of the eye seen from the scene, counter-clockwise from +x
    elevation : float [rad], of the eye above the horizon, less than a right angle

    Returns
    -------
    ndarray, shape (3, 3), as ``View.axes``; the vertical is upright in the picture
    """
    level = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    eye = np.cos(elevation) * level + np.array([0.0, 0.0, np.sin(elevation)])
    right = np.array([-level[1], level[0], 0.0])
    return np.stack([right, np.cross(eye, right), eye])


def fitted(axes: Array, points: Array, shape: tuple[int, int], margin: float = 0.0) -> View:
    """View along ``axes`` in which all points lie within the picture less a margin.

    Parameters
    ----------
    axes : ndarray, shape (3, 3), see ``axes_of``
    points : ndarray, shape (n, 3) [m]
    shape : (int, int), rows and columns
    margin : float, share of the picture's lesser side that stays free on every side
    """
    placed = points @ axes.T
    low, high = placed.min(axis=0), placed.max(axis=0)
    free = 2.0 * margin * min(shape)
    pixel = max((high[0] - low[0]) / (shape[1] - free), (high[1] - low[1]) / (shape[0] - free))
    return View(axes, 0.5 * (low + high) @ axes, float(pixel), shape)


def reach(path: Array, radius: float) -> Array:
    """Points that span a rock along its path.

    Parameters
    ----------
    path : ndarray, shape (n, 3) [m], of its centre
    radius : float [m]

    Returns
    -------
    ndarray, shape (6 n, 3) [m]
    """
    return np.concatenate([path + radius * side for side in (*np.eye(3), *-np.eye(3))])


def round_number(value: float) -> float:
    """Largest of 1, 2 and 5 times a power of ten that is not above a value.

    Examples
    --------
    >>> round_number(73.0), round_number(0.021)
    (50.0, 0.02)
    """
    power = 10.0 ** math.floor(math.log10(value))
    return power * max(step for step in (1.0, 2.0, 5.0) if step * power <= value * (1.0 + 1e-9))


def contour_step(points: Array) -> float:
    """Height between two contours of a picture.

    Parameters
    ----------
    points : ndarray, shape (n, 3) [m], what the picture spans

    Returns
    -------
    float [m]
    """
    return round_number(0.06 * float(np.ptp(points, axis=0).max()))
