"""Figures of an archive: boundaries with their bands, and where the bands come from."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.drawing.style import FAINT, INK, SERIES, styled
from vsr_core.archive.photographs import ODDS
from vsr_core.arrays import Indices

MOST = 6
"""Rocks whose boundaries are drawn."""

WORDS = {
    "equations": "the equations",
    "alpha_2": "angle of side 2",
    "height": "height of the centre",
    "inertia": "moment of inertia",
    "friction": "friction",
    "roundness": "roundness of the base",
}
"""What a band comes from, in words."""


def chosen(static: np.ndarray) -> Indices:
    """Rocks that are drawn: from the weakest to the strongest, evenly."""
    order = np.argsort(static, kind="stable")
    places = np.linspace(0, len(order) - 1, min(MOST, len(order))).round().astype(int)
    return np.asarray(order[np.unique(places)])


@styled
def boundaries(dataset: xr.Dataset, names: list[str]) -> Figure:
    """First-overturning PGA against PGV/PGA, with the band, a panel a rock."""
    rocks = chosen(dataset["static_pga"].values)
    columns = min(3, max(len(rocks), 1))
    rows = -(-max(len(rocks), 1) // columns)
    figure = Figure(figsize=(2.7 * columns + 0.6, 2.3 * rows + 0.5), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False, sharex=True).ravel()
    for axes in panels[len(rocks) :]:
        axes.set_visible(False)
    for axes, rock in zip(panels, rocks.tolist(), strict=False):
        _boundary(axes, dataset.isel(rock=rock))
        name = names[rock] if len(names[rock]) < 32 else names[rock][:30] + "…"
        axes.set_title(name, parse_math=False)
        axes.legend(loc="upper right")  # each rock has directions of its own
    figure.supxlabel("PGV/PGA [s]", fontsize=9)
    figure.supylabel("first-overturning PGA [g]", fontsize=9)
    return figure


def _boundary(axes: Axes, rock: xr.Dataset) -> None:
    ratio = rock["pgv_pga"].values
    for side, colour in enumerate(SERIES[:2]):
        one = rock.isel(side=side)
        low, high = (one[f"first_overturning_{end}"].values for end in ("low", "high"))
        axes.fill_between(ratio, low, high, color=colour, alpha=0.18, linewidth=0)
        axes.plot(ratio, low, color=colour, linewidth=0.5)
        azimuth = float(one["push_direction"])
        line = one["first_overturning_pga"].values
        axes.plot(ratio, line, color=colour, marker=".", label=f"pushed to {azimuth:.0f}°")
    axes.axhline(float(rock["static_pga"]), color=FAINT, linestyle=":", linewidth=1.0)
    axes.set_xscale("log")
    axes.set_xticks([0.05, 0.1, 0.2, 0.4, 0.8], ["0.05", "0.1", "0.2", "0.4", "0.8"])
    axes.minorticks_off()
    axes.set_ylim(bottom=0.0)
    axes.grid()


@styled
def spread(dataset: xr.Dataset) -> Figure:
    """Half-width of the 95 % band by where it comes from, median over rocks and directions."""
    figure = Figure(figsize=(6.4, 2.8), layout="constrained")
    axes = figure.subplots()
    ratio = dataset["pgv_pga"].values
    if dataset.sizes["rock"]:
        parts = {"equations": dataset["equation_error"]}
        for name in dataset["assumption"].values.tolist():
            parts[name] = ODDS * dataset["unseen_log_sd"].sel(assumption=name)
        for (name, part), colour in zip(parts.items(), (INK, *SERIES), strict=False):
            middle = 100.0 * part.median(("rock", "side")).values
            if middle.any():
                axes.plot(ratio, middle, color=colour, marker=".", label=WORDS[name])
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    axes.set_xscale("log")
    axes.set_xticks([0.05, 0.1, 0.2, 0.4, 0.8], ["0.05", "0.1", "0.2", "0.4", "0.8"])
    axes.minorticks_off()
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("PGV/PGA [s]")
    axes.set_ylabel("half-width of the band [%]")
    axes.grid()
    return figure
