"""Figures of the validation: predicted probabilities against what was observed on the table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.drawing.style import FAINT, INK, MARKERS, OVERTURNED, SERIES, UPRIGHT, styled
from pipeline.stages.studies.validation import predictions
from pipeline.stages.studies.validation.predictions import Origin, Predictions
from pipeline.stages.studies.validation.recorded_tests import Tests
from vsr_core.validation import curves, scores


def _panels(tests: Tests) -> tuple[Figure, list[Axes]]:
    """A panel for each specimen that has outcomes; one that says so if there is none."""
    count = max(len(tests.observed), 1)
    figure = Figure(figsize=(4.6 * count, 4.2), layout="constrained")
    axes = [figure.add_subplot(1, count, k + 1) for k in range(count)]
    if not tests.observed:
        place = axes[0].transAxes
        axes[0].text(0.5, 0.5, "no outcomes to compare with", ha="center", transform=place)
    return figure, axes


def _square(axes: Axes, specimen: int, margin: float, names: Sequence[str]) -> None:
    """Shares against shares, with the diagonal."""
    axes.plot([0, 1], [0, 1], color=FAINT, lw=0.8)
    ends = (-margin, 1.0 + margin)
    axes.set(xlim=ends, ylim=ends, xlabel=names[0], ylabel=names[1], aspect="equal")
    axes.set_title(f"specimen {specimen}")


@styled
def reliability(tests: Tests, made: Predictions) -> Figure:
    """Share of tests that overturned against predicted probability, in classes.

    Parameters
    ----------
    tests : Tests
    made : Predictions

    Returns
    -------
    Figure
    """
    figure, panels = _panels(tests)
    for axes, (row, specimen, observed) in zip(panels, predictions.compared(tests), strict=False):
        names = ("predicted probability of overturning", "share of tests that overturned")
        _square(axes, specimen, 0.03, names)
        kinds = (
            ("priors only, all tests", made.share[row], np.ones(len(observed), dtype=bool)),
            ("calibrated, other half", made.calibrated[row], ~made.half),
        )
        for k, (label, probability, inside) in enumerate(kinds):
            found = scores.reliability(observed[inside], probability[inside])
            shift = 0.008 * (2 * k - 1)
            axes.errorbar(
                found.predicted + shift,
                found.observed,
                yerr=np.clip([found.observed - found.low, found.high - found.observed], 0.0, None),
                fmt=MARKERS[k],
                color=SERIES[k],
                ms=4,
                lw=0.8,
                label=label,
            )
            for x, y, n in zip(found.predicted, found.observed, found.count, strict=True):
                axes.annotate(
                    str(n), (x + shift, y), xytext=(4, -9 + 14 * k), fontsize=6.5,
                    textcoords="offset points", color=SERIES[k],
                )  # fmt: skip
        axes.legend(loc="upper left")
    return figure


@styled
def roc(tests: Tests, made: Predictions) -> Figure:
    """Tests correctly against wrongly predicted to overturn, over all limits of probability.

    Parameters
    ----------
    tests : Tests
    made : Predictions

    Returns
    -------
    Figure
    """
    from sklearn.metrics import roc_auc_score, roc_curve

    figure, panels = _panels(tests)
    for axes, (row, specimen, observed) in zip(panels, predictions.compared(tests), strict=False):
        names = ("balanced tests", "overturned tests")
        _square(axes, specimen, 0.02, [f"share of {one} predicted to overturn" for one in names])
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
        axes.legend(loc="lower right", fontsize=6.5)
    return figure


@styled
def fragility(tests: Tests, made: Predictions) -> Figure:
    """Fragility curves of the experiment and of the ensemble, over PGA and PGV.

    Parameters
    ----------
    tests : Tests
    made : Predictions

    Returns
    -------
    Figure
    """
    known = list(predictions.compared(tests))
    figure = Figure(figsize=(9.2, 3.4 * max(len(known), 1)), layout="constrained")
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
            axes.legend(loc="upper left")
    return figure


@styled
def map_of_tests(tests: Tests, made: Predictions) -> Figure:
    """Every test over PGV/PGA and PGA: what was observed, and the probability it had.

    Parameters
    ----------
    tests : Tests
    made : Predictions

    Returns
    -------
    Figure
    """
    figure = Figure(figsize=(5.0 * len(tests.specimens), 4.2), layout="constrained")
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
        axes.legend(loc="lower left")
    if drawn is not None:
        figure.colorbar(drawn, ax=figure.axes, label="predicted probability of overturning")
    return figure
