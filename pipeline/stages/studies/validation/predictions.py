"""Predictions of shake-table tests, and those of other predictors."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np
import trimesh
import xarray as xr
from numpy.typing import NDArray

from pipeline.stages.studies.validation.recorded_runs import Outcomes, Role
from pipeline.stages.studies.validation.recorded_tests import Tests
from pipeline.stages.uncertainty.draws import priors
from pipeline.workflow.rows import RunRow
from vsr_core.arrays import Array, Mask
from vsr_core.judge import proofs
from vsr_core.outcome import Outcome
from vsr_core.validation import scores
from vsr_core.validation.priors import best_guess
from vsr_core.validation.scores import Calibration, calibrate, first_half, logistic
from vsr_core.validation.specimen import Form, drawn, form

_NEAR = 0.5
"""Share of the tilt from which a rock falls on that is near toppling."""


@dataclass(frozen=True, eq=False)
class Predictions:
    """What was predicted, arrays of shape (specimens, tests).

    Attributes
    ----------
    calibrated : ndarray, probability after calibration on half of the ground motions
    half : ndarray of bool, shape (tests,), those of the half on which things are calibrated
    """

    overturned: Array
    members: Array
    lost: int
    best_guess: Mask
    calibrated: Array
    calibration: Calibration
    half: Mask

    @property
    def share(self) -> Array:
        """Probability of overturning: share of the members; one half where none has a verdict."""
        return np.where(self.members > 0, self.overturned / np.maximum(self.members, 1.0), 0.5)


def forms(scans: dict[int, trimesh.Trimesh]) -> dict[int, Form]:
    """Form of each specimen, with the next specimen's scan as a replica if it is one."""
    numbers = list(scans)
    return {
        number: form(
            scans[number], scans[numbers[(at + 1) % len(numbers)]] if len(numbers) > 1 else None
        )
        for at, number in enumerate(numbers)
    }


def undecided(tests: Tests, specimen: int, of: Form, found: Outcomes) -> tuple[int, ...]:
    """Find the tests in which a member came half-way to toppling, or is unresolved.

    Of 184 tests of a public specimen that six members did not take that far, no other member of
    twenty overturned in any.
    """
    guess = drawn(of, best_guess(priors(tests.config)), tests.config.density)
    limit = _NEAR * proofs.barrier(guess).edge_tilt
    rows = [
        row for draw, row in found.items() if draw.specimen == specimen and draw.role is Role.MEMBER
    ]

    def is_open(run: RunRow) -> bool:
        if run.peak_tilt is None or Outcome(run.outcome).overturned < 0:
            return True
        return not run.peak_tilt < limit

    return tuple(n for n in tests.number if any(is_open(row[n]) for row in rows))


def predictions(tests: Tests, found: Outcomes) -> Predictions:
    """Take the shares of the ensembles, and the same calibrated on half of the ground motions.

    Members that left a test out count as those that ran it.
    """
    sides = np.array([o.overturned for o in Outcome])
    shape = (len(tests.specimens), len(tests.number))
    overturned, members = np.zeros(shape), np.zeros(shape)
    guess = np.zeros(shape, dtype=bool)
    lost = 0
    for draw, rows in found.items():
        row = tests.specimens.index(draw.specimen)
        side = np.array([sides[rows[n].outcome] if n in rows else -1 for n in tests.number])
        if draw.role is Role.BEST_GUESS:
            guess[row] = side == 1
        else:
            overturned[row] += side == 1
            members[row] += side >= 0
            lost += sum(sides[run.outcome] < 0 for run in rows.values())
    half = first_half(np.array(tests.motion))
    whole = float(tests.config.members)
    counted = overturned * whole / np.maximum(members, 1.0)
    calibration = _calibration(tests, counted, np.full(shape, whole), half)
    calibrated = np.array(
        [calibration.probability(row, np.full(len(row), whole)) for row in counted]
    )
    return Predictions(overturned, members, int(lost), guess, calibrated, calibration, half)


