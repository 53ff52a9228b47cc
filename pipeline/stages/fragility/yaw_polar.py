"""Fragility against yaw: how many runs topple, and from which PGA."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes
from matplotlib.ticker import MaxNLocator

from pipeline.drawing import style
from pipeline.stages.fragility.summary import long_rows_in_words, static_pga, typical_pga
from vsr_core.arrays import Array

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
    rim = 1.15 * max([*upper[np.isfinite(upper)], min(static.max(), grid[-1]), grid[0]])
    if np.isinf(upper).any():
        rim = max(rim, 1.15 * grid[-1])
    axes.set_ylim(0.0, rim)
    several = fragility.sizes["friction"] > 1
    for k, friction in enumerate(fragility["friction"].values):
        name = f"friction {friction:g}" if several else "first overturning in the simulations"
        _ring(axes, yaw, np.where(np.isinf(first[:, k]), np.nan, first[:, k]), k, name, "first")
        for turn, low, high in zip(np.radians(yaw), lower[:, k], upper[:, k], strict=True):
            if np.isfinite(high):
                axes.plot([turn, turn], [low, high], color=style.SERIES[k % 6], lw=2.2, alpha=0.5)
        above = np.isinf(upper[:, k])
        if above.any():
            axes.plot(
                np.radians(yaw[above]),
                np.full(above.sum(), (0.97 - 0.07 * k) * rim),
                ls="",
                marker="^",
                mfc="white",
                mec=style.SERIES[k % 6],
                gid="above",
            )
    if np.isinf(upper).any():
        none = f"none up to {grid[-1]:.3g} g"
        axes.plot([], [], ls="", marker="^", mfc="white", mec=style.INK, label=none)
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
