"""Fig. 13: Double Rock on a flat pedestal, shaken from twelve directions."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from scipy.spatial import ConvexHull
from scipy.stats import spearmanr

from pipeline.drawing import style
from pipeline.stages.figures import diagrams
from pipeline.stages.figures.paper import Data, Finding, Source, by_rule
from pipeline.stages.fragility.summary import static_pga
from vsr_core.arrays import Array
from vsr_core.fragility.boundary import locate

TITLE = "Double Rock on a flat pedestal, from twelve directions"

SOURCES = {
    "responses": Source("double_rock", "responses"),
    "fragility": Source("double_rock", "fragility"),
    "rock": Source("double_rock", "rock"),
}

DIFFERENT = 0.02
"""Share of cells from which on two directions differ."""

CLUSTER = 5
"""Cells that make a cluster, not a stray outcome."""

ROWS = 3
"""Rows that show the same."""

_PANELS = 3, 4


@style.styled
def draw(data: Data) -> Figure:
    """Draw the rock from above with the directions, and a response diagram of each."""
    responses, fragility = data["responses"], data["fragility"]
    figure = Figure(figsize=(diagrams.WIDTH, 11.2))
    _plan(figure.add_axes((0.28, 0.71, 0.44, 0.24)), data["rock"], responses["yaw"].values)
    margins = {"left": 0.065, "right": 0.99, "bottom": 0.085, "top": 0.675}
    panels = figure.subplots(
        *_PANELS, sharex=True, sharey=True,
        gridspec_kw={**margins, "hspace": 0.17, "wspace": 0.07},
    )  # fmt: skip
    pga, ratios = responses["pga"].values, responses["pgv_pga"].values
    for place, (axes, yaw) in enumerate(zip(panels.flat, responses["yaw"].values, strict=False)):
        diagrams.cells(axes, pga, ratios, diagrams.grid(responses, float(yaw)))
        diagrams.logistic(axes, fragility, place, color="white", lw=2.6)
        diagrams.logistic(axes, fragility, place, color="black", lw=1.2, gid="logistic",
                          label="logistic regression")  # fmt: skip
        axes.set_title(f"yaw {yaw:g}°")
    for axes in panels.flat[responses.sizes["yaw"] :]:
        axes.set_axis_off()
    panels[0, 0].xaxis.set_major_locator(MaxNLocator(5, prune="both"))
    diagrams.labelled(panels)
    diagrams.note(figure, data["rock"].attrs["shape_source"])
    lines = panels[0, 0].get_legend_handles_labels()[0]
    figure.legend(handles=[*diagrams.key(), *lines], loc="lower center", ncols=3)
    return figure


def _plan(axes: Axes, rock: xr.Dataset, yaws: Array) -> None:
    """Panel a: the rock and its base from above, and where the ground moves first at each yaw."""
    points = rock["surface_vertex"].values[:, :2].astype(float)
    outline = points[ConvexHull(points).vertices]
    axes.fill(*outline.T, facecolor="#d9d5cd", edgecolor=style.INK, lw=0.8)
    axes.fill(*rock["base_polygon"].values.T, facecolor="none", edgecolor=style.BASE, lw=1.4)
    x, y = rock["base_polygon"].values.mean(axis=0)
    axes.text(x, y, "base", size=7.5, ha="center", va="center", color="#8a5600")
    reach = np.linalg.norm(outline, axis=1).max()
    for yaw in yaws:
        turn = -math.radians(float(yaw))  # the rock is turned, the ground moves along +x
        unit = np.array([math.cos(turn), math.sin(turn)])
        arrow = {"arrowstyle": "-|>", "color": style.OVERTURNED, "lw": 1.2, "shrinkA": 0}
        axes.annotate("", tuple(1.32 * reach * unit), tuple(1.06 * reach * unit), arrowprops=arrow)
        x, y = 1.5 * reach * unit
        axes.text(x, y, f"{yaw:g}°", ha="center", va="center", size=8)
    axes.set(xlim=(-1.7 * reach, 1.7 * reach), ylim=(-1.65 * reach, 1.65 * reach))
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set_title("(a) the rock from above; first motion of the ground at each yaw")


def findings(data: Data) -> list[Finding]:
    """Compare with sections 5.2 and 4.3."""
    responses = data["responses"]
    pga = responses["pga"].values
    yaws = [float(yaw) for yaw in responses["yaw"].values]
    grids = {yaw: diagrams.grid(responses, yaw) for yaw in yaws}
    share = {yaw: 100.0 * diagrams.toppled_share(grids[yaw]) for yaw in yaws}
    opposite = {yaw: diagrams.differing(grids[yaw], grids[yaw + 180.0]) for yaw in (0.0, 90.0)}
    result = "; ".join(f"{yaw:g}° and {yaw + 180:g}°: {100 * value:.1f} % of the cells"
                     for yaw, value in opposite.items())  # fmt: skip
    sizes = {yaw: sorted(locate(pga, grids[yaw]).cluster_sizes.tolist())[::-1] for yaw in yaws}
    return [
        Finding(
            "Fig. 13, section 5.2",
            "Opposite directions of shaking give different responses.",
            f"more than {100 * DIFFERENT:g} % of the cells differ, for 0° and 180° and for 90° "
            "and 270°",
            result,
            by_rule(min(opposite.values()) > DIFFERENT, *opposite.values()),
        ),
        Finding(
            "Fig. 13, section 5.2",
            "The rock is less fragile at yaw 90° than at 0° and at 180°.",
            "fewer runs overturn at 90° than at either",
            f"{share[90.0]:.1f} % overturn at 90°, {share[0.0]:.1f} % at 0°, "
            f"{share[180.0]:.1f} % at 180°",
            by_rule(share[90.0] < min(share[0.0], share[180.0]), *share.values()),
        ),
        Finding(
            "section 6.1",
            "At full size, too, yaw 0° is more fragile than 270°.",
            "more runs overturn at 0°",
            f"{share[0.0]:.1f} % against {share[270.0]:.1f} %",
            by_rule(share[0.0] > share[270.0], share[0.0], share[270.0]),
        ),
        _cluster(sizes),
        _returns({yaw: before_balanced(grid) for yaw, grid in grids.items()}),
        _logistic(data["fragility"], yaws),
        _static(data["rock"], yaws, share),
    ]


def _cluster(sizes: dict[float, list[int]]) -> Finding:
    """Toppled cells apart from the main boundary at yaw 300."""
    apart = {yaw: [size for size in found[1:] if size >= CLUSTER] for yaw, found in sizes.items()}
    others = [f"{yaw:g}° ({', '.join(map(str, found))} cells)" for yaw, found in apart.items()
              if found and yaw != 300.0]  # fmt: skip
    here = ", ".join(map(str, apart[300.0])) or "none"
    return Finding(
        "Fig. 13f, section 5.2",
        "At yaw 300° a small cluster of toppled runs is separated from the main boundary.",
        f"a second cluster of at least {CLUSTER} cells, which not even touches at a corner",
        f"beside the main one at 300°: {here}"
        + (" cells" if apart[300.0] else "")
        + f"; at other yaws: {', '.join(others) or 'none'}",
        bool(apart[300.0]),
    )


def before_balanced(outcomes: Array) -> tuple[int, int]:
    """Count toppled cells below balanced ones of the same row that are between toppled ones.

    Parameters
    ----------
    outcomes : ndarray, shape (rows, columns), 1 overturned, 0 not, -1 undecided

    Examples
    --------
    >>> before_balanced(np.array([[0, 1, 1, 0, 1], [0, 0, 1, 1, 1], [0, 1, 0, 0, 0]]))
    (1, 2)
    """
    toppled, balanced = outcomes == 1, outcomes == 0
    below = np.cumsum(toppled, axis=1)  # toppled up to here
    between = balanced & (below > 0) & (below < below[:, -1:])
    cells = np.where(between, below, 0).max(axis=1)
    return int((cells > 0).sum()), int(cells.sum())


def _returns(found: dict[float, tuple[int, int]]) -> Finding:
    """Balanced cells between toppled ones at yaw 300."""
    rows, cells = found[300.0]
    more = [f"{yaw:g}°" for yaw, (_, number) in found.items() if number > cells]
    return Finding(
        "Fig. 13f, section 5.2",
        "At yaw 300° balanced runs lie between a few toppled ones and the main toppled zone.",
        f"along rows of one PGV/PGA, at least {CLUSTER} toppled runs in {ROWS} rows or more have a "
        "balanced one at a larger PGA, and a toppled one beyond it",
        f"{cells} such runs in {rows} rows at 300°; more at {', '.join(more) or 'no other yaw'}",
        cells >= CLUSTER and rows >= ROWS,
    )


def _logistic(fragility: xr.Dataset, yaws: list[float]) -> Finding:
    fit = fragility.isel(friction=0)
    best = [str(name) for name in fit["recommended"].values]
    loss = fit.isel(yaw=yaws.index(300.0)).set_index(model="model")["log_loss"]
    result = ", ".join(f"{name} {float(loss.sel(model=name)):.4f}" for name in loss["model"].values)
    return Finding(
        "section 5.2",
        "Logistic regression is not the right model at yaw 300°.",
        "another model is recommended there for its cross-validated log loss",
        f"log loss at 300°: {result}; recommended there: {best[yaws.index(300.0)]}, and the "
        f"logistic at {best.count('logistic')} of {len(best)} yaws",
        best[yaws.index(300.0)] != "logistic",
    )


def _static(rock: xr.Dataset, yaws: list[float], share: dict[float, float]) -> Finding:
    tipping = static_pga(rock, np.array(yaws))
    found = spearmanr(tipping, [share[yaw] for yaw in yaws])
    return Finding(
        "section 4.3",
        "A rock is more fragile the smaller its contact angle along the shaking.",
        "over the twelve yaws the toppled share falls with the static tipping acceleration, "
        "p below 0.05",
        f"rank correlation {found.statistic:.2f}, p = {found.pvalue:.2g}",
        by_rule(found.statistic < 0.0 and found.pvalue < 0.05, found.pvalue),
    )
