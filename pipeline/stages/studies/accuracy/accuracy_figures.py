"""Error against CPU time and against time step."""

from __future__ import annotations

import math
from collections import defaultdict
from typing import Any

from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from pipeline.drawing.style import FAINT, INK, MARKERS, SERIES, styled
from vsr_core.verification.agreement import WORST

Record = dict[str, Any]


def lines(records: list[Record], part: str) -> dict[str, list[Record]]:
    """Measured settings of each method, coarse to fine."""
    found: dict[str, list[Record]] = defaultdict(list)
    for record in records:
        if record["part"] == part and record["cpu_s"] != "":
            found[record["method"]].append(record)
    ranked = sorted(found.items(), key=lambda pair: (not pair[1][0]["own"], pair[0]))
    return {
        method: sorted(points, key=lambda point: float(point["step"]), reverse=True)
        for method, points in ranked
    }


def cheapest(records: list[Record], tolerance: float) -> list[Record]:
    """The cheapest setting of each method within a tolerance, the cheapest method first."""
    best = []
    for points in lines(records, "method").values():
        good = [point for point in points if point["error"] <= tolerance]
        best += sorted(good, key=lambda point: float(point["cpu_s"]))[:1]
    return sorted(best, key=lambda point: float(point["cpu_s"]))


@styled
def work_precision(records: list[Record], tolerance: float, title: str) -> Figure:
    """Error of the boundary against CPU time of a run, one line a method."""
    figure = Figure(figsize=(6.6, 4.3), layout="constrained")
    axes = figure.add_subplot()
    for at, (method, points) in enumerate(lines(records, "method").items()):
        own = points[0]["own"]
        axes.plot(
            [1e3 * point["cpu_s"] for point in points],
            [100.0 * min(point["error"], WORST) for point in points],
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
    axes.set_xlabel("CPU time per run [ms]")
    axes.set_ylabel("error of the overturning boundary [%]")
    axes.set_title(title, loc="left")
    figure.legend(loc="outside lower center", ncols=2)
    return figure


@styled
def boundary_convergence(rows: list[Record], chosen: float, tolerance: float) -> Figure:
    """Error of each row's boundary against the time step, and what most rows keep.

    Parameters
    ----------
    rows : list of dict with ``label``, ``steps`` [ms], ``error``; the last is what most keep
    chosen : float [ms]
    tolerance : float
    """
    figure = Figure(figsize=(6.6, 3.9), layout="constrained")
    axes = figure.add_subplot()
    for at, row in enumerate(rows):
        last = at == len(rows) - 1
        axes.plot(
            row["steps"],
            [100.0 * error for error in row["error"]],
            color=INK if last else SERIES[at % len(SERIES)],
            linewidth=2.2 if last else 0.9,
            marker=MARKERS[at % len(MARKERS)] if not last else None,
            markersize=4,
            label=row["label"],
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
    axes.set_xscale("log")
    axes.set_xticks(rows[-1]["steps"], [f"{step:.2g}" for step in rows[-1]["steps"]])
    axes.xaxis.set_minor_formatter(FuncFormatter(lambda value, _: ""))
    axes.set_xlabel("time step [ms]")
    axes.set_ylabel("error of the boundary [%]")
    figure.legend(loc="outside lower center", ncols=2)
    return figure


@styled
def suite_convergence(records: list[Record]) -> Figure:
    """Error of each case of the reference suite against the time step, one panel an engine."""
    engines = sorted({record["engine"] for record in records if record["part"] == "reference"})
    figure = Figure(figsize=(9.0, 4.6), layout="constrained")
    panels = figure.subplots(1, max(len(engines), 1), sharey=True, squeeze=False)[0]
    names = sorted({r["case"] for r in records if r["part"] == "reference"})
    for panel, engine in zip(panels, engines, strict=False):
        for at, name in enumerate(names):
            points = [
                (1e3 * r["step"], float(r["error"]))
                for r in records
                if r["part"] == "reference" and r["engine"] == engine and r["case"] == name
            ]
            points = sorted(p for p in points if math.isfinite(p[1]))
            panel.plot(
                [step for step, _ in points],
                [max(error, 1e-10) for _, error in points],
                color=SERIES[at % len(SERIES)],
                marker=MARKERS[at // len(SERIES) % len(MARKERS)],
                markersize=3.5,
                linewidth=0.9,
                label=name,
            )
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.grid(visible=True)
        panel.set_title(engine, loc="left")
        panel.set_xlabel("time step [ms]")
    panels[0].set_ylabel("relative error")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right upper", fontsize=6.5)
    return figure


def _percent_axis(axes: Any) -> None:
    axes.set_yscale("log")
    axes.set_ylim(0.09, 100.0 * WORST * 1.25)
    axes.set_yticks([0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0])
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(FuncFormatter(lambda value, _: ""))
    axes.grid(visible=True)
