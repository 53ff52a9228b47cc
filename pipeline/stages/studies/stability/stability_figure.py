"""The map of verdicts: time step against contact stiffness."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from pipeline.drawing.style import INK, SERIES, styled
from vsr_core.verification.stability import Verdict
from vsr_core.verification.stability.stiffness_map import Limits

Record = dict[str, Any]

COLOURS = {Verdict.RIGHT: SERIES[4], Verdict.FLAGGED: "#f3e3b3", Verdict.WRONG: "#c7362f"}
HATCHES = {Verdict.RIGHT: "", Verdict.FLAGGED: "////", Verdict.WRONG: "xxxx"}
"""Each verdict by colour and by hatch: they differ in grey and for a reader who sees no red."""

LABELS = {
    Verdict.RIGHT: "right",
    Verdict.FLAGGED: "flagged: refused or ended without an outcome",
    Verdict.WRONG: "silently wrong",
}

GAP = 0.35
"""Between the stiffest spring and the rigid contact, in decades."""


@styled
def stability_map(records: list[Record], limits: Limits) -> Figure:
    """Verdict at each time step and stiffness, with the limits that the program knows.

    Parameters
    ----------
    records : list of dict, with ``time_step`` [s], ``stiffness`` [N/m] and ``verdict``
    limits : Limits
    """
    figure = Figure(figsize=(7.2, 4.9), layout="constrained")
    axes = figure.add_subplot()
    steps = sorted({record["time_step"] for record in records})
    stiffnesses = sorted({record["stiffness"] for record in records})
    finite = [k for k in stiffnesses if math.isfinite(k)]
    edges = _edges(np.log10(steps))
    rigid = math.log10(finite[-1]) + 1.0 + GAP
    for record in records:
        at = steps.index(record["time_step"])
        k = record["stiffness"]
        centre = math.log10(k) if math.isfinite(k) else rigid
        verdict = Verdict(record["verdict"])
        axes.add_patch(
            Rectangle(
                (centre - 0.5, edges[at]),
                1.0,
                edges[at + 1] - edges[at],
                facecolor=COLOURS[verdict],
                hatch=HATCHES[verdict],
                edgecolor="white",
                linewidth=1.2,
            )
        )
    _draw_limits(axes, finite, limits, (edges[0], edges[-1]), rigid)
    axes.set_xlim(math.log10(finite[0]) - 0.5, rigid + 0.5)
    axes.set_ylim(edges[0], edges[-1])
    places = [*(math.log10(k) for k in finite), rigid]
    axes.set_xticks(places, [*(f"$10^{{{round(math.log10(k))}}}$" for k in finite), "rigid"])
    axes.set_yticks(np.log10(steps), [_named(step) for step in steps])
    axes.tick_params(length=0)
    axes.set_xlabel("stiffness of each point of contact [N/m]")
    axes.set_ylabel("time step [ms]")
    _legend(figure, axes, records)
    return figure


def _edges(centres: Any) -> Any:
    """Edges of tiles around centres, halfway between them."""
    middle = 0.5 * (centres[1:] + centres[:-1])
    return np.concatenate([[2 * centres[0] - middle[0]], middle, [2 * centres[-1] - middle[-1]]])


def _draw_limits(
    axes: Axes, finite: list[float], limits: Limits, ends: tuple[float, float], rigid: float
) -> None:
    left, right = math.log10(finite[0]) - 0.5, math.log10(finite[-1]) + 0.5
    longest = math.log10(limits.step)
    axes.plot([left, rigid + 0.5], [longest] * 2, color=INK, label="longest step for the rock")
    axes.plot(
        [math.log10(limits.stiffness)] * 2,
        ends,
        color=INK,
        linestyle=(0, (4, 2)),
        label="softest contact that bears it",
    )
    slope = np.polyfit(np.log10(finite), np.log10(limits.spring_steps), 1)
    axes.plot(
        [left, right],
        np.polyval(slope, [left, right]),
        color=INK,
        linestyle=(0, (1, 1.2)),
        linewidth=2.0,
        label="longest step for the springs",
    )


def _legend(figure: Figure, axes: Axes, records: list[Record]) -> None:
    counts = {verdict: sum(r["verdict"] == verdict.value for r in records) for verdict in Verdict}
    tiles = [
        Patch(
            facecolor=COLOURS[verdict],
            hatch=HATCHES[verdict],
            edgecolor="white",
            label=f"{LABELS[verdict]} ({counts[verdict]})",
        )
        for verdict in Verdict
    ]
    lines, _ = axes.get_legend_handles_labels()
    figure.legend(handles=[*tiles, *lines], loc="outside lower center", ncols=2, handleheight=1.3)


def _named(step: float) -> str:
    return f"{1e3 * step:.3g}"
