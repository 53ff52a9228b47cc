"""The terrain from above: its heights on a grid, shaded and with contours."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from pipeline.drawing.rendering import depths_of, drawn, seen
from pipeline.drawing.view import View
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


def around(points: Array, terrain: xr.Dataset) -> Window:
    """Window around points with a margin; all of the terrain if there are none.

    Parameters
    ----------
    points : ndarray, shape (n, 2) [m]

    Returns
    -------
    Window, whose shorter side is at least ``FLATTEST`` of the longer
    """
    if not len(points):
        points = terrain["terrain_vertex"].values[:, :2]
    low, high = points.min(axis=0), points.max(axis=0)
    size = np.maximum(high - low, 1.0)
    size = np.maximum(size + 0.16 * size.max(), FLATTEST * 1.16 * size.max())
    left, bottom = 0.5 * (low + high - size)
    return Window((left, left + size[0]), (bottom, bottom + size[1]))


def relief(terrain: xr.Dataset, window: Window) -> xr.DataArray:
    """Heights of what is seen of the terrain from above.

    Returns
    -------
    DataArray, dimensions (y, x) [m], on a grid in the window; NaN where there is no terrain
    """
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
    upwards = height.reshape(view.shape)[::-1]  # a picture's rows run downwards
    return xr.DataArray(upwards, {"y": y, "x": x})


def draw(axes: Axes, ground: xr.DataArray, window: Window, *, named: bool = True) -> None:
    """Shade the ground, draw its contours and set the axes to it.

    Parameters
    ----------
    named : bool
        Whether contours bear their height.
    """
    x, y, height = ground["x"].values, ground["y"].values, ground.values
    cell = float(x[1] - x[0])
    down, across = np.gradient(height, cell)
    normal = np.stack([-across, -down, np.ones(across.shape)])
    light = np.tensordot(_LIGHT, normal / np.linalg.norm(normal, axis=0), 1)
    half = 0.5 * cell
    axes.imshow(
        _DARK + (_BRIGHT - _DARK) * (0.5 + 0.5 * light),
        origin="lower", extent=(x[0] - half, x[-1] + half, y[0] - half, y[-1] + half),
        cmap="gray", vmin=0.0, vmax=1.0, interpolation="bilinear", zorder=0, gid="relief",
    )  # fmt: skip
    if np.nanmax(height, initial=-np.inf) - np.nanmin(height, initial=np.inf) > 1e-6:
        lines = axes.contour(x, y, height, 8, colors="#6a6a6a", linewidths=0.5,
                             linestyles="solid", zorder=1)  # fmt: skip
        if named:
            axes.clabel(lines, fontsize=6.0, fmt="%g m", colors="#4a4a4a")
    axes.set(xlim=window.x, ylim=window.y, aspect="equal")
