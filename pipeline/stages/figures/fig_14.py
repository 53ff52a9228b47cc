"""Fig. 14: Double Rock among its surrounding pedestals, shaken at yaw 0 and 90."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.spatial import ConvexHull

from pipeline.drawing import style
from pipeline.drawing.ground_map import Window, relief
from pipeline.drawing.ground_map import draw as draw_ground
from pipeline.stages.figures import diagrams
from pipeline.stages.figures.paper import Data, Finding, Source, by_rule
from vsr_core.arrays import Array
from vsr_core.outcome import Outcome

TITLE = "Double Rock among its surrounding pedestals"

SITE = "double_rock_terrain"

SOURCES = {
    "0": Source(SITE, "displacement"),
    "90": Source(SITE, "displacement", "yaw_90"),
    "terrain": Source(SITE, "terrain"),
    "rock": Source(SITE, "rock"),
    "flat": Source("double_rock", "boundary"),
}

YAWS = ("0", "90")

MUCH = 0.75
"""Toppled share on the terrain over that on flat ground, below which it is much reduced."""

APART = 0.1
"""Difference of the two factors from which on the direction of the shaking matters."""

_AROUND = 3.0  # m, half the width of the maps


@style.styled
def draw(data: Data) -> Figure:
    """Draw the seat from above with the shaking, and the response diagrams."""
    figure = Figure(figsize=(diagrams.WIDTH, 8.9))
    margins = {"left": 0.065, "right": 0.985, "bottom": 0.105, "top": 0.93}
    panels = figure.subplots(
        2, 2, width_ratios=(0.86, 1.0), gridspec_kw={**margins, "hspace": 0.27, "wspace": 0.17}
    )
    for row, letters, yaw in zip(panels, ("ab", "cd"), YAWS, strict=True):
        _seat(row[0], data, float(yaw))
        row[0].set_title(f"({letters[0]}) the rock on its seat, shaken at yaw {yaw}°")
        _responses(row[1], data, yaw)
        row[1].set_title(f"({letters[1]}) yaw {yaw}°, on the terrain")
    diagrams.note(figure, diagrams.terrain_source(data["rock"]))
    lines = panels[0, 1].get_legend_handles_labels()[0]
    figure.legend(handles=[*diagrams.key(), *lines], loc="lower center", ncols=3)
    return figure


def _seat(axes: Axes, data: Data, yaw: float) -> None:
    """The ground around the rock with the rock's outline and the direction of the shaking."""
    window = Window((-_AROUND, _AROUND), (-_AROUND, _AROUND))
    draw_ground(axes, relief(data["terrain"], window), window)
    corners = data["rock"]["vertex"].values[:, :2]
    outline = corners[ConvexHull(corners).vertices]
    axes.fill(*outline.T, facecolor="#f3c680", edgecolor=style.BASE, alpha=0.75, gid="rock")
    along = np.array([np.cos(np.radians(yaw)), -np.sin(np.radians(yaw))])
    middle = 0.78 * _AROUND * np.array([-1.0, 1.0]) * (0.8, 0.8)
    arrow: Any = {**style.BOTH_WAYS, "color": style.OVERTURNED, "lw": 2.2}
    axes.annotate("", tuple(middle + 0.7 * along), tuple(middle - 0.7 * along), arrowprops=arrow)
    axes.set(xlabel="x [m]", ylabel="y [m]")


def _responses(axes: Axes, data: Data, yaw: str) -> None:
    pga, ratios, outcomes = gridded(data[yaw])
    diagrams.cells(axes, pga, ratios, outcomes)
    flat = data["flat"]
    first = diagrams.first_overturning(flat, float(yaw))
    for colour, width in (("white", 3.0), ("black", 1.4)):
        axes.plot(first, flat["pgv_pga"].values, color=colour, lw=width, gid="flat",
                  label="first overturning on flat ground" if width < 2 else None)  # fmt: skip
    axes.set(xlabel=diagrams.PGA, ylabel=diagrams.RATIO)


def gridded(displacement: xr.Dataset) -> tuple[Array, Array, Array]:
    """Outcomes of the runs of one direction on their grid.

    Returns
    -------
    pga, ratios : ndarray [g], [s]
    outcomes : ndarray, shape (ratios, pga), as ``diagrams.grid`` gives them
    """
    verdicts = np.array([outcome.overturned for outcome in Outcome])
    table = displacement[["pga", "pgv_pga"]].to_dataframe()[["pga", "pgv_pga"]]
    table["overturned"] = verdicts[displacement["outcome"].values]
    wide = table.pivot(index="pgv_pga", columns="pga", values="overturned")
    return wide.columns.to_numpy(), wide.index.to_numpy(), wide.to_numpy()


def findings(data: Data) -> list[Finding]:
    """Compare with section 5.3."""
    share = {yaw: diagrams.toppled_share(gridded(data[yaw])[2]) for yaw in YAWS}
    flat = {yaw: diagrams.toppled_share(diagrams.grid(data["flat"], float(yaw))) for yaw in YAWS}
    left = {yaw: share[yaw] / flat[yaw] if flat[yaw] else math.nan for yaw in YAWS}
    result = {
        yaw: f"{100 * share[yaw]:.1f} % of the runs overturn, {100 * flat[yaw]:.1f} % on flat "
        f"ground: a factor of {left[yaw]:.2f}, on a surrogate terrain"
        for yaw in YAWS
    }
    return [
        Finding(
            "Fig. 14, section 5.3",
            "Surrounding pedestals much reduce the fragility at yaw 0°.",
            f"the toppled share falls to less than {MUCH:g} of that on flat ground",
            result["0"],
            by_rule(left["0"] < MUCH, left["0"]),
        ),
        Finding(
            "Fig. 14, section 5.3",
            "They reduce it only slightly at yaw 90°.",
            f"the toppled share falls, but stays at {MUCH:g} of that on flat ground at least",
            result["90"],
            by_rule(MUCH <= left["90"] < 1.0, left["90"]),
        ),
        Finding(
            "section 5.3",
            "The effect depends on the direction of the shaking.",
            f"the two factors differ by more than {APART:g}",
            f"{left['0']:.2f} at 0°, {left['90']:.2f} at 90°",
            by_rule(abs(left["0"] - left["90"]) > APART, *left.values()),
        ),
    ]
