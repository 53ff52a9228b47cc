"""Table 1: how trajectories depend on the shaking, here and as published."""

from __future__ import annotations

from matplotlib.figure import Figure

from pipeline.drawing import style
from pipeline.stages.datasets.displaced_runs import overturned_runs
from pipeline.stages.datasets.stored_runs import in_words, ways
from pipeline.stages.displacement.correlation_figures import TABLE_1, power
from pipeline.stages.figures import diagrams
from pipeline.stages.figures.fig_15 import SOURCES as SOURCES
from pipeline.stages.figures.paper import Data, Finding, by_rule
from vsr_core.displacement.correlation import Correlation, correlations

TITLE = "Correlation of displacement with ground motion"

NAMES = {
    "trajectory_length": "mean trajectory length",
    "largest_speed": "mean largest velocity",
    "terminal_distance": "mean terminal distance",
    "pga": "PGA",
    "pgv_pga": "PGV/PGA",
}

SIGNIFICANT = 1e-3

_LEFT = (0.02, 0.4, 0.56, 0.72, 0.88)


@style.styled
def draw(data: Data) -> Figure:
    """Set the table, with the published numbers beside those computed."""
    figure = Figure(figsize=(6.8, 2.8))
    for left, text in zip(_LEFT[1::2], ("R²", "p of a slope of zero"), strict=True):
        figure.text(left, 0.85, text, weight="bold", size=9)
    for left, text in zip(_LEFT[1:], ("here", "paper", "here", "paper"), strict=True):
        figure.text(left, 0.76, text, size=9)
    _rule(figure, 0.73)
    for number, found in enumerate(correlations(overturned_runs(data["displacement"]))):
        height = 0.64 - 0.1 * number
        r2, p = TABLE_1[found.statistic, found.regressor]
        line = found.line
        row = (f"{NAMES[found.statistic]} on {NAMES[found.regressor]}", f"{line.r2:.2f}",
               f"{r2:.2f}", power(line.p), power(p))  # fmt: skip
        for left, text in zip(_LEFT, row, strict=True):
            figure.text(left, height, text, size=9)
    _rule(figure, 0.09)
    runs = data["displacement"]
    moved = in_words(ways(runs["outcome"].values, runs["movement"].values))
    diagrams.note(figure, f"{diagrams.terrain_source(data['rock'])}; {moved}")
    return figure


def _rule(figure: Figure, height: float) -> None:
    axes = figure.add_axes((0.02, height, 0.96, 0.01))
    axes.axhline(0.5, color=style.INK, lw=0.8)
    axes.set_axis_off()


def findings(data: Data) -> list[Finding]:
    """Compare each regression with the published one."""
    return [_compared(found) for found in correlations(overturned_runs(data["displacement"]))]


def _compared(found: Correlation) -> Finding:
    r2, p = TABLE_1[found.statistic, found.regressor]
    line = found.line
    return Finding(
        "Table 1, Fig. 17",
        f"{NAMES[found.statistic].capitalize()} grows with {NAMES[found.regressor]}: "
        f"R² {r2:.2f}, p = {power(p)}.",
        f"the line rises, and p is below {SIGNIFICANT:g}",
        found.reason
        or f"slope {line.slope:.2g}, R² {line.r2:.2f}, p = {power(line.p)}, "
        f"{line.n_groups} ensembles, on a surrogate terrain",
        by_rule(line.slope > 0.0 and line.p < SIGNIFICANT, line.slope, line.p),
    )
