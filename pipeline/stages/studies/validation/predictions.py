"""Predictions of shake-table tests, and those of other predictors."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
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
from vsr_core.arrays import Array, Indices, Mask
from vsr_core.judge import proofs
from vsr_core.outcome import Outcome
from vsr_core.validation import conditioning, scores
from vsr_core.validation.priors import best_guess
from vsr_core.validation.regression import Calibration, calibrate, first_half, logistic
from vsr_core.validation.specimen import Form, drawn, form

_NEAR = 0.5
"""Share of the tilt from which a rock falls on that is near toppling."""


@dataclass(frozen=True, eq=False)
class Predictions:
    """What was predicted, arrays of shape (specimens, tests).

    Attributes
    ----------
    calibrated : ndarray
        Probability after calibration on half of the ground motions; NaN without a calibration.
    conditioned : ndarray
        Probability after the outcomes of all other series of the specimen.
    effective : ndarray, shape (specimens, tests), members that count in it
    half : ndarray of bool, shape (tests,), those of the half on which things are calibrated
    ensembles : ndarray of int, shape (specimens, members, tests), 1 overturned, 0 not, -1 neither
    """

    overturned: Array
    members: Array
    lost: int
    best_guess: Mask
    calibrated: Array
    conditioned: Array
    effective: Array
    calibration: Calibration
    half: Mask
    ensembles: Indices

    def only(self, chosen: Mask) -> Predictions:
        """Those of some tests.

        Parameters
        ----------
        chosen : ndarray of bool, shape (tests,)
        """
        names = ("overturned", "members", "best_guess", "calibrated", "conditioned", "effective")
        parts = {name: getattr(self, name)[:, chosen] for name in names}
        own = self.ensembles[:, :, chosen]
        return replace(self, half=self.half[chosen], ensembles=own, **parts)

    @property
    def share(self) -> Array:
        """Probability of overturning: share of the members; one half where none has a verdict."""
        return np.where(self.members > 0, self.overturned / np.maximum(self.members, 1.0), 0.5)


def forms(scans: dict[int, trimesh.Trimesh]) -> dict[int, Form]:
    """Form of each specimen, with the next specimen's scan as a replica if it is another of one."""
    found, numbers = {}, list(scans)
    for at, number in enumerate(numbers):
        found[number] = form(scans[number], scans[numbers[(at + 1) % len(numbers)]])
    return found


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
    ensembles: dict[int, list[Indices]] = {specimen: [] for specimen in tests.specimens}
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
            left_out = np.array([n not in rows for n in tests.number])
            ensembles[draw.specimen].append(np.where(left_out, 0, side))
    half = first_half(np.array(tests.motion))
    whole = float(tests.config.members)
    counted = overturned * whole / np.maximum(members, 1.0)
    calibration = _calibration(tests, counted, np.full(shape, whole), half)
    calibrated = np.array(
        [calibration.probability(row, np.full(len(row), whole)) for row in counted]
    )
    after = [_conditioned(tests, specimen, np.array(ensembles[specimen])) for specimen in ensembles]
    conditioned, effective = (np.array(part) for part in zip(*after, strict=True))
    every = np.array([np.array(ensembles[specimen]) for specimen in tests.specimens])
    return Predictions(
        overturned,
        members,
        int(lost),
        guess,
        calibrated,
        conditioned,
        effective,
        calibration,
        half,
        every,
    )


def _conditioned(tests: Tests, specimen: int, members: Indices) -> tuple[Array, Array]:
    """Probability of each test after the outcomes of all other series, and how many members count.

    Parameters
    ----------
    members : ndarray of int, shape (members, tests), 1 overturned, 0 not, -1 unresolved
    """
    observed = np.array(tests.observed.get(specimen, (-1,) * len(tests.number)))
    series = np.array(tests.series)
    found = np.zeros((2, len(observed)))
    for name in dict.fromkeys(tests.series):
        own = series == name
        weights = conditioning.weights(members[:, ~own], observed[~own])
        found[0, own] = conditioning.probability(members[:, own], weights)
        found[1, own] = conditioning.effective_number(weights)
    return found[0], found[1]


def _calibration(tests: Tests, overturned: Array, members: Array, half: Mask) -> Calibration:
    """One for all specimens, from those that have outcomes."""
    parts = []
    for row, specimen in enumerate(tests.specimens):
        observed = np.array(tests.observed.get(specimen, (-1,) * len(half)))
        inside = half & (observed >= 0)
        parts.append((overturned[row][inside], members[row][inside], observed[inside] == 1))
    counts, whole, sides = (np.concatenate(part) for part in zip(*parts, strict=True))
    return calibrate(counts, whole, sides)


class Compared(NamedTuple):
    """A specimen with outcomes: those tests that have one, and their predictions.

    Attributes
    ----------
    observed : ndarray of bool, shape (tests,), whether it overturned
    share, calibrated, conditioned : ndarray of bool, shape (tests,)
        Which are predicted to overturn by these, beside those without an outcome.
    """

    row: int
    specimen: int
    tests: Tests
    made: Predictions
    observed: Mask
    share: Mask
    calibrated: Mask
    conditioned: Mask


