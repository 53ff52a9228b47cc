"""Accuracy: error of the boundary against CPU time, of this project and of other ways.

The products hold CPU times, which are their subject: unlike all others they differ from call to
call.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from pipeline.config import in_si
from pipeline.config.motion_schema import PulseConfig
from pipeline.config.problems import InputError, Problem
from pipeline.config.schema import SceneSettings
from pipeline.drawing.style import FAINT, INK, MARKERS, SERIES, pictures, png_uri, styled, svg_uri
from pipeline.stages.runs.step_choice import StepData, front, kept
from pipeline.stages.runs.study import Study
from pipeline.stages.studies.accuracy import comparison, quantity_fronts
from pipeline.stages.studies.accuracy.comparison import Place, Record, SampledCell
from pipeline.workflow import pages, writers
from pipeline.workflow.datasets import described, netcdf
from pipeline.workflow.grammar import listed
from pipeline.workflow.stage import Product, Work
from vsr_core import engines
from vsr_core.arrays import Array
from vsr_core.run.agreement import WINDOW, WORST
from vsr_core.run.time_step import Boundary
from vsr_core.verification.work_precision import Target

FILE, TABLE, PAGE, PICTURE = "accuracy.nc", "accuracy.csv", "accuracy.html", "work_precision"


def make(work: Work, study: Study, measured: StepData) -> Product:
    """Compare ways of running on the site's own rows, and run the reference suite."""
    _comparable(work, study)
    site = work.origin.name
    targets = comparison.find_targets(work, study)
    records = comparison.score_ways(work, study, targets)
    cells = comparison.sample_cells(work, study)
    records += comparison.compare_cells(cells)
    records += quantity_fronts.fronts(work, study)
    records += comparison.run_suite(work)
    if not study.settings.on_terrain:
        records += comparison.absent_engines()
    table = pd.DataFrame(records)
    diagram = work_precision(table, study.settings.simulation.tolerance, site)
    shown = facts(site, study.settings, table, targets, measured.data, diagram)
    files = {
        FILE: netcdf(described(_dataset(targets, cells), work, "Accuracy")),
        TABLE: writers.table(table[list(comparison.COLUMNS)]),
        PAGE: writers.text(pages.filled(PAGE, shown, work.up)),
        **pictures(PICTURE, diagram),
    }
    return Product(files, _summary(table, _least(targets)))


def _comparable(work: Work, study: Study) -> None:
    """Refuse what not every way of running can hold."""
    contact, level = study.settings.contact, not study.settings.on_terrain
    pulses = isinstance(study.motion, PulseConfig)
    held = "engines are compared in a scene that all of them can hold"
    checks: tuple[tuple[str, bool, object, str, object], ...] = (
        (
            "motion.kind",
            pulses,
            study.motion.kind,
            "engines are compared under pulses",
            "cosine_pulse",
        ),
        ("drive", study.settings.drive != "servo", "servo", held, "table_frame"),
        ("contact.restitution", not (level and contact.restitution), contact.restitution, held, 0),
        (
            "contact.rolling_friction",
            not contact.rolling_friction,
            contact.rolling_friction,
            held,
            0,
        ),
    )
    for key, holds, given, rule, value in checks:
        if not holds:
            file, remedy = work.origin.file_of(key), f"use the site with {key}: {value}"
            raise InputError(Problem(file, key, str(given), rule, remedy))


def _dataset(targets: dict[Place, Target], cells: list[SampledCell]) -> xr.Dataset:
    dataset = xr.Dataset(
        {
            "row_yaw": ("row", [yaw for yaw, _ in targets]),
            "row_pgv_pga": ("row", [pgv_pga for _, pgv_pga in targets]),
            "row_reference": ("row", [in_si.in_g(t.boundary) for t in targets.values()]),
            "row_spread": ("row", [t.spread for t in targets.values()]),
            "row_least_error": ("row", [t.least for t in targets.values()]),
        }
    )
    for name in ("yaw", "pgv_pga", "pga") if cells else ():
        dataset[f"cell_{name}"] = ("cell", [getattr(cell, name) for cell in cells])
    for name in cells[0].outcomes if cells else ():
        dataset[f"outcome_{name}"] = ("cell", [cell.outcomes[name] for cell in cells])
    return dataset


