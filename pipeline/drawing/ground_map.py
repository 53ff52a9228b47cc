"""The terrain from above: its heights on a grid, shaded and with contours."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from scipy.interpolate import RegularGridInterpolator

from pipeline.drawing.rendering import View, depths_of, drawn, seen
from vsr_core.arrays import Array

CELLS = 420
"""Cells of the grid along the longer side of the window."""

FLATTEST = 0.6
"""Sides of a window, the shorter over the longer, at least."""

_LIGHT = np.array([-0.5, 0.5, 0.7]) / np.linalg.norm([-0.5, 0.5, 0.7])  # from the upper left
_DARK, _BRIGHT = 0.3, 1.0


@dataclass(frozen=True)
class Window:
    """A rectangle of the ground: ends of x and y [m]."""

    x: tuple[float, float]
    y: tuple[float, float]

    @property
    def size(self) -> tuple[float, float]:
        """Width and height [m]."""
        return self.x[1] - self.x[0], self.y[1] - self.y[0]


@dataclass(frozen=True, eq=False)
class Relief:
    """Heights of the terrain's upper side.

    Attributes
    ----------
    x : ndarray, shape (n,) [m]
    y : ndarray, shape (m,) [m]
    height : ndarray, shape (m, n) [m], NaN where there is no terrain
    """

    x: Array
    y: Array
    height: Array

    def at(self, x: Array, y: Array) -> Array:
        """Height [m] at points, any shape; NaN outside."""
        heights = RegularGridInterpolator((self.y, self.x), self.height, bounds_error=False)
        found: Array = heights(np.stack([y, x], axis=-1))
        return found


def around(points: Array, terrain: xr.Dataset) -> Window:
    """Window around ``points``, shape (n, 2) [m], with a margin; all the terrain if there are none.

    The shorter side is at least ``FLATTEST`` of the longer.
    """
    if not len(points):
        points = terrain["terrain_vertex"].values[:, :2]
    low, high = points.min(axis=0), points.max(axis=0)
    size = np.maximum(high - low, 1.0)
    size = np.maximum(size + 0.16 * size.max(), FLATTEST * 1.16 * size.max())
    left, bottom = 0.5 * (low + high - size)
    return Window((left, left + size[0]), (bottom, bottom + size[1]))


def relief(terrain: xr.Dataset, window: Window) -> Relief:
    """Heights of what is seen of the terrain from above, on a grid in ``window``."""
    cell = max(window.size) / CELLS
    columns, rows = (math.ceil(side / cell) for side in window.size)
    middle = np.array([sum(window.x), sum(window.y), 0.0]) / 2.0
    view = View(np.eye(3), middle, cell, (rows, columns))
    vertices, faces = terrain["terrain_vertex"].values, terrain["terrain_face"].values
    buffer = drawn(view, vertices.astype(float), faces.astype(np.int64))
    height = np.full(buffer.shape, np.nan)
    height[seen(buffer)] = depths_of(buffer[seen(buffer)])
    x, y = (
        at + (np.arange(count) + 0.5 - 0.5 * count) * cell
        for at, count in ((middle[0], columns), (middle[1], rows))
    )
    return Relief(x, y, height.reshape(view.shape)[::-1])  # a picture's rows run downwards


def draw(axes: Axes, ground: Relief, window: Window, *, named: bool = True) -> None:
    """Shade the ground, draw its contours, ``named`` by their height, and set the axes to it."""
    cell = float(ground.x[1] - ground.x[0])
    down, across = np.gradient(ground.height, cell)
    normal = np.stack([-across, -down, np.ones(across.shape)])
    light = np.tensordot(_LIGHT, normal / np.linalg.norm(normal, axis=0), 1)
    axes.imshow(
        _DARK + (_BRIGHT - _DARK) * (0.5 + 0.5 * light),
        origin="lower",
        extent=(
            ground.x[0] - 0.5 * cell, ground.x[-1] + 0.5 * cell,
            ground.y[0] - 0.5 * cell, ground.y[-1] + 0.5 * cell,
        ),
        cmap="gray",
        vmin=0.0,
        vmax=1.0,
        interpolation="bilinear",
        zorder=0,
        gid="relief",
    )  # fmt: skip
    known = ground.height[~np.isnan(ground.height)]
    if known.size and np.ptp(known) > 1e-6:
        levels = MaxNLocator(9).tick_values(known.min(), known.max())
        lines = axes.contour(
            ground.x,
            ground.y,
            ground.height,
            levels,
            colors="#6a6a6a",
            linewidths=0.5,
            linestyles="solid",
            zorder=1,
        )
        if named:
            axes.clabel(lines, fontsize=6.0, fmt="%g m", colors="#4a4a4a")
    axes.set_xlim(window.x)
    axes.set_ylim(window.y)
    axes.set_aspect("equal")
