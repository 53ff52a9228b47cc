"""Origin of an observed fallen rock: probable motions, and end positions of the runs around it."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from pipeline.drawing import style
from pipeline.drawing.ground_map import around, draw, relief
from pipeline.stages.displacement.correlation_figures import NAMES
from pipeline.stages.displacement.trajectory_maps import WIDTH, named
from vsr_core.arrays import Array, Mask
from vsr_core.displacement.origin import REACH, Forward, ObservedBoulder, Origin

SHARE = 0.95
"""Of the probability, that the outlined motions hold."""

_ODDS = "Blues"
_UNKNOWN = "#cfcfcf"


@style.styled
def origin_maps(
    origin: Origin, forward: Forward, found: ObservedBoulder, terrain: xr.Dataset, source: str
) -> Figure:
    """Draw the probability of each PGA and PGV/PGA, and the runs that end near the place.

    Parameters
    ----------
    origin : Origin, as ``trace`` gives it from ``forward`` and ``found``
    """
    figure = Figure(figsize=(WIDTH, 4.9))
    left = figure.add_axes((0.06, 0.2, 0.34, 0.68))
    right = figure.add_axes((0.53, 0.2, 0.455, 0.68))
    _motions(figure, left, origin, forward)
    _ground(right, origin, forward, found, terrain)
    text, weight = textwrap.fill(origin.statement, 65), "normal" if origin.answered else "bold"
    figure.text(0.06, 0.105, text, va="top", weight=weight, gid="statement")
    named(figure, source)
    return figure


def _motions(figure: Figure, axes: Axes, origin: Origin, forward: Forward) -> None:
    right, up = style.cell_edges(origin.pga), style.cell_edges(origin.pgv_pga)
    axes.set(title="probability of the motion, given the place", facecolor=_UNKNOWN,
             xlabel=NAMES["pga"], ylabel=NAMES["pgv_pga"],
             xlim=right[[0, -1]], ylim=up[[0, -1]])  # fmt: skip
    if not origin.answered:
        axes.text(0.5, 0.5, "no answer", transform=axes.transAxes, ha="center", gid="none")
        return
    tried = np.zeros(origin.of_motion.shape, dtype=bool)
    at = np.searchsorted(origin.pgv_pga, forward.pgv_pga), np.searchsorted(origin.pga, forward.pga)
    tried[at] = True
    odds = np.where(tried, 100.0 * origin.of_motion, np.nan)
    cells = axes.pcolormesh(
        right, up, odds, cmap=_ODDS, vmin=0.0, rasterized=True, gid="motions"
    )  # fmt: skip
    figure.colorbar(cells, ax=axes, label="probability of a cell [%]", pad=0.02)
    sides = list(_outline(origin.region(SHARE), right, up))
    red: Any = {"color": style.OVERTURNED, "lw": 1.1}
    axes.add_collection(LineCollection(sides, **red, gid="region"))
    axes.plot([], [], label=f"holds {100 * SHARE:.0f} % of the probability", **red)
    if not tried.all():
        axes.plot([], [], "s", color=_UNKNOWN, ms=7, label="no run, or its end unknown")
    axes.legend(loc="lower left", frameon=True, framealpha=0.9, edgecolor="none")


def _outline(region: Mask, right: Array, up: Array) -> Iterator[Array]:
    """Sides of cells on the border of the region."""
    padded = np.pad(region, 1)
    for row, column in np.argwhere(padded[1:, 1:-1] != padded[:-1, 1:-1]):
        yield np.array([[right[column], up[row]], [right[column + 1], up[row]]])
    for row, column in np.argwhere(padded[1:-1, 1:] != padded[1:-1, :-1]):
        yield np.array([[right[column], up[row]], [right[column], up[row + 1]]])


def _ground(
    axes: Axes, origin: Origin, forward: Forward, found: ObservedBoulder, terrain: xr.Dataset
) -> None:
    on_it = ~np.isnan(forward.end).any(axis=1)
    end, weight = forward.end[on_it], origin.weight[on_it]
    reach = REACH * found.sigma * np.array([[-1.0, -1.0], [1.0, 1.0]])
    window = around(np.concatenate([end, np.zeros((1, 2)), found.place + reach]), terrain)
    draw(axes, relief(terrain, window), window)
    look: Any = {"rasterized": True, "zorder": 3}
    far = weight == 0.0
    axes.scatter(
        end[far, 0], end[far, 1], 9, color="#6e6e6e", lw=0.0, label="end of a run, too far", **look
    )
    if origin.answered:
        order = np.flatnonzero(~far)[np.argsort(weight[~far])]
        look |= {"c": weight[order], "cmap": _ODDS, "vmin": 0.0, "edgecolors": style.INK}
        label = "end of a run, by weight"
        axes.scatter(end[order, 0], end[order, 1], 20, lw=0.35, label=label, gid="near", **look)
    red: Any = {"color": style.OVERTURNED}
    for sigmas, line in ((1.0, "-"), (REACH, "--")):
        ring: Any = {**red, "ls": line, "lw": 1.3}
        circle = Circle(found.place, sigmas * found.sigma, fill=False, zorder=4, **ring)
        circle.set_gid("reach")
        axes.add_patch(circle)
        axes.plot([], [], label=f"{sigmas:g} sigma from the place", **ring)
    axes.plot(*found.place, "P", mec="white", ms=9, zorder=5, label="observed place", gid="place",
              **red)  # fmt: skip
    axes.plot(0.0, 0.0, "o", mfc="white", mec=style.INK, ms=6, zorder=5, label="start")
    axes.set(title="end positions around the place", xlabel="x [m]", ylabel="y [m]")
    below: Any = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.13)}
    axes.legend(**below, ncols=3, fontsize=7, columnspacing=1.0)
