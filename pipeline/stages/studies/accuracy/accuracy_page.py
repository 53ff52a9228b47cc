"""The page of the accuracy stage: sentences, tables and pictures from its records."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

from pipeline.config import in_si
from pipeline.config.schema import Config
from pipeline.drawing.style import png_uri, svg_uri
from pipeline.stages.runs.step_choice import kept
from pipeline.stages.studies.accuracy.accuracy_figures import (
    boundary_convergence,
    cheapest,
    measured,
    suite_convergence,
)
from pipeline.stages.studies.accuracy.comparison import Place, Record
from vsr_core.verification import time_step
from vsr_core.verification.time_step import Boundary
from vsr_core.verification.work_precision import Target

_CHOICE = ("time_step", "boundary_error", "boundary_error_worst")


def facts(
    site: str,
    config: Config,
    table: pd.DataFrame,
    targets: dict[Place, Target],
    chosen: xr.Dataset,
    diagram: Figure,
) -> dict[str, Any]:
    """Everything that the page says.

    Parameters
    ----------
    chosen : Dataset, what the stage of the time step measured and chose
    diagram : Figure, error against CPU time
    """
    tolerance = config.simulation.tolerance
    part = {name: table[table["part"] == name] for name in ("method", "sweep", "cells")}
    suite = table[table["part"] == "reference"].astype({"error": float, "step": float})
    found, best = measured(table), cheapest(table, 0.01)
    own = best["cpu_s"][best["own"]]
    return {
        "site": site,
        "tolerance": tolerance,
        "by_hand": config.simulation.time_step != "auto",
        "kept": kept(chosen.isel(friction=0), Boundary.TOPPLED) if "row_error" in chosen else (),
        "choice": {name: float(chosen[name].values[0]) for name in _CHOICE},
        "friction": config.contact.friction[0],
        "rows": _rows(targets),
        "lines": {
            method: list(points.itertuples())
            for method, points in found.groupby("method", sort=False)
        },
        "absent": list(part["method"][part["method"]["cpu_s"] == ""].itertuples()),
        "cheapest": list(best.itertuples()),
        "own_cpu_s": own.iloc[0] if len(own) else math.nan,
        "better": _better(found),
        "sweep": list(part["sweep"].itertuples()),
        "cells": list(part["cells"].itertuples()),
        "suite": [
            {"name": name, "note": own["note"].iloc[0], "errors": own.set_index("setting")["error"]}
            for name, own in suite.groupby("method")
        ],
        "work_precision": svg_uri(diagram),
        "front": _front(chosen, tolerance),
        "convergence": png_uri(suite_convergence(suite)) if len(suite) else "",
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


def _better(found: pd.DataFrame) -> list[str]:
    """Settings of others with less error at less cost than every setting of the project."""
    own = found[found["own"]]
    return [
        f"{point['method']} at {point['setting']}: {100 * point['error']:.3g} % in "
        f"{1e3 * point['cpu_s']:.3g} ms"
        for point in found[~found["own"]].to_dict("records")
        if (own["error"][own["cpu_s"] <= point["cpu_s"]] > point["error"]).all()
    ]


def _front(chosen: xr.Dataset, tolerance: float) -> str:
    """Error of each row that topples against the time step; empty where it was not measured."""
    first = chosen.isel(friction=0)
    if np.isnan(first["boundary_error"]):
        return ""
    first = first.isel(row=first["row_displaced"].values == 0)
    errors = [
        (f"yaw {row['row_yaw'].item():g} deg, PGV/PGA {row['row_pgv_pga'].item():.2g} s", error)
        for row in (first.isel(row=at) for at in range(first.sizes["row"]))
        if not np.isnan(error := row["row_error"].values).any()
    ]
    shares = first["step_share"].values
    most = time_step.front(shares.tolist(), first["row_error"].values, first["row_steps"].values)
    errors.append(("not exceeded in at least 80 % of rows", most.error))
    steps = shares * (1e3 * float(chosen.attrs["step_unit_s"]))
    figure = boundary_convergence(steps, errors, 1e3 * float(first["time_step"]), tolerance)
    return svg_uri(figure)
