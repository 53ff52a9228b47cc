"""Figures of a sweep: small multiples, the boundary over a key, and all boundaries at once."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from pipeline.config.sweep import Dimension
from pipeline.drawing import style
from pipeline.stages.studies.sweeps.changes import (
    BOUNDARY,
    LOWER,
    UPPER,
    axis_label,
    places,
    typical,
)
from pipeline.workflow.datasets import label
from vsr_core.arrays import Array, Indices, Mask

MOST_PANELS, ACROSS = 12, 4
"""Panels of small multiples, and how many stand side by side."""

MOST_ROWS, MOST_CURVES = 5, 12
"""PGV/PGA, and places along a dimension, that are drawn as curves."""

_SHARES = LinearSegmentedColormap.from_list("shares", ["#dfe9f5", "#f6f2ee", style.OVERTURNED])


def shown(count: int, most: int) -> Indices:
    """Places to draw where there are too many, both ends included.

    >>> shown(9, 3).tolist(), shown(2, 3).tolist()
    ([0, 4, 8], [0, 1])
    """
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.int64))


@style.styled
def multiples(data: xr.Dataset, dimension: Dimension) -> Figure:
    """Share of runs that topple in each cell, one panel for each place along a dimension."""
    picked, names = shown(len(dimension.labels), MOST_PANELS), places(dimension)
    across = min(ACROSS, len(picked))
    down = -(-len(picked) // across)
    figure = Figure(figsize=(2.1 * across + 0.7, 2.15 * down + 0.5), layout="constrained")
    panels = figure.subplots(down, across, sharex=True, sharey=True, squeeze=False)
    reference = data.isel({dimension.name: dimension.reference})
    for axes, place in zip(panels.flat, picked, strict=False):
        one = data.isel({dimension.name: place})
        cells = _cells(axes, one)
        for member, line in ((reference, ":"), (one, "-")):
            curve, ran = _curve(member), _ran(member)
            axes.plot(curve[ran], data["pgv_pga"].values[ran], color=style.INK, lw=1.2, ls=line)
        mark = " (reference)" if place == dimension.reference else ""
        axes.set_title(f"{names[place]}{mark}", fontsize=8.5)
    for axes in panels.flat[len(picked) :]:
        axes.set_visible(False)
    figure.supxlabel(label("pga"), fontsize=9.0)
    figure.supylabel("PGV/PGA [s]", fontsize=9.0)
    bar = figure.colorbar(cells, ax=panels, shrink=0.8 if down == 1 else 0.5, aspect=25)
    bar.set_label("share of runs that topple")
    return figure


@style.styled
def over_key(data: xr.Dataset, dimension: Dimension) -> Figure:
    """The boundary against what is swept, at some PGV/PGA."""
    figure = Figure(figsize=(6.2, 4.2), layout="constrained")
    axes = figure.add_subplot()
    positions = _positions(axes, dimension)
    curves = _typical(_completed(data, dimension.name), dimension.name)
    rows = np.flatnonzero(np.isfinite(curves[BOUNDARY].values).sum(axis=0) > 1)
    picked = rows[shown(len(rows), MOST_ROWS)] if len(rows) else rows
    for number, row in enumerate(picked):
        one = curves.isel(pgv_pga=row)
        middle = one[BOUNDARY].values
        ends = [np.abs(middle - one[end].values) for end in (LOWER, UPPER)]
        axes.errorbar(
            positions,
            middle,
            yerr=np.array(ends),
            lw=1.2,
            ms=4.0 if len(positions) < 20 else 2.0,
            elinewidth=0.8,
            label=f"{one['pgv_pga'].item():.3g} s",
            color=style.SERIES[number],
            marker=style.MARKERS[number],
        )
    axes.set_ylabel(f"boundary: {label('pga')}")
    axes.grid(visible=True)
    if len(picked):
        figure.legend(loc="outside lower center", ncols=MOST_ROWS, title="PGV/PGA")
    return figure


@style.styled
def boundaries(data: xr.Dataset, dimension: Dimension, own: xr.Dataset | None) -> Figure:
    """Boundaries of all places; beside them in the rock's own units, where the rock changes."""
    figure = Figure(figsize=(6.0 if own is None else 8.6, 4.4), layout="constrained")
    panels = figure.subplots(1, 1 if own is None else 2, squeeze=False)[0]
    curves = _typical(data, dimension.name)[BOUNDARY].values
    ratio = data["pgv_pga"].values
    picked, names = shown(len(dimension.labels), MOST_CURVES), places(dimension)
    colours = _colours(dimension, picked)
    for place, colour in zip(picked, colours, strict=True):
        ran = _ran(data.isel({dimension.name: place}))
        line = {
            "color": colour,
            "lw": 2.0 if place == dimension.reference else 1.2,
            "marker": style.MARKERS[place % len(style.MARKERS)],
            "ms": 3.5,
        }
        panels[0].plot(curves[place][ran], ratio[ran], label=names[place], **line)
        if own is not None:
            scaled = _typical(own, dimension.name)[BOUNDARY].values[place]
            time = own["time"].values[place]
            panels[1].plot(scaled[ran], ratio[ran] / time, **line)
    panels[0].set(xlabel=f"boundary: {label('pga')}", ylabel="PGV/PGA [s]")
    if own is not None:
        panels[1].set(
            xlabel="boundary / static toppling acceleration", ylabel=r"PGV/PGA / $\sqrt{R/g}$"
        )
    for axes in panels:
        if not np.isfinite(curves).any():  # for which there is no scale
            axes.text(0.5, 0.5, "no boundary", transform=axes.transAxes, ha="center")
            continue
        axes.set(yscale="log", xscale="log")
        for scale in (axes.xaxis, axes.yaxis):
            scale.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0, 7.0)))
            scale.set_major_formatter("{x:g}")
            scale.set_minor_locator(NullLocator())
        axes.grid(visible=True)
    figure.legend(loc="outside lower center", ncols=4, title=dimension.name)
    return figure


