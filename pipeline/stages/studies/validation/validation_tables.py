"""Scores of predictions of shake-table tests, and where they are right and wrong."""

from __future__ import annotations

from dataclasses import asdict
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd

from pipeline.config.priors_schema import ShakeTableConfig
from pipeline.stages.studies.validation.predictions import Origin, Predictions, compared, predictors
from pipeline.stages.studies.validation.recorded_tests import Tests
from pipeline.stages.uncertainty.unknowns import in_words, uniform
from vsr_core.validation import scores

_SCORES = ["specimen", "predictor", "subset", "n", "accuracy", "balanced_accuracy", "f1",
           "matthews", "brier", "log_loss", "mcnemar_p"]  # fmt: skip

_FAILED = ["specimen", "test", "ground_motion", "pga_g", "pgv_pga_s", "happened", "share"]

_CLASSES = 4
"""Classes of PGA and of PGV/PGA, with equally many tests."""


def scored(tests: Tests, made: Predictions) -> pd.DataFrame:
    """Scores of every predictor of each specimen with outcomes, on each subset of tests."""
    subsets = {
        "all": np.ones(len(made.half), dtype=bool),
        "calibration half": made.half,
        "other half": ~made.half,
    }
    rows = []
    for row, specimen, observed in compared(tests):
        known = predictors(tests, made, row)
        ensemble = known["ensemble"].sides
        for name, (_, sides, probability) in known.items():
            for subset, inside in subsets.items():
                part = None if probability is None else probability[inside]
                score = scores.scored(observed[inside], sides[inside], part)
                p = scores.mcnemar(observed[inside], ensemble[inside], sides[inside])
                about = {"specimen": specimen, "predictor": name, "subset": subset}
                rows.append({**about, **asdict(score), "mcnemar_p": p})
    return pd.DataFrame(rows, columns=_SCORES)


def failed(tests: Tests, made: Predictions) -> pd.DataFrame:
    """Tests that every predictor but the constant one and other specimens has wrong."""
    table = pd.DataFrame(
        {
            "test": tests.number,
            "ground_motion": tests.motion,
            "pga_g": tests.pga,
            "pgv_pga_s": tests.pgv_pga,
        }
    )
    parts = [pd.DataFrame(columns=_FAILED)]
    for row, specimen, observed in compared(tests):
        wrong = [
            predictor.sides != observed
            for predictor in predictors(tests, made, row).values()
            if predictor.origin not in (Origin.CONSTANT, Origin.OTHER_SPECIMEN)
        ]
        known = table.assign(specimen=specimen, happened=1 * observed, share=made.share[row])
        parts.append(known[np.all(wrong, axis=0)])
    return pd.concat(parts)[_FAILED]


def confusions(tests: Tests, made: Predictions) -> list[dict[str, Any]]:
    """Right and wrong predictions of the ensemble by classes of PGA and of PGV/PGA."""
    rows: list[dict[str, Any]] = []
    for row, specimen, observed in compared(tests):
        kind = 2 * scores.decided(made.share[row]) + observed
        for name, unit, values in (("PGA", "g", tests.pga), ("PGV/PGA", "s", tests.pgv_pga)):
            edges = np.quantile(values, np.linspace(0.0, 1.0, _CLASSES + 1))
            number = np.clip(np.searchsorted(edges, values, "right") - 1, 0, _CLASSES - 1)
            for k, (low, high) in enumerate(pairwise(edges.tolist())):
                count = np.bincount(kind[number == k], minlength=4)
                names = ("right_balanced", "misses", "false_alarms", "hits")
                about = {"specimen": specimen, "measure": name, "unit": unit}
                counted = dict(zip(names, count.tolist(), strict=True))
                rows.append({**about, "low": low, "high": high, **counted})
    return rows


def assumed(config: ShakeTableConfig) -> list[tuple[str, str, str]]:
    """What was assumed of the tests, in words."""
    record = config.acceleration or "the merged record, or else that of the accelerometer"
    return [
        *in_words(config, "from the scan's +x"),
        (
            "base with a replica",
            f"fraction of the replica: {uniform(config.replica_fraction)}",
            "replica_fraction",
        ),
        ("base without one", f"{config.base_error:g} times the error below", "base_error"),
        ("density", f"{config.density:g} kg/m³, taken as known", "density"),
        ("acceleration of the table", record, "acceleration"),
    ]
