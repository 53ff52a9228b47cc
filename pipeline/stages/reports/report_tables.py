"""The report's tables and sentences, as plain rows."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from pipeline.stages.fragility.summary import (
    between,
    groups,
    typical_pga,
    undecided,
    weak_directions,
)
from pipeline.workflow.datasets import rows_of
from vsr_core.arrays import Array
from vsr_core.outcome import DecidedBy, Outcome

Row = dict[str, Any]

RATIOS = (0.1, 0.2, 0.3, 0.5, 0.8)
"""PGV/PGA [s] near which the table of the boundary has its columns."""

EARLY = (DecidedBy.ENERGY_BOUND, DecidedBy.NO_RETURN)


def about_rock(rock: xr.Dataset) -> Row:
    """Size, weight, base and weak directions."""
    corners, base = rock["surface_vertex"].values, rock["base_polygon"].values
    x, y = base.T
    return {
        **{name: rock.attrs[name] for name in ("shape_source", "repaired", "mass_kg", "volume_m3")},
        "turned": float(rock.attrs["turned_to_rest_deg"]),
        "surrogate": bool(rock.attrs["surrogate"]),
        "size": [float(length) for length in np.ptp(corners, axis=0)],
        "height": -float(rock["vertex"].values[:, 2].min()),
        "corners": len(base),
        "area": 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))),
        "weak": weak_directions(rock),
    }


def left_out(responses: xr.Dataset, gains: dict[str, float]) -> list[Row]:
    """What was left out of the scene, why that is harmless, and what it gains where measured.

    Parameters
    ----------
    responses : Dataset
    gains : dict, from a reduction's name to CPU time without it over that with it
    """
    rows = []
    attributes = responses.attrs
    lines, names = attributes["left_out"].splitlines(), attributes["left_out_names"].split()
    for line, name in zip(lines, names, strict=True):
        what, _, why = line.partition(": ")
        rows.append({"what": what, "why": why, "gain": gains.get(name)})
    return rows


def time_steps(responses: xr.Dataset) -> list[Row]:
    """Time step of each friction and the measured error of the boundary, with a sentence."""
    names = ("friction", "time_step", "boundary_error", "boundary_error_worst")
    columns = [responses[name].values.tolist() for name in names]
    return [
        {"friction": friction, "time_step": step, "error": error, "worst": worst}
        for friction, step, error, worst in zip(*columns, strict=True)
    ]


def by_yaw(responses: xr.Dataset, fragility: xr.Dataset) -> list[Row]:
    """Toppled share, typical first-overturning PGA and model of each yaw and friction."""
    lower, upper = typical_pga(fragility)
    lost = undecided(responses).sum(axis=(2, 3))
    return [
        {
            "name": name,
            "yaw": f"{float(fragility['yaw'][place[0]]):g}",
            "friction": place[1],
            "share": float(fragility["toppled_share"].values[place]),
            "first": between(lower[place], upper[place], fragility["pga"].values),
            "undecided": int(lost[place]),
            "model": str(fragility["recommended"].values[place]) or "none",
            "reason": str(fragility["reason"].values[place]) or "No run was decided.",
        }
        for place, name in groups(fragility)
    ]


def answer(rows: list[Row], frictions: Array) -> list[Row]:
    """Most and least fragile yaws of each friction, by toppled share; ties together."""
    found = []
    for k, friction in enumerate(frictions):
        own = [row for row in rows if row["friction"] == k and np.isfinite(row["share"])]
        if own:
            shares = [row["share"] for row in own]
            most, least = (
                _end([row for row in own if row["share"] == end])
                for end in (max(shares), min(shares))
            )
            found.append(
                {
                    "friction": f"At friction {friction:g}, " if len(frictions) > 1 else "",
                    "most": most,
                    "least": least,
                    "alike": max(shares) == min(shares),
                    "yaws": len(own),
                }
            )
    return found


def _end(rows: list[Row]) -> Row:
    names = ", ".join(row["yaw"] for row in rows)
    firsts = sorted({row["first"] for row in rows})
    return {"yaw": f"yaw {names} deg", "share": rows[0]["share"], "first": " or ".join(firsts)}


def counts(responses: xr.Dataset) -> Row:
    """Count runs by outcome and by what decided them."""
    outcome, rule = responses["outcome"].values, responses["decided_by"].values
    kinds = [code for code in Outcome if (outcome == code).any()]
    table = [
        {
            "how": code.how,
            "runs": [int(((outcome == kind) & (rule == code)).sum()) for kind in kinds],
        }
        for code in DecidedBy
        if (rule == code).any()
    ]
    decided = ~undecided(responses)
    return {
        "kinds": [kind.name.lower() for kind in kinds],
        "table": table,
        "total": outcome.size,
        "toppled": float((outcome == Outcome.OVERTURNED).sum() / max(decided.sum(), 1)),
        "proved": int((decided & (rule == DecidedBy.NO_UPLIFT_BOUND)).sum()),
        "early": int((decided & np.isin(rule, EARLY)).sum()),
        "simulated": int((decided & (rule == DecidedBy.SIMULATION)).sum()),
    }


def unresolved(responses: xr.Dataset, most: int) -> Row:
    """How many runs are without a verdict, and the first ``most`` of them."""
    places = np.argwhere(undecided(responses))
    names = {outcome.value: outcome.name.lower() for outcome in Outcome}
    dims = responses["outcome"].dims
    listed = []
    for place in map(tuple, places[:most]):
        at = dict(zip(map(str, dims), place, strict=True))
        row: Row = {name: float(responses[name][at[name]]) for name in ("yaw", "friction", "pga")}
        row["motion"] = heads(responses)[at[rows_of(responses)]]
        row["outcome"] = names.get(int(responses["outcome"].values[place]), "missing")
        row["tilt"] = float(np.degrees(responses["peak_tilt"].values[place]))
        listed.append(row)
    return {"total": len(places), "listed": listed}


def heads(data: xr.Dataset) -> list[str]:
    """Names of the rows of motions: their PGV/PGA, or the records."""
    if rows_of(data) == "record":
        return [str(name) for name in data["record"].values]
    return [f"{ratio:.6g} s" for ratio in data["pgv_pga"].values]


def records(motions: xr.Dataset) -> list[Row]:
    """Each record with its measures before scaling, and what was repaired."""
    words = ("record", "station", "channel", "record_source", "record_unit", "repairs")
    numbers = ("pgv_pga", "record_pga", "record_pgv", "record_pgd", "sa_1hz", "sa_2hz", "arias")
    return [
        {name: str(motions[name].values[i]) for name in words}
        | {
            name: float(motions[name].values[i])
            for name in (*numbers, "cav", "significant_duration")
        }
        for i in range(motions.sizes["record"])
    ]


def boundary(fragility: xr.Dataset) -> Row:
    """First overturning, and the recommended model's median, near a few PGV/PGA or per record."""
    grid, ratios = fragility["pga"].values, fragility["pgv_pga"].values
    columns = list(range(len(ratios)))
    if rows_of(fragility) == "pgv_pga":
        columns = sorted({int(np.argmin(abs(ratios - ratio))) for ratio in RATIOS})
    rows = []
    for place, name in groups(fragility):
        upper = fragility["first_overturning_pga"].values[place][columns]
        lower = np.nan_to_num(fragility["last_balanced_pga"].values[place][columns], nan=0.0)
        cells = [
            {"grid": between(*ends, grid), "model": ""} for ends in zip(lower, upper, strict=True)
        ]
        model = str(fragility["recommended"].values[place])
        if model in fragility["model"].values:
            fit = fragility.sel(model=model)
            medians = fit["median_pga"].values[place][columns]
            ends = fit["median_pga_interval"].values[place][columns]
            for cell, median, interval in zip(cells, medians, ends, strict=True):
                cell["model"] = _with_interval(median, interval, grid)
        rows.append({"name": name, "model": model or "none", "cells": cells})
    return {"heads": [heads(fragility)[c] for c in columns], "rows": rows}


