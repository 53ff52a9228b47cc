"""The page of the accuracy stage: sentences, tables and pictures from its records."""

from __future__ import annotations

import math
from typing import Any

import xarray as xr
from matplotlib.figure import Figure

from pipeline.config import in_si
from pipeline.config.schema import Config
from pipeline.drawing.style import png_uri, svg_uri
from pipeline.stages.studies.accuracy.accuracy_figures import (
    boundary_convergence,
    cheapest,
    lines,
    suite_convergence,
)
from pipeline.stages.studies.accuracy.comparing import Place, Record
from vsr_core.verification import time_step
from vsr_core.verification.work_precision import Target

_CHOICE = ("time_step", "boundary_error", "boundary_error_worst")


def facts(
    site: str,
    config: Config,
    records: list[Record],
    targets: dict[Place, Target],
    chosen: xr.Dataset,
    diagram: Figure,
) -> dict[str, Any]:
    """Everything that the page says.

    Parameters
    ----------
    site : str
    config : Config
    records : list of Record
    targets : dict of the rows
    chosen : Dataset, what the stage of the time step measured and chose
    diagram : Figure, error against CPU time
    """
    tolerance = config.simulation.tolerance
    suite = [record for record in records if record["part"] == "reference"]
    return {
        "site": site,
        "tolerance": tolerance,
        "choice": {name: float(chosen[name].values[0]) for name in _CHOICE},
        "friction": config.contact.friction[0],
        "rows": _rows(targets),
        "lines": lines(records, "method"),
        "absent": [r for r in records if r["part"] == "method" and r["cpu_s"] == ""],
        "cheapest": _with_ratio(cheapest(records, 0.01)),
        "better": _better(records),
        "sweep": [record for record in records if record["part"] == "sweep"],
        "cells": [record for record in records if record["part"] == "cells"],
        "suite": _suite(suite),
        "work_precision": svg_uri(diagram),
        "front": svg_uri(_front(chosen, tolerance)) if "row_error" in chosen else "",
        "convergence": png_uri(suite_convergence(suite)) if suite else "",
    }


def _rows(targets: dict[Place, Target]) -> list[Record]:
    return [
        {
            "yaw": yaw,
            "pgv_pga": pgv_pga,
            "boundary": in_si.in_g(wanted.boundary),
            "answer": "Housner's equation" if wanted.exact else "two engines at 1/16 of the step",
            "spread": wanted.spread,
        }
        for (yaw, pgv_pga), wanted in targets.items()
    ]


def _with_ratio(ways: list[Record]) -> list[Record]:
    own = [way["cpu_s"] for way in ways if way["own"]]
    return [{**way, "ratio": way["cpu_s"] / own[0] if own else math.nan} for way in ways]


def _better(records: list[Record]) -> list[str]:
    """Settings of others with less error at less cost than every setting of the project."""
    ways = lines(records, "method")
    own = [p for points in ways.values() for p in points if p["own"]]
    found = []
    for method, points in ways.items():
        for point in points:
            if point["own"]:
                continue
            rivals = [p for p in own if p["cpu_s"] <= point["cpu_s"]]
            if all(p["error"] > point["error"] for p in rivals):
                found.append(
                    f"{method} at {point['setting']}: {100 * point['error']:.3g} % in "
                    f"{1e3 * point['cpu_s']:.3g} ms"
                )
    return found


def _suite(records: list[Record]) -> list[Record]:
    """One row a case and engine: error at a millisecond and at the finest step."""
    found: dict[str, Record] = {}
    for record in records:
        entry = found.setdefault(
            record["method"], {"name": record["method"], "note": record["note"], "errors": {}}
        )
        entry["errors"][record["setting"]] = float(record["error"])
    return [found[name] for name in sorted(found)]


def _front(chosen: xr.Dataset, tolerance: float) -> Figure:
    first = chosen.isel(friction=0)
    shares = first["step_share"].values
    unit = 1e3 * float(chosen.attrs["step_unit_s"])
    rows = [
        {
            "label": f"yaw {float(first['row_yaw'][at]):g} deg, "
            f"PGV/PGA {float(first['row_pgv_pga'][at]):.2g} s",
            "steps": shares * unit,
            "error": first["row_error"].values[at],
        }
        for at in range(first.sizes["row"])
        if bool((first["row_error"].values[at] == first["row_error"].values[at]).all())
    ]
    most = time_step.front(first["row_error"].values, first["row_steps"].values)
    rows.append({"label": "kept by four in five", "steps": shares * unit, "error": most.error})
    return boundary_convergence(rows, 1e3 * float(first["time_step"]), tolerance)
