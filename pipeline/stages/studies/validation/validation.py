"""Validation: every recorded shake-table test predicted as a probability, and scored."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from pipeline.drawing.style import pictures, png_uri
from pipeline.stages.studies.validation import predictions
from pipeline.stages.studies.validation import validation_page as page
from pipeline.stages.studies.validation.predictions import Predictions
from pipeline.stages.studies.validation.recorded_runs import Draw, Outcomes, Role, Series, outcomes
from pipeline.stages.studies.validation.recorded_tests import (
    Folder,
    digests_of_motions,
    motions_of,
    scan,
    scans_in,
    tests_in,
)
from pipeline.stages.studies.validation.remarks import remarks, sizes
from pipeline.stages.studies.validation.table_motions import RECORDS
from pipeline.stages.uncertainty.draws import priors
from pipeline.workflow import pages, writers
from pipeline.workflow.datasets import described, netcdf
from pipeline.workflow.grammar import counted
from pipeline.workflow.stage import Product, Work
from vsr_core.outcome import Outcome
from vsr_core.validation.priors import Member, best_guess, draws, extremes

FILE, TABLE, PAGE, DOUBTS, FAILED = (
    "validation.nc",
    "validation.csv",
    "validation.html",
    "validation_unknowns.csv",
    "validation_failed.csv",
)

_DOUBTS = ["specimen", "unknown", "tests", "overturned_low", "overturned_high", "changed"]

_FIRST = 6
"""Members that run all tests; the others leave out those that none of these was moved much by."""

_DOUBTFUL, _MOST_DOUBTFUL = (0.15, 0.85), 40
"""Tests with a share in this range, and so many of them at most, are run again at the ends of each
prior."""


def make(work: Work, folder: Folder) -> Product:
    """Predict the tests, score the predictions beside others', and say what they depend on.

    Returns
    -------
    Product
        Dataset, tables, page and figures of the validation.
    """
    known = digests_of_motions(folder.path)
    tests = tests_in(folder.path)
    motions_of(folder.path, known)  # what is wrong is told at once
    scans = {number: scan(path) for number, path in scans_in(folder.path).items()}
    for line in (*tests.unused, *remarks(folder.path, tests), *sizes(scans)):
        work.log(f"validation: {line}")
    forms = predictions.forms(scans)
    series = Series(folder.path, known, tests, forms)
    found, predicted = _predict(work, series)
    at_ends, doubts = _doubtful(work, series, predicted)
    scores = page.scored(tests, predicted)
    left_out = [
        line for one in predictions.compared(tests, predicted) for line in predictions.left_out(one)
    ]
    for line in left_out:
        work.log(f"validation: {line}")
    failed = page.failed(tests, predicted)
    drawn = {
        "validation_reliability": page.reliability(tests, predicted),
        "validation_roc": page.roc(tests, predicted),
        "validation_fragility": page.fragility(tests, predicted),
        "validation_tests": page.map_of_tests(tests, predicted),
    }
    facts = {
        "site": work.origin.name,
        "tests": len(tests.number),
        "forms": forms,
        "compared": tests.observed,
        "members": tests.config.members,
        "assumed": page.assumed(tests.config, recorded=(folder.path / RECORDS).is_file()),
        "scores": list(scores.itertuples()),
        "calibration": predicted.calibration,
        "left_out": left_out,
        "classes": page.confusions(tests, predicted),
        "doubts": list(doubts.itertuples()),
        "failed": list(failed.itertuples()),
        "pictures": {name: png_uri(figure) for name, figure in drawn.items()},
    }
    dataset = described(predictions.dataset(tests, predicted), work, "Shake-table tests")
    files = {
        FILE: netcdf(dataset),
        TABLE: writers.table(scores),
        DOUBTS: writers.table(doubts),
        FAILED: writers.table(failed),
        PAGE: writers.text(pages.filled("validation.html", facts)),
    }
    for name, figure in drawn.items():
        files |= pictures(name, figure)
    crashed = sum(
        row.outcome == Outcome.CRASHED
        for rows in (found | at_ends).values()
        for row in rows.values()
    )
    return Product(files, _summary(scores), unresolved=predicted.lost, retry=crashed)


def _predict(work: Work, series: Series) -> tuple[Outcomes, Predictions]:
    tests, drawn = series.tests, priors(series.tests.config)
    members = {
        Draw(specimen, Role.MEMBER, number): member
        for specimen in tests.specimens
        for number, member in enumerate(draws(drawn, tests.config.members))
    }
    guesses = {Draw(specimen, Role.BEST_GUESS): best_guess(drawn) for specimen in tests.specimens}
    first = [draw for draw in members if int(draw.of) < _FIRST]
    specimens = counted(len(tests.specimens), "specimen")
    work.log(f"validation: {counted(len(tests.number), 'test')}, {specimens}")
    every = dict.fromkeys([*guesses, *first], tests.number)
    found = outcomes(work, series, guesses | members, every)
    open_ones = {
        specimen: predictions.undecided(tests, specimen, series.forms[specimen], found)
        for specimen in tests.specimens
    }
    rest = {draw: open_ones[draw.specimen] for draw in members if draw not in every}
    found |= outcomes(work, series, members, rest)
    return found, predictions.predictions(tests, found)


def _doubtful(work: Work, series: Series, predicted: Predictions) -> tuple[Outcomes, pd.DataFrame]:
    """What each unknown does to the tests that are in doubt, from one end of it to the other."""
    tests, (least, most) = series.tests, _DOUBTFUL
    members: dict[Draw, Member] = {}
    wanted: dict[Draw, tuple[int, ...]] = {}
    for specimen, share in zip(tests.specimens, predicted.share, strict=True):
        doubtful = np.array(tests.number)[(share >= least) & (share <= most)].tolist()
        doubtful = doubtful[:: math.ceil(len(doubtful) / _MOST_DOUBTFUL) or 1]
        pairs = extremes(priors(tests.config), replica=series.forms[specimen].replica)
        for unknown, pair in pairs.items():
            for role, member in zip((Role.LOW, Role.HIGH), pair, strict=True):
                draw = Draw(specimen, role, unknown)
                members[draw], wanted[draw] = member, tuple(doubtful)
    found = outcomes(work, series, members, wanted)
    rows = []
    for draw in members:
        if draw.role is Role.LOW:
            ends = (found[draw].values(), found[draw._replace(role=Role.HIGH)].values())
            sides = np.array([[Outcome(row.outcome).overturned for row in end] for end in ends])
            low, high = sides[:, (sides >= 0).all(axis=0)] == 1
            changed = float((low != high).mean()) if low.size else math.nan
            toppled = int(low.sum()), int(high.sum())
            rows.append((draw.specimen, draw.of, low.size, *toppled, changed))
    return found, pd.DataFrame(rows, columns=_DOUBTS)


def _summary(scores: pd.DataFrame) -> str:
    rows = scores.query("predictor == 'ensemble' and subset == 'all' and n > 0")
    parts = [
        f"specimen {row.specimen}: balanced accuracy {row.balanced_accuracy:.3f}, "
        f"Matthews {row.matthews:.3f}, Brier {row.brier:.4f}"
        for row in rows.itertuples()
    ]
    return "; ".join(parts) or "no outcomes to compare with"