def _calibration(tests: Tests, overturned: Array, members: Array, half: Mask) -> Calibration:
    """One for all specimens, from those that have outcomes."""
    known = list(compared(tests))
    if not known:
        return Calibration()
    observed = np.concatenate([sides[half] for _, _, sides in known])
    counts, whole = (
        np.concatenate([part[row][half] for row, _, _ in known]) for part in (overturned, members)
    )
    return calibrate(counts, whole, observed)


def compared(tests: Tests) -> Iterator[tuple[int, int, Mask]]:
    """The specimens that have outcomes.

    Yields
    ------
    observed : ndarray of bool, shape (tests,), whether it overturned
    """
    for row, specimen in enumerate(tests.specimens):
        if specimen in tests.observed:
            yield row, specimen, np.array(tests.observed[specimen]) == 1


class Origin(Enum):
    """Where a prediction comes from."""

    OURS = "this project"
    REGRESSION = "a regression of the outcomes on the motions"
    PUBLISHED = "someone's publication"
    CONSTANT = "no information"
    OTHER_SPECIMEN = "the outcome of another specimen"


class Predictor(NamedTuple):
    """Predictions of the tests of one specimen.

    Attributes
    ----------
    sides : ndarray of bool, shape (tests,), whether it overturns
    probability : ndarray, shape (tests,), or None where there is none
    """

    origin: Origin
    sides: Mask
    probability: Array | None = None


def predictors(tests: Tests, made: Predictions, row: int) -> dict[str, Predictor]:
    """Gather the predictions for a specimen with outcomes."""
    specimen = tests.specimens[row]
    observed = np.array(tests.observed[specimen]) == 1
    motions = np.array(tests.motion)
    intensity = np.log(np.column_stack([tests.pga, tests.pgv_pga]))
    regression = logistic(intensity, observed, motions)
    velocity = logistic(intensity.sum(axis=1, keepdims=True), observed, motions)

    def decided(origin: Origin, probability: Array) -> Predictor:
        return Predictor(origin, scores.predicted_to_overturn(probability), probability)

    constant = np.zeros(len(observed), dtype=bool)
    found = {
        "ensemble": decided(Origin.OURS, made.share[row]),
        "calibrated ensemble": decided(Origin.OURS, made.calibrated[row]),
        "best guess": Predictor(Origin.OURS, made.best_guess[row]),
        "logistic of PGA and PGV/PGA": decided(Origin.REGRESSION, regression),
        "logistic of PGV": decided(Origin.REGRESSION, velocity),
        "always balanced": Predictor(Origin.CONSTANT, constant),
    }
    for (owner, name), values in tests.published.items():
        if owner == specimen:
            found[name] = Predictor(Origin.PUBLISHED, np.array(values) == 1)
    for other, values in tests.observed.items():
        if other != specimen:
            name = f"outcome of specimen {other}"
            found[name] = Predictor(Origin.OTHER_SPECIMEN, np.array(values) == 1)
    return found


def dataset(tests: Tests, made: Predictions) -> xr.Dataset:
    """The predictions on (specimen, test)."""
    dims = ("specimen", "test")
    observed = np.full(made.share.shape, -1, dtype="i1")
    for row, _, sides in compared(tests):
        observed[row] = sides
    found = xr.Dataset(
        {
            "probability": (dims, made.share),
            "predicted": (dims, _decided(made.share)),
            "best_guess": (dims, made.best_guess.astype("i1")),
            "probability_calibrated": (dims, made.calibrated),
            "predicted_calibrated": (dims, _decided(made.calibrated)),
            "members": (dims, made.members.astype("i4")),
            "happened": (dims, observed),
        },
        {
            "specimen": list(tests.specimens),
            "test": list(tests.number),
            "ground_motion": ("test", list(tests.motion)),
            "test_pga": ("test", list(tests.pga)),
            "test_pgv_pga": ("test", list(tests.pgv_pga)),
            "calibration_half": ("test", made.half.astype("i1")),
        },
    )
    found["happened"].encoding["_FillValue"] = np.int8(-1)
    return found


def _decided(probability: Array) -> NDArray[np.int8]:
    return np.array([scores.predicted_to_overturn(row) for row in probability], dtype=np.int8)
