"""How the way of the overturned rock goes with the shaking (Figs 16 and 17 of Chen et al. 2024)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from pipeline.drawing import style
from pipeline.stages.datasets.displaced_runs import overturned_runs, toppled
from pipeline.stages.displacement.trajectory_maps import WIDTH, named
from pipeline.workflow.datasets import label
from vsr_core.displacement.correlation import STATISTICS, Correlation, correlations

NAMES = {
    "pga": "PGA [g]",
    "pgv_pga": "PGV/PGA [s]",
    **{name: label(name).replace("m s-1", "m/s") for name in STATISTICS},
}
"""Labels short enough for small panels."""

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@style.styled
def trajectory_lengths(displacement: xr.Dataset, source: str) -> Figure:
    """Length of each path against PGA and PGV/PGA, the third of the three as colour.

    Parameters
    ----------
    displacement : Dataset
        As in ``displacement.nc``; runs that did not topple are grey in the first panel.
    source : str
        What the terrain is.
    """
    runs = overturned_runs(displacement)
    figure = Figure(figsize=(WIDTH, 3.4))
    panels = figure.subplots(
        1, 3, gridspec_kw={"left": 0.06, "right": 0.97, "bottom": 0.15, "top": 0.91, "wspace": 0.34}
    )
    standing = ~toppled(displacement)
    panels[0].plot(
        displacement["pga"].values[standing],
        displacement["pgv_pga"].values[standing],
        ".",
        ms=1.6,
        color="#bdbdbd",
        label="did not topple",
        rasterized=True,
        gid="standing",
    )
    for axes, (right, up, colour) in zip(
        panels,
        (
            ("pga", "pgv_pga", "trajectory_length"),
            ("pga", "trajectory_length", "pgv_pga"),
            ("pgv_pga", "trajectory_length", "pga"),
        ),
        strict=True,
    ):
        dots = axes.scatter(
            getattr(runs, right),
            getattr(runs, up),
            c=getattr(runs, colour),
            s=9,
            cmap="viridis",
            linewidths=0,
            rasterized=True,
            gid="runs",
        )
        axes.set_xlabel(NAMES[right])
        axes.set_ylabel(NAMES[up])
        if len(runs.pga):
            bar = figure.colorbar(dots, ax=axes, location="top", pad=0.03, aspect=35)
            bar.set_label(NAMES[colour])
        else:
            axes.text(0.5, 0.5, "no run toppled", transform=axes.transAxes, ha="center")
        if up == "trajectory_length":
            _from_zero(axes)
    if standing.any():
        panels[0].legend(
            loc="lower left",
            handletextpad=0.1,
            markerscale=3,
            frameon=True,
            framealpha=1.0,
            edgecolor="none",
        )
    named(figure, source)
    return figure


@style.styled
def ensemble_means(displacement: xr.Dataset, source: str) -> Figure:
    """Means of ensembles against PGA and PGV/PGA, with the line through them and its band."""
    found = correlations(overturned_runs(displacement))
    figure = Figure(figsize=(7.4, 8.4))
    panels = figure.subplots(
        3,
        2,
        sharex="col",
        sharey="row",
        gridspec_kw={
            "left": 0.09, "right": 0.985, "bottom": 0.095, "top": 0.965, "hspace": 0.08,
            "wspace": 0.05,
        },
    )  # fmt: skip
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
    """Write a small probability with a power of ten in raised digits."""
    if not 0.0 < p < 1e-3:
        return f"{p:.2g}"
    mantissa, exponent = f"{p:.1e}".split("e")
    return f"{mantissa}\N{MULTIPLICATION SIGN}10{str(int(exponent)).translate(_RAISED)}"


def _means(axes: Axes, found: Correlation) -> None:
    groups, line = found.ensembles, found.line
    several = groups.n > 1
    bars: Any = {"fmt": "none", "ecolor": "#9db7d3", "elinewidth": 0.9, "zorder": 1}
    axes.errorbar(
        groups.value[several],
        groups.mean[several],
        groups.deviation[several],
        label="standard deviation of the runs",
        **bars,
    )
    dots: Any = {"ls": "none", "marker": "o", "ms": 4.2, "mec": style.UPRIGHT, "zorder": 3}
    axes.plot(
        groups.value[several],
        groups.mean[several],
        color=style.UPRIGHT,
        label="mean of an ensemble",
        gid="means",
        **dots,
    )
    axes.plot(groups.value[~several], groups.mean[~several], mfc="white", gid="single", **dots)
    if not found.reason:
        at = np.linspace(groups.value[0], groups.value[-1], 100)
        axes.plot(
            at, line.mean(at), "-.", color=style.OVERTURNED, lw=1.4, label="line", gid="line",
            zorder=4,
        )  # fmt: skip
        axes.fill_between(
            at,
            *line.band(at),
            color=style.OVERTURNED,
            alpha=0.18,
            lw=0,
            label="its 95 % confidence band",
            gid="band",
            zorder=2,
        )
        text = f"R² = {line.r2:.2f}\np = {power(line.p)}\n{line.n_groups} ensembles"
    else:
        text = f"no line: {found.reason}"
    falls = math.isfinite(line.slope) and line.slope < 0.0
    axes.text(
        0.97 if falls else 0.03,
        0.97,
        text,
        transform=axes.transAxes,
        va="top",
        ha="right" if falls else "left",
        linespacing=1.45,
        path_effects=[withStroke(linewidth=2.5, foreground="white")],
        zorder=5,
        gid="numbers",
    )


def _from_zero(axes: Axes) -> None:
    """Lengths and speeds are read against nothing; room above for text."""
    axes.set_ylim(bottom=0.0, top=1.1 * axes.get_ylim()[1])
