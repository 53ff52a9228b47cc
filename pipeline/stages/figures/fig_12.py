"""Fig. 12: overturning of four cuboids on a flat pedestal."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from pipeline.drawing import style
from pipeline.stages.figures import diagrams
from pipeline.stages.figures.paper import Data, Finding, Source, by_rule
from vsr_core.arrays import Array
from vsr_core.fragility.boundary import locate

TITLE = "Overturning of cuboids on a flat pedestal"

SIZES = {
    "1x1x2": (1.0, 1.0, 2.0),
    "1x1x3": (1.0, 1.0, 3.0),
    "0.5x0.5x1": (0.5, 0.5, 1.0),
    "1x2x3": (1.0, 2.0, 3.0),
}
"""Lengths along x, y and z [m], in the order of the paper's panels b to e."""

SOURCES = {name: Source(f"cuboid_{name}", "boundary") for name in SIZES}

MOST_ROWS = 0.9
"""Share of the rows in which a boundary must lie lower."""

ALIKE = 0.01
"""Share of cells that may differ where depth is said not to matter."""

CLOSE = 0.03
"""Relative distance from Housner's equation that counts as agreement."""

_TALL = 3.75  # m, of panel a
_OBLIQUE = 0.42 * np.array([np.cos(np.radians(35.0)), np.sin(np.radians(35.0))])


@style.styled
def draw(data: Data) -> Figure:
    """Draw the cuboids and a response diagram of each."""
    figure = Figure(figsize=(7.6, 9.2))
    top = figure.add_axes((0.08, 0.79, 0.89, 0.18))
    _cuboids(top)
    margins = {"left": 0.085, "right": 0.975, "bottom": 0.1, "top": 0.755}
    panels = figure.subplots(2, 2, gridspec_kw={**margins, "hspace": 0.2, "wspace": 0.16})
    for axes, letter, (name, size) in zip(panels.flat, "bcde", SIZES.items(), strict=True):
        responses = data[name]
        pga, ratios = responses["pga"].values, responses["pgv_pga"].values
        diagrams.cells(axes, pga, ratios, diagrams.grid(responses))
        exact = diagrams.housner(size[0], size[2], ratios, pga[-1])
        axes.plot(exact, ratios, color="black", lw=1.2, gid="housner", label="Housner's equation")
        axes.set_title(f"({letter}) {name} m")
    diagrams.labelled(panels)
    handles = [*diagrams.key(), *panels.flat[0].get_legend_handles_labels()[0]]
    figure.legend(handles=handles, loc="lower center", ncols=3, bbox_to_anchor=(0.5, 0.008))
    return figure


def _cuboids(axes: Axes) -> None:
    """Panel a: the four blocks, x to the right and z up; the shaking is along x."""
    left = 0.3
    for name, size in SIZES.items():
        _block(axes, left, size)
        across = size[0] + size[1] * _OBLIQUE[0]
        text = f"{name} m"
        axes.text(left + 0.5 * size[0], -0.18, text, ha="center", va="top", size=8)
        left += across + 1.5
    arrow = {"arrowstyle": "-|>", "color": style.OVERTURNED, "lw": 1.6, "shrinkA": 0, "shrinkB": 0}
    for tip, text in (((1.2, 0.0), "x, shaking"), ((0.0, 1.2), "z"), (tuple(2.2 * _OBLIQUE), "y")):
        foot = np.array([left, 0.2])
        look = arrow if text.startswith("x") else {**arrow, "color": style.INK, "lw": 0.9}
        axes.annotate("", tuple(foot + tip), tuple(foot), arrowprops=look)
        right, up = foot + 1.08 * np.array(tip) + (0.05, 0.0)
        axes.text(right, up, text, size=8, va="center")
    axes.set(xlim=(0.0, left + 2.6), ylim=(-0.75, _TALL), aspect="equal")
    axes.set_axis_off()
    axes.set_title("(a) cuboids, x x y x z")


def _block(axes: Axes, left: float, size: tuple[float, float, float]) -> None:
    wide, deep, tall = size
    back = deep * _OBLIQUE
    front = np.array([(left, 0), (left + wide, 0), (left + wide, tall), (left, tall)])
    side = np.array([front[1], front[1] + back, front[2] + back, front[2]])
    lid = np.array([front[3], front[2], front[2] + back, front[3] + back])
    for face, shade in ((front, "#cfcac2"), (side, "#a49d92"), (lid, "#e5e2dc")):
        axes.add_patch(Polygon(face, facecolor=shade, edgecolor=style.INK, lw=0.8))


def findings(data: Data) -> list[Finding]:
    """Compare with section 5.1."""
    outcomes = {name: diagrams.grid(data[name]) for name in SIZES}
    first = {name: diagrams.first_overturning(data[name]) for name in SIZES}
    share = {name: 100.0 * diagrams.toppled_share(outcomes[name]) for name in SIZES}

    def weaker(one: str, other: str, claim: str) -> Finding:
        rows = diagrams.lower_in(first[one], first[other])
        return Finding(
            "Fig. 12, section 5.1",
            claim,
            f"{one} m overturns in more runs than {other} m, and its boundary lies lower in "
            f"{100 * MOST_ROWS:g} % of the rows",
            f"{share[one]:.1f} % of the runs against {share[other]:.1f} %; lower in "
            f"{100 * rows:.0f} % of the rows",
            by_rule(
                share[one] > share[other] and rows >= MOST_ROWS, share[one], share[other], rows
            ),
        )

    apart = diagrams.differing(outcomes["1x1x3"], outcomes["1x2x3"])
    islands = {name: _islands(data[name]["pga"].values, outcomes[name]) for name in SIZES}
    off = np.concatenate(
        [diagrams.from_housner(data[name], size[0], size[2]) for name, size in SIZES.items()]
    )
    median = diagrams.middle(off)
    return [
        weaker("1x1x3", "1x1x2", "The slenderer of two cuboids is more fragile."),
        weaker("0.5x0.5x1", "1x1x2", "The smaller of two similar cuboids is more fragile."),
        Finding(
            "Fig. 12, section 5.1",
            "Depth across the shaking does not matter, but for a few cells.",
            f"at most {100 * ALIKE:g} % of the cells of 1x1x3 m and 1x2x3 m end differently",
            f"{100 * apart:.2f} % differ",
            by_rule(apart <= ALIKE, apart),
        ),
        Finding(
            "Fig. 12, caption",
            "Within the toppled zone some blocks stand: the returning motion pulls them back.",
            "at least one such cell in one diagram",
            ", ".join(f"{name} m: {number}" for name, number in islands.items()) + " cells",
            any(islands.values()),
        ),
        Finding(
            "section 2.3",
            "Simulated cuboids rock as Housner's equation says.",
            f"median distance of the boundaries from Housner's at most {100 * CLOSE:g} %",
            f"{100 * median:.2f} % in {len(off)} rows of all four",
            by_rule(median <= CLOSE, median),
        ),
    ]


def _islands(pga: Array, outcomes: Array) -> int:
    return int(locate(pga, outcomes).islands.sum())
