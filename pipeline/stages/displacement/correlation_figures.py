"""How the trajectory of the overturned rock depends on the shaking (Figs 16 and 17 of the paper).

The paper is Chen et al. (2024).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.drawing import style
from pipeline.stages.datasets.displaced_runs import left_seat, overturned_runs
from pipeline.stages.displacement.trajectory_maps import WIDTH, named
from pipeline.workflow.datasets import label
from vsr_core.displacement.correlation import STATISTICS, Correlation, correlations

NAMES = {
    "pga": "PGA [g]",
    "pgv_pga": "PGV/PGA [s]",
    **{name: label(name).replace("m s-1", "m/s") for name in STATISTICS},
}
"""Labels short enough for small panels."""

TABLE_1 = {
    ("trajectory_length", "pga"): (0.90, 2.3e-11),
    ("trajectory_length", "pgv_pga"): (0.92, 3.2e-22),
    ("largest_speed", "pga"): (0.82, 5.5e-9),
    ("largest_speed", "pgv_pga"): (0.78, 1.0e-13),
    ("terminal_distance", "pga"): (0.73, 3.5e-7),
    ("terminal_distance", "pgv_pga"): (0.87, 3.9e-18),
}
"""R2 and p of the ensembles' means, as Chen et al. (2024) give them in Table 1."""

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@style.styled
def trajectory_lengths(displacement: xr.Dataset, source: str) -> Figure:
    """Length of each trajectory, PGA and PGV/PGA: two as axes, the third as colour.

    Parameters
    ----------
    displacement : Dataset
        As in ``displacement.nc``; runs that stayed on the seat are grey in the first panel.
    """
    runs, standing = overturned_runs(displacement), displacement.isel(run=~left_seat(displacement))
    figure = Figure(figsize=(WIDTH, 3.4))
    margins = {"left": 0.06, "right": 0.97, "bottom": 0.15, "top": 0.91, "wspace": 0.34}
    panels = figure.subplots(1, 3, gridspec_kw=margins)
    grey: Any = {"ms": 1.6, "color": "#bdbdbd", "rasterized": True, "gid": "standing"}
    panels[0].plot(standing["pga"], standing["pgv_pga"], ".", label="stayed on the seat", **grey)
    length = "trajectory_length"
    axes_and_colour = (("pga", "pgv_pga", length), ("pga", length, "pgv_pga"),
                       ("pgv_pga", length, "pga"))  # fmt: skip
    for axes, (right, up, colour) in zip(panels, axes_and_colour, strict=True):
        look: Any = {"s": 9, "cmap": "viridis", "linewidths": 0, "rasterized": True, "gid": "runs"}
        dots = axes.scatter(runs[right], runs[up], c=runs[colour], **look)
        axes.set(xlabel=NAMES[right], ylabel=NAMES[up])
        if len(runs):
            bar = figure.colorbar(dots, ax=axes, location="top", pad=0.03, aspect=35)
            bar.set_label(NAMES[colour])
        else:
            axes.text(0.5, 0.5, "no run left the seat", transform=axes.transAxes, ha="center")
        if up == length:
            _from_zero(axes)
    if standing.sizes["run"]:
        frame: Any = {"frameon": True, "framealpha": 1.0, "edgecolor": "none"}
        panels[0].legend(loc="lower left", handletextpad=0.1, markerscale=3, **frame)
    named(figure, source)
    return figure


@style.styled
def ensemble_means(displacement: xr.Dataset, source: str) -> Figure:
    """Means of ensembles against PGA and PGV/PGA, with the line through them and its band."""
    found = correlations(overturned_runs(displacement))
    figure = Figure(figsize=(7.4, 8.4))
    margins = {"left": 0.09, "right": 0.985, "bottom": 0.095, "top": 0.965,
               "hspace": 0.08, "wspace": 0.05}  # fmt: skip
    panels = figure.subplots(3, 2, sharex="col", sharey="row", gridspec_kw=margins)
    for axes, one in zip(panels.ravel(), found, strict=True):
        _means(axes, one)
        if axes in panels[-1]:
            axes.set_xlabel(NAMES[one.regressor])
        if axes in panels[:, 0]:
            axes.set_ylabel("mean " + NAMES[one.statistic])
    for axes in panels[:, 0]:
        _from_zero(axes)
    style.legend_below(figure, panels[0, 0], 4, top=0.045)
    named(figure, source)
    return figure


def power(p: float) -> str:
    """Write a small probability with a power of ten in raised digits.

    Examples
    --------
    >>> power(0.0431), power(2.34e-9)
    ('0.043', '2.3×10⁻⁹')
    """
    if not 0.0 < p < 1e-3:
        return f"{p:.2g}"
    mantissa, exponent = f"{p:.1e}".split("e")
    return f"{mantissa}\N{MULTIPLICATION SIGN}10{str(int(exponent)).translate(_RAISED)}"


def _means(axes: Axes, found: Correlation) -> None:
    several, single = (found.ensembles[found.ensembles["n"] > 1],
                       found.ensembles[found.ensembles["n"] == 1])  # fmt: skip
    bars: Any = {"fmt": "none", "ecolor": "#9db7d3", "elinewidth": 0.9, "zorder": 1}
    axes.errorbar(several.index, several["mean"], several["deviation"],
                  label="standard deviation of the runs", **bars)  # fmt: skip
    dots: Any = {"color": style.UPRIGHT, "ls": "none", "marker": "o", "ms": 4.2, "zorder": 3}
    axes.plot(several.index, several["mean"], label="mean of an ensemble", gid="means", **dots)
    axes.plot(single.index, single["mean"], mfc="white", gid="single", **dots)
    text = f"no line: {found.reason}" if found.reason else _line(axes, found)
    at, side = (0.97, "right") if found.line.slope < 0.0 else (0.03, "left")
    corner: Any = {"transform": axes.transAxes, "va": "top", "ha": side, "linespacing": 1.45}
    axes.text(at, 0.97, text, **corner, path_effects=style.HALO, zorder=5, gid="numbers")


def _line(axes: Axes, found: Correlation) -> str:
    """Draw the line and its band; the text beside them."""
    line, value = found.line, found.ensembles.index
    at = np.linspace(value[0], value[-1], 100)
    red: Any = {"color": style.OVERTURNED}
    axes.plot(at, line.mean(at), "-.", lw=1.4, label="line", gid="line", zorder=4, **red)
    axes.fill_between(at, *line.band(at), alpha=0.18, lw=0, label="its 95 % confidence band",
                      gid="band", zorder=2, **red)  # fmt: skip
    return f"R² = {line.r2:.2f}\np = {power(line.p)}\n{line.n_groups} ensembles"


def _from_zero(axes: Axes) -> None:
    """Lengths and speeds start at zero; there is room above for text."""
    axes.set_ylim(bottom=0.0, top=1.1 * axes.get_ylim()[1])
