"""The page of the uncertainty: its sentences, tables and figures."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from pipeline.config.priors_schema import UncertaintyConfig
from pipeline.drawing import style
from pipeline.stages.fragility.fragility_figures import heights, name_rows
from pipeline.stages.fragility.summary import SEARCHED
from pipeline.stages.mesh.products import RockData
from pipeline.stages.uncertainty import unknowns
from pipeline.stages.uncertainty.draw_step import DrawStep
from pipeline.stages.uncertainty.draws import Observed
from pipeline.stages.uncertainty.ensemble import CHECKED, REACH, followed_share
from pipeline.workflow.datasets import label, open_below, rows_of
from pipeline.workflow.grammar import listed
from vsr_core.arrays import Array
from vsr_core.outcome import FoundBy
from vsr_core.uncertainty import step_error
from vsr_core.uncertainty.probability import chance
from vsr_core.uncertainty.sensitivity import FEWEST, SUPPORTED


def facts(
    site: str,
    rock: RockData,
    config: UncertaintyConfig,
    found: xr.Dataset,
    boundary: xr.Dataset,
    observed: Observed | None,
    step: DrawStep,
    drawn: dict[str, str],
) -> dict[str, Any]:
    """Values for the template."""
    origin = rock.data.attrs
    by = (
        np.bincount(found["found_by"].values.ravel(), minlength=len(FoundBy))
        / found["found_by"].size
    )
    return {
        "site": site,
        "source": origin["shape_source"],
        "box": origin["shape_source"] == "box",
        "surrogate": bool(origin["surrogate"]),
        "members": found.sizes["member"],
        "cells": found["probability"].size,
        "directions": directions(found),
        "asked": float(found["boundary_resolution"]),
        "reached": _width(found),
        "error": float(found["boundary_error"]),
        "time_step": float(found["time_step"]),
        "step_levels": int(found["step_levels"]),
        "few": min(step_error.FEW, found.sizes["member"]),
        "tried": tried(found),
        "chosen": math.isfinite(step.tolerance),
        "tolerance": step.tolerance,
        "within": step.within,
        "searched": [found.attrs[name] for name in SEARCHED],
        "never": standing_aside(found["member_boundary"].values),
        "runs": int(found["member_runs"].sum()),
        "each": float(found["member_runs"].mean()),
        "middle_ratio": float(found[_ratios(found)][_middle(found)]),
        "widest": widest(found),
        "ranked": ranked(found),
        "leaders": leaders(ranked(found)),
        "explained": float(found["explained_share_joined"]),
        "unsupported": yaws(found, found["explained_share"] < SUPPORTED),
        "untried": yaws(found, found["explained_share"].isnull()),
        "supported": SUPPORTED,
        "fewest": FEWEST,
        "none_topples": float(chance(np.zeros((found.sizes["member"], 1), np.int8)).high[0]),
        "simulated": by[FoundBy.SIMULATED],
        "proved": by[FoundBy.PROVED],
        "inferred": by[FoundBy.INFERRED],
        "checked": CHECKED,
        "followed": followed_share(found["member_boundary"].size),
        "scanned": 1.0 - math.exp(-REACH),
        "seats": by_seat(found, boundary),
        "observed": observed,
        "observations": observed.data["observation"].values.tolist() if observed else [],
        "tests": tests(found),
        "undecided": int(found["member_unresolved"].sum()),
        "records": rows_of(found) == "record",
        "assumed": unknowns.assumed(
            config, box=origin["shape_source"] == "box", terrain="drawn_seat" in found
        ),
        "pictures": drawn,
    }


def yaws(found: xr.Dataset, chosen: xr.DataArray) -> list[str]:
    """Some of the directions, in words."""
    return [f"{yaw:g}" for yaw in found["yaw"].values[chosen.values]]


def tried(found: xr.Dataset) -> list[dict[str, Any]]:
    """What each time step tried does to the boundaries of draws; nothing where none was found."""
    names = ("step", "shift", "shift_sd", "error", "islands")
    rows = zip(*(found[f"tried_{name}"].values.tolist() for name in names), strict=True)
    return [dict(zip(names, row, strict=True)) for row in rows if not math.isnan(row[1])]


def directions(found: xr.Dataset) -> list[dict[str, float]]:
    """The boundary of each direction in the middle row, and how wide it is in the median row."""
    rows = []
    for at in range(found.sizes["yaw"]):
        one = found.isel(yaw=at)
        ends = [one[f"boundary_{name}"].values for name in ("low", "median", "high")]
        known = (ends[0] > 0.0) & np.isfinite(ends[2])
        spread = np.log(ends[2][known] / ends[0][known])
        half = _middle(found)
        rows.append(
            {
                "yaw": float(one["yaw"]),
                "low": float(ends[0][half]),
                "median": float(ends[1][half]),
                "high": float(ends[2][half]),
                "ratio": float(np.exp(np.median(spread))) if known.any() else np.nan,
                "explained": float(one["explained_share"]),
            }
        )
    return rows


def _middle(found: xr.Dataset) -> int:
    return found.sizes[rows_of(found)] // 2


def _ratios(found: xr.Dataset) -> str:
    return "record_pgv_pga" if rows_of(found) == "record" else "pgv_pga"


def by_seat(found: xr.Dataset, boundary: xr.Dataset) -> list[dict[str, Any]]:
    """The boundary of the draws of each kind of seat; nothing of a flat pedestal.

    Parameters
    ----------
    boundary : xr.Dataset, of the site as it is
    """
    if "drawn_seat" not in found:
        return []
    drawn = found["drawn_seat"].values
    kinds = {key: drawn == key for key in ("rim", "whole")}
    kinds["points"] = ~(kinds["rim"] | kinds["whole"])
    edges = open_below(found, "member_boundary").values
    own = boundary["first_overturning_pga"].values
    ratio = edges / np.where(np.isfinite(own), own, np.nan)  # else it would be none of all
    rows = []
    for key, name in unknowns.KINDS.items():
        members = kinds[key]
        known = ratio[members][np.isfinite(ratio[members]) & (ratio[members] > 0.0)]
        rows.append(
            {
                "kind": name,
                "members": int(members.sum()),
                "boundary": _median(edges[members][:, :, _middle(found)]),
                "ratio": _median(known),
            }
        )
    return rows


def _width(found: xr.Dataset) -> float:
    """Relative width of the draws' brackets, in the median."""
    ratio = (found["member_boundary_upper"] / found["member_boundary_lower"]).values
    return _median(ratio[np.isfinite(ratio)] - 1.0)


