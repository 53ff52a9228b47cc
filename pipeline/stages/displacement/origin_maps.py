"""Where a found rock came from: probable shakings, and the ends of the runs around the place."""

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
from matplotlib.patheffects import withStroke

from pipeline.drawing import style
from pipeline.drawing.ground_map import around, draw, relief
from pipeline.stages.displacement.correlation_figures import NAMES
from pipeline.stages.displacement.trajectory_maps import WIDTH, named
from vsr_core.arrays import Array, Mask
from vsr_core.displacement.origin import REACH, Forward, Found, Origin

SHARE = 0.95
"""Of the probability, that the outlined motions hold."""

_ODDS = "Blues"
_UNKNOWN = "#cfcfcf"


@style.styled
def origin_maps(
    origin: Origin,
    forward: Forward,
    found: Found,
    terrain: xr.Dataset,
    source: str,
    starts: Array | None = None,
) -> Figure:
    """Draw the probability of each PGA and PGV/PGA, and of what is near the place.

    Parameters
    ----------
    origin : Origin, as ``trace`` gives it from ``forward`` and ``found``
    forward : Forward
    found : Found
    terrain : Dataset
        As in ``terrain.nc``, in the frame of the place.
    source : str
        What the terrain is.
    starts : ndarray, shape (s, 2) [m], optional
        Places of the starts in the order of their numbers; the origin if there is one only.
    """
    figure = Figure(figsize=(WIDTH, 4.9))
    left = figure.add_axes((0.06, 0.2, 0.34, 0.68))
    right = figure.add_axes((0.53, 0.2, 0.455, 0.68))
    _motions(figure, left, origin, forward)
    places = np.zeros((1, 2)) if starts is None else starts
    _ground(right, origin, forward, found, terrain, places)
    figure.text(
        0.06,
        0.08,
        textwrap.fill(origin.statement, 65),
        va="top",
        weight="normal" if origin.answered else "bold",
        gid="statement",
    )
    named(figure, source)
    return figure


def _motions(figure: Figure, axes: Axes, origin: Origin, forward: Forward) -> None:
    axes.set_title("PGA and PGV/PGA, given the place")
    axes.set_xlabel(NAMES["pga"])
    axes.set_ylabel(NAMES["pgv_pga"])
    right, up = style.cell_edges(origin.pga), style.cell_edges(origin.pgv_pga)
    axes.set_xlim(right[0], right[-1])
    axes.set_ylim(up[0], up[-1])
    axes.set_facecolor(_UNKNOWN)
    if not origin.answered:
        axes.text(0.5, 0.5, "no answer", transform=axes.transAxes, ha="center", gid="none")
        return
    tried = np.zeros(origin.of_motion.shape, dtype=bool)
    at = np.searchsorted(origin.pgv_pga, forward.pgv_pga), np.searchsorted(origin.pga, forward.pga)
    tried[at] = True
    cells = axes.pcolormesh(
        right,
        up,
        np.where(tried, 100.0 * origin.of_motion, np.nan),
        cmap=_ODDS,
        vmin=0.0,
        rasterized=True,
        gid="motions",
    )
    figure.colorbar(cells, ax=axes, label="probability of a cell [%]", pad=0.02)
    axes.add_collection(
        LineCollection(
            list(_outline(origin.region(SHARE), right, up)),
            colors=style.OVERTURNED,
            linewidths=1.1,
            gid="region",
        )
    )
    axes.plot([], [], color=style.OVERTURNED, lw=1.1, label=f"{100 * SHARE:.0f} % lie inside")
    if not tried.all():
        axes.plot([], [], "s", color=_UNKNOWN, ms=7, label="no run, or its end not known")
    axes.legend(loc="lower left", frameon=True, framealpha=0.9, edgecolor="none")


def _outline(region: Mask, right: Array, up: Array) -> Iterator[Array]:
    """Sides of cells that part the region from the rest."""
    padded = np.pad(region, 1)
    for row, column in np.argwhere(padded[1:, 1:-1] != padded[:-1, 1:-1]):
        yield np.array([[right[column], up[row]], [right[column + 1], up[row]]])
    for row, column in np.argwhere(padded[1:-1, 1:] != padded[1:-1, :-1]):
        yield np.array([[right[column], up[row]], [right[column], up[row + 1]]])


def _ground(
    axes: Axes,
    origin: Origin,
    forward: Forward,
    found: Found,
    terrain: xr.Dataset,
    starts: Array,
) -> None:
    on_it = ~np.isnan(forward.end).any(axis=1)
    end, weight = forward.end[on_it], origin.weight[on_it]
    reach = REACH * found.sigma * np.array([[-1.0, -1.0], [1.0, 1.0]])
    window = around(np.concatenate([end, starts, found.place + reach]), terrain)
    draw(axes, relief(terrain, window), window)
    dots: Any = {"s": 9, "linewidths": 0.0, "rasterized": True, "zorder": 3}
    far = weight == 0.0
    axes.scatter(*end[far].T, color="#6e6e6e", label="end of a run, too far", **dots)
    if origin.answered:
        order = np.flatnonzero(~far)[np.argsort(weight[~far])]
        axes.scatter(
            end[order, 0],
            end[order, 1],
            c=weight[order],
            cmap=_ODDS,
            vmin=0.0,
            **{**dots, "s": 20, "linewidths": 0.35},
            edgecolors=style.INK,
            label="end of a run, by weight",
            gid="near",
        )
    for reach_of, line in ((1.0, "-"), (REACH, "--")):
        ring: Any = {"ls": line, "lw": 1.3}
        circle = Circle(found.place, reach_of * found.sigma, fill=False, zorder=4, **ring)
        circle.set(edgecolor=style.OVERTURNED, gid="reach")
        axes.add_patch(circle)
        text = f"{reach_of:g} sigma from the place"
        axes.plot([], [], color=style.OVERTURNED, label=text, **ring)
    axes.plot(*found.place, "P", color=style.OVERTURNED, mec="white", ms=9, zorder=5, ls="none",
              label="place", gid="place")  # fmt: skip
    axes.plot(*starts.T, "o", mfc="white", mec=style.INK, ms=6, zorder=5, label="start")
    if len(starts) > 1 and origin.answered:
        for number, share in zip(origin.start, origin.of_start, strict=True):
            axes.annotate(
                f"{100.0 * share:.0f} %",
                starts[number],
                (5.0, 5.0),
                textcoords="offset points",
                path_effects=[withStroke(linewidth=2.2, foreground="white")],
                zorder=6,
                gid="start",
            )
    axes.set_title("ends of the runs around the place")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.legend(
        loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=3, fontsize=7, columnspacing=1.0
    )
