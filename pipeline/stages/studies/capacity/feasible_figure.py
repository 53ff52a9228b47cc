"""What a shake table can do of a grid of motions, and where the rock topples in it."""

from __future__ import annotations

from typing import Any

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from pipeline.drawing import style
from pipeline.workflow.datasets import label
from vsr_core.fragility.boundary import locate

_LINES = (
    ("acceleration_pga", "acceleration", "solid"),
    ("velocity_pga", "velocity", (0, (5, 2))),
    ("stroke_pga", "stroke", (0, (1, 1.5))),
)
"""Limits of motion: their variable, name and dashes."""

CAN, CANNOT, FAINTER = "#dcebdd", "#f2f2f2", "#b9b9b9"


@style.styled
def feasible_grid(feasible: xr.Dataset, responses: xr.Dataset | None) -> Figure:
    """Draw the motions that a table can do, its limits, and the rock's boundary.

    Parameters
    ----------
    responses : Dataset or None
        As in ``responses.nc``; its first friction is drawn.
    """
    figure = Figure(figsize=(5.6, 5.2))
    axes = figure.add_axes((0.11, 0.24, 0.86, 0.69))
    _cells(axes, feasible)
    _limits(axes, feasible)
    if responses is not None:
        _boundary(axes, responses)
    axes.set_xlim(0.0, feasible["pga"].values[-1] * 1.02)
    axes.set_ylim(0.0, feasible["pgv_pga"].values[-1] * 1.02)
    axes.set_xlabel(label("pga"))
    axes.set_ylabel("PGV/PGA [s]")
    axes.set_title(_title(feasible))
    style.legend_below(figure, axes, 2, top=0.15)
    return figure


def _title(feasible: xr.Dataset) -> str:
    share = float(feasible["feasible"].values.mean())
    mass = f"rock of {feasible.attrs['mass_kg']:.4g} kg"
    return f"{feasible.attrs['table']}: {share:.0%} of the motions, {mass}"


def _cells(axes: Axes, feasible: xr.Dataset) -> None:
    pga, ratio = (
        style.cell_edges(feasible["pga"].values),
        style.cell_edges(feasible["pgv_pga"].values),
    )
    can = feasible["feasible"].values
    for gid, kind, colour, hatch in (("can", 1, CAN, ""), ("outside", 0, CANNOT, "////")):
        with mpl.rc_context({"hatch.linewidth": 0.5, "hatch.color": FAINTER}):
            axes.pcolor(
                pga,
                ratio,
                np.ma.masked_not_equal(can, kind),
                cmap=ListedColormap([colour]),
                hatch=hatch,
                linewidth=0.0,
                gid=gid,
            )
    axes.fill([], [], facecolor=CAN, edgecolor="#8fb392", label="the table can do it")
    beyond: dict[str, Any] = {"facecolor": CANNOT, "edgecolor": FAINTER, "hatch": "////"}
    axes.fill([], [], label="beyond its limits", **beyond)


def _limits(axes: Axes, feasible: xr.Dataset) -> None:
    pga, ratio = feasible["pga"].values, feasible["pgv_pga"].values
    dense = np.linspace(ratio[0], ratio[-1], 400)
    for name, text, dashes in _LINES:
        values = feasible[name].values
        # 1 / PGA goes as a power of the ratio, so it is drawn between the rows as on them
        end = np.exp(np.interp(np.log(dense), np.log(ratio), np.log(values)))
        if np.isfinite(end).any() and (end < pga[-1]).any():
            axes.plot(end, dense, color=style.INK, ls=dashes, lw=1.3, label=f"{text} limit")


def _boundary(axes: Axes, responses: xr.Dataset) -> None:
    """First overturning of each direction."""
    runs = responses.isel(friction=0)
    for number, yaw in enumerate(runs["yaw"].values):
        first = locate(runs["pga"].values, runs["overturned"].values[number]).pga
        text = "first overturning of the rock" + (", each yaw" if runs.sizes["yaw"] > 1 else "")
        axes.plot(
            np.where(np.isfinite(first), first, np.nan),
            runs["pgv_pga"].values,
            ".-",
            color=style.OVERTURNED,
            lw=1.0,
            ms=3.0,
            alpha=0.85 if runs.sizes["yaw"] == 1 else 0.5,
            label=text if number == 0 else None,
            gid=f"boundary-{yaw:g}",
        )