def _summary(table: pd.DataFrame, least: float) -> str:
    ways = cheapest(table, 0.01).to_dict("records")
    texts = [f"{way['method']} {1e3 * way['cpu_s']:.3g} ms" for way in ways]
    none = "no method gets there"
    if least > 0.01:
        none = f"none can be told, the references know the boundary to {100 * least:.3g} %"
    return "a run at 1 % error of the boundary: " + (", ".join(texts) or none)


def _least(targets: dict[Place, Target]) -> float:
    """The error below which none is told over the rows; nan without rows."""
    return comparison.kept([t.least for t in targets.values()]) if targets else math.nan


_CHOICE = ("time_step", "boundary_error", "boundary_error_worst")


def facts(
    site: str,
    config: SceneSettings,
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
    parts = "method", "sweep", "cells", "quantity"
    part = {name: table[table["part"] == name] for name in parts}
    others = part["quantity"]
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
        "on_terrain": config.on_terrain,
        "rows": _rows(targets),
        "window": WINDOW,
        "least": _least(targets),
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
        "quantities": {
            name: list(own.itertuples()) for name, own in others.groupby("method", sort=False)
        },
        "of_quantities": svg_uri(
            quantity_fronts.diagram(others, float(chosen["time_step"].values[0]))
        )
        if len(others)
        else "",
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
            "boundary": in_si.in_g(target.boundary),
            "exact": target.exact,
            "answer": "Housner's equation" if target.exact else _in_words(target.references),
            "spread": target.spread,
            "least": target.least,
        }
        for (yaw, pgv_pga), target in targets.items()
    ]


def _in_words(references: tuple[tuple[str, float], ...]) -> str:
    """Engines that are references, each with its share of its usual step.

    >>> _in_words((("bullet", 0.000375), ("nonsmooth", 0.0025)))
    'bullet at 1/16 and nonsmooth at 1/8 of the usual step'
    """
    shares = [
        f"{name} at 1/{engines.load(name).LADDER.coarse / step:.2g}" for name, step in references
    ]
    return f"{listed(shares)} of the usual step"


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
    most = front(first, Boundary.TOPPLED)
    first = first.isel(row=first["row_displaced"].values == 0)
    errors = [
        (f"yaw {row['row_yaw'].item():g} deg, PGV/PGA {row['row_pgv_pga'].item():.2g} s", error)
        for row in (first.isel(row=at) for at in range(first.sizes["row"]))
        if not np.isnan(error := np.fmax(row["row_error"].values, row["row_shift"].values)).any()
    ]
    errors.append(("not exceeded in at least 80 % of rows", most.error))
    errors.append(("outcomes agree in at least 80 % of rows", most.agreement))
    steps = most.shares * (1e3 * float(chosen.attrs["step_unit_s"]))
    figure = boundary_convergence(steps, errors, 1e3 * float(first["time_step"]), tolerance)
    return svg_uri(figure)


def measured(table: pd.DataFrame) -> pd.DataFrame:
    """Settings of methods that were measured, the project's first, each method coarse to fine.

    Parameters
    ----------
    table : DataFrame
        With the records of the accuracy stage as rows.
    """
    found = table[(table["part"] == "method") & (table["cpu_s"] != "")]
    found = found.astype({"own": bool, "error": float, "cpu_s": float, "step": float})
    return found.sort_values(["own", "method", "step"], ascending=[False, True, False])


def cheapest(table: pd.DataFrame, tolerance: float) -> pd.DataFrame:
    """The cheapest setting of each method within a tolerance, the cheapest method first.

    Parameters
    ----------
    table : DataFrame
        With the records of the accuracy stage as rows.
    """
    found = measured(table)
    good = found[found["error"] <= tolerance].sort_values("cpu_s", kind="stable")
    return good.groupby("method", sort=False).head(1)


