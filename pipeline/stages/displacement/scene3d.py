"""Terrain, rock and runs that left the seat in three dimensions, in a page that works offline."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import xarray as xr
from markupsafe import Markup

from pipeline.drawing.rendering import clearest, packed, packed_mesh, thinned
from pipeline.drawing.view import contour_step, reach
from pipeline.stages.datasets.displaced_runs import STOPS, chosen, ends, left_seat
from pipeline.stages.datasets.stored_runs import in_words, ways
from pipeline.stages.displacement.timelapse import SPEEDS
from pipeline.workflow.datasets import is_shaken_along_x
from pipeline.workflow.pages import filled
from pipeline.workflow.pages import source as text_of
from vsr_core.arrays import Array, Indices
from vsr_core.outcome import Movement, StopReason

PAGE = "scene3d.html"
SCRIPTS = tuple(
    f"{part}.js" for part in ("geometry", "samples", "drawing", "controls", "playing", "page")
)
"""Templates, the scripts in the order in which they build on each other."""

MOST_SAMPLES = 200_000
"""Of all runs, for a page below 8 MB; left out are those that their neighbours predict best."""

MOST_TERRAIN_FACES = 80_000
MOST_ROCK_FACES = 20_000

_FINEST = 65_535  # steps of a number in two bytes
_TURNS = 32_767  # steps of a part of a quaternion
_VIEW_POINTS = 500  # of all paths, to choose where to look from


def page(
    displacement: xr.Dataset,
    terrain: xr.Dataset,
    rock: xr.Dataset,
    title: str,
    source: str,
    up: str = "../",
) -> str:
    """Page with the paths of all runs that left the seat, one of which is played.

    Positions are stored to a 65,535th of the extent of their run.

    Parameters
    ----------
    source : str
        Where rock and terrain come from, such as that they are surrogates.
    up : str
        The way from the page to the folder of all results, as a link has it.

    Returns
    -------
    str
        HTML that holds all it needs.
    """
    fallen = left_seat(displacement)
    runs = chosen(displacement, fallen & (displacement["row_size"].values > 1))
    corners = rock["vertex"].values.astype(float)
    radius = float(np.linalg.norm(corners, axis=1).max())
    ground = (terrain["terrain_vertex"].values, terrain["terrain_face"].values.astype(np.int64))
    surface = (rock["surface_vertex"].values.astype(float), rock["surface_face"].values)
    start = np.array([[0.0, 0.0, -corners[:, 2].min()]])  # of the centre of mass
    samples, error = _samples(runs, radius)
    path = np.concatenate([start, _places(runs)])
    path = path[:: -(-len(path) // _VIEW_POINTS)]
    along = ends(runs).mean(axis=0) if runs.sizes["run"] else np.array([1.0, 0.0])
    azimuth, elevation = clearest(ground, path, radius, along)
    contour = contour_step(reach(path, radius))
    data = {
        "terrain": packed_mesh(*thinned(*ground, MOST_TERRAIN_FACES)),
        "rock": packed_mesh(*thinned(*surface, MOST_ROCK_FACES)),
        "radius": radius,
        "start": start[0].tolist(),
        "runs": _table(runs),
        "samples": samples,
        "view": {"azimuth": azimuth, "elevation": elevation},
        "contour": contour,
        "along_x": is_shaken_along_x(displacement),
        "colours": np.array(SPEEDS(np.linspace(0.0, 1.0, 5)))[:, :3].round(4).tolist(),
    }
    scripts = [text_of(name) for name in SCRIPTS]
    return filled(
        PAGE,
        {
            "title": title,
            "source": source,
            "left": int(fallen.sum()),
            "ways": in_words(ways(displacement["outcome"].values, displacement["movement"].values)),
            "total": displacement.sizes["run"],
            "contour": contour,
            "error": error,
            "data": data,
            "scripts": [Markup(script) for script in scripts],  # noqa: S704  (our own files)
        },
        up,
    )


def _places(runs: xr.Dataset) -> Array:
    return np.column_stack([runs[name].values for name in "xyz"])


def _table(runs: xr.Dataset) -> list[dict[str, Any]]:
    """The parameters and the end of each run."""
    names = ("pga", "pgv_pga", "yaw", "friction", "trajectory_length")
    columns = {name: runs[name].values.astype(float).round(6).tolist() for name in names}
    columns["movement"] = [Movement(int(kind)).words for kind in runs["movement"]]
    columns["stop"] = [STOPS[StopReason(int(reason))] for reason in runs["stop_reason"]]
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _samples(runs: xr.Dataset, radius: float) -> tuple[dict[str, Any], float]:
    """Samples of all runs in few bytes, and by how much [m] positions err for those left out."""
    time, place, turn = runs["time"].values, _places(runs), runs["quaternion"].values
    run = np.repeat(np.arange(runs.sizes["run"]), runs["row_size"].values)
    indices = fewer(time, place, turn, run, radius, MOST_SAMPLES)
    error = _error(time, place, run, indices)
    time, place, turn, run = time[indices], place[indices], turn[indices], run[indices]
    speed = runs["speed"].values[indices]
    starts = np.flatnonzero(np.diff(run, prepend=-1))
    low = np.minimum.reduceat(place, starts) if len(starts) else np.zeros((0, 3))
    high = np.maximum.reduceat(place, starts) if len(starts) else np.zeros((0, 3))
    step = np.maximum(high - low, 1e-6) / _FINEST
    largest = max(float(speed.max(initial=0.0)), 0.1)
    return {
        "count": np.bincount(run, minlength=runs.sizes["run"]).tolist(),
        "time": packed(time, "<f4"),
        "low": packed(low, "<f4"),
        "step": packed(step, "<f4"),
        "place": packed(np.rint((place - low[run]) / step[run]), "<u2"),
        "turn": packed(np.rint(turn * _TURNS), "<i2"),
        "speed": packed(np.rint(speed / largest * _FINEST), "<u2"),
        "largest_speed": largest,
    }, error


def fewer(
    time: Array, place: Array, turn: Array, run: Indices, radius: float, most: int
) -> Indices:
    """Choose samples to keep: those that their neighbours predict best are left out.

    Parameters
    ----------
    time : ndarray, shape (n,) [s]
    place : ndarray, shape (n, 3) [m]
    turn : ndarray, shape (n, 4), unit quaternions
    run : ndarray of int, shape (n,), ascending; a run's first and last sample stay
    radius : float [m], of the rock, by which an angle counts as a distance
    most : int, how many to keep, if so many can go

    Returns
    -------
    ndarray of int, shape (k,), ascending
    """
    indices = np.arange(len(time))
    for number in itertools.count():
        inside = run[indices[:-2]] == run[indices[2:]]
        if len(indices) <= most or not inside.any():
            break
        # Neighbours never go together, and few at once: each predicts the other.
        free = np.flatnonzero(inside & (np.arange(len(inside)) % 2 == number % 2)) + 1
        before, here, after = indices[free - 1], indices[free], indices[free + 1]
        share = ((time[here] - time[before]) / (time[after] - time[before]))[:, None]
        predicted = (1.0 - share) * place[before] + share * place[after]
        same = np.sign(np.einsum("ij,ij->i", turn[before], turn[after]))[:, None]
        turned = (1.0 - share) * turn[before] + share * same * turn[after]
        turned /= np.linalg.norm(turned, axis=1, keepdims=True)
        off = np.minimum(*(np.linalg.norm(turn[here] - s * turned, axis=1) for s in (1, -1)))
        cost = np.linalg.norm(place[here] - predicted, axis=1) + 2.0 * radius * off
        count = min(len(indices) - most, len(indices) // 8 + 1)
        indices = np.delete(indices, free[np.argsort(cost, kind="stable")[:count]])
    return indices


def _error(time: Array, place: Array, run: Indices, indices: Indices) -> float:
    """Largest distance [m] of a position from that between the stored samples."""
    if len(indices) == len(time):
        return 0.0
    clock = time + run * (float(np.ptp(time)) + 1.0)  # ascends over all runs
    between = [np.interp(clock, clock[indices], part[indices]) for part in place.T]
    return float(np.linalg.norm(np.column_stack(between) - place, axis=1).max())
