"""Figures of the validation: predicted probabilities against what was observed on the table."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.drawing.style import FAINT, INK, MARKERS, OVERTURNED, SERIES, UPRIGHT, styled
from pipeline.stages.studies.validation import predictions
from pipeline.stages.studies.validation.predictions import Origin, Predictions
from pipeline.stages.studies.validation.recorded_tests import Tests
from vsr_core.validation import curves, scores


def _panels(tests: Tests, heights: tuple[float, ...]) -> tuple[Figure, Any]:
    """Panels of these heights for each specimen that has outcomes; they say so if there is none.

    The panels are an array on (height, specimen).
    """
    count = max(len(tests.observed), 1)
    figure = Figure(figsize=(4.6 * count, sum(heights)), layout="constrained")
    panels = figure.subplots(
        len(heights), count, squeeze=False, sharex="col", height_ratios=heights
    )
    if not tests.observed:
        place = panels[0, 0].transAxes
        panels[0, 0].text(0.5, 0.5, "no outcomes to compare with", ha="center", transform=place)
    return figure, panels


def _shares(axes: Axes, specimen: int, margin: float) -> None:
    """Shares against shares, with the diagonal."""
    axes.plot([0, 1], [0, 1], color=FAINT, lw=0.8)
    ends = (-margin, 1.0 + margin)
    axes.set(xlim=ends, ylim=ends, title=f"specimen {specimen}")


def _legend_under(axes: Axes, columns: int, **given: Any) -> None:
    """A legend below the label of x, where it covers nothing that is drawn."""
    # the layout makes room; the anchor is a share of the panel's height, too little on a low one
    inch = axes.get_window_extent().height / axes.figure.dpi
    below = (0.5, -0.5 / inch)
    axes.legend(loc="upper center", bbox_to_anchor=below, ncols=columns, **given)


@styled
def reliability(tests: Tests, made: Predictions) -> Figure:
    """Share of tests that overturned against predicted probability, in classes, and their sizes."""
    figure, panels = _panels(tests, (4.2, 1.3))
    known = list(predictions.compared(tests))
    for (above, below), (row, specimen, observed) in zip(panels.T, known, strict=False):
        _shares(above, specimen, 0.03)
        above.set_ylabel("share of tests that overturned")
        below.set(xlabel="predicted probability of overturning", ylabel="tests", yscale="log")
        kinds = (
            ("priors only, all tests", made.share[row], np.ones(len(observed), dtype=bool)),
            ("calibrated, other half", made.calibrated[row], ~made.half),
        )
        for k, (label, probability, inside) in enumerate(kinds):
            found = scores.reliability(observed[inside], probability[inside])
            shift = 0.008 * (2 * k - 1)
            above.errorbar(
                found.predicted + shift,
                found.observed,
                yerr=np.clip([found.observed - found.low, found.high - found.observed], 0.0, None),
                fmt=MARKERS[k],
                color=SERIES[k],
                ms=4,
                lw=0.8,
                label=label,
            )
            below.bar(found.predicted + shift, found.count, 0.014, bottom=0.5, color=SERIES[k])
        below.set_ylim(0.5, None)
    if known:
        handles = panels[0, 0].get_legend_handles_labels()
        figure.legend(*handles, loc="outside lower center", ncols=2)
    return figure


@styled
def roc(tests: Tests, made: Predictions) -> Figure:
    """Tests correctly against wrongly predicted to overturn, over all limits of probability."""
    from sklearn.metrics import roc_auc_score, roc_curve

    figure, panels = _panels(tests, (5.2,))
    for axes, (row, specimen, observed) in zip(
        panels[0], predictions.compared(tests), strict=False
    ):
        _shares(axes, specimen, 0.02)
        names = [
            f"share of {one} tests predicted to overturn" for one in ("balanced", "overturned")
        ]
        axes.set(xlabel=names[0], ylabel=names[1])
        points = 0
        for k, (name, known) in enumerate(predictions.predictors(tests, made, row).items()):
            sides, probability = known.sides, known.probability
            if probability is not None:
                false, right, _ = roc_curve(observed, probability)
                area = roc_auc_score(observed, probability)
                text = f"{name}, area {area:.3f}"
                axes.plot(false, right, color=SERIES[k % 6], lw=1.2, label=text)
            elif known.origin is not Origin.CONSTANT:
                place = sides[~observed].mean(), sides[observed].mean()
                look: Any = {"mfc": "none", "color": INK, "lw": 0, "label": name}
                axes.plot(*place, MARKERS[points % 6], ms=5, **look)
                points += 1
        _legend_under(axes, 2, fontsize=6.5)
    return figure


@styled
def fragility(tests: Tests, made: Predictions) -> Figure:
    """Fragility curves of the experiment and of the ensemble, over PGA and PGV."""
    known = list(predictions.compared(tests))
    figure = Figure(figsize=(9.2, 3.8 * max(len(known), 1)), layout="constrained")
    motions = np.array(tests.motion)
    pga, ratio = np.array(tests.pga), np.array(tests.pgv_pga)
    measures = (("peak ground acceleration [g]", pga), ("peak ground velocity [g s]", pga * ratio))
    for at, (row, specimen, observed) in enumerate(known):
        for column, (label, values) in enumerate(measures):
            axes = figure.add_subplot(len(known), 2, 2 * at + column + 1)
            grid = np.geomspace(values.min(), values.max(), 80)
            for share, name, colour in (
                (observed.astype(np.float64), "experiment", OVERTURNED),
                (made.share[row], "ensemble, priors only", UPRIGHT),
            ):
                found = curves.curve(values, share, motions, grid)
                axes.fill_between(grid, found.low, found.high, color=colour, alpha=0.18, lw=0)
                text = f"{name}, median {found.median:.3g}"
                axes.plot(grid, found.probability, color=colour, lw=1.4, label=text)
            axes.set_xscale("log")
            axes.set(xlabel=label, ylabel="probability of overturning", ylim=(-0.02, 1.02))
            axes.set_title(f"specimen {specimen}")
            _legend_under(axes, 1)
    return figure


@styled
def map_of_tests(tests: Tests, made: Predictions) -> Figure:
    """Every test over PGV/PGA and PGA: what was observed, and the probability it had."""
    figure = Figure(figsize=(5.0 * len(tests.specimens), 4.5), layout="constrained")
    drawn = None
    for row, specimen in enumerate(tests.specimens):
        axes = figure.add_subplot(1, len(tests.specimens), row + 1)
        known = specimen in tests.observed
        observed = np.array(tests.observed[specimen] if known else [0] * len(tests.number)) == 1
        for side, marker, name in ((False, "o", "balanced"), (True, "^", "overturned")):
            inside = observed == side
            if not inside.any():
                continue
            drawn = axes.scatter(
                np.array(tests.pgv_pga)[inside],
                np.array(tests.pga)[inside],
                c=made.share[row][inside],
                cmap="coolwarm",
                vmin=0,
                vmax=1,
                marker=marker,
                s=18,
                lw=0.3,
                edgecolor=INK,
                label=name if known else "predicted only",
            )
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set(title=f"specimen {specimen}", xlabel="PGV/PGA [s]", ylabel="PGA [g]")
        _legend_under(axes, 2)
    if drawn is not None:
        figure.colorbar(drawn, ax=figure.axes, label="predicted probability of overturning")
    return figure