def _ran(one: xr.Dataset) -> Mask:
    """Rows of PGV/PGA that a member was run on; in these a line has a gap where nothing topples."""
    others = [dim for dim in one["outcome"].dims if dim != "pgv_pga"]
    ran: Mask = (one["outcome"] >= 0).any(others).values
    return ran


def _cells(axes: Axes, one: xr.Dataset) -> QuadMesh:
    """Share of decided runs that topple, over directions and frictions."""
    overturned = one["overturned"]
    others = [dim for dim in overturned.dims if dim not in ("pga", "pgv_pga")]
    share = (overturned == 1).sum(others) / (overturned >= 0).sum(others)
    share = share.transpose("pgv_pga", "pga").dropna("pgv_pga", how="all")
    pga, ratio = one["pga"].values, share["pgv_pga"].values
    return axes.pcolormesh(
        style.cell_edges(pga), style.cell_edges(ratio), share.values, cmap=_SHARES, vmin=0, vmax=1
    )


def _curve(one: xr.Dataset) -> Array:
    """Boundary at each PGV/PGA, the median of all else [g]; nan where none was found."""
    values: Array = typical(one[[BOUNDARY]], ("pgv_pga",))[BOUNDARY].values
    return np.where(np.isfinite(values), values, np.nan)


def _typical(data: xr.Dataset, name: str) -> xr.Dataset:
    """Boundaries and their ends on (dimension, PGV/PGA), medians of all else."""
    curves = data[[one for one in (BOUNDARY, LOWER, UPPER) if one in data]]
    found = typical(curves, (name, "pgv_pga"))
    return found.where(np.isfinite(found[BOUNDARY])).transpose(name, "pgv_pga")


def _completed(data: xr.Dataset, name: str) -> xr.Dataset:
    """All places on the rows of the one with the fewest, interpolated where they have others."""
    ran = (data["outcome"] >= 0).any(
        [d for d in data["outcome"].dims if d not in (name, "pgv_pga")]
    )
    if bool(ran.all()):
        return data
    rows = ran.isel({name: int(np.argmin(ran.sum("pgv_pga").values))}).values
    places = [_filled(data.isel({name: n})) for n in range(data.sizes[name])]
    return xr.concat(places, name, data_vars="all").isel(pgv_pga=rows)


def _filled(data: xr.Dataset) -> xr.Dataset:
    """Boundaries also on rows that were not run, straight between neighbours in the logarithms.

    Motions of another kind may have a PGV/PGA between those of a grid; between two records there is
    no third.
    """
    if "record" in data and bool((data["record"] != "").any()):
        return data
    ran = (data["outcome"] >= 0).any([dim for dim in data["outcome"].dims if dim != "pgv_pga"])
    if "pgv_pga" not in data.dims or bool(ran.all()):
        return data
    ratio, ran_there = np.log(data["pgv_pga"].values), ran.values

    def between(values: Array) -> Array:
        with np.errstate(divide="ignore", invalid="ignore"):
            found = np.exp(
                np.interp(
                    ratio, ratio[ran_there], np.log(values[ran_there]), left=np.nan, right=np.nan
                )
            )
        return np.where(ran_there, values, found)

    dims = ["pgv_pga"]
    return data.assign(
        {
            name: xr.apply_ufunc(
                between, data[name], input_core_dims=[dims], output_core_dims=[dims], vectorize=True
            )
            for name in (BOUNDARY, LOWER, UPPER)
        }
    )


def _positions(axes: Axes, dimension: Dimension) -> Array:
    """Where the places of a dimension stand on an axis, which is labelled and holds them all."""
    axes.set_xlabel(axis_label(dimension))
    if dimension.is_numeric:
        at = np.array(dimension.values[dimension.key], dtype=np.float64)
        margin = 0.05 * np.ptp(at) or 0.5
        axes.set_xlim(at.min() - margin, at.max() + margin)
        return at
    at = np.arange(len(dimension.labels), dtype=np.float64)
    turned = max(map(len, dimension.labels)) > 8
    axes.set_xticks(at, dimension.labels, rotation=20 if turned else 0)
    axes.set_xlim(-0.5, len(at) - 0.5)
    return at


def _colours(dimension: Dimension, picked: Indices) -> list[object]:
    """A scale for numbers, and colours that are told apart for anything else."""
    if dimension.is_numeric and len(picked) > len(style.SERIES):
        return [colormaps["viridis"](share) for share in np.linspace(0.0, 0.9, len(picked))]
    return [style.SERIES[n % len(style.SERIES)] for n in range(len(picked))]
