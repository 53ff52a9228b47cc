"""The driven table: how it follows its motions, what a falling rock does to it, the boundary."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from pipeline.drawing import style
from pipeline.workflow.datasets import label
from vsr_core.arrays import Array

AROUND = (0.06, 0.14)
"""Time shown before and after the largest push [s]."""

LAY = 1.0
"""Tilt of a rock that is down [rad]; what it does to the table before is no disturbance yet."""


class _Case(NamedTuple):
    name: str
    time: Array
    wanted: Array
    measured: Array
    tilt: Array


@style.styled
def tracking(drive: xr.Dataset) -> Figure:
    """Velocity wanted and measured in the pulse (the paper's Fig. 7a), and their difference.

    Parameters
    ----------
    drive : Dataset
        As in ``drive.nc``.
    """
    figure = Figure(figsize=(6.4, 4.8), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.2))
    cases = [case for case in _cases(drive) if case.name.startswith("pulse")]
    first = cases[0]
    upper.plot(first.time, first.wanted, color=style.INK, lw=3.2, alpha=0.35, label="wanted")
    for number, case in enumerate(cases):
        colour = style.SERIES[number]
        name = case.name.removeprefix("pulse, ")
        upper.plot(case.time, case.measured, color=colour, lw=0.9, label=f"measured: {name}")
        error = 1e3 * (case.measured - case.wanted)
        lower.plot(case.time, error, color=colour, lw=0.5, zorder=3 - number)
    upper.set_ylabel("velocity of the table [m/s]")
    upper.legend()
    upper.grid(visible=True)
    lower.grid(visible=True)
    lower.set_ylabel("measured less\nwanted [mm/s]")
    lower.set_xlabel("time [s]")
    return figure


@style.styled
def disturbed(drive: xr.Dataset) -> Figure:
    """The rough motion while the rock topples (the paper's Fig. 7b), and the push closely.

    Parameters
    ----------
    drive : Dataset
        As in ``drive.nc``.
    """
    figure = Figure(figsize=(6.4, 6.0), layout="constrained")
    upper, middle, lower = figure.subplots(3, 1, height_ratios=(1.6, 0.8, 1.4))
    case = _cases(drive)[-1]
    at = _largest_push(case)
    upper.plot(case.time, case.wanted, color=style.INK, lw=2.4, alpha=0.35, label="wanted")
    upper.plot(case.time, case.measured, color=style.SERIES[0], lw=0.8, label="measured")
    upper.set_ylabel("velocity of the\ntable [m/s]")
    upper.legend(loc="upper left")
    middle.plot(case.time, np.degrees(case.tilt), color=style.OVERTURNED, lw=1.0)
    middle.set_ylabel("tilt of the\nrock [deg]")
    middle.set_xlabel("time [s]")
    _closely(lower, case, at)
    start, stop = case.time[at] - 2.0 * AROUND[0], case.time[at] + 2.0 * AROUND[1]
    inside = (case.time >= start) & (case.time <= stop)
    low, high = case.measured[inside].min(), case.measured[inside].max()
    pad = 0.04 * np.ptp(case.measured)
    box = (start, low - pad), stop - start, high - low + 2.0 * pad
    upper.add_patch(Rectangle(*box, fill=False, edgecolor=style.BASE, lw=1.2))
    for axes in (upper, middle, lower):
        axes.grid(visible=True)
    return figure


@style.styled
def boundaries(drive: xr.Dataset) -> Figure:
    """First overturning with each way to drive the table.

    Parameters
    ----------
    drive : Dataset
        As in ``drive.nc``.
    """
    figure = Figure(figsize=(5.6, 4.6), layout="constrained")
    axes = figure.add_subplot()
    ratio = drive["pgv_pga"].values
    names = drive["drive"].values.tolist()
    for number, name in enumerate(names):
        low, high = (
            drive[part].values[number] for part in ("last_balanced_pga", "first_overturning_pga")
        )
        known = np.isfinite(low) & np.isfinite(high)
        middle = 0.5 * (low + high)
        frame = number == 0
        axes.errorbar(
            middle[known],
            ratio[known],
            xerr=0.5 * (high - low)[known],
            color=style.INK if frame else style.SERIES[number - 1],
            marker=style.MARKERS[number],
            mfc="white",
            ms=8.0 - 1.8 * number,
            lw=2.6 if frame else 1.1,
            alpha=0.45 if frame else 1.0,
            label=name,
        )
    axes.set_yscale("log")
    axes.set_yticks(ratio, [f"{value:.2g}" for value in ratio])
    axes.minorticks_off()
    axes.set_xlabel(f"first overturning: {label('pga')}")
    axes.set_ylabel("PGV/PGA [s]")
    axes.grid(visible=True)
    figure.legend(loc="outside lower center", ncols=1)
    return figure


def _cases(drive: xr.Dataset) -> list[_Case]:
    ends = np.cumsum(drive["row_size"].values)
    parts = ("time", "wanted_velocity", "table_velocity", "tilt")
    return [
        _Case(str(name), *(drive[part].values[end - size : end] for part in parts))
        for name, size, end in zip(
            drive["case"].values, drive["row_size"].values, ends, strict=True
        )
    ]


def _largest_push(case: _Case) -> int:
    """Sample at which the table is farthest from where it should be, once the rock falls."""
    falls = case.tilt > 0.5 * LAY
    error = np.abs(case.measured - case.wanted)
    return int(np.argmax(np.where(falls, error, 0.0) if falls.any() else error))


def _closely(axes: Axes, case: _Case, at: int) -> None:
    start, stop = case.time[at] - AROUND[0], case.time[at] + AROUND[1]
    inside = (case.time >= start) & (case.time <= stop)
    time, error = case.time[inside], 1e3 * (case.measured - case.wanted)[inside]
    axes.plot(time, error, color=style.SERIES[0], lw=0.9, marker=".", ms=2.0)
    axes.axhline(0.0, color=style.INK, lw=0.6)
    axes.set_ylabel("measured less\nwanted [mm/s]")
    axes.set_xlabel("time [s], around the largest push of the falling rock")
    axes.set_xlim(start, stop)
