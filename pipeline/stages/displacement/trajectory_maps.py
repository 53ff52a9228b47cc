"""Where the rock goes: its paths over the terrain from above, and where they end.

Figures as 15 of Chen et al. (2024). Each says in a corner whose terrain it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from pipeline.drawing import style
from pipeline.drawing.ground_map import Window, around, draw, relief
from pipeline.stages.datasets.displaced_runs import chosen, ends, toppled
from vsr_core.arrays import Array
from vsr_core.outcome import StopReason

PGA_EDGES = (0.0, 0.5, 0.7, 0.8, 1.0)
"""Ends of the ranges of PGA [g], open below and closed above; the middle two are the paper's."""

SPEEDS = colormaps["plasma"]

WIDTH = 9.4
"""Of a figure [inch]."""

_FINEST = 3.0 / style.DPI  # inch: a shorter piece of a path is not seen
_ARROW = {"arrowstyle": "<|-|>", "color": style.INK, "lw": 1.4, "shrinkA": 0, "shrinkB": 0}
_HALO = [withStroke(linewidth=2.2, foreground="white")]

_STOPS: tuple[tuple[StopReason, str, str, str], ...] = (
    (StopReason.REST, "o", style.SERIES[0], "came to rest"),
    (StopReason.LEFT_TERRAIN, "^", style.SERIES[1], "left the terrain"),
    (StopReason.TIME, "s", style.SERIES[3], "still moving when time ran out"),
    (StopReason.UNDONE, "X", style.INK, "no verdict"),
)


@style.styled
def trajectories(
    displacement: xr.Dataset,
    terrain: xr.Dataset,
    source: str,
    edges: Sequence[float] = PGA_EDGES,
) -> Figure:
    """Paths of the overturned rock from above, all together and by range of PGA.

    Parameters
    ----------
    displacement, terrain : Dataset
        As in ``displacement.nc`` and ``terrain.nc``.
    source : str
        What the terrain is, e.g. "surrogate terrain".
    edges : sequence of float [g]
        Ends of the ranges; the last one is raised to the largest PGA.
    """
    runs = chosen(displacement, toppled(displacement))
    window = around(np.column_stack([runs["x"].values, runs["y"].values]), terrain)
    ground = relief(terrain, window)
    pga = runs["pga"].values
    edges = [*edges[:-1], max(edges[-1], float(pga.max(initial=0.0)))]
    speed = speeds(runs)
    large, panels, bar = _panels(len(edges) // 2, window.size[1] / window.size[0])
    figure = large.get_figure(root=True)
    assert isinstance(figure, Figure)
    draw(large, ground, window)
    paths(large, runs, ("x", "y"), speed, window.size[0] / _width(large))
    _start(large)
    _shaking(large, np.unique(displacement["yaw"].values), window)
    large.set_title(f"all that toppled, N = {runs.sizes['run']}")
    for axes, low, high in zip(panels, edges, edges[1:], strict=False):
        inside = chosen(runs, (pga > low) & (pga <= high))
        draw(axes, ground, window, named=False)
        paths(axes, inside, ("x", "y"), speed, window.size[0] / _width(axes))
        _start(axes, 3.5)
        axes.set_title(f"{low:g} < PGA ≤ {high:g} g, N = {inside.sizes['run']}")
    for axes in panels[len(edges) - 1 :]:
        axes.set_axis_off()
    for axes in panels:
        axes.tick_params(labelleft=False, labelbottom=False)
    large.set_xlabel("x [m]")
    large.set_ylabel("y [m]")
    _speed_bar(figure, bar, speed)
    named(figure, source)
    return figure


@style.styled
def end_positions(displacement: xr.Dataset, terrain: xr.Dataset, source: str) -> Figure:
    """Where every run ended, and why it did."""
    places, stop = ends(displacement), displacement["stop_reason"].values
    window = around(places, terrain)
    width, left, below = 6.1, 0.6, 0.5
    height = width * window.size[1] / window.size[0]
    tall = height + below + 0.3
    figure = Figure(figsize=(WIDTH, tall))
    axes = figure.add_axes((left / WIDTH, below / tall, width / WIDTH, height / tall))
    draw(axes, relief(terrain, window), window)
    for reason, marker, colour, words in _STOPS:
        runs = stop == reason
        if runs.any():
            axes.scatter(
                places[runs, 0],
                places[runs, 1],
                s=13,
                marker=marker,
                color=colour,
                edgecolors="white",
                linewidths=0.3,
                alpha=0.85,
                label=f"{words} ({runs.sum()})",
                rasterized=True,
                gid=reason.name.lower(),
                zorder=3,
            )
    _start(axes, label="start")
    _shaking(axes, np.unique(displacement["yaw"].values), window)
    axes.set_title(f"ends of all {displacement.sizes['run']} runs")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0)
    named(figure, source)
    return figure


