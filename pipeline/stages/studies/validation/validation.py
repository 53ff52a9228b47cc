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
from pipeline.stages.studies.validation.recorded_runs import Draw, outcomes
from pipeline.stages.studies.validation.recorded_tests import (
    ASSUMED,
    OUTCOMES,
    RECORDS,
    Tests,
    accelerations,
    scan,
    scans_in,
    tests_in,
)
from pipeline.workflow import pages, writers
from pipeline.workflow.datasets import described, netcdf
from pipeline.workflow.keys import digest_file
from pipeline.workflow.stage import Job, Product
from vsr_core.outcome import Outcome
from vsr_core.validation.priors import best_guess, draws, extremes

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
    """Predict the tests, score the predictions beside others', and say what they hang on."""
    tests = tests_in(job.site.folder)
    accelerations(job.site.folder, tests.config.acceleration)  # what is wrong is told at once
    forms = predictions.forms({n: scan(path) for n, path in scans_in(job.site.folder).items()})
    predicted = _predict(job, tests, forms)
    doubts = _doubts(job, tests, forms, predicted)
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
    unresolved = predicted.lost
    return Product(files, _summary(records), unresolved=unresolved)


def _predict(job: Job, tests: Tests, forms: Any) -> Predictions:
    priors = tests.config.priors()
    members = {
        f"{specimen}/{number}": Draw(specimen, member)
        for specimen in tests.specimens
        for number, member in enumerate(draws(priors, tests.config.members))
    }
    guesses = {
        f"{specimen}/best guess": Draw(specimen, best_guess(priors)) for specimen in tests.specimens
    }
    first = {name: draw for name, draw in members.items() if int(name.split("/")[1]) < FIRST}
    job.log(f"validation: {len(tests.number)} tests, {len(tests.specimens)} specimens")
    every = {**guesses, **first}
    found = outcomes(job, tests, forms, every, dict.fromkeys(every, tests.number))
    open_ones = {
        specimen: predictions.undecided(tests, specimen, forms[specimen], found)
        for specimen in tests.specimens
    }
    rest = {name: draw for name, draw in members.items() if name not in first}
    wanted = {name: open_ones[draw.specimen] for name, draw in rest.items()}
    return predictions.predictions(tests, found | outcomes(job, tests, forms, rest, wanted))


def _doubts(job: Job, tests: Tests, forms: Any, predicted: Predictions) -> list[dict[str, Any]]:
    """What each unknown does to the tests that are in doubt, from one end of it to the other."""
    low, high = DOUBTFUL
    draws: dict[str, Draw] = {}
    wanted: dict[str, tuple[int, ...]] = {}
    unknowns = {
        specimen: extremes(tests.config.priors(), replica=forms[specimen].replica)
        for specimen in tests.specimens
    }
    for row, specimen in enumerate(tests.specimens):
        share = predicted.share[row]
        doubtful = tuple(
            number
            for number, p in zip(tests.number, share.tolist(), strict=True)
            if low <= p <= high
        )
        doubtful = doubtful[:: math.ceil(len(doubtful) / MOST_DOUBTFUL) or 1]
        for unknown, pair in unknowns[specimen].items():
            for end, member in zip(("low", "high"), pair, strict=True):
                name = f"{specimen}/{unknown}/{end}"
                draws[name], wanted[name] = Draw(specimen, member), doubtful
    found = outcomes(job, tests, forms, draws, wanted)
    records = []
    for specimen in tests.specimens:
        for unknown in unknowns[specimen]:
            low_end, high_end = (found[f"{specimen}/{unknown}/{end}"] for end in ("low", "high"))
            sides = [
                [row.outcome == Outcome.OVERTURNED for row in end.values()]
                for end in (low_end, high_end)
            ]
            count = len(sides[0])
            changed = sum(one != other for one, other in zip(*sides, strict=True))
            records.append(
                {
                    "specimen": specimen,
                    "unknown": unknown,
                    "tests": count,
                    "overturned_low": sum(sides[0]),
                    "overturned_high": sum(sides[1]),
                    "changed": changed / count if count else float("nan"),
                }
            )
    return records


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
