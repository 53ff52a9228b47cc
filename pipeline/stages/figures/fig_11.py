"""Fig. 11: the PLA print of Double Rock from two sides."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from pipeline.drawing import style
from pipeline.stages.figures import diagrams
from pipeline.stages.figures.paper import Data, Finding, Source, by_rule
from vsr_core.arrays import Mask

TITLE = "PLA print of Double Rock, 12.0 cm high, from two sides"

SOURCES = {
    "print": Source("pla_12cm", "boundary"),
    "fit": Source("pla_12cm", "fragility"),
    "rock": Source("pla_12cm", "rock"),
}

INPUTS = (*diagrams.ROBOT_FILES, diagrams.PRINT_TESTS)

YAWS = (0.0, 270.0)

MOST_ROWS = 0.8
"""Share of the rows in which a boundary must lie lower."""


@style.styled
def draw(data: Data) -> Figure:
    """Draw the runs and tests at both yaws, the boundary of each, and the robot's limits."""
    figure = Figure(figsize=(9.4, 5.0))
    margins = {"left": 0.07, "right": 0.985, "bottom": 0.235, "top": 0.905, "wspace": 0.12}
    panels = figure.subplots(1, 2, squeeze=False, sharey=True, gridspec_kw=margins)
    responses = data["print"]
    pga, ratios = responses["pga"].values, responses["pgv_pga"].values
    for axes, yaw in zip(panels[0], YAWS, strict=True):
        diagrams.cells(axes, pga, ratios, diagrams.grid(responses, yaw), pale=True)
        diagrams.robot_limits(axes, axes.get_ylim()[1])
        for side, colour in zip(YAWS, (style.OVERTURNED, style.INK), strict=True):
            look: Any = {"color": colour, "lw": 2.2}
            place = data["fit"]["yaw"].values.tolist().index(side)
            diagrams.logistic(axes, data["fit"], place, label=f"boundary at yaw {side:g}°",
                              gid=f"logistic-{side:g}", **look)  # fmt: skip
        axes.set_title(f"yaw {yaw:g}°")
    tests = diagrams.tested(panels[0, 0], diagrams.physical_tests("yaw 0"))
    diagrams.labelled(panels)
    published = "tests at their commanded pulses, of DREAMS-lab/shakebot_motion (MIT)"
    diagrams.note(figure, f"{data['rock'].attrs['shape_source']}; {published}")
    lines = panels[0, 0].get_legend_handles_labels()[0]
    figure.legend(
        handles=[*diagrams.key(pale=True), *lines[:-2], *tests], loc="lower center", ncols=3
    )
    return figure


def findings(data: Data) -> list[Finding]:
    """Compare with section 4.3."""
    responses = data["print"]
    can = diagrams.feasible(responses["pga"].values, responses["pgv_pga"].values)
    return [
        _compared(data, np.ones_like(can), "in all runs"),
        _compared(data, can, "in the runs that the mini shake robot can do"),
        _tested(data),
    ]


def _tested(data: Data) -> Finding:
    """Tests at yaw 0 deg against the runs at the pulses that were commanded."""
    tests = diagrams.physical_tests("yaw 0")
    responses = data["print"]
    row, column = (
        np.abs(responses[name].values - values[:, None]).argmin(axis=1)
        for name, values in (("pgv_pga", tests.ratio), ("pga", tests.pga))
    )
    runs = diagrams.grid(responses, 0.0)[row, column]
    known = runs >= 0
    real, virtual = (100.0 * side[known].mean() for side in (tests.toppled, runs == 1))
    return Finding(
        "Fig. 11, section 5.2",
        "The print is more fragile on the table than in simulation, at yaw 0°.",
        "more of the tests overturn than of the runs at the commanded pulses",
        f"{real:.0f} % of {known.sum()} tests against {virtual:.0f} % of the runs nearest to them; "
        "docs/validation.md says why",
        by_rule(real > virtual, real, virtual),
    )


def _compared(data: Data, cells: Mask, which: str) -> Finding:
    responses = data["print"]
    pga = responses["pga"].values
    outcomes = [np.where(cells, diagrams.grid(responses, yaw), -1) for yaw in YAWS]
    share = [100.0 * diagrams.toppled_share(each) for each in outcomes]
    highest = np.where(cells, pga, 0.0).max(axis=1)
    found = [diagrams.first_overturning(responses, yaw) for yaw in YAWS]
    first = [np.where(each <= highest, each, np.nan) for each in found]
    rows = diagrams.lower_in(*first)
    return Finding(
        "Fig. 11, section 4.3",
        f"The PLA print is more fragile at yaw 0° than at yaw 270° ({which}).",
        f"more runs overturn at 0°, and the boundary lies lower in {100 * MOST_ROWS:g} % of the "
        "rows",
        f"{share[0]:.1f} % of the runs overturn against {share[1]:.1f} %; lower in "
        f"{100 * rows:.0f} % of the rows",
        by_rule(share[0] > share[1] and rows >= MOST_ROWS, *share, rows),
    )
