"""Validation: every recorded shake-table test predicted as a probability, and scored."""

from __future__ import annotations

import math
from typing import Any

import pandas as pd

from pipeline.config.layers import Site
from pipeline.drawing.style import pictures, png_uri
from pipeline.stages.studies.validation import predictions
from pipeline.stages.studies.validation import validation_figures as figures
from pipeline.stages.studies.validation.predictions import Predictions
from pipeline.stages.studies.validation.recorded_runs import (
    Draw,
    Outcomes,
    Role,
    Series,
    outcomes,
)
from pipeline.stages.studies.validation.recorded_tests import (
    ASSUMED,
    OUTCOMES,
    RECORDS,
    accelerations,
    priors,
    scan,
    scans_in,
    tests_in,
)
from pipeline.workflow import pages, writers
from pipeline.workflow.datasets import described, netcdf
from pipeline.workflow.keys import digest_file
from pipeline.workflow.stage import Job, Product
from vsr_core.outcome import Outcome
from vsr_core.validation.priors import Member, best_guess, draws, extremes

FILE, TABLE, PAGE, DOUBTS, FAILED = (
    "validation.nc",
    "validation.csv",
    "validation.html",
    "validation_unknowns.csv",
    "validation_failed.csv",
)

FIRST = 6
"""Members that run all tests; the others leave out those that none of these was moved much by."""

DOUBTFUL, MOST_DOUBTFUL = (0.15, 0.85), 40
"""Tests with a share in this range, and so many of them at most, are run again at the ends of each
prior."""


def make(job: Job) -> Product:
    """Predict the tests, score the predictions beside others', and say what they hang on.

    Parameters
    ----------
    job : Job

    Returns
    -------
    Product
    """
    tests = tests_in(job.site.folder)
    accelerations(job.site.folder, tests.config.acceleration)  # what is wrong is told at once
    forms = predictions.forms({n: scan(path) for n, path in scans_in(job.site.folder).items()})
    series = Series(tests, forms)
    found, predicted = _predict(job, series)
    at_ends, doubts = _doubtful(job, series, predicted)
    records = predictions.records(tests, predicted)
    failed = predictions.failed(tests, predicted)
    drawn = {
        "validation_reliability": figures.reliability(tests, predicted),
        "validation_roc": figures.roc(tests, predicted),
        "validation_fragility": figures.fragility(tests, predicted),
        "validation_tests": figures.map_of_tests(tests, predicted),
    }
    facts = {
        "site": job.site.name,
        "tests": len(tests.number),
        "specimens": predictions.specimens(tests, forms),
        "assumed": tests.config.model_dump(mode="json"),
        "records": records,
        "calibration": predicted.calibration,
        "classes": predictions.confusions(tests, predicted),
        "doubts": doubts,
        "failed": failed,
        "pictures": {name: png_uri(figure) for name, figure in drawn.items()},
    }
    dataset = described(predictions.dataset(tests, predicted), job, "Shake-table tests")
    files = {
        FILE: netcdf(dataset),
        TABLE: writers.table(pd.DataFrame(records, columns=predictions.COLUMNS)),
        DOUBTS: writers.table(pd.DataFrame(doubts, columns=predictions.DOUBT_COLUMNS)),
        FAILED: writers.table(pd.DataFrame(failed, columns=predictions.FAILED_COLUMNS)),
        PAGE: writers.text(pages.filled("validation.html", facts)),
    }
    for name, figure in drawn.items():
        files |= pictures(name, figure)
    crashed = sum(
        row.outcome == Outcome.CRASHED
        for rows in (found | at_ends).values()
        for row in rows.values()
    )
    return Product(files, _summary(records), unresolved=predicted.lost, retry=crashed)


def _predict(job: Job, series: Series) -> tuple[Outcomes, Predictions]:
    tests, drawn = series.tests, priors(series.tests.config)
    members = {
        Draw(specimen, Role.MEMBER, number): member
        for specimen in tests.specimens
        for number, member in enumerate(draws(drawn, tests.config.members))
    }
    guesses = {Draw(specimen, Role.BEST_GUESS): best_guess(drawn) for specimen in tests.specimens}
    first = [draw for draw in members if int(draw.of) < FIRST]
    job.log(f"validation: {len(tests.number)} tests, {len(tests.specimens)} specimens")
    every = dict.fromkeys([*guesses, *first], tests.number)
    found = outcomes(job, series, guesses | members, every)
    open_ones = {
        specimen: predictions.undecided(tests, specimen, series.forms[specimen], found)
        for specimen in tests.specimens
    }
    rest = {draw: open_ones[draw.specimen] for draw in members if draw not in every}
    found |= outcomes(job, series, members, rest)
    return found, predictions.predictions(tests, found)


def _doubtful(
    job: Job, series: Series, predicted: Predictions
) -> tuple[Outcomes, list[dict[str, Any]]]:
    """What each unknown does to the tests that are in doubt, from one end of it to the other."""
    tests, (least, most) = series.tests, DOUBTFUL
    members: dict[Draw, Member] = {}
    wanted: dict[Draw, tuple[int, ...]] = {}
    for specimen, share in zip(tests.specimens, predicted.share.tolist(), strict=True):
        shares = zip(tests.number, share, strict=True)
        doubtful = tuple(number for number, p in shares if least <= p <= most)
        doubtful = doubtful[:: math.ceil(len(doubtful) / MOST_DOUBTFUL) or 1]
        pairs = extremes(priors(tests.config), replica=series.forms[specimen].replica)
        for unknown, pair in pairs.items():
            for role, member in zip((Role.LOW, Role.HIGH), pair, strict=True):
                draw = Draw(specimen, role, unknown)
                members[draw], wanted[draw] = member, doubtful
    found = outcomes(job, series, members, wanted)
    records = []
    for draw in members:
        if draw.role is Role.LOW:
            ends = (found[draw], found[draw._replace(role=Role.HIGH)])
            sides = [[Outcome(row.outcome).overturned for row in end.values()] for end in ends]
            both = [pair for pair in zip(*sides, strict=True) if min(pair) >= 0]
            records.append(
                {
                    "specimen": draw.specimen,
                    "unknown": draw.of,
                    "tests": len(both),
                    "overturned_low": sum(low for low, _ in both),
                    "overturned_high": sum(high for _, high in both),
                    "changed": sum(a != b for a, b in both) / len(both) if both else math.nan,
                }
            )
    return found, records


def _summary(records: list[dict[str, Any]]) -> str:
    rows = [r for r in records if r["predictor"] == "ensemble" and r["subset"] == "all"]
    parts = [
        f"specimen {r['specimen']}: balanced accuracy {r['balanced_accuracy']:.3f}, "
        f"Matthews {r['matthews']:.3f}, Brier {r['brier']:.4f}"
        for r in rows
        if r["n"]
    ]
    return "; ".join(parts) or "no outcomes to compare with"


def inputs(site: Site) -> dict[str, str]:
    """Digests of the files in the folder of tests."""
    names = [RECORDS, OUTCOMES, ASSUMED, *(path.name for path in scans_in(site.folder).values())]
    paths = [site.folder / name for name in names]
    return {path.name: digest_file(path) for path in paths if path.is_file()}
