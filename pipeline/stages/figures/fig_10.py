"""Fig. 10: the PETG print of Double Rock on the mini shake robot."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from pipeline.drawing import style
from pipeline.stages.figures import diagrams
from pipeline.stages.figures.paper import Data, Finding, Source, by_rule

TITLE = "PETG print of Double Rock, 12.8 cm high"

SOURCES = {
    "print": Source("petg_12.8cm", "responses"),
    "fit": Source("petg_12.8cm", "fragility"),
    "rock": Source("petg_12.8cm", "rock"),
    "full_fit": Source("double_rock", "fragility"),
}

INPUTS = diagrams.ROBOT_FILES

SIZE = 0.084852
"""Of the print, in sizes of the rock."""

CLOSE = 0.05
"""Relative distance of two boundaries that counts as the same."""


@style.styled
def draw(data: Data) -> Figure:
    """Draw the runs, their logistic boundary, that of the full-size rock, and the limits."""
    figure = Figure(figsize=(6.4, 5.9))
    axes = figure.add_axes((0.1, 0.24, 0.87, 0.69))
    responses, full = data["print"], data["full_fit"]
    ratios = responses["pgv_pga"].values
    diagrams.cells(axes, responses["pga"].values, ratios, diagrams.grid(responses), pale=True)
    diagrams.robot_limits(axes, axes.get_ylim()[1])
    look: Any = {"color": style.OVERTURNED, "lw": 2.0, "gid": "logistic"}
    diagrams.logistic(axes, data["fit"], label="logistic regression of these runs", **look)
    dotted: Any = {"color": "black", "lw": 1.6, "ls": (0, (1, 1.4)), "gid": "similar"}
    axes.plot(diagrams.median(full), math.sqrt(SIZE) * full["pgv_pga"].values,
              label="that of the full-size rock, periods by √size", **dotted)  # fmt: skip
    axes.set(xlabel=diagrams.PGA, ylabel=diagrams.RATIO)
    diagrams.note(figure, diagrams.print_source(data["rock"]))
    lines = axes.get_legend_handles_labels()[0]
    figure.legend(handles=[*diagrams.key(pale=True), *lines], loc="lower center", ncols=2)
    return figure


def findings(data: Data) -> list[Finding]:
    """Compare with section 4.3."""
    responses, full = data["print"], data["full_fit"]
    pga, ratios = responses["pga"].values, responses["pgv_pga"].values
    similar = np.interp(
        ratios, math.sqrt(SIZE) * full["pgv_pga"].values, diagrams.median(full),
        left=math.nan, right=math.nan,
    )  # fmt: skip
    off = diagrams.apart(diagrams.median(data["fit"]), similar)
    median = diagrams.middle(off)
    can = diagrams.feasible(pga, ratios)
    toppled = diagrams.grid(responses)[can] == 1
    return [
        Finding(
            "Fig. 10, section 4.3",
            "The simulated boundary of the PETG print is close to the physical one; the physical "
            "print is the more fragile.",
            "distance of the two boundaries",
            f"The physical outcomes are not public. Of the pulses of this grid the robot can do "
            f"{100 * can.mean():.0f} %, and {toppled.sum()} of these {can.sum()} overturn the "
            "simulated print.",
            None,
        ),
        Finding(
            "sections 4.3 and 6.1",
            "The print overturns as the rock itself does at full size, of chert.",
            f"median distance of their logistic boundaries, periods scaled by the square root of "
            f"the size, at most {100 * CLOSE:g} %",
            f"{100 * median:.1f} % in {len(off)} rows",
            by_rule(median <= CLOSE, median),
        ),
    ]
