"""Response diagrams on the paper's axes: PGA [g] to the right, PGV/PGA [s] upward."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from pipeline.drawing import style
from vsr_core.arrays import Array

PGA, RATIO = "PGA [g]", "PGV/PGA [s]"

WIDTH = 9.4
"""Of a figure [inch]."""

PALE = {1: "#e9aaa6", 0: "#bccfe4", -1: "#ffffff"}
"""Colours of cells on which curves are drawn."""

FULL = {1: style.OVERTURNED, 0: style.UPRIGHT, -1: style.UNDECIDED}


def cells(axes: Axes, pga: Array, ratios: Array, outcomes: Array, *, pale: bool = False) -> None:
    """Draw the outcome of every run, red where it overturned and blue where not.

    Parameters
    ----------
    pga, ratios : ndarray [g], [s]
    outcomes : ndarray, shape (ratios, pga), 1, 0, or -1 for undecided
    pale : bool, whether curves are to be drawn on them
    """
    colours = PALE if pale else FULL
    axes.pcolormesh(
        style.cell_edges(pga),
        style.cell_edges(ratios),
        outcomes,
        cmap=ListedColormap([colours[kind] for kind in (-1, 0, 1)]),
        vmin=-1.5,
        vmax=1.5,
        edgecolors=(1.0, 1.0, 1.0, 0.35),
        linewidth=0.25,
        rasterized=True,
        gid="cells",
    )
    row, column = np.nonzero(outcomes < 0)
    if row.size:
        axes.plot(pga[column], ratios[row], "x", color="black", ms=4, gid="undecided")
    axes.set_xlim(0.0, style.cell_edges(pga)[-1])
    axes.set_ylim(0.0, style.cell_edges(ratios)[-1])


def labelled(panels: Any) -> None:
    """Label the axes at the left and lower side of a grid of panels."""
    for axes in panels[-1]:
        axes.set_xlabel(PGA)
    for axes in panels[:, 0]:
        axes.set_ylabel(RATIO)


def key(*, pale: bool = False, undecided: bool = False) -> list[Any]:
    """Handles of the cells, for a legend.

    Parameters
    ----------
    pale, undecided : bool, as the cells are drawn, and whether some are undecided
    """
    axes = Figure().add_subplot()
    colours = PALE if pale else FULL
    square: Any = {"ls": "", "marker": "s", "ms": 7}
    handles = axes.plot([], [], color=colours[1], label="overturned", **square)
    handles += axes.plot([], [], color=colours[0], label="balanced", **square)
    if undecided:
        handles += axes.plot([], [], "x", color="black", label="undecided")
    return handles


def logistic(axes: Axes, fragility: xr.Dataset, place: int = 0, **look: Any) -> None:
    """Draw the median of the logistic model of one direction."""
    axes.plot(median(fragility, place), fragility["pgv_pga"].values, **look)


def median(fragility: xr.Dataset, place: int = 0) -> Array:
    """PGA of probability one half in the logistic model of each row.

    Returns
    -------
    ndarray, shape (rows,) [g]; nan outside the tested PGA
    """
    pga = fragility["pga"].values
    line = fragility.isel(yaw=place, friction=0).sel(model="logistic")["median_pga"].values
    return np.where((line >= pga[0]) & (line <= pga[-1]), line, np.nan)


def note(figure: Figure, text: str) -> None:
    """Say in the upper left corner what a reader must know of the whole figure."""
    figure.text(0.006, 0.995, text, ha="left", va="top", size=7.5, color="#5a5a5a", gid="source")
