"""The boundary with its band, what decides it, and the fragility surface."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from pipeline.drawing import style
from pipeline.workflow.datasets import label, rows_of

COLUMNS = 4
"""Diagrams side by side."""

LEVELS = (0.05, 0.16, 0.5, 0.84, 0.95)
"""Contours of the surface."""


@style.styled
def bands(found: xr.Dataset, responses: xr.Dataset) -> Figure:
    """The band of the boundary over the site's own response diagram, for each direction."""
    count = found.sizes["yaw"]
    columns = min(COLUMNS, count)
    rows = math.ceil(count / columns)
    figure = Figure(figsize=(2.3 * columns + 0.5, 2.2 * rows + 0.8), layout="constrained")
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    pga, heights = found["pga"].values, _heights(found)
    colours = ListedColormap([style.UNDECIDED, style.PROVED, "#e9aba6"])
    for number, axes in enumerate(panels.flat):
        if number >= count:
            axes.set_axis_off()
            continue
        own, one = responses.isel(yaw=number), found.isel(yaw=number)
        axes.pcolormesh(
            style.cell_edges(pga),
            style.cell_edges(heights),
            own["overturned"].values,
            cmap=colours,
            vmin=-1.5,
            vmax=1.5,
        )
        low, middle, high = (
            np.minimum(one[f"boundary_{name}"].values, 2.0 * pga[-1])
            for name in ("low", "median", "high")
        )
        axes.fill_betweenx(
            heights, low, high, color=style.MODEL, alpha=0.65, lw=0, label="5 to 95 % of the draws"
        )
        axes.plot(middle, heights, color=style.INK, lw=1.3, label="median of the draws")
        axes.set_xlim(style.cell_edges(pga)[[0, -1]])
        axes.set_ylim(style.cell_edges(heights)[[0, -1]])
        axes.set_title(f"yaw {one['yaw'].item():g} deg", fontsize=8.5, pad=3)
    for colour, text in ((style.PROVED, "stands as scanned"), ("#e9aba6", "topples as scanned")):
        panels[0, 0].plot([], [], "s", ms=7, color=colour, label=text)
    for axes in panels.flat[max(count - columns, 0) : count]:  # with no other panel below
        axes.tick_params(labelbottom=True)
        axes.set_xlabel("PGA [g]")
    figure.supylabel(_row_label(found), fontsize=9)
    handles = panels[0, 0].get_legend_handles_labels()
    figure.legend(*handles, loc="outside lower center", ncols=min(columns, 2))
    return figure


@style.styled
def shares(found: xr.Dataset) -> Figure:
    """First-order and total indices of each unknown, of all directions together."""
    order = np.argsort(np.nan_to_num(found["total_index_joined"].values))
    names = found["unknown"].values[order]
    figure = Figure(figsize=(6.0, 0.42 * len(names) + 1.3), layout="constrained")
    axes = figure.add_subplot()
    place = np.arange(len(names))
    for shift, name, colour, text in (
        (0.2, "first", style.SERIES[0], "alone (first-order index)"),
        (-0.2, "total", style.SERIES[4], "with all that it takes part in (total index)"),
    ):
        value = found[f"{name}_index_joined"].values[order]
        ends = found[f"{name}_index_joined_interval"].values[order]
        axes.barh(place + shift, value, 0.36, color=colour, label=text)
        axes.hlines(place + shift, *ends.T, color=style.INK, lw=1.0)
    axes.set_yticks(place, names)
    axes.set_xlim(0.0, 1.0)
    axes.set_xlabel("share of the variance of the boundary's height, 5 to 95 %")
    axes.grid(visible=True, axis="x")
    figure.legend(loc="outside lower center", ncols=1)
    return figure


@style.styled
def surface(found: xr.Dataset) -> Figure:
    """Probability of toppling over PGA and PGV/PGA, averaged over the directions."""
    figure = Figure(figsize=(5.6, 4.4), layout="constrained")
    axes = figure.add_subplot()
    pga, heights, values = found["pga"].values, _heights(found), found["surface"].values
    mesh = axes.pcolormesh(
        style.cell_edges(pga), style.cell_edges(heights), values, cmap="RdYlBu_r", vmin=0, vmax=1
    )
    if min(values.shape) > 1:
        lines = axes.contour(pga, heights, values, LEVELS, colors=style.INK, linewidths=0.9)
        axes.clabel(lines, fmt=lambda level: f"{100 * level:g} %", fontsize=8)
    bar = figure.colorbar(mesh, ax=axes)
    bar.set_label("probability of toppling")
    axes.set_xlabel(label("pga"))
    axes.set_ylabel(_row_label(found))
    return figure


def _heights(data: xr.Dataset) -> np.ndarray:
    """Where rows lie: at their PGV/PGA [s], records one above the other."""
    if rows_of(data) == "record":
        return np.arange(data.sizes["record"], dtype=np.float64)
    return np.asarray(data["pgv_pga"].values)


def _row_label(data: xr.Dataset) -> str:
    return "number of the record" if rows_of(data) == "record" else "PGV/PGA [s]"