def _median(values: np.ndarray) -> float:
    return float(np.median(values)) if values.size else math.nan


def standing_aside(boundary: Array) -> int:
    """Most draws that topple nowhere in a direction and at a PGV/PGA at which most others do.

    Parameters
    ----------
    boundary : ndarray, shape (draws, yaws, rows), infinite where a draw does not topple

    Examples
    --------
    >>> standing_aside(np.array([[[np.inf, np.inf]], [[0.4, np.inf]], [[0.5, np.inf]]]))
    1
    """
    stand = np.isinf(boundary).sum(axis=0)
    return int(np.max(stand, where=2 * stand < len(boundary), initial=0))


def widest(found: xr.Dataset) -> dict[str, float]:
    """The directions with the widest and the narrowest band; empty where none has one."""
    rows = [row for row in directions(found) if np.isfinite(row["ratio"])]
    if not rows:
        return {}
    by_width = sorted(rows, key=lambda row: row["ratio"])
    return {
        "narrow": by_width[0]["ratio"],
        "narrow_yaw": by_width[0]["yaw"],
        "wide": by_width[-1]["ratio"],
        "wide_yaw": by_width[-1]["yaw"],
        "median": float(np.median([row["ratio"] for row in rows])),
        "partial": not (
            (found["boundary_low"].values > 0.0) & np.isfinite(found["boundary_high"].values)
        ).all(),
    }


def ranked(found: xr.Dataset) -> list[dict[str, Any]]:
    """Unknowns by their total index, largest first; none where no index is supported."""
    total = found["total_index_joined"].values
    if not np.isfinite(total).all():
        return []
    rows = []
    for at in np.argsort(-total, kind="stable"):
        one = found.isel(unknown=int(at))
        rows.append(
            {
                "name": str(one["unknown"].item()),
                "first": float(one["first_index_joined"]),
                "first_ends": one["first_index_joined_interval"].values.tolist(),
                "total": float(one["total_index_joined"]),
                "total_ends": one["total_index_joined_interval"].values.tolist(),
            }
        )
    return rows


