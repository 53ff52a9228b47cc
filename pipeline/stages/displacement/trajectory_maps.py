"""Trajectories of the rock over the terrain from above, and where they end.

Figures like Fig. 15 of Chen et al. (2024). Each says in a corner whose terrain it is.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from pipeline.drawing import style
from pipeline.drawing.ground_map import Window, around, draw, relief
from pipeline.stages.datasets.displaced_runs import STOPS, chosen, ends, left_seat
from pipeline.workflow.datasets import is_shaken_along_x
from pipeline.workflow.grammar import counted
from vsr_core.arrays import Array, Indices
from vsr_core.outcome import Movement, StopReason

PGA_EDGES = (0.0, 0.5, 0.7, 0.8, 1.0)
"""Ends of the ranges of PGA [g], open below and closed above; the middle two are the paper's."""

SPEEDS = "plasma"

WIDTH, NOTE = 9.4, 0.18
"""Width of a figure, and height of the note at its top [inch]."""

_FINEST = 3.0 / style.DPI  # inch: a shorter piece of a path is not seen
_MARKS = {
    StopReason.REST: "o",
    StopReason.LEFT_TERRAIN: "^",
    StopReason.TIME: "s",
    StopReason.UNDONE: "X",
}
_COLOURS = {
    Movement.STAYED: style.SERIES[4],
    Movement.ROLLED_OVER: style.SERIES[1],
    Movement.FELL: style.SERIES[3],
    Movement.SLID: style.SERIES[0],
}


@style.styled
def trajectories(displacement: xr.Dataset, terrain: xr.Dataset, source: str) -> Figure:
    """Trajectories of the overturned rock from above, all together and by range of PGA.

    Parameters
    ----------
    source : str
        What the terrain is, e.g. "surrogate terrain".
    """
    runs = chosen(displacement, left_seat(displacement))
    window = around(np.column_stack([runs["x"].values, runs["y"].values]), terrain)
    ground = relief(terrain, window)
    pga, speed = runs["pga"].values, speeds(runs)
    edges = [*PGA_EDGES[:-1], max(PGA_EDGES[-1], float(pga.max(initial=0.0)))]
    figure, large, panels, bar = _panels(window.size[1] / window.size[0])
    titles = [f"all runs that left the seat, N = {runs.sizes['run']}"]
    parts = [runs]
    for low, high in itertools.pairwise(edges):
        parts.append(chosen(runs, (pga > low) & (pga <= high)))
        titles.append(f"{low:g} < PGA ≤ {high:g} g, N = {parts[-1].sizes['run']}")
    for axes, part, title in zip((large, *panels), parts, titles, strict=True):
        draw(axes, ground, window, named=axes is large)
        inch = window.size[0] / (WIDTH * axes.get_position().width)
        paths(axes, part, ("x", "y"), speed, inch)
        _start(axes, 6.0 if axes is large else 3.5)
        axes.set_title(title)
        axes.tick_params(labelleft=axes is large, labelbottom=axes is large)
    _shaking(large, displacement, window)
    large.set(xlabel="x [m]", ylabel="y [m]")
    scale = ScalarMappable(speed, SPEEDS)
    figure.colorbar(scale, cax=bar, orientation="horizontal", label="speed [m/s]")
    named(figure, source)
    return figure


@style.styled
def end_positions(displacement: xr.Dataset, terrain: xr.Dataset, source: str) -> Figure:
    """Where every run ended, by how the rock moved and what ended the run."""
    places, stop = ends(displacement), displacement["stop_reason"].values
    window = around(places, terrain)
    width, left, below = 6.1, 0.6, 0.5
    height = width * window.size[1] / window.size[0]
    tall = height + below + 0.25 + NOTE
    figure = Figure(figsize=(WIDTH, tall))
    axes = figure.add_axes((left / WIDTH, below / tall, width / WIDTH, height / tall))
    draw(axes, relief(terrain, window), window)
    dots: Any = {"s": 13, "edgecolors": "white", "linewidths": 0.3, "alpha": 0.85,
                 "rasterized": True, "zorder": 3}  # fmt: skip
    movement = displacement["movement"].values
    colours = np.full(len(stop), style.INK, dtype=object)
    for kind, colour in _COLOURS.items():
        colours[movement == kind] = colour
    for reason, marker in _MARKS.items():
        runs = stop == reason
        if runs.any():
            dots |= {"c": colours[runs].tolist(), "gid": reason.name.lower()}
            axes.scatter(*places[runs].T, marker=marker, **dots)
    _start(axes, label="start")
    _shaking(axes, displacement, window)
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.set_title(f"end positions, {counted(displacement.sizes['run'], 'run')}")
    _key_to_ends(axes, movement, stop)
    named(figure, source)
    return figure