def compared(tests: Tests, made: Predictions) -> Iterator[Compared]:
    """The specimens that have outcomes."""
    for row, specimen in enumerate(tests.specimens):
        observed = np.array(tests.observed.get(specimen, ()))
        if (observed >= 0).any():
            known = observed >= 0
            every = made.share, made.calibrated, made.conditioned
            ours = (decided(tests, probability[row])[known] for probability in every)
            own, those = tests.only(known), made.only(known)
            yield Compared(row, specimen, own, those, observed[known] == 1, *ours)


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


CALIBRATED = "calibrated ensemble"
REGRESSIONS = "logistic of PGA and PGV/PGA", "logistic of PGV"
"""Predictors that are fitted to outcomes."""


def left_out(one: Compared) -> list[str]:
    """Predictors of a specimen that outcomes allow no fit of, one line each."""
    known = predictors(one)
    reason = (
        "the outcomes that it would be fitted to are all {}or divided without an overlap: such a "
        "regression has no maximum"
    )
    alone, half = reason.format("alike, "), reason.format("alike, all of one probability, ")
    if not one.made.calibration.tests:
        half = "no outcome is of the half of the ground motions that it would be fitted to"
    if len(set(one.tests.motion)) == 1:
        alone = "all outcomes are of one ground motion, and each is predicted from the others"
    reasons = {CALIBRATED: half} | dict.fromkeys(REGRESSIONS, alone)
    return [
        f"specimen {one.specimen}: no {name}, as {why}"
        for name, why in reasons.items()
        if name not in known
    ]


def predictors(one: Compared) -> dict[str, Predictor]:
    """Gather the predictions for a specimen with outcomes, without those of `left_out`."""
    row, specimen, tests = one.row, one.specimen, one.tests
    made, observed = one.made, one.observed
    motions = np.array(tests.motion)
    intensity = np.log(np.column_stack([tests.pga, tests.pgv_pga]))
    found = {"ensemble": Predictor(Origin.OURS, one.share, made.share[row])}
    if made.calibration.known:
        found[CALIBRATED] = Predictor(Origin.OURS, one.calibrated, made.calibrated[row])
    found["best guess"] = Predictor(Origin.OURS, made.best_guess[row])
    measures = intensity, intensity.sum(axis=1, keepdims=True)
    for name, features in zip(REGRESSIONS, measures, strict=True):
        probability = logistic(features, observed, motions)
        if not np.isnan(probability).any():
            sides = decided(tests, probability)
            found[name] = Predictor(Origin.REGRESSION, sides, probability)
    found["always balanced"] = Predictor(Origin.CONSTANT, np.zeros(len(observed), dtype=bool))
    if len(set(tests.series)) > 1:
        after = Predictor(Origin.OURS, one.conditioned, made.conditioned[row])
        found["ensemble after the other series"] = after
    for (owner, name), values in tests.published.items():
        if owner == specimen:
            found[name] = Predictor(Origin.PUBLISHED, np.array(values) == 1)
    for other, values in tests.observed.items():
        if other != specimen and min(values) >= 0:
            name = f"outcome of specimen {other}"
            found[name] = Predictor(Origin.OTHER_SPECIMEN, np.array(values) == 1)
    return found


def dataset(tests: Tests, made: Predictions) -> xr.Dataset:
    """The predictions on (specimen, test)."""
    dims = ("specimen", "test")
    observed = np.full(made.share.shape, -1, dtype="i1")

    def sides(probability: Array) -> NDArray[np.int8]:
        found = np.array([decided(tests, row) for row in probability], dtype=np.int8)
        return np.where(np.isnan(probability), np.int8(-1), found)

    for row, specimen in enumerate(tests.specimens):
        observed[row] = tests.observed.get(specimen, observed[row])
    found = xr.Dataset(
        {
            "probability": (dims, made.share),
            "predicted": (dims, sides(made.share)),
            "best_guess": (dims, made.best_guess.astype("i1")),
            "probability_calibrated": (dims, made.calibrated),
            "predicted_calibrated": (dims, sides(made.calibrated)),
            "probability_conditioned": (dims, made.conditioned),
            "predicted_conditioned": (dims, sides(made.conditioned)),
            "effective_members": (dims, made.effective),
            "members": (dims, made.members.astype("i4")),
            "happened": (dims, observed),
        },
        {
            "specimen": list(tests.specimens),
            "test": list(tests.number),
            "ground_motion": ("test", list(tests.motion)),
            "test_pga": ("test", list(tests.pga)),
            "test_pgv_pga": ("test", list(tests.pgv_pga)),
            "test_azimuth": ("test", np.array(tests.azimuth, dtype=np.float64)),
            "series": ("test", list(tests.series)),
            "calibration_half": ("test", made.half.astype("i1")),
        },
    )
    for name in ("predicted_calibrated", "happened"):
        found[name].encoding["_FillValue"] = np.int8(-1)
    return found


def decided(tests: Tests, probability: Array) -> Mask:
    """Which tests are predicted to overturn, series by series, shape (tests,)."""
    sides, series = np.zeros(len(probability), dtype=bool), np.array(tests.series)
    for name in dict.fromkeys(tests.series):
        own = series == name
        sides[own] = scores.predicted_to_overturn(probability[own])
    return sides
