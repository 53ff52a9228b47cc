"""Runs of ``displacement.nc`` as figures and pages take them: paths, ends, which left the seat."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd
import xarray as xr

from vsr_core.arrays import Array, Mask
from vsr_core.displacement import correlation
from vsr_core.displacement.origin import Forward
from vsr_core.outcome import Outcome, StopReason

STOPS = {
    StopReason.REST: "came to rest",
    StopReason.LEFT_TERRAIN: "left the terrain",
    StopReason.TIME: "still moving when time ran out",
    StopReason.UNDONE: "unresolved",
}
"""What ended a run, in words."""


def left_seat(displacement: xr.Dataset) -> Mask:
    """Find the runs whose rock left its seat: those with the outcome overturned.

    Returns
    -------
    ndarray of bool, shape (run,)
    """
    overturned: Mask = displacement["outcome"].values == Outcome.OVERTURNED
    return overturned


def chosen(displacement: xr.Dataset, runs: Mask) -> xr.Dataset:
    """The dataset with some of its runs, and their samples, only.

    Parameters
    ----------
    runs : ndarray of bool, shape (run,)
    """
    samples = np.repeat(runs, displacement["row_size"].values)
    return displacement.isel(run=runs, sample=samples)


def groups(displacement: xr.Dataset) -> Iterator[tuple[str, xr.Dataset]]:
    """Name and runs of each yaw and friction.

    Returns
    -------
    iterator of (str, Dataset)
    """
    yaw, friction = displacement["yaw"].values, displacement["friction"].values
    several = len(np.unique(friction)) > 1
    for turn, grip in sorted(set(zip(yaw.tolist(), friction.tolist(), strict=True))):
        name = f"yaw {turn:g} deg" + (f", friction {grip:g}" if several else "")
        yield name, chosen(displacement, (yaw == turn) & (friction == grip))


def overturned_runs(displacement: xr.Dataset) -> pd.DataFrame:
    """The overturned runs, as the correlations take them.

    Returns
    -------
    DataFrame
        See ``vsr_core.displacement.correlation``.
    """
    names = [*correlation.REGRESSORS, *correlation.STATISTICS]
    table = displacement[names].isel(run=left_seat(displacement)).to_dataframe()
    return table[names].astype(float)


def typical(displacement: xr.Dataset) -> int | None:
    """Place of the run of median length among those that left the seat and came to rest."""
    rested = left_seat(displacement) & (displacement["stop_reason"].values == StopReason.REST)
    runs = np.flatnonzero(rested)
    if not len(runs):
        return None
    order = np.argsort(displacement["trajectory_length"].values[runs], kind="stable")
    return int(runs[order[len(order) // 2]])


def ends(displacement: xr.Dataset) -> Array:
    """Where the centre of mass of each run ended.

    A run without samples never left its start, the origin of the frame.

    Returns
    -------
    ndarray, shape (run, 2) [m], x and y in the site's frame
    """
    size = displacement["row_size"].values
    last = np.cumsum(size) - 1
    end = np.zeros((len(size), 2))
    some = size > 0
    for axis, name in enumerate("xy"):
        end[some, axis] = displacement[name].values[last[some]]
    return end


def forward(displacements: Sequence[xr.Dataset], starts: Array) -> Forward:
    """Runs from several starts whose resting place is known.

    Runs that time ended, or that are unresolved, are left out: where they rest is not known.

    Parameters
    ----------
    displacements : sequence of Dataset
        One a start, as in ``displacement.nc``, with terrains that do not differ in direction.
    starts : ndarray, shape (s, 2) [m]
        Origin of each dataset's frame in the frame of the observed place.
    """
    parts = []
    for displacement, start in zip(displacements, starts, strict=True):
        stop, end = displacement["stop_reason"].values, ends(displacement) + start
        end[stop == StopReason.LEFT_TERRAIN] = np.nan
        known = np.isin(stop, (StopReason.REST, StopReason.LEFT_TERRAIN))
        pga, ratio = (displacement[name].values.astype(float) for name in ("pga", "pgv_pga"))
        parts.append((pga[known], ratio[known], end[known]))
    number = np.repeat(np.arange(len(parts)), [len(pga) for pga, _, _ in parts])
    return Forward(number, *(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))