def leaders(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The unknowns of which none is shown to matter more than another: their intervals meet."""
    return [row for row in rows if row["total_ends"][1] >= rows[0]["total_ends"][0]]


def tests(found: xr.Dataset) -> list[dict[str, Any]]:
    """Inferred cells that were simulated as a check, by kind of PGV/PGA level."""
    rows = []
    for at, name in enumerate(found["level_kind"].values.tolist()):
        tested = int(found["inferred_tested"][at])
        key = f"inferred_wrong_{name.replace('-', '_')}_levels_interval"
        ends = found.attrs.get(key, [np.nan, np.nan])
        rows.append(
            {
                "kind": name,
                "rows": int((found["non_monotonic"] == at).sum()),
                "tested": tested,
                "wrong": int(found["inferred_wrong"][at]),
                "share": int(found["inferred_wrong"][at]) / tested if tested else np.nan,
                "ends": list(ends),
                "followed": int(found["levels_followed"][at]),
                "not_first": int(found["levels_not_first"][at]),
                "too_high": 100 * float(found["levels_too_high"][at]),
            }
        )
    return rows


def summary(found: xr.Dataset) -> str:
    """One line for the log."""
    width, order = widest(found), ranked(found)
    text = f"{found.sizes['member']} draws; " + (
        f"the 5 to 95 % interval of the boundary spans a factor of "
        f"{width['median']:.2f} in the median direction"
        if width
        else "under no motion do 95 % of them topple, but fewer than 5 % at the lowest PGA tried"
    )
    first = listed([row["name"] for row in leaders(order)])
    return text + (f"; largest contribution: {first}" if order else "")


COLUMNS = 4
"""Diagrams side by side."""

LEVELS = (0.05, 0.16, 0.5, 0.84, 0.95)
"""Contours of the surface."""


@style.styled
def bands(found: xr.Dataset, responses: xr.Dataset) -> Figure:
    """The band of the boundary over the site's own response diagram, for each direction."""
    count = found.sizes["yaw"]
    columns = min(COLUMNS, count)
    rows = math.ceil(count / columns)
    figure = Figure(figsize=(2.3 * columns + 0.5, 2.2 * rows + 0.8), layout="constrained")
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    pga, edges = found["pga"].values, style.cell_edges(heights(found))
    colours = ListedColormap([style.UNDECIDED, style.PROVED, "#e9aba6"])
    for number, axes in enumerate(panels.flat):
        if number >= count:
            axes.set_axis_off()
            continue
        own, one = responses.isel(yaw=number), found.isel(yaw=number)
        axes.pcolormesh(
            style.cell_edges(pga),
            edges,
            own["overturned"].values,
            cmap=colours,
            vmin=-1.5,
            vmax=1.5,
        )
        # each row for itself: a band that is open at an end reaches over the axis there
        low, middle, high = (one[f"boundary_{name}"].values for name in ("low", "median", "high"))
        sides = (np.minimum(np.append(side, side[-1]), 2.0 * pga[-1]) for side in (low, high))
        own_row: Any = {"step": "post", "color": style.MODEL, "alpha": 0.65, "lw": 0}
        axes.fill_betweenx(edges, *sides, **own_row, label="5 to 95 % of the draws")
        known = np.where((middle > 0.0) & np.isfinite(middle), middle, np.nan)
        axes.vlines(
            known, edges[:-1], edges[1:], color=style.INK, lw=1.3, label="median of the draws"
        )
        axes.set(xlim=style.cell_edges(pga)[[0, -1]], ylim=edges[[0, -1]])
        axes.set_title(f"yaw {one['yaw'].item():g} deg", fontsize=8.5, pad=3)
    for colour, text in ((style.PROVED, "stands as given"), ("#e9aba6", "topples as given")):
        panels[0, 0].plot([], [], "s", ms=7, color=colour, label=text)
    for axes in panels.flat[max(count - columns, 0) : count]:  # with no other panel below
        axes.tick_params(labelbottom=True)
        axes.set_xlabel("PGA [g]")
    figure.supylabel(name_rows(panels[0, 0], responses), fontsize=9)
    handles = panels[0, 0].get_legend_handles_labels()
    figure.legend(*handles, loc="outside lower center", ncols=min(columns, 2))
    return figure


@style.styled
def shares(found: xr.Dataset) -> Figure:
    """First-order and total indices of each unknown, of all directions together."""
    order = np.argsort(np.nan_to_num(found["total_index_joined"].values))
    names = found["unknown"].values[order]
    figure = Figure(figsize=(6.0, 0.42 * len(names) + 1.3), layout="constrained")
    axes = figure.add_subplot()
    place = np.arange(len(names))
    for shift, name, colour, text in (
        (0.2, "first", style.SERIES[0], "alone (first-order index)"),
        (-0.2, "total", style.SERIES[4], "with all that it takes part in (total index)"),
    ):
        value = found[f"{name}_index_joined"].values[order]
        ends = found[f"{name}_index_joined_interval"].values[order]
        axes.barh(place + shift, value, 0.36, color=colour, label=text)
        axes.hlines(place + shift, *ends.T, color=style.INK, lw=1.0)
    axes.set_yticks(place, names)
    axes.set(xlim=(0.0, 1.0), xlabel="share of the explained variance of the height, 5 to 95 %")
    axes.grid(visible=True, axis="x")
    figure.legend(loc="outside lower center", ncols=1)
    return figure


@style.styled
def surface(found: xr.Dataset) -> Figure:
    """Probability of toppling over PGA and PGV/PGA, averaged over the directions."""
    figure = Figure(figsize=(5.6, 4.4), layout="constrained")
    axes = figure.add_subplot()
    pga, rows, values = found["pga"].values, heights(found), found["surface"].values
    mesh = axes.pcolormesh(
        style.cell_edges(pga), style.cell_edges(rows), values, cmap="RdYlBu_r", vmin=0, vmax=1
    )
    if min(values.shape) > 1 and rows_of(found) == "pgv_pga":  # nothing lies between two records
        lines = axes.contour(pga, rows, values, LEVELS, colors=style.INK, linewidths=0.9)
        axes.clabel(lines, fmt=lambda level: f"{100 * level:g} %", fontsize=8)
    named = found.assign(pgv_pga=found[_ratios(found)])
    bar = figure.colorbar(mesh, ax=axes)
    bar.set_label("probability of toppling")
    axes.set(xlabel=label("pga"), ylabel=name_rows(axes, named))
    return figure
