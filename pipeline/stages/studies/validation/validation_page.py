"""Tables and figures of predictions of shake-table tests against what was observed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.config.priors_schema import ShakeTableConfig
from pipeline.drawing.style import FAINT, INK, MARKERS, OVERTURNED, SERIES, UPRIGHT, styled
from pipeline.stages.studies.validation.predictions import (
    Compared,
    Origin,
    Predictions,
    compared,
    predictors,
)
from pipeline.stages.studies.validation.recorded_tests import Tests
from pipeline.stages.uncertainty.unknowns import in_words, inset, uniform
from vsr_core.validation import scores

_SCORES = ["specimen", "predictor", "subset", "n", "accuracy", "balanced_accuracy", "f1",
           "matthews", "brier", "log_loss", "spiegelhalter_z", "intercept", "slope",
           "spiegelhalter_p", "mcnemar_p"]  # fmt: skip

_FAILED = ["specimen", "test", "ground_motion", "pga_g", "pgv_pga_s", "happened", "share"]

_CLASSES = 4
"""Classes of PGA and of PGV/PGA, with equally many tests."""


def scored(tests: Tests, made: Predictions) -> pd.DataFrame:
    """Scores of every predictor of each specimen with outcomes, on each subset of tests."""
    rows = []
    for one in compared(tests, made):
        specimen, observed, half = one.specimen, one.observed, one.made.half
        series = np.array(one.tests.series)
        names = [name for name in dict.fromkeys(one.tests.series) if name]
        subsets = {
            "all": np.ones(len(half), dtype=bool),
            "calibration half": half,
            "other half": ~half,
            **{f"series {name}": series == name for name in names},
        }
        known = predictors(one)
        ensemble = known["ensemble"].sides
        for name, (_, sides, probability) in known.items():
            for subset, inside in subsets.items():
                part = None if probability is None else probability[inside]
                score = scores.scored(observed[inside], sides[inside], part)
                p = scores.mcnemar(observed[inside], ensemble[inside], sides[inside])
                about = {"specimen": specimen, "predictor": name, "subset": subset}
                chance = np.nan
                if name == "ensemble":
                    members = one.made.ensembles[one.row][:, inside]
                    chance = scores.chance_of_z(observed[inside], members)
                tested = {"spiegelhalter_p": chance, "mcnemar_p": p}
                rows.append({**about, **asdict(score), **tested})
    return pd.DataFrame(rows, columns=_SCORES)


def failed(tests: Tests, made: Predictions) -> pd.DataFrame:
    """Tests that every predictor but the constant one and other specimens has wrong."""
    parts = [pd.DataFrame(columns=_FAILED)]
    for one in compared(tests, made):
        wrong = [
            predictor.sides != one.observed
            for predictor in predictors(one).values()
            if predictor.origin not in (Origin.CONSTANT, Origin.OTHER_SPECIMEN)
        ]
        known = pd.DataFrame(
            {
                "specimen": one.specimen,
                "test": one.tests.number,
                "ground_motion": one.tests.motion,
                "pga_g": one.tests.pga,
                "pgv_pga_s": one.tests.pgv_pga,
                "happened": 1 * one.observed,
                "share": one.made.share[one.row],
            }
        )
        parts.append(known[np.all(wrong, axis=0)])
    return pd.concat(parts)[_FAILED]


def confusions(tests: Tests, made: Predictions) -> list[dict[str, Any]]:
    """Right and wrong predictions of the ensemble by classes of PGA and of PGV/PGA."""
    rows: list[dict[str, Any]] = []
    for one in compared(tests, made):
        specimen, own, kind = one.specimen, one.tests, 2 * one.share + one.observed
        for name, unit, values in (("PGA", "g", own.pga), ("PGV/PGA", "s", own.pgv_pga)):
            edges = np.quantile(values, np.linspace(0.0, 1.0, _CLASSES + 1))
            number = np.clip(np.searchsorted(edges, values, "right") - 1, 0, _CLASSES - 1)
            for k, (low, high) in enumerate(pairwise(edges.tolist())):
                count = np.bincount(kind[number == k], minlength=4)
                names = ("right_balanced", "misses", "false_alarms", "hits")
                about = {"specimen": specimen, "measure": name, "unit": unit}
                counted = dict(zip(names, count.tolist(), strict=True))
                rows.append({**about, "low": low, "high": high, **counted})
    return rows


def assumed(config: ShakeTableConfig, *, recorded: bool) -> list[tuple[str, str, str]]:
    """Assumptions on the tests, with records of the table or without, in words."""
    table = config.acceleration or "the merged record, or else that of the accelerometer"
    if not recorded:
        table = "as commanded, a cosine pulse of each test's PGA and PGV/PGA"
        if config.stepper:
            delay = 1e3 * config.stepper.overhead
            table += f", each motor step {delay:g} ms longer than it was to take"
    return [
        *in_words(config, "from the scan's +x"),
        (
            "base with a replica",
            f"fraction of the replica: {uniform(config.replica_fraction)}",
            "replica_fraction",
        ),
        ("base without one", f"{config.base_error:g} times the error below", "base_error"),
        inset(config),
        ("density", f"{config.density:g} kg/m³, taken as known", "density"),
        ("acceleration of the table", table, "acceleration" if recorded else "stepper"),
    ]


def _panels(known: Sequence[Compared], heights: tuple[float, ...]) -> tuple[Figure, Any]:
    """Panels of these heights for each specimen that has outcomes; they say so if there is none.

    The panels are an array on (height, specimen).
    """
    count = max(len(known), 1)
    figure = Figure(figsize=(4.6 * count, sum(heights)), layout="constrained")
    panels = figure.subplots(
        len(heights), count, squeeze=False, sharex="col", height_ratios=heights
    )
    if not known:
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
    compared_ones = list(compared(tests, made))
    figure, panels = _panels(compared_ones, (4.2, 1.3))
    for (above, below), one in zip(panels.T, compared_ones, strict=False):
        row, specimen, known, observed = one.row, one.specimen, one.made, one.observed
        _shares(above, specimen, 0.03)
        above.set_ylabel("share of tests that overturned")
        below.set(xlabel="predicted probability of overturning", ylabel="tests", yscale="log")
        kinds = [("priors only, all tests", known.share[row], np.ones(len(observed), dtype=bool))]
        if known.calibration.known:
            kinds.append(("calibrated, other half", known.calibrated[row], ~known.half))
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
    if compared_ones:
        handles = panels[0, 0].get_legend_handles_labels()
        figure.legend(*handles, loc="outside lower center", ncols=2)
    return figure


@styled
def roc(tests: Tests, made: Predictions) -> Figure:
    """Tests correctly against wrongly predicted to overturn, over all limits of probability."""
    from sklearn.metrics import roc_auc_score, roc_curve

    compared_ones = list(compared(tests, made))
    figure, panels = _panels(compared_ones, (5.2,))
    for axes, one in zip(panels[0], compared_ones, strict=False):
        specimen, observed = one.specimen, one.observed
        _shares(axes, specimen, 0.02)
        names = [
            f"share of {one} tests predicted to overturn" for one in ("balanced", "overturned")
        ]
        axes.set(xlabel=names[0], ylabel=names[1])
        if len(set(observed.tolist())) == 1:
            axes.text(0.5, 0.5, "all tests ended alike: no curve", ha="center")
            continue
        points = 0
        for k, (name, known) in enumerate(predictors(one).items()):
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
    compared_ones = list(compared(tests, made))
    figure = Figure(figsize=(9.2, 3.8 * max(len(compared_ones), 1)), layout="constrained")
    for at, one in enumerate(compared_ones):
        row, specimen, own = one.row, one.specimen, one.tests
        known, observed = one.made, one.observed
        motions = np.array(own.motion)
        pga, velocity = np.array(own.pga), np.array(own.pga) * own.pgv_pga
        measures = (("peak ground acceleration [g]", pga), ("peak ground velocity [g s]", velocity))
        for column, (label, values) in enumerate(measures):
            axes = figure.add_subplot(len(compared_ones), 2, 2 * at + column + 1)
            grid = np.geomspace(values.min(), values.max(), 80)
            for share, name, colour in (
                (observed.astype(np.float64), "experiment", OVERTURNED),
                (known.share[row], "ensemble, priors only", UPRIGHT),
            ):
                found = scores.curve(values, share, motions, grid)
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
        observed = np.array(tests.observed.get(specimen, (-1,) * len(tests.number)))
        kinds = ((0, "o", "balanced"), (1, "^", "overturned"), (-1, "s", "predicted only"))
        for side, marker, name in kinds:
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
                label=name,
            )
        axes.set(xscale="log", yscale="log")
        axes.set(title=f"specimen {specimen}", xlabel="PGV/PGA [s]", ylabel="PGA [g]")
        _legend_under(axes, 2)
    if drawn is not None:
        figure.colorbar(drawn, ax=figure.axes, label="predicted probability of overturning")
    return figure
