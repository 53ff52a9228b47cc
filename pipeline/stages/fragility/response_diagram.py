"""Overturning response diagram: what each ground motion does to the rock, and where it topples."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from pipeline.drawing import style
from pipeline.stages.fragility.summary import undecided
from pipeline.workflow.datasets import label, rows_of
from vsr_core.arrays import Array, Indices, Mask
from vsr_core.outcome import DecidedBy, Outcome

PROVED, UPRIGHT, OVERTURNED, UNDECIDED = range(4)
"""What a cell of the diagram shows."""

MOST_NAMED, LONGEST = 16, 14
"""Records named at the side of a diagram, and letters of a name."""

_KINDS = (
    (OVERTURNED, style.OVERTURNED, "overturned"),
    (UPRIGHT, style.UPRIGHT, "upright"),
    (PROVED, style.PROVED, "upright, proved without a run"),
    (UNDECIDED, style.UNDECIDED, ""),
)


@style.styled
def overturning_diagram(
    responses: xr.Dataset, fragility: xr.Dataset, place: tuple[int, int], name: str = ""
) -> Figure:
    """Draw the cells of one yaw and friction, their boundary and the recommended model.

    Parameters
    ----------
    responses, fragility : Dataset
        As in ``responses.nc`` and ``fragility.nc``.
    place : tuple of int
        Positions of the yaw and of the friction.
    name : str
        Title.
    """
    figure = Figure(figsize=(4.3, 4.4))
    axes = figure.add_axes((0.125, 0.3, 0.85, 0.63))
    runs = responses.isel(yaw=place[0], friction=place[1])
    fit = fragility.isel(yaw=place[0], friction=place[1])
    _cells(axes, runs)
    _boundary(axes, fit)
    _model(axes, fit)
    axes.set_xlabel(label("pga"))
    _rows(axes, runs)
    axes.set_title(name)
    style.legend_below(figure, axes, 2, top=0.2)
    return figure


def shown(runs: xr.Dataset) -> Indices:
    """Classify each cell of a diagram, shape (rows, pga), as one of the kinds above."""
    kinds = np.where(runs["overturned"].values == 1, OVERTURNED, UPRIGHT)
    proved = runs["decided_by"].values == DecidedBy.NO_UPLIFT_BOUND
    kinds[proved & (kinds == UPRIGHT)] = PROVED
    kinds[undecided(runs)] = UNDECIDED
    return kinds


def heights(data: xr.Dataset) -> Array:
    """Where the rows of a diagram lie: at their PGV/PGA [s], records one above the other."""
    if rows_of(data) == "record":
        return np.arange(data.sizes["record"], dtype=np.float64)
    ratio: Array = data["pgv_pga"].values
    return ratio


def _rows(axes: Axes, runs: xr.Dataset) -> None:
    if rows_of(runs) == "pgv_pga":
        axes.set_ylabel("PGV/PGA [s]")
        return
    shown_every = -(-runs.sizes["record"] // MOST_NAMED)
    places = heights(runs)[::shown_every]
    names = [
        f"{name[:LONGEST]}\n{ratio:.3g} s"
        for name, ratio in zip(runs["record"].values, runs["pgv_pga"].values, strict=True)
    ]
    axes.set_yticks(places, names[::shown_every], fontsize=7)
    axes.set_ylabel("record, with its PGV/PGA")
    axes.set_position((0.215, 0.3, 0.76, 0.63))


def _cells(axes: Axes, runs: xr.Dataset) -> None:
    pga, ratio = runs["pga"].values, heights(runs)
    kinds = shown(runs)
    colours = {kind: colour for kind, colour, _ in _KINDS}
    axes.pcolormesh(
        style.cell_edges(pga),
        style.cell_edges(ratio),
        kinds,
        cmap=ListedColormap([colours[kind] for kind in range(4)]),
        vmin=-0.5,
        vmax=3.5,
        edgecolors=(1.0, 1.0, 1.0, 0.22),  # cells are runs: let them be counted
        linewidth=0.25,
        gid="cells",
    )
    for kind, colour, text in _KINDS:
        if text and (kinds == kind).any():
            axes.plot([], [], "s", ms=7, color=colour, label=text)
    size = 220.0 / max(pga.size, ratio.size)  # of a cell, in points
    _marks(axes, runs, runs["outcome"].values == Outcome.DISPLACED, "displaced", size)
    _marks(axes, runs, kinds == UNDECIDED, "undecided", size)


def _marks(axes: Axes, runs: xr.Dataset, cells: Mask, gid: str, size: float) -> None:
    if not cells.any():
        return
    row, column = np.nonzero(cells)
    x, y = runs["pga"].values[column], heights(runs)[row]
    if gid == "displaced":
        axes.plot(
            x,
            y,
            ".",
            color="white",
            ms=float(np.clip(0.6 * size, 1.8, 6.0)),
            mew=0,
            gid=gid,
        )
        key: Any = {"ms": 5, "mfc": "white", "mec": style.UPRIGHT, "mew": 2.5}
        axes.plot([], [], "s", label="upright, but slid", **key)
        return
    axes.plot(
        x,
        y,
        "x",
        color="black",
        ms=float(np.clip(0.8 * size, 5.0, 10.0)),  # one in 2,500 must be seen
        mew=1.6,
        zorder=6,
        path_effects=[withStroke(linewidth=3.2, foreground="white")],
        label=f"UNDECIDED ({len(x)})",
        gid=gid,
    )


def _boundary(axes: Axes, fit: xr.Dataset) -> None:
    """Where the first overturning lies: from the last balanced run to the first overturned."""
    lower, upper = fit["last_balanced_pga"].values, fit["first_overturning_pga"].values
    both = np.isfinite(lower) & np.isfinite(upper)
    if both.any():
        axes.hlines(
            heights(fit)[both],
            lower[both],
            upper[both],
            color="black",
            lw=1.0,
            label="interval of the first overturning",
            gid="boundary",
            zorder=3,
        )


def _model(axes: Axes, fit: xr.Dataset) -> None:
    """Median of the recommended model and its interval, within the tested PGA."""
    name = str(fit["recommended"].values)
    if name not in fit["model"].values:
        return
    model = fit.sel(model=name)
    ratio, pga = heights(fit), fit["pga"].values
    median = model["median_pga"].values
    inside = (median >= pga[0]) & (median <= pga[-1])
    lower, upper = model["median_pga_interval"].values.T
    known = ~np.isnan(lower) & ~np.isnan(upper) & (upper >= pga[0]) & (lower <= pga[-1])
    if rows_of(fit) == "record":
        ends = np.clip([lower, upper], pga[0], pga[-1])[:, known]
        _model_of_records(axes, name, np.where(inside, median, np.nan), ratio[known], ends)
        return
    axes.plot(
        np.where(inside, median, np.nan),
        ratio,
        color=style.MODEL,
        lw=1.6,
        path_effects=[withStroke(linewidth=2.8, foreground="black")],
        label=f"{name} model, median",
        gid="median",
        zorder=5,
    )
    axes.fill_betweenx(
        ratio,
        np.clip(np.where(known, lower, pga[0]), pga[0], pga[-1]),
        np.clip(np.where(known, upper, pga[0]), pga[0], pga[-1]),
        where=known,
        facecolor=style.MODEL,
        alpha=0.55,
        lw=0,
        label="95 % interval of that median",
        gid="interval",
        zorder=4,
    )


def _model_of_records(axes: Axes, name: str, median: Array, rows: Array, ends: Array) -> None:
    """Median and interval of a model, each record for itself: nothing lies between two of them."""
    axes.plot(
        median,
        np.arange(len(median)),
        "D",
        ms=6,
        mfc=style.MODEL,
        mec="black",
        label=f"{name} model, median",
        gid="median",
        zorder=5,
    )
    axes.hlines(
        rows,
        ends[0],
        ends[1],
        lw=3.0,
        color=style.MODEL,
        alpha=0.75,
        label="95 % interval of that median",
        gid="interval",
        zorder=4,
    )