def _with_interval(median: float, interval: Array, grid: Array) -> str:
    middle, low, high = (_in(value, grid) for value in (median, *interval))
    known = not np.isnan(interval).any() and not middle == low == high
    return f"{middle} [{low}, {high}]" if known else middle


def _in(value: float, grid: Array) -> str:
    """Name a level PGA; outside the tested range only that it is."""
    if np.isnan(value):
        return "?"
    if value < grid[0]:
        return f"<{grid[0]:.3f}"
    return f">{grid[-1]:.3f}" if value > grid[-1] else f"{value:.3f}"


def models(fragility: xr.Dataset) -> list[Row]:
    """Scores of every model of each yaw and friction."""
    scores = ("log_loss", "log_loss_error", "brier", "accuracy")
    rows = []
    for place, name in groups(fragility):
        recommended = str(fragility["recommended"].values[place])
        fits = [
            {
                "name": str(model),
                **{score: float(fragility[score].values[(*place, m)]) for score in scores},
                "separated": bool(fragility["separated"].values[(*place, m)] == 1),
                "method": str(fragility["method"].values[(*place, m)]),
                "recommended": str(model) == recommended,
            }
            for m, model in enumerate(fragility["model"].values)
        ]
        reason = str(fragility["reason"].values[place]) or "No run was decided."
        rows.append({"name": name, "reason": reason, "model": recommended or "none", "fits": fits})
    return rows