def _key_to_ends(axes: Axes, movement: Indices, stop: Indices) -> None:
    """Key beside the map: colours of the movements, then marks of what ended the runs."""
    for kind, colour in _COLOURS.items():
        if count := int((movement == kind).sum()):
            axes.plot([], [], "o", color=colour, label=f"{kind.words} ({count})")
    for reason, marker in _MARKS.items():
        if count := int((stop == reason).sum()):
            look: Any = {"mfc": "none", "mec": style.INK, "ls": "none"}
            axes.plot([], [], marker, label=f"{STOPS[reason]} ({count})", **look)
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0)


def named(figure: Figure, source: str) -> None:
    """Say in the upper left corner, above all else, what the terrain is."""
    layout = figure.get_layout_engine()
    if isinstance(layout, ConstrainedLayoutEngine):
        layout.set(rect=(0.0, 0.0, 1.0, 1.0 - NOTE / figure.get_figheight()))
    figure.text(0.006, 0.992, source, ha="left", va="top", size=7.5, color="#5a5a5a", gid="source")


def speeds(runs: xr.Dataset) -> Normalize:
    """Scale of the colours of speed.

    Returns
    -------
    Normalize, from 0 to the largest speed [m/s]
    """
    return Normalize(0.0, max(float(runs["speed"].values.max(initial=0.0)), 1e-9))


def paths(
    axes: Axes, runs: xr.Dataset, names: tuple[str, str], speed: Normalize, inch: float
) -> None:
    """Draw paths coloured by speed, in pieces no shorter than can be seen.

    Parameters
    ----------
    names : (str, str)
        The coordinates to the right and up.
    inch : float [m], what an inch of the panel shows
    """
    if runs.sizes["run"] == 0:
        middle: Any = {"transform": axes.transAxes, "ha": "center", "gid": "empty"}
        axes.text(0.5, 0.1, "no run left the seat", path_effects=style.HALO, **middle)
        return
    points = np.column_stack([runs[name].values for name in names]).astype(float)
    run = np.repeat(np.arange(runs.sizes["run"]), runs["row_size"].values)
    starts = np.diff(run, prepend=-1) > 0
    step = np.hypot(*np.diff(points, axis=0, prepend=points[:1]).T)
    pieces = np.floor(np.cumsum(np.where(starts, 0.0, step)) / (_FINEST * inch))
    drawn = starts | (np.diff(pieces, prepend=-1.0) > 0) | np.roll(starts, -1)
    points, run, pace = points[drawn], run[drawn], runs["speed"].values[drawn]
    joined = run[1:] == run[:-1]
    look: Any = {"linewidths": 0.65, "alpha": 0.75, "capstyle": "round", "rasterized": True}
    lines = LineCollection(
        np.stack([points[:-1], points[1:]], axis=1)[joined],
        array=(0.5 * (pace[1:] + pace[:-1]))[joined],
        cmap=SPEEDS, norm=speed, zorder=2, gid="paths", **look,
    )  # fmt: skip
    axes.add_collection(lines, autolim=False)


def _panels(aspect: float) -> tuple[Figure, Axes, list[Axes], Axes]:
    """One large panel, two rows of two small ones as high together, and a bar below [inch]."""
    gap, title, left, below, top = 0.12, 0.24, 0.6, 0.75, 0.42
    room = WIDTH - left - 3 * gap
    # heights: large = a W, small = a w; 2 w a + gap + title = a W; W + 2 w = room
    small = (room - (gap + title) / aspect) / 4
    large = room - 2 * small
    height = large * aspect + below + top
    figure = Figure(figsize=(WIDTH, height))

    def place(x: float, y: float, width: float, tall: float) -> Axes:
        return figure.add_axes((x / WIDTH, y / height, width / WIDTH, tall / height))

    whole = place(left, below, large, large * aspect)
    lefts = [left + large + gap, left + large + 2 * gap + small]
    bottoms = [below + small * aspect + gap + title, below]
    panels = [place(x, y, small, small * aspect) for y in bottoms for x in lefts]
    return figure, whole, panels, place(lefts[0], below - 0.28, 2 * small + gap, 0.12)


def _start(axes: Axes, size: float = 6.0, **given: Any) -> None:
    look: Any = {"mfc": "white", "mec": style.INK, "mew": 0.9, "zorder": 5, "gid": "start"}
    axes.plot(0.0, 0.0, "o", ms=size, **look, **given)


