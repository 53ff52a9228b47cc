"""The report's tables and sentences, as plain rows."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from pipeline.stages.datasets.bullet_sample import beyond_errors
from pipeline.stages.datasets.stored_runs import SIDES, in_words, kinds, ways
from pipeline.stages.fragility.summary import (
    SEARCHED,
    groups,
    typical_pga,
    undecided,
    weak_directions,
    with_interval,
)
from pipeline.workflow.datasets import rows_of
from vsr_core.arrays import Array, Indices, Mask
from vsr_core.outcome import DecidedBy, Movement, Outcome

Row = dict[str, Any]

_RATIOS = (0.1, 0.2, 0.3, 0.5, 0.8)
"""PGV/PGA [s] near which the table of the boundary has its columns."""

_EARLY = (DecidedBy.ENERGY_BOUND, DecidedBy.NO_RETURN)


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
    """Simplifications of the scene, their justification, and the measured speed-up.

    Parameters
    ----------
    gains : dict, from a reduction's name to CPU time without it over that with it
    """
    rows = []
    attributes = responses.attrs
    lines, names = attributes["left_out"].splitlines(), attributes["left_out_names"].split()
    for line, name in zip(lines, names, strict=True):
        what, _, why = line.partition(": ")
        rows.append({"what": what, "why": why, "gain": gains.get(name)})
    return rows


def other_engine(sample: xr.Dataset) -> Row:
    """How a sample of the runs ended in another engine.

    Returns
    -------
    dict
        With ``expected``, how many the errors of both boundaries explain, nan where one was not
        measured; and ``odd``, whether more differ.
    """
    near = sample["next_to_boundary"].values == 1
    differs = sample["overturned"].values != sample["overturned_in_other_engine"].values
    expected = float(sample["explained"].sum(skipna=False))
    listed = [
        {
            "yaw": float(sample["yaw"][i]),
            "friction": float(sample["friction"][i]),
            "row": str(sample["row"].values[i]),
            "pga": float(sample["pga"][i]),
            "near": bool(near[i]),
            "here": _SIDES[int(sample["overturned"][i])],
            "there": _SIDES[int(sample["overturned_in_other_engine"][i])],
        }
        for i in np.flatnonzero(differs)
    ]
    return {
        "name": sample.attrs["other_engine"],
        "total": len(near),
        "near": int(near.sum()),
        "same": int((~differs).sum()),
        "same_near": int((~differs & near).sum()),
        "expected": expected,
        "odd": beyond_errors(sample),
        "differing": listed,
    }


_SIDES = {1: "toppled", 0: "upright", -1: "unresolved"}


def records(motions: xr.Dataset) -> list[Row]:
    """Each record with its measures before scaling, and what was repaired."""
    return _rows(motions.drop_dims([dim for dim in motions.dims if dim != "record"]).to_dataframe())


def by_yaw(responses: xr.Dataset, fragility: xr.Dataset) -> list[Row]:
    """Toppled share, typical first-overturning PGA and model of each yaw and friction."""
    typical = typical_pga(fragility)
    return [
        {
            "name": name,
            "yaw": f"{float(fragility['yaw'][place[0]]):g}",
            "friction": place[1],
            "share": float(fragility["toppled_share"].values[place]),
            "first": with_interval(*typical[:, *place]),
            "undecided": int(undecided(responses.isel(yaw=place[0], friction=place[1])).sum()),
            "model": (str(fragility["recommended"].values[place]) or "none")
            + " (too few levels to compare)" * bool(np.isnan(fragility["log_loss"][place]).all()),
        }
        for place, name in groups(fragility)
    ]


def answer(rows: list[Row], frictions: Array) -> list[Row]:
    """Yaws of each friction with the largest and the smallest toppled share; ties together.

    Neither need be the most or the least fragile: first overturning may rank them otherwise.
    """
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
    (outcome, movement, rule), number, peaks = _ends(responses)
    found, left = kinds(outcome, movement), ways(outcome, movement, number)
    decided, total = SIDES[outcome] >= 0, int(number.sum())

    def of(runs: Mask) -> int:
        return int(number[runs].sum())

    return {
        "kinds": list(found),
        "table": [
            {"how": code.how, "runs": [of(runs & (rule == code)) for runs in found.values()]}
            for code in DecidedBy
            if (rule == code).any()
        ],
        "ways": in_words(left),
        "total": total,
        "peaks": peaks,
        "toppled": of(outcome == Outcome.OVERTURNED) / max(of(decided), 1),
        "proved": of(decided & (rule == DecidedBy.NO_UPLIFT_BOUND)),
        "early": of(decided & np.isin(rule, _EARLY)),
        "simulated": of(decided & (rule == DecidedBy.SIMULATION)),
    }


def _ends(responses: xr.Dataset) -> tuple[Indices, Indices, int]:
    """Outcomes, movements and rules that occur together, and how many runs have each.

    Returns
    -------
    ends : ndarray of int, shape (3, n)
    number : ndarray of int, shape (n,)
    peaks : int, runs whose largest tilt is known
    """
    sizes = (len(Outcome) + 1, len(Movement) + 1, len(DecidedBy))
    number, peaks = np.zeros(sizes, dtype=int), 0
    for (yaw, friction), _ in groups(responses):
        runs = responses.isel(yaw=yaw, friction=friction)
        outcome, movement, rule = (
            runs[name].values.ravel().astype(int) for name in ("outcome", "movement", "decided_by")
        )
        at = np.ravel_multi_index((outcome + 1, movement + 1, rule), sizes)
        number += np.bincount(at, minlength=number.size).reshape(sizes)
        peaks += int(np.isfinite(runs["peak_tilt"].values).sum())
    ends = np.array(np.nonzero(number))
    return ends - np.array([[1], [1], [0]]), number[number > 0], peaks


def unresolved(responses: xr.Dataset, most: int) -> Row:
    """How many runs are unresolved, and the first ``most`` of them."""
    names = {outcome.value: outcome.name.lower() for outcome in Outcome}
    total, heads = 0, _heads(responses)
    listed: list[Row] = []
    for (yaw, friction), _ in groups(responses):
        runs = responses[["outcome", "overturned", "tilt_until_decided"]]
        runs = runs.isel(yaw=yaw, friction=friction).load()
        lost = undecided(runs)
        for row, column in np.argwhere(lost)[: most - len(listed)]:
            one = runs.isel({rows_of(runs): row, "pga": column})
            values = {str(name): one[name].item() for name in one.variables}
            listed.append(
                values
                | {
                    "outcome": names.get(values["outcome"], "missing"),
                    "tilt": np.degrees(values["tilt_until_decided"]),
                    "motion": heads[row],
                }
            )
        total += int(lost.sum())
    return {"total": total, "listed": listed}


def _heads(data: xr.Dataset) -> list[str]:
    """Names of the rows of motions: their PGV/PGA, or the records."""
    if rows_of(data) == "record":
        return [str(name) for name in data["record"].values]
    return [f"{ratio:.6g} s" for ratio in data["pgv_pga"].values]


def boundary(fragility: xr.Dataset) -> Row:
    """First overturning, and the recommended model's median, near a few PGV/PGA or per record."""
    ratios = fragility["pgv_pga"].values
    columns = list(range(len(ratios)))
    if rows_of(fragility) == "pgv_pga":
        columns = sorted({int(np.argmin(abs(ratios - ratio))) for ratio in _RATIOS})
    rows = []
    for (i, k), name in groups(fragility):
        fit = fragility.isel({"yaw": i, "friction": k, rows_of(fragility): columns})
        lower = np.nan_to_num(fit["first_overturning_pga_lower"].values, nan=0.0)
        first, upper = (fit[f"first_overturning_pga{end}"].values for end in ("", "_upper"))
        cells = [
            {"first": with_interval(*row), "model": ""}
            for row in zip(first, lower, upper, strict=True)
        ]
        model = str(fit["recommended"].values)
        if model in fit["model"].values:
            own = fit.sel(model=model)
            medians = zip(own["median_pga"].values, own["median_pga_interval"].values, strict=True)
            for cell, (median, interval) in zip(cells, medians, strict=True):
                cell["model"] = _with_interval(median, interval)
        rows.append({"name": name, "model": model or "none", "cells": cells})
    return {"heads": [_heads(fragility)[c] for c in columns], "rows": rows}


