"""Where the rock goes, from the side: height against distance along the slope."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure

from pipeline.drawing import style
from pipeline.drawing.ground_map import around, relief
from pipeline.stages.datasets.displaced_runs import chosen, ends, left_seat
from pipeline.stages.displacement.trajectory_maps import NOTE, SPEEDS, WIDTH, named, paths, speeds
from vsr_core.arrays import Array


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
