"""A record in one picture: acceleration, velocity, displacement and response spectrum."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.drawing import style
from pipeline.workflow.datasets import label, split
from vsr_core import GRAVITY
from vsr_core.motions.records.trace import Trace

_BESIDE = 0.25
"""What is shown of the zeros at each end, at most, as a share of the record's length."""

_ROOM = 1.15
"""Half-height of a panel, in units of the processed motion's peak."""


@style.styled
def record_figure(motions: xr.Dataset, number: int) -> Figure:
    """Draw one record, as processed and as recorded."""
    figure = Figure(figsize=(8.6, 5.0))
    grid = figure.add_gridspec(
        3, 2, width_ratios=(1.75, 1.0), left=0.08, right=0.985, top=0.93, bottom=0.13, hspace=0.14
    )
    one = split(motions, "record_size")[number]
    before = split(motions, "raw_size", "raw_sample")[number]
    left = [figure.add_subplot(grid[0, 0])]
    left += [figure.add_subplot(grid[row, 0], sharex=left[0]) for row in (1, 2)]
    _histories(left, one, before)
    _spectrum(figure.add_subplot(grid[:, 1]), one)
    left[0].set_title(f"{one['record'].item()}, as recorded and as processed", loc="left")
    style.legend_below(figure, left[0], 3, top=0.055)
    return figure


def _histories(panels: list[Axes], one: xr.Dataset, before: xr.Dataset) -> None:
    """The motion in ``one`` as processed, over that ``before``."""
    start = float(one["raw_start"])
    raw = Trace(before["raw_acceleration"].values, float(one["raw_interval"]))
    times = float(one["interval"]) * np.arange(one.sizes["sample"]) - start
    quantities = {"acceleration": GRAVITY, "velocity": 1.0, "displacement": 1.0}
    for axes, (name, unit) in zip(panels, quantities.items(), strict=True):
        values = one[name].values / unit
        recorded = getattr(raw, name) / unit
        axes.plot(raw.times, recorded, color=style.FAINT, lw=1.0, label="as recorded, integrated")
        axes.plot(times, values, color=style.SERIES[0], lw=0.9, label="processed", gid=name)
        peak = int(np.abs(values).argmax())
        axes.plot(times[peak], values[peak], "o", ms=4, color=style.OVERTURNED, label="peak")
        axes.set_ylim(-_ROOM * abs(values[peak]), _ROOM * abs(values[peak]))
        for span in ((-start, 0.0), (raw.duration, raw.duration + start)):
            axes.axvspan(*span, color="#f1f1ee", lw=0, zorder=0)
        axes.axhline(0.0, color=style.INK, lw=0.4)
        axes.tick_params(labelbottom=axes is panels[-1])
    panels[0].set_ylabel("a [g]")
    panels[1].set_ylabel("v [m/s]")
    panels[2].set_ylabel("d [m]")
    panels[2].set_xlabel(
        "time since the first sample as recorded [s]; shaded: zeros for the filter"
    )
    beside = min(start, _BESIDE * raw.duration)
    panels[0].set_xlim(-beside, raw.duration + beside)


def _spectrum(axes: Axes, one: xr.Dataset) -> None:
    frequency = one["oscillator_frequency"].values
    for name, colour in (
        ("raw_spectral_acceleration", style.FAINT),
        ("spectral_acceleration", style.SERIES[0]),
    ):
        axes.loglog(frequency, one[name].values, color=colour, lw=1.3, gid=name)
    for name, at in (("sa_1hz", 1.0), ("sa_2hz", 2.0)):
        axes.plot(at, float(one[name]), "o", ms=4, color=style.OVERTURNED)
    axes.axhline(float(one["record_pga"]), color=style.INK, lw=0.8, ls=(0, (4, 2)))
    axes.annotate(
        "PGA",
        (frequency[0], float(one["record_pga"])),
        xytext=(3, 3),
        textcoords="offset points",
        fontsize=8,
    )
    axes.set_xlabel(label("oscillator_frequency"))
    axes.set_title("pseudo-spectral acceleration [g], 5 % damping", fontsize=8.5)
    axes.grid(visible=True, which="major")
    axes.set_xlim(frequency[0], frequency[-1])
