"""The driven table: how it follows its motions, what a falling rock does to it, the boundary."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from pipeline.drawing import style
from pipeline.stages.studies.servo.drive_runs import A_PULSE
from pipeline.workflow.datasets import label, split
from vsr_core.arrays import Array

_AROUND = (0.06, 0.14)
"""Time shown before and after the largest push [s]."""

_LAY = 1.0
"""Tilt of a rock that is down [rad]; what it does to the table before is no disturbance yet."""


@style.styled
def tracking(drive: xr.Dataset) -> Figure:
    """Velocity commanded and measured in the pulse (the paper's Fig. 7a), and their difference."""
    figure = Figure(figsize=(6.4, 4.8), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.2))
    cases = [case for case in split(drive, "row_size") if case["case_motion"].item() == A_PULSE]
    first = cases[0]
    upper.plot(
        first["time"],
        first["wanted_velocity"],
        color=style.INK,
        lw=3.2,
        alpha=0.35,
        label="commanded",
    )
    for number, case in enumerate(cases):
        colour = style.SERIES[number]
        name = "measured: " + case["case_drive"].item()
        upper.plot(case["time"], case["table_velocity"], color=colour, lw=0.9, label=name)
        lower.plot(case["time"], _error(case), color=colour, lw=0.5, zorder=3 - number)
    upper.set_ylabel("velocity of the table [m/s]")
    upper.legend()
    upper.grid(visible=True)
    lower.grid(visible=True)
    lower.set_ylabel("measured less\ncommanded [mm/s]")
    lower.set_xlabel("time [s]")
    return figure


@style.styled
def disturbed(drive: xr.Dataset) -> Figure:
    """The rough motion while the rock topples (the paper's Fig. 7b), and the push closely."""
    figure = Figure(figsize=(6.4, 6.0), layout="constrained")
    upper, middle, lower = figure.subplots(3, 1, height_ratios=(1.6, 0.8, 1.4))
    case = split(drive, "row_size")[-1]
    time, measured = case["time"].values, case["table_velocity"].values
    push = time[_largest_push(case)]
    upper.plot(
        case["time"],
        case["wanted_velocity"],
        color=style.INK,
        lw=2.4,
        alpha=0.35,
        label="commanded",
    )
    upper.plot(
        case["time"], case["table_velocity"], color=style.SERIES[0], lw=0.8, label="measured"
    )
    upper.set_ylabel("velocity of the\ntable [m/s]")
    upper.legend(loc="upper left")
    middle.plot(time, np.degrees(case["tilt"]), color=style.OVERTURNED, lw=1.0)
    middle.set_ylabel("tilt of the\nrock [deg]")
    middle.set_xlabel("time [s]")
    start, stop = push - _AROUND[0], push + _AROUND[1]
    inside = (time >= start) & (time <= stop)
    error = _error(case)[inside]
    lower.plot(time[inside], error, color=style.SERIES[0], lw=0.9, marker=".", ms=2.0)
    lower.axhline(0.0, color=style.INK, lw=0.6)
    lower.set_ylabel("measured less\ncommanded [mm/s]")
    lower.set_xlabel("time [s], around the largest push of the falling rock")
    lower.set_xlim(start, stop)
    start, stop = push - 2.0 * _AROUND[0], push + 2.0 * _AROUND[1]
    shown = measured[(time >= start) & (time <= stop)]
    low, high, pad = shown.min(), shown.max(), 0.04 * np.ptp(measured)
    box = (start, low - pad), stop - start, high - low + 2.0 * pad
    upper.add_patch(Rectangle(*box, fill=False, edgecolor=style.BASE, lw=1.2))
    for axes in (upper, middle, lower):
        axes.grid(visible=True)
    return figure


@style.styled
def boundaries(drive: xr.Dataset) -> Figure:
    """First overturning with each way to drive the table."""
    figure = Figure(figsize=(5.6, 4.6), layout="constrained")
    axes = figure.add_subplot()
    ratio = drive["pgv_pga"].values
    for number, name in enumerate(drive["drive"].values.tolist()):
        one = drive.isel(drive=number)
        middle, low, high = (
            one[f"first_overturning_pga{end}"].values for end in ("", "_lower", "_upper")
        )
        known = np.isfinite(middle)
        frame = number == 0
        axes.errorbar(
            middle[known],
            ratio[known],
            xerr=np.array([middle - low, high - middle])[:, known],
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


def _error(case: xr.Dataset) -> Array:
    """Velocity measured less commanded [mm/s]."""
    return 1e3 * (case["table_velocity"].values - case["wanted_velocity"].values)


def _largest_push(case: xr.Dataset) -> int:
    """Sample at which the table is farthest from where it should be, once the rock falls."""
    falls = case["tilt"].values > 0.5 * _LAY
    error = np.abs(_error(case))
    return int(np.argmax(np.where(falls, error, 0.0) if falls.any() else error))