def named(figure: Figure, source: str) -> None:
    """Say in the upper left corner what the terrain is."""
    figure.text(0.006, 0.992, source, ha="left", va="top", size=7.5, color="#5a5a5a", gid="source")


def speeds(runs: xr.Dataset) -> Normalize:
    """Scale of the colours of speed."""
    return Normalize(0.0, max(float(runs["speed"].values.max(initial=0.0)), 1e-9))


def paths(
    axes: Axes, runs: xr.Dataset, names: tuple[str, str], speed: Normalize, inch: float
) -> None:
    """Paths coloured by speed, in pieces no shorter than can be seen; ``inch`` [m] of the panel."""
    if runs.sizes["run"] == 0:
        middle: Any = {"transform": axes.transAxes, "ha": "center", "gid": "empty"}
        axes.text(0.5, 0.5, "no run toppled", path_effects=_HALO, **middle)
        return
    points = np.column_stack([runs[name].values for name in names]).astype(float)
    run = np.repeat(np.arange(runs.sizes["run"]), runs["row_size"].values)
    starts = np.diff(run, prepend=-1) > 0
    step = np.hypot(*np.diff(points, axis=0, prepend=points[:1]).T)
    way = np.floor(np.cumsum(np.where(starts, 0.0, step)) / (_FINEST * inch))
    kept = starts | (np.diff(way, prepend=-1.0) > 0) | np.roll(starts, -1)
    points, run, pace = points[kept], run[kept], runs["speed"].values[kept]
    joined = run[1:] == run[:-1]
    lines = LineCollection(
        np.stack([points[:-1], points[1:]], axis=1)[joined],
        array=(0.5 * (pace[1:] + pace[:-1]))[joined],
        cmap=SPEEDS,
        norm=speed,
        linewidths=0.65,
        alpha=0.75,
        capstyle="round",
        rasterized=True,
        zorder=2,
        gid="paths",
    )
    axes.add_collection(lines, autolim=False)


def _panels(rows: int, aspect: float) -> tuple[Axes, list[Axes], Axes]:
    """One large panel, two columns of small ones as high together, and a bar below [inch]."""
    gap, title, left, below, top = 0.12, 0.24, 0.6, 0.75, 0.42
    room = WIDTH - left - 3 * gap
    # heights: large = a W, small = a w; rows w a + (rows - 1) (gap + title) = a W; W + 2 w = room
    spare = (rows - 1) * (gap + title)
    small = (room - spare / aspect) / (rows + 2)
    large = room - 2 * small
    height = large * aspect + below + top
    figure = Figure(figsize=(WIDTH, height))

    def place(x: float, y: float, width: float, tall: float) -> Axes:
        return figure.add_axes((x / WIDTH, y / height, width / WIDTH, tall / height))

    whole = place(left, below, large, large * aspect)
    panels = [
        place(
            left + large + gap + column * (small + gap),
            below + (rows - 1 - row) * (small * aspect + gap + title),
            small,
            small * aspect,
        )
        for row in range(rows)
        for column in range(2)
    ]
    bar = place(left + large + gap, below - 0.28, 2 * small + gap, 0.12)
    return whole, panels, bar


def _width(axes: Axes) -> float:
    return WIDTH * axes.get_position().width


def _speed_bar(figure: Figure, axes: Axes, speed: Normalize) -> None:
    figure.colorbar(
        ScalarMappable(speed, SPEEDS), cax=axes, orientation="horizontal", label="speed [m/s]"
    )


def _start(axes: Axes, size: float = 6.0, **given: Any) -> None:
    axes.plot(0.0, 0.0, "o", ms=size, mfc="white", mec=style.INK, mew=0.9, zorder=5, gid="start",
              **given)  # fmt: skip


def _shaking(axes: Axes, yaws: Array, window: Window) -> None:
    """Arrows of the shaking, to and fro, in the upper left corner."""
    unit = 0.06 * min(window.size)
    middle = np.array([window.x[0] + 1.5 * unit, window.y[1] - 1.5 * unit])
    for yaw in np.radians(yaws):
        half = unit * np.array([np.cos(yaw), -np.sin(yaw)])
        tips = tuple(middle + half), tuple(middle - half)
        axes.annotate("", *tips, arrowprops=_ARROW, zorder=6, gid="shaking")
    axes.text(middle[0] + 1.3 * unit, middle[1], "shaking", va="center", path_effects=_HALO)
