"""Figures of overturning: response diagrams with their cells, and fragility around the circle."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.projections.polar import PolarAxes
from matplotlib.ticker import MaxNLocator

from pipeline.drawing import style
from pipeline.stages.fragility.summary import long_rows_in_words, static_pga, typical_pga, undecided
from pipeline.workflow.datasets import is_shaken_along_x, label, rows_of
from vsr_core.arrays import Array, Indices
from vsr_core.outcome import DecidedBy, Movement, Outcome

PROVED, UPRIGHT, OVERTURNED, UNDECIDED = range(4)
"""Classes of cells of the diagram."""

_MOST_DRAWN = 1000
"""Rows and columns of cells of a diagram, which has fewer pixels."""

_MOST_NAMED, _LONGEST = 16, 14
"""Records named at the side of a diagram, and letters of a name."""

_KINDS = (
    (OVERTURNED, style.OVERTURNED, "overturned"),
    (UPRIGHT, style.UPRIGHT, "upright"),
    (PROVED, style.PROVED, "upright, proved"),
    (UNDECIDED, style.UNDECIDED, ""),
)


@style.styled
def overturning_diagram(
    responses: xr.Dataset, fragility: xr.Dataset | None, place: tuple[int, int], name: str = ""
) -> Figure:
    """Draw the cells of one yaw and friction; of a fragility its boundary and model, too."""
    figure = Figure(figsize=(4.3, 4.4))
    axes = figure.add_axes((0.125, 0.3, 0.85, 0.63))
    runs = responses.isel(yaw=place[0], friction=place[1])
    _cells(axes, runs)
    if fragility is not None:
        fit = fragility.isel(yaw=place[0], friction=place[1])
        _boundary(axes, fit)
        _model(axes, fit)
    axes.set_xlabel(label("pga"))
    axes.set_ylabel(name_rows(axes, runs))
    if rows_of(runs) == "record":  # whose names take room
        axes.set_position((0.215, 0.3, 0.76, 0.63))
    axes.set_title(name)
    style.legend_below(figure, axes, 2, top=0.2)
    return figure


def cell_borders(figure: Figure, runs: xr.Dataset) -> tuple[Array, Array]:
    """Where the cells of one yaw and friction lie in the picture of their diagram.

    Returns
    -------
    across : ndarray, shape (columns + 1,), borders as shares of the width, from the left
    down : ndarray, shape (rows + 1,), as shares of the height, from the top, of ascending PGV/PGA
    """
    (axes,) = figure.axes
    axes.autoscale_view()
    to_share = axes.transData + figure.transFigure.inverted()
    ends = style.cell_edges(runs["pga"].values), style.cell_edges(heights(runs))
    across = to_share.transform([(pga, ends[1][0]) for pga in ends[0]])[:, 0]
    up = to_share.transform([(ends[0][0], row) for row in ends[1]])[:, 1]
    return across, 1.0 - up


def _shown(runs: xr.Dataset) -> Indices:
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


def name_rows(axes: Axes, runs: xr.Dataset) -> str:
    """Name records at the side of a diagram, and tell what its rows are."""
    if rows_of(runs) == "pgv_pga":
        return "PGV/PGA [s]"
    shown_every = -(-runs.sizes["record"] // _MOST_NAMED)
    places = heights(runs)[::shown_every]
    names = [
        f"{name[:_LONGEST]}\n{ratio:.3g} s"
        for name, ratio in zip(runs["record"].values, runs["pgv_pga"].values, strict=True)
    ]
    axes.set_yticks(places, names[::shown_every], fontsize=7)
    return "record, with its PGV/PGA"


def _thinned(values: Array) -> tuple[Indices, Array]:
    """Rows or columns that are drawn, one for several of too many; and their borders."""
    step = -(-values.size // _MOST_DRAWN)
    starts, edges = np.arange(0, values.size, step), style.cell_edges(values)
    return np.minimum(starts + step // 2, values.size - 1), np.append(edges[starts], edges[-1])


def _cells(axes: Axes, every: xr.Dataset) -> None:
    all_pga, all_ratios = every["pga"].values, heights(every)
    (columns, across), (rows, up) = map(_thinned, (all_pga, all_ratios))
    runs = every.isel({"pga": columns, rows_of(every): rows})
    pga, ratio, kinds = all_pga[columns], all_ratios[rows], _shown(runs)
    colours = {kind: colour for kind, colour, _ in _KINDS}
    axes.pcolormesh(
        across,
        up,
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
    row, column = np.nonzero(undecided(every))  # none is left out
    if row.size:
        axes.plot(
            all_pga[column],
            all_ratios[row],
            "x",
            color="black",
            ms=float(np.clip(0.8 * size, 5.0, 10.0)),  # one in 2,500 must be seen
            mew=1.6,
            zorder=6,
            path_effects=[withStroke(linewidth=3.2, foreground="white")],
            label=f"UNRESOLVED ({row.size})",
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
    """First overturning of each row that has it within the grid, a stroke as high as its cells.

    None of a row that topples at the lowest PGA tried, as one is assumed there.
    """
    first = fit["first_overturning_pga"].where(fit["first_overturning_pga_lower"] > 0.0).values
    ends = style.cell_edges(fit["pga"].values)
    borders = style.cell_edges(heights(fit))
    inside = (first >= ends[0]) & (first <= ends[-1])
    if inside.any():
        look: Any = {"color": "black", "lw": 1.2, "zorder": 3, "gid": "boundary"}
        rows = first[inside], borders[:-1][inside], borders[1:][inside]
        axes.vlines(*rows, label="first overturning", **look)


def _model(axes: Axes, fit: xr.Dataset) -> None:
    """Median of the recommended model and its interval, within the tested PGA."""
    name = str(fit["recommended"].values)
    if name not in fit["model"].values:
        return
    model = fit.sel(model=name)
    ratio, pga = heights(fit), fit["pga"].values
    median = model["median_pga"].values
    inside = np.where((median >= pga[0]) & (median <= pga[-1]), median, np.nan)
    lower, upper = model["median_pga_interval"].values.T
    known = ~np.isnan(lower) & ~np.isnan(upper) & (upper >= pga[0]) & (lower <= pga[-1])
    ends = np.clip(np.where(known, [lower, upper], pga[0]), pga[0], pga[-1])
    line: Any = {"label": f"{name} model, median", "gid": "median", "zorder": 5}
    band: Any = {"label": "95 % interval of that median", "gid": "interval", "zorder": 4}
    found = np.isfinite(inside)
    if rows_of(fit) == "record":  # each record for itself: nothing lies between two of them
        if found.any():
            axes.plot(inside, ratio, "D", ms=6, mfc=style.MODEL, mec="black", **line)
        if known.any():
            rows = ratio[known], *ends[:, known]
            axes.hlines(*rows, lw=3.0, color=style.MODEL, alpha=0.75, **band)
        return
    if (found[1:] & found[:-1]).any():  # else there is no line to show
        rim = [withStroke(linewidth=2.8, foreground="black")]
        axes.plot(inside, ratio, color=style.MODEL, lw=1.6, path_effects=rim, **line)
    if (known[1:] & known[:-1]).any():
        filled: Any = {"facecolor": style.MODEL, "alpha": 0.55, "lw": 0}
        axes.fill_betweenx(ratio, ends[0], ends[1], where=known, **filled, **band)


RULES = len(DecidedBy)
"""A cell is a letter: `A` and further by the outcome, in steps of this, and by what decided it."""


def axes_of(responses: xr.Dataset) -> dict[str, Any]:
    """Axes and codes that all diagrams have in common."""
    ratios = responses["pgv_pga"].values
    records = responses["record"].values if rows_of(responses) == "record" else None
    return {
        "pga": [f"{value:.6g}" for value in responses["pga"].values],
        "pgv_pga": [f"{value:.6g}" for value in ratios],
        "record": None if records is None else [str(name) for name in records],
        "outcomes": [outcome.name.lower() for outcome in Outcome],
        "rules": [rule.how for rule in DecidedBy],
    }


def cells_of(responses: xr.Dataset, place: tuple[int, int], figure: Any) -> dict[str, Any]:
    """The cells of a diagram, and where they lie in its picture."""
    runs = responses.isel(yaw=place[0], friction=place[1])
    across, down = cell_borders(figure, runs)
    return {
        "across": across.round(5).tolist(),
        "down": down.round(5).tolist(),
        "cells": in_letters(runs["outcome"].values, runs["decided_by"].values),
    }


def in_letters(outcome: Array, decided_by: Array) -> str:
    """Outcomes and rules row by row, a letter each; a letter and a number are so many of it.

    Parameters
    ----------
    outcome, decided_by : ndarray of int, shape (rows, columns)

    Examples
    --------
    >>> import numpy as np
    >>> in_letters(np.array([[0, 0, 0, 0, 1]]), np.array([[1, 1, 1, 1, 3]]))
    'B4H'
    """
    codes = (RULES * outcome.astype(int) + decided_by.astype(int)).ravel()
    letters = "".join(chr(ord("A") + code) for code in codes.tolist())
    return re.sub(r"(.)\1{2,}", lambda run: f"{run[1]}{len(run[0])}", letters)


_WIDEST_GAP = 60.0
"""Yaws [degree] further apart than this are not joined by a line."""


@style.styled
def fragility_by_yaw(fragility: xr.Dataset, rock: xr.Dataset) -> Figure:
    """Draw the toppled share and the typical first-overturning PGA around the circle."""
    figure = Figure(figsize=(8.6, 4.5))
    share, first = panels = [_circle(figure, left) for left in (0.05, 0.55)]
    _share(share, fragility)
    _first(first, fragility, rock)
    rows = long_rows_in_words(fragility["pgv_pga"].values)
    titles = (
        "Toppled share of the runs [%]\nfurther out = more fragile",
        f"First-overturning PGA [g], median over {rows}\nfurther in = more fragile",
    )
    for axes, title in zip(panels, titles, strict=True):
        axes.set_title(title, pad=16)
    style.legend_below(figure, first, 4, top=0.065)
    return figure


def _circle(figure: Figure, left: float) -> PolarAxes:
    """Polar axes: 0 to the east, counter-clockwise, as yaw turns."""
    axes = PolarAxes(figure, (left, 0.13, 0.4, 0.67))
    figure.add_axes(axes)
    axes.set_theta_zero_location("E")
    axes.set_theta_direction(1)
    axes.set_thetagrids(np.arange(0, 360, 30), [f"{a}°" for a in range(0, 360, 30)])
    axes.tick_params(pad=1)
    return axes


def _share(axes: PolarAxes, fragility: xr.Dataset) -> None:
    for k, friction in enumerate(fragility["friction"].values):
        percent = 100.0 * fragility["toppled_share"].values[:, k]
        _ring(axes, fragility["yaw"].values, percent, k, f"friction {friction:g}", "share")
    axes.set_ylim(0.0, 100.0)
    axes.set_rgrids([25, 50, 75, 100], ["25", "50", "75", "100"], angle=15.0, color="#555555")


def _first(axes: PolarAxes, fragility: xr.Dataset, rock: xr.Dataset) -> None:
    yaw, grid = fragility["yaw"].values, fragility["pga"].values
    first, lower, upper = typical_pga(fragility)
    around = np.arange(361.0)
    static = static_pga(rock, around)
    along_x = is_shaken_along_x(fragility)
    inner = [min(static.max(), grid[-1])] if along_x else []
    rim = 1.15 * max([*upper[np.isfinite(upper)], *inner, grid[0]])
    axes.set_ylim(0.0, rim)
    several = fragility.sizes["friction"] > 1
    for k, friction in enumerate(fragility["friction"].values):
        name = f"friction {friction:g}" if several else "first overturning in the simulations"
        closed = (lower[:, k] > 0.0) & np.isfinite(upper[:, k])
        _ring(axes, yaw, np.where(closed, first[:, k], np.nan), k, name, "first")
        for turn, low, high in zip(np.radians(yaw), lower[:, k], upper[:, k], strict=True):
            if np.isfinite(high):
                axes.plot([turn, turn], [low, high], color=style.SERIES[k % 6], lw=2.2, alpha=0.5)
    at_rim = np.broadcast_to((0.97 - 0.07 * np.arange(first.shape[1])) * rim, first.shape)
    for open_end, marker, gid, bound, radius in (
        ((lower > 0.0) & np.isinf(upper), "^", "above", lower, at_rim),
        ((lower == 0.0) & np.isfinite(upper), "v", "below", upper, upper),
    ):
        look: Any = {"ls": "", "marker": marker, "mfc": "white"}
        for k in np.flatnonzero(open_end.any(axis=0)).tolist():
            own = open_end[:, k]
            place = np.radians(yaw[own]), radius[own, k]
            axes.plot(*place, mec=style.SERIES[k % 6], gid=gid, **look)
        if open_end.any():
            ends = dict.fromkeys((bound[open_end].min(), bound[open_end].max()))
            words = " to ".join(f"{gid} {end:.4g} g" for end in ends)
            axes.plot([], [], mec=style.INK, label=words, **look)
    if along_x:
        axes.plot(
            np.radians(around),
            np.where(static <= rim, static, np.nan),
            color=style.INK,
            lw=0.9,
            ls=(0, (4, 2)),
            label="static overturning, weaker direction",
            gid="static",
        )
    ticks = [tick for tick in MaxNLocator(4).tick_values(0.0, rim) if 0.0 < tick < 0.97 * rim]
    axes.set_rgrids(ticks, [f"{tick:g}" for tick in ticks], angle=15.0, color="#555555")


def _ring(axes: PolarAxes, yaw: Array, radius: Array, number: int, name: str, gid: str) -> None:
    """Values around the circle, joined where the yaws are close enough together."""
    order = np.argsort(yaw % 360.0)
    turn, radius = (yaw % 360.0)[order], radius[order]
    gaps = np.diff(np.append(turn, turn[0] + 360.0))
    colour = style.SERIES[number % len(style.SERIES)]
    if gaps.max() <= _WIDEST_GAP:
        around, closed = np.radians(np.append(turn, turn[0])), np.append(radius, radius[0])
        axes.plot(around, closed, color=colour, lw=1.4)
        axes.fill(around, closed, color=colour, alpha=0.08)
    elif gid == "share":
        known = np.isfinite(radius)
        axes.vlines(np.radians(turn[known]), 0.0, radius[known], color=colour, lw=1.4)
    axes.plot(
        np.radians(turn),
        radius,
        ls="",
        marker=style.MARKERS[number % len(style.MARKERS)],
        ms=5,
        color=colour,
        label=name,
        gid=gid,
    )