@styled
def work_precision(table: pd.DataFrame, tolerance: float, title: str) -> Figure:
    """Error of the boundary against CPU time of a run, one line a method.

    Parameters
    ----------
    table : DataFrame
        With the records of the accuracy stage as rows.
    """
    figure = Figure(figsize=(6.6, 4.3), layout="constrained")
    axes = figure.add_subplot()
    for at, (method, points) in enumerate(measured(table).groupby("method", sort=False)):
        own = points["own"].all()
        axes.plot(
            1e3 * points["cpu_s"],
            100.0 * points["error"].clip(upper=WORST),
            color=INK if own and at == 0 else SERIES[at % len(SERIES)],
            marker=MARKERS[at % len(MARKERS)],
            markersize=6 if own else 5,
            linewidth=2.0 if own else 1.0,
            linestyle="-" if own else "--",
            label=method,
        )
    axes.axhline(100.0 * tolerance, color=FAINT, linewidth=0.8, linestyle=":")
    axes.annotate(
        "tolerance",
        (0.0, 100.0 * tolerance),
        xycoords=("axes fraction", "data"),
        xytext=(4, 3),
        textcoords="offset points",
        color=FAINT,
        fontsize=8,
    )
    _percent_axis(axes)
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set(xlabel="CPU time per run [ms]", ylabel="error of the overturning boundary [%]")
    axes.set_title(title, loc="left")
    if not measured(table).empty:  # no boundary to measure an error of, where nothing topples
        figure.legend(loc="outside lower center", ncols=2)
    return figure


@styled
def boundary_convergence(
    steps: Array, errors: list[tuple[str, Array]], chosen: float, tolerance: float
) -> Figure:
    """Error of each row's boundary against the time step, then error and agreement most rows keep.

    Parameters
    ----------
    steps : ndarray [ms]
    chosen : float [ms]
    """
    figure = Figure(figsize=(6.6, 3.9), layout="constrained")
    axes = figure.add_subplot()
    for at, (name, error) in enumerate(errors):
        kept = at >= len(errors) - 2
        axes.plot(
            steps,
            100.0 * error,
            color=INK if kept else SERIES[at % len(SERIES)],
            linewidth=2.2 if kept else 0.9,
            linestyle="--" if at == len(errors) - 1 else "-",
            marker=MARKERS[at // len(SERIES) % len(MARKERS)] if not kept else None,
            markersize=4,
            label=name,
        )
    axes.axvline(chosen, color=FAINT, linewidth=0.8)
    axes.axhline(100.0 * tolerance, color=FAINT, linewidth=0.8, linestyle=":")
    axes.annotate(
        f"chosen: {chosen:.3g} ms",
        (chosen, 1.0),
        xycoords=("data", "axes fraction"),
        xytext=(4, -10),
        textcoords="offset points",
        color=FAINT,
        fontsize=8,
    )
    _percent_axis(axes)
    axes.set_ylim(top=125.0 * max(WORST, *(float(error.max()) for _, error in errors)))
    axes.set_xscale("log")
    axes.set_xticks(steps, [f"{step:.2g}" for step in steps])
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set(xlabel="time step [ms]", ylabel="error of the boundary [%]")
    figure.legend(loc="outside lower center", ncols=2)
    return figure


@styled
def suite_convergence(suite: pd.DataFrame) -> Figure:
    """Error of each case of the reference suite against the time step, one panel an engine."""
    groups = suite.groupby("engine")
    figure = Figure(figsize=(9.0, 4.6), layout="constrained")
    panels = figure.subplots(1, groups.ngroups, sharey=True, squeeze=False)[0]
    for panel, (engine, own) in zip(panels, groups, strict=True):
        for at, name in enumerate(sorted(suite["case"].unique())):
            points = own[(own["case"] == name) & np.isfinite(own["error"])].sort_values("step")
            panel.plot(
                1e3 * points["step"],
                points["error"].clip(lower=1e-10),
                color=SERIES[at % len(SERIES)],
                marker=MARKERS[at // len(SERIES) % len(MARKERS)],
                markersize=3.5,
                linewidth=0.9,
                label=name,
            )
        panel.set(xscale="log", yscale="log")
        panel.grid(visible=True)
        panel.set_title(engine, loc="left")
        panel.set_xlabel("time step [ms]")
    panels[0].set_ylabel("relative error")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right upper", fontsize=6.5)
    return figure


def _percent_axis(axes: Axes) -> None:
    axes.set(
        yscale="log", ylim=(0.09, 100.0 * WORST * 1.25), yticks=[0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0]
    )
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.grid(visible=True)