def _shaking(axes: Axes, displacement: xr.Dataset, window: Window) -> None:
    """Arrows of the shaking, to and fro, in the upper left corner; none along several axes."""
    if not is_shaken_along_x(displacement):
        return
    unit = 0.06 * min(window.size)
    middle = np.array([window.x[0] + 1.5 * unit, window.y[1] - 1.5 * unit])
    for yaw in np.radians(np.unique(displacement["yaw"].values)):
        half = unit * np.array([np.cos(yaw), -np.sin(yaw)])
        arrow = {**style.BOTH_WAYS, "color": style.INK, "lw": 1.4}
        tips = tuple(middle + half), tuple(middle - half)
        axes.annotate("", *tips, arrowprops=arrow, zorder=6, gid="shaking")
    axes.text(middle[0] + 1.3 * unit, middle[1], "shaking", va="center", path_effects=style.HALO)


@style.styled
def side_view(displacement: xr.Dataset, terrain: xr.Dataset, source: str) -> Figure:
    """Trajectories of the overturned rock from the side: height against distance along the slope.

    The distance is that along the mean direction from the start to the ends. A line shows the
    ground below the start, a band the lowest and highest ground within the width of the
    trajectories.
    """
    runs = chosen(displacement, left_seat(displacement))
    points = np.column_stack([runs["x"].values, runs["y"].values])
    along = _mean_direction(ends(runs))
    distance, aside = points @ along, points @ np.array([-along[1], along[0]])
    least, most = distance.min(initial=0.0), distance.max(initial=0.0)
    margin = 0.06 * max(most - least, 1.0)
    at = np.linspace(least - margin, most + margin, 500)
    below, beside = _profiles(relief(terrain, around(points, terrain)), at, along, aside)
    low, high = _span(np.concatenate([below, beside.ravel(), runs["z"].values]))
    height = float(np.clip(6.9 * (high - low) / np.ptp(at), 1.2, 6.0))
    figure = Figure(figsize=(WIDTH, height + 1.0 + NOTE), layout="constrained")
    axes = figure.add_subplot()
    known = ~np.isnan(beside).all(axis=0)
    axes.fill_between(
        at[known],
        np.nanmin(beside[:, known], axis=0),
        np.nanmax(beside[:, known], axis=0),
        color="#dcdcdc",
        lw=0,
        label="ground within the width of the trajectories",
        gid="band",
    )
    axes.plot(at, below, color=style.INK, lw=1.2, label="ground below the start", gid="ground")
    speed = speeds(runs)
    sideways = runs.assign(distance=("sample", distance))
    paths(axes, sideways, ("distance", "z"), speed, float(np.ptp(at)) / 8.0)
    axes.set_xlim(at[0], at[-1])
    axes.set_ylim(low, high)
    axes.set_aspect("equal")
    turn = np.round(np.degrees(np.arctan2(along[1], along[0]))) % 360.0
    axes.set_xlabel(f"distance from the start, at {turn:.0f}° counter-clockwise from +x [m]")
    axes.set_ylabel("height of the\ncentre of mass [m]")
    axes.set_title(f"all runs that left the seat, N = {runs.sizes['run']}")
    axes.legend(loc="upper right")
    figure.colorbar(ScalarMappable(speed, SPEEDS), ax=axes, label="speed [m/s]", shrink=0.9)
    named(figure, source)
    return figure


def _mean_direction(places: Array) -> Array:
    """Unit vector, shape (2,), from the start to the middle of the ends; else along x."""
    middle = places.mean(axis=0) if len(places) else np.zeros(2)
    length = float(np.hypot(*middle))
    return middle / length if length > 1e-6 else np.array([1.0, 0.0])


def _profiles(ground: xr.DataArray, at: Array, along: Array, aside: Array) -> tuple[Array, Array]:
    """Height of the ground [m] along the line through the start, and along lines beside it.

    Parameters
    ----------
    at : ndarray, shape (n,) [m], distances along the lines
    along : ndarray, shape (2,), their direction
    aside : ndarray [m], how far to the left the trajectories pass; the lines cover most of them

    Returns
    -------
    below : ndarray, shape (n,)
    beside : ndarray, shape (k, n)
    """
    left = np.array([-along[1], along[0]])
    width = np.percentile(np.append(aside, 0.0), [2.0, 98.0])
    offsets = np.linspace(float(width[0]), float(width[1]), 25)
    lines = at[:, None] * along + np.append(offsets, 0.0)[:, None, None] * left
    x, y = (xr.DataArray(lines[..., axis], dims=("line", "at")) for axis in (0, 1))
    heights = ground.interp(x=x, y=y).values
    return heights[-1], heights[:-1]


def _span(heights: Array) -> tuple[float, float]:
    low, high = float(np.nanmin(heights)), float(np.nanmax(heights))
    margin = 0.05 * max(high - low, 1.0)
    return low - margin, high + margin
