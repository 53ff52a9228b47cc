"""Fig. 8: first overturning of the wooden block W2, as stated and ten times as large."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.drawing import style
from pipeline.stages.figures import diagrams
from pipeline.stages.figures.diagrams import RATIO
from pipeline.stages.figures.paper import Data, Finding, Source, by_rule
from pipeline.stages.fragility.summary import SEARCHED
from vsr_core.arrays import Array

TITLE = "First overturning of the wooden block W2"

SOURCES = {"stated": Source("w2_5.5cm", "boundary"), "larger": Source("w2_55cm", "boundary")}

SIZES = {"stated": (0.011, 0.055), "larger": (0.11, 0.55)}
"""Width along the shaking and height [m]."""

_LOOKS = {
    "stated": ("as stated, 1.1 x 1.1 x 5.5 cm", style.SERIES[0], "o"),
    "larger": ("ten times as large, 11 x 11 x 55 cm", style.SERIES[1], "s"),
}

SHORT = 0.08
"""PGV/PGA below which the published curve rises [s]."""

RISES = 1.3
"""Factor from the longest to the shortest pulse from which on a curve rises."""

CLOSE = 0.03
"""Relative distance from Housner's equation that counts as agreement."""


@style.styled
def draw(data: Data) -> Figure:
    """Draw the first-overturning PGA over PGV/PGA, with Housner's curves."""
    figure = Figure(figsize=(6.4, 5.4), layout="constrained")
    axes = figure.add_subplot()
    for name in SIZES:
        _curve(axes, data[name], name)
    axes.axvline(SHORT, color=style.FAINT, lw=0.8, ls=":")
    axes.text(SHORT + 0.002, 0.485, f"{SHORT:g} s", color="#5a5a5a", size=8, va="top")
    axes.set(xlim=(0.05, 0.35), ylim=(0.05, 0.5), xlabel=RATIO)
    axes.set_ylabel("PGA of the first overturning [g]")
    axes.grid(visible=True)
    figure.legend(loc="outside lower center", ncols=1)
    return figure


def _curve(axes: Axes, responses: xr.Dataset, name: str) -> None:
    text, colour, marker = _LOOKS[name]
    ratios, pga = responses["pgv_pga"].values, responses["pga"].values
    first = diagrams.first_overturning(responses)
    look: Any = {"color": colour, "ls": "", "marker": marker, "ms": 3.2, "gid": f"{name}-first"}
    axes.plot(ratios, first, label=f"{text}: simulated", **look)
    exact = diagrams.housner(*SIZES[name], ratios, pga[-1])
    axes.plot(
        ratios,
        exact,
        color=colour,
        lw=1.1,
        label=f"{text}: Housner's equation, tried every {pga[-1] / diagrams.TRIED:.3g} g",
        gid=f"{name}-housner",
    )


def findings(data: Data) -> list[Finding]:
    """Compare with section 4.2."""
    found = [
        Finding(
            "Fig. 8, section 4.2",
            f"For PGV/PGA above {SHORT:g} s the simulated curve lies within the 95 % band of "
            "Purvance's physical tests; below, above it.",
            "share of the rows within that band",
            "The coefficients of the band and the physical results are in no source that could be "
            "read. What can be computed is below.",
            None,
        )
    ]
    for name, text in (("stated", "as stated, 5.5 cm high"), ("larger", "ten times as large")):
        found.append(_rise(data[name], text))
    off = np.concatenate([diagrams.from_housner(data[name], *SIZES[name]) for name in SIZES])
    median = diagrams.middle(off)
    found.append(
        Finding(
            "section 2.3",
            "Simulated blocks rock as Housner's equation says (Ma et al. 2018, as cited).",
            f"median distance of the boundaries from Housner's at most {100 * CLOSE:g} %",
            f"{100 * median:.2f} % in {len(off)} rows of both blocks",
            by_rule(median <= CLOSE, median),
        )
    )
    return found


def _rise(responses: xr.Dataset, text: str) -> Finding:
    """How much higher the boundary lies at the shortest pulse than at the longest."""
    ratios, first = _rows(responses)
    high = f"more than {responses.attrs[SEARCHED[1]]:.2f}"
    start, end = (f"{pga:.3f}" if np.isfinite(pga) else high for pga in (first[0], first[-1]))
    rise = first[0] / first[-1]
    factor = f": a factor of {rise:.2f}" if np.isfinite(rise) else ""
    return Finding(
        "Fig. 8, section 4.2",
        f"The first-overturning PGA rises steeply below {SHORT:g} s (block {text}).",
        f"at the shortest pulse at least {RISES:g} times that at the longest",
        f"{start} g at {ratios[0]:.2g} s and {end} g at {ratios[-1]:.2g} s{factor}",
        by_rule(not np.isfinite(first[0]) or rise >= RISES, first[-1]),
    )


def _rows(responses: xr.Dataset) -> tuple[Array, Array]:
    return responses["pgv_pga"].values, diagrams.first_overturning(responses)
