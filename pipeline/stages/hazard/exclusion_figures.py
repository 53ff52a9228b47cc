"""Figures of the earthquakes that a rock excludes."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.drawing import style
from pipeline.workflow.datasets import label

_CHANCES = np.linspace(0.0, 1.0, 11)

_TICKS = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0)

_DASHES = ("dotted", "dashed", "solid")
"""Of the lines along which the rock stands with each probability, rising."""

_MOST_NAMED = 12
"""Faults whose names are written; more are points without names."""


@style.styled
def exclusion(found: xr.Dataset) -> Figure:
    """Chance that an earthquake topples the rock, by magnitude and distance, with the faults."""
    figure = Figure(figsize=(6.2, 4.4), layout="constrained")
    axes = figure.add_subplot()
    magnitude, distance = found["magnitude"].values, found["distance"].values
    chance = found["scenario_toppling_probability"].values
    filled = axes.contourf(distance, magnitude, chance, _CHANCES, cmap="magma_r")
    figure.colorbar(filled, ax=axes, label=label("scenario_toppling_probability"))
    standing = found["standing_probability"].values
    for level, dashes in zip(standing.tolist(), _DASHES, strict=True):
        if chance.min() < 1.0 - level < chance.max():  # named beside the map, where no fault lies
            look: Any = {"linestyles": [dashes], "colors": style.INK, "linewidths": 1.1}
            axes.contour(distance, magnitude, 1.0 - chance, [level], **look)
            name = f"stands with {100 * level:g} %"
            axes.plot([], [], ls=dashes, color=style.INK, lw=1.1, label=name)
    if axes.get_legend_handles_labels()[0]:
        figure.legend(loc="outside lower center", ncols=len(standing))
    if "fault" in found.dims:
        _faults(axes, found)
    axes.set_xscale("log")
    ticks = [x for x in _TICKS if distance[0] <= x <= distance[-1]]
    axes.set_xticks(ticks, [f"{x:g}" for x in ticks])
    axes.minorticks_off()
    axes.set(
        xlim=(distance[0], distance[-1]),
        ylim=(magnitude[0], magnitude[-1]),
        xlabel=label("distance"),
        ylabel=label("magnitude"),
    )
    return figure


def _faults(axes: Axes, found: xr.Dataset) -> None:
    """Mark the faults; those beyond the map stand at its edge."""
    at = np.clip(found["fault_distance"].values, *found["distance"].values[[0, -1]])
    size = np.clip(found["fault_magnitude"].values, *found["magnitude"].values[[0, -1]])
    rejected = found["fault_rejected"].values == 1
    for out, mark in ((False, "o"), (True, "X")):
        if not (rejected == out).any():
            continue  # nothing without a border still takes a place in the layout
        axes.plot(
            at[rejected == out],
            size[rejected == out],
            mark,
            color="white",
            markeredgecolor=style.INK,
            clip_on=False,
            zorder=3,
        )
    if found.sizes["fault"] <= _MOST_NAMED:
        for name, x, y in zip(found["fault"].values, at, size, strict=True):
            axes.annotate(
                str(name)[:40],
                (x, y),
                (6, 4),
                textcoords="offset points",
                fontsize=7.5,
                path_effects=style.HALO,
            )
