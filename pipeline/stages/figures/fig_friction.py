"""Friction from almost none to no sliding: what the paper's section 6.3 says of it."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

from pipeline.drawing import style
from pipeline.stages.figures import diagrams
from pipeline.stages.figures.paper import Data, Finding, Source, by_rule
from vsr_core.arrays import Array

TITLE = "Friction and its thresholds"

ROCKS = {"cuboid_1x1x2": "1x1x2 m", "double_rock": "Double Rock, yaw 0°"}

SOURCES = {rock: Source(rock, "boundary", "friction_thresholds") for rock in ROCKS}

PLATEAU = 0.05
"""Largest change of the toppled share between two frictions on a plateau."""

SHOWN = (0.1, 0.2, 0.3, 0.5, 0.6, 2.0)
"""Frictions whose boundaries are drawn, each thinner than the one before."""


@style.styled
def draw(data: Data) -> Figure:
    """Draw the toppled share against friction, and boundaries of some frictions."""
    figure = Figure(figsize=(9.4, 3.9))
    margins = {"left": 0.065, "right": 0.985, "bottom": 0.25, "top": 0.92, "wspace": 0.26}
    whole, *panels = figure.subplots(1, 3, gridspec_kw=margins)
    for number, (rock, name) in enumerate(ROCKS.items()):
        look = {"color": style.SERIES[number], "marker": style.MARKERS[number], "ms": 4.5}
        friction = data[rock]["friction"].values
        whole.plot(friction, 100.0 * _shares(data[rock]), label=name, gid=rock, **look)
    whole.set(xlabel="friction of the pair", ylabel="runs that overturn [%]", xlim=(0.0, 2.1))
    whole.set_ylim(0.0, 100.0)
    whole.legend(loc="center right")
    whole.grid(visible=True)
    for axes, (rock, name) in zip(panels, ROCKS.items(), strict=True):
        _boundaries(axes, data[rock])
        axes.set_title(f"first overturning, {name}")
    handles, labels = panels[1].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=len(SHOWN),
                  title="friction of the pair (without a line nothing overturns)")  # fmt: skip
    return figure


def _boundaries(axes: Axes, responses: xr.Dataset) -> None:
    pga, ratios = responses["pga"].values, responses["pgv_pga"].values
    viridis, shades = colormaps["viridis"], np.linspace(0.0, 0.85, len(SHOWN))
    for place, friction in enumerate(responses["friction"].values.tolist()):
        if friction in SHOWN:
            number = SHOWN.index(friction)
            first = diagrams.first_overturning(responses, friction=place)
            axes.plot(first, ratios, color=viridis(shades[number]),
                      lw=7.0 - 1.1 * number, label=f"{friction:g}")  # fmt: skip
    axes.set(xlim=(0.0, pga[-1]), ylim=(0.0, ratios[-1]))
    axes.xaxis.set_major_locator(MultipleLocator(0.2))
    axes.set(xlabel=diagrams.PGA, ylabel=diagrams.RATIO)
    axes.grid(visible=True)


def _shares(responses: xr.Dataset) -> Array:
    """Toppled share at each friction."""
    each = range(responses.sizes["friction"])
    return np.array([diagrams.toppled_share(diagrams.grid(responses, friction=k)) for k in each])


def findings(data: Data) -> list[Finding]:
    """Compare with section 6.3."""
    shares = {rock: _shares(responses) for rock, responses in data.items()}
    steps = {rock: np.abs(np.diff(share)) for rock, share in shares.items()}
    known = np.concatenate(list(shares.values()))
    friction = data["double_rock"]["friction"].values
    ends = "; ".join(
        f"{name}: {100 * shares[rock][0]:.1f} % of the runs overturn at {friction[0]:g}, "
        f"{100 * shares[rock][-1]:.1f} % at {friction[-1]:g}"
        for rock, name in ROCKS.items()
    )
    jumps = "; ".join(
        f"{name}: by {100 * step.max():.0f} points from {friction[step.argmax()]:g} to "
        f"{friction[step.argmax() + 1]:g}, by {100 * step[-3:].max():.1f} at most from "
        f"{friction[-4]:g} on"
        for (rock, name), step in zip(ROCKS.items(), steps.values(), strict=True)
    )
    return [
        Finding(
            "section 6.3",
            "A rock is more fragile with a very high friction than with a very low one.",
            "both rocks overturn in more runs at the highest friction than at the lowest",
            ends,
            by_rule(all(share[-1] > share[0] for share in shares.values()), *known),
        ),
        Finding(
            "section 6.3",
            "Friction has thresholds: between them it matters little.",
            f"the toppled share jumps by more than {100 * PLATEAU:g} points between two "
            f"frictions, and changes by less between all from {friction[-4]:g} on",
            jumps,
            by_rule(
                all(step.max() > PLATEAU >= step[-3:].max() for step in steps.values()), *known
            ),
        ),
    ]
