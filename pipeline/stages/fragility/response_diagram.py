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
from vsr_core.arrays import Array, Indices
from vsr_core.outcome import DecidedBy, Movement, Outcome

PROVED, UPRIGHT, OVERTURNED, UNDECIDED = range(4)
"""What a cell of the diagram shows."""

_MOST_NAMED, _LONGEST = 16, 14
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
    """Draw the cells of one yaw and friction, their boundary and the recommended model."""
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


def cell_borders(figure: Figure) -> tuple[Array, Array]:
    """Where the cells of a diagram lie in its picture.

    Returns
    -------
    across : ndarray, shape (columns + 1,), borders as shares of the width, from the left
    down : ndarray, shape (rows + 1,), as shares of the height, from the top, of ascending PGV/PGA
    """
    (axes,) = figure.axes
    cells: Any = next(part for part in axes.collections if part.get_gid() == "cells")
    axes.autoscale_view()
    to_share = axes.transData + figure.transFigure.inverted()
    corners = cells.get_coordinates()
    shares = to_share.transform(corners.reshape(-1, 2)).reshape(corners.shape)
    return shares[0, :, 0], 1.0 - shares[:, 0, 1]


def _shown(runs: xr.Dataset) -> Indices:
    """Classify each cell of a diagram, shape (rows, pga), as one of the kinds above."""
    kinds = np.where(runs["overturned"].values == 1, OVERTURNED, UPRIGHT)
    proved = runs["decided_by"].values == DecidedBy.NO_UPLIFT_BOUND
    kinds[proved & (kinds == UPRIGHT)] = PROVED
    kinds[undecided(runs)] = UNDECIDED
    return kinds


def _heights(data: xr.Dataset) -> Array:
    """Where the rows of a diagram lie: at their PGV/PGA [s], records one above the other."""
    if rows_of(data) == "record":
        return np.arange(data.sizes["record"], dtype=np.float64)
    ratio: Array = data["pgv_pga"].values
    return ratio


def _rows(axes: Axes, runs: xr.Dataset) -> None:
    if rows_of(runs) == "pgv_pga":
        axes.set_ylabel("PGV/PGA [s]")
        return
    shown_every = -(-runs.sizes["record"] // _MOST_NAMED)
    places = _heights(runs)[::shown_every]
    names = [
        f"{name[:_LONGEST]}\n{ratio:.3g} s"
        for name, ratio in zip(runs["record"].values, runs["pgv_pga"].values, strict=True)
    ]
    axes.set_yticks(places, names[::shown_every], fontsize=7)
    axes.set_ylabel("record, with its PGV/PGA")
    axes.set_position((0.215, 0.3, 0.76, 0.63))


def _cells(axes: Axes, runs: xr.Dataset) -> None:
    pga, ratio = runs["pga"].values, _heights(runs)
    kinds = _shown(runs)
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
    _not_rolled_over(axes, runs, pga, ratio, float(np.clip(0.6 * size, 1.8, 6.0)))
    row, column = np.nonzero(kinds == UNDECIDED)
    if row.size:
        axes.plot(
            pga[column],
            ratio[row],
            "x",
            color="black",
            ms=float(np.clip(0.8 * size, 5.0, 10.0)),  # one in 2,500 must be seen
            mew=1.6,
            zorder=6,
            path_effects=[withStroke(linewidth=3.2, foreground="white")],
            label=f"UNDECIDED ({row.size})",
            gid="undecided",
        )


def _not_rolled_over(axes: Axes, runs: xr.Dataset, pga: Array, ratio: Array, size: float) -> None:
    """Dots on the runs whose rock slid or fell: still on its seat, or off it."""
    standing = runs["movement"].values != Movement.ROLLED_OVER
    for outcome, colour, text in (
        (Outcome.DISPLACED, style.UPRIGHT, "upright, but slid"),
        (Outcome.OVERTURNED, style.OVERTURNED, "slid or fell off its seat"),
    ):
        row, column = np.nonzero(standing & (runs["outcome"].values == outcome))
        if row.size:
            dot: Any = {"ls": "", "marker": ".", "color": "white", "mew": 0, "ms": size}
            axes.plot(pga[column], ratio[row], gid=outcome.name.lower(), **dot)
            key: Any = {"ms": 5, "mfc": "white", "mec": colour, "mew": 2.5}
            axes.plot([], [], "s", label=text, **key)


def _boundary(axes: Axes, fit: xr.Dataset) -> None:
    """Where the first overturning lies: from the last balanced run to the first overturned."""
    lower, upper = (fit[f"first_overturning_pga_{end}"].values for end in ("lower", "upper"))
    both = np.isfinite(lower) & np.isfinite(upper)
    if both.any():
        look: Any = {"color": "black", "lw": 1.0, "zorder": 3, "gid": "boundary"}
        name = "interval of the first overturning"
        axes.hlines(_heights(fit)[both], lower[both], upper[both], label=name, **look)


def _model(axes: Axes, fit: xr.Dataset) -> None:
    """Median of the recommended model and its interval, within the tested PGA."""
    name = str(fit["recommended"].values)
    if name not in fit["model"].values:
        return
    model = fit.sel(model=name)
    ratio, pga = _heights(fit), fit["pga"].values
    median = model["median_pga"].values
    inside = np.where((median >= pga[0]) & (median <= pga[-1]), median, np.nan)
    lower, upper = model["median_pga_interval"].values.T
    known = ~np.isnan(lower) & ~np.isnan(upper) & (upper >= pga[0]) & (lower <= pga[-1])
    ends = np.clip(np.where(known, [lower, upper], pga[0]), pga[0], pga[-1])
    line: Any = {"label": f"{name} model, median", "gid": "median", "zorder": 5}
    band: Any = {"label": "95 % interval of that median", "gid": "interval", "zorder": 4}
    if rows_of(fit) == "record":  # each record for itself: nothing lies between two of them
        axes.plot(inside, ratio, "D", ms=6, mfc=style.MODEL, mec="black", **line)
        rows = ratio[known], *ends[:, known]
        axes.hlines(*rows, lw=3.0, color=style.MODEL, alpha=0.75, **band)
        return
    rim = [withStroke(linewidth=2.8, foreground="black")]
    axes.plot(inside, ratio, color=style.MODEL, lw=1.6, path_effects=rim, **line)
    filled: Any = {"facecolor": style.MODEL, "alpha": 0.55, "lw": 0}
    axes.fill_betweenx(ratio, ends[0], ends[1], where=known, **filled, **band)