def _with_interval(median: float, interval: Array) -> str:
    middle, low, high = map(_in_words, (median, *interval))
    known = not np.isnan(interval).any() and not middle == low == high
    return f"{middle} [{low}, {high}]" if known else middle


def _in_words(value: float) -> str:
    """Name a level PGA; where a model does not reach it, on which side it lies."""
    if np.isnan(value):
        return "?"
    return {0.0: "below", np.inf: "above"}.get(value, f"{value:#.4g}")


def between_cells(boundary: xr.Dataset) -> Row:
    """What the runs between the cells of the grid were, and how narrow the intervals are."""
    width = np.log(boundary["change_upper"].values / boundary["change_lower"].values)
    return {
        "asked": float(boundary["boundary_resolution"].max()),
        "reached": float(np.median(width)) if width.size else np.nan,
        "changes": width.size,
        "several": int((boundary["changes"] > 1).sum()),
        "levels": boundary["changes"].size,
        "runs": boundary.sizes["run"],
        "probes": int(boundary["probes"].sum()),
        "wrong": int(boundary["probes_wrong"].sum()),
        "searched": [float(boundary.attrs[name]) for name in SEARCHED],
    }


def models(fragility: xr.Dataset) -> list[Row]:
    """Scores of every model of each yaw and friction."""
    scores = ["log_loss", "log_loss_error", "brier", "accuracy", "separated", "method"]
    return [
        {
            "name": name,
            "recommended": str(one["recommended"].values) or "none",
            "reason": str(one["reason"].values) or "No run was decided.",
            "fits": _rows(one[scores].to_dataframe()),
        }
        for (i, k), name in groups(fragility)
        for one in [fragility.isel(yaw=i, friction=k)]
    ]


def _rows(table: pd.DataFrame) -> list[Any]:
    return table.reset_index().to_dict("records")
