"""Predictions of two specimens from a table of outcomes that can be counted by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.config.priors_schema import ShakeTableConfig
from pipeline.stages.studies.validation import predictions, recorded_tests, validation_page
from pipeline.stages.studies.validation.predictions import Origin, Predictions
from pipeline.stages.studies.validation.recorded_runs import Draw, Role
from pipeline.workflow.rows import RunRow
from vsr_core.outcome import Outcome

LETTERS = {
    "b": Outcome.BALANCED,
    "o": Outcome.OVERTURNED,
    "d": Outcome.DISPLACED,
    "u": Outcome.UNSETTLED,
    "n": Outcome.UNSTABLE,
    "c": Outcome.CRASHED,
}

MOTIONS = ("RSN316", "RSN3")
"""Of the half on which things are calibrated, and of the other, as their names have it."""

RUNS = {
    # outcomes of the four members in each test, whose motion is MOTIONS[0] in the first seven
    1: "obbb obdd bobb ooob oobo oobo oodo obbb bodb oobo boob bbob",
    2: "bbbb uuuu oubb onnn cubo uubd oooo bbbb bdbb ooob oooo bbbb",
}
COUNTED = {
    1: ([1, 1, 1, 3, 3, 3, 3, 1, 1, 3, 2, 1], [4] * 12),
    2: ([0, 0, 1, 1, 1, 0, 4, 0, 0, 3, 4, 0], [4, 0, 3, 1, 2, 2, 4, 4, 4, 4, 4, 4]),
}
"""Members that overturned, and members with a verdict."""

OBSERVED = (1, 0, 0, 1, 1, 1, 0, 1, 1, 0, 1, 1)
"""What specimen 1 did; nothing is known of specimen 2."""

TESTS = recorded_tests.Tests(
    number=tuple(range(11, 23)),
    motion=(MOTIONS[0],) * 7 + (MOTIONS[1],) * 5,
    pga=tuple(np.linspace(0.1, 0.6, 12)),
    pgv_pga=tuple(np.linspace(0.3, 0.1, 12)),
    azimuth=(None,) * 12,
    series=("",) * 12,
    observed={1: OBSERVED},
    published={},
    specimens=(1, 2),
    config=ShakeTableConfig(members=4),
)


def row(letter: str) -> RunRow:
    return RunRow(b"", int(LETTERS[letter]))


@pytest.fixture(scope="module")
def made() -> Predictions:
    found = {
        Draw(specimen, Role.MEMBER, member): {
            number: row(test[member])
            for number, test in zip(TESTS.number, text.split(), strict=True)
        }
        for specimen, text in RUNS.items()
        for member in range(4)
    }
    for specimen, letter in ((1, "b"), (2, "o")):
        found[Draw(specimen, Role.BEST_GUESS)] = {n: row(letter) for n in TESTS.number}
    return predictions.predictions(TESTS, found)


def test_a_share_is_of_the_members_with_a_verdict(made: Predictions) -> None:
    for at, (overturned, decided) in enumerate(COUNTED.values()):
        np.testing.assert_array_equal(made.overturned[at], overturned)
        np.testing.assert_array_equal(made.members[at], decided)
        for share, fell, known in zip(made.share[at], overturned, decided, strict=True):
            assert share == (fell / known if known else 0.5)
    assert made.lost == 4 + 1 + 3 + 2 + 2
    np.testing.assert_array_equal(made.best_guess, [[False] * 12, [True] * 12])


def test_the_calibration_is_of_one_half_and_of_what_was_observed(made: Predictions) -> None:
    """A line through two points: at each share of that half, what was observed of its tests."""
    half = made.half.tolist()
    assert half == [True] * 7 + [False] * 5
    assert made.calibration.tests == 7
    # of three tests with one member of four, one fell; of four with three members, three fell
    expected = {1: 1 / 3, 3: 3 / 4}
    for fell, calibrated in zip(COUNTED[1][0], made.calibrated[0], strict=True):
        if fell in expected:
            assert calibrated == pytest.approx(expected[fell], abs=1e-4)
    # the other specimen has the same: four members of four lie beyond, as one of three between
    second = made.calibrated[1]
    assert second[9] == pytest.approx(3 / 4, abs=1e-4)
    assert 1 / 3 < second[2] < 3 / 4 < second[6]
    assert second[0] < 1 / 3


def test_each_specimen_has_its_own_predictors(made: Predictions) -> None:
    both = replace(TESTS, observed={1: OBSERVED, 2: (0,) * 11 + (1,)})
    one, two = map(predictions.predictors, predictions.compared(both, made))
    for at, known in enumerate((one, two)):
        np.testing.assert_array_equal(known["ensemble"].probability, made.share[at])
        np.testing.assert_array_equal(known["calibrated ensemble"].probability, made.calibrated[at])
        np.testing.assert_array_equal(known["best guess"].sides, [bool(at)] * 12)
    other = one["outcome of specimen 2"]
    assert other.origin is Origin.OTHER_SPECIMEN
    np.testing.assert_array_equal(other.sides, [False] * 11 + [True])
    np.testing.assert_array_equal(two["outcome of specimen 1"].sides, np.array(OBSERVED) == 1)


def test_what_outcomes_allow_no_fit_of_is_left_out_and_told() -> None:
    """Specimen 1 as its members say, sharply: its shares and its PGA divide the outcomes."""
    letters = {"b": (0, 3), "o": (1, 4)}
    found = {
        Draw(specimen, Role.MEMBER, member): {
            number: row("o" if member < letters["bo"[k >= 6]][specimen - 1] else "b")
            for k, number in enumerate(TESTS.number)
        }
        for specimen in (1, 2)
        for member in range(4)
    }
    sharp = replace(TESTS, observed={1: (0,) * 6 + (1,) * 6})
    (one,) = predictions.compared(sharp, predictions.predictions(sharp, found))
    names = set(predictions.predictors(one))
    assert names == {"ensemble", "best guess", "always balanced"}
    lines = predictions.left_out(one)
    assert [line.split(",")[0] for line in lines] == [
        "specimen 1: no calibrated ensemble",
        "specimen 1: no logistic of PGA and PGV/PGA",
        "specimen 1: no logistic of PGV",
    ]
    assert set(validation_page.scored(sharp, one.made)["predictor"]) == names
    stored = predictions.dataset(sharp, predictions.predictions(sharp, found))
    assert np.isnan(stored["probability_calibrated"]).all()
    assert (stored["predicted_calibrated"] == -1).all()


@pytest.mark.parametrize(("motion", "calibrated"), [(MOTIONS[0], True), (MOTIONS[1], False)])
def test_a_table_of_one_motion_is_told_as_one(motion: str, calibrated: bool) -> None:
    """Its outcomes overlap; what lacks is another motion, or one of the half for calibration."""
    single = replace(TESTS, motion=(motion,) * 12, specimens=(1,))
    found = {
        Draw(1, Role.MEMBER, member): {
            number: row(test[member])
            for number, test in zip(TESTS.number, RUNS[1].split(), strict=True)
        }
        for member in range(4)
    }
    (one,) = predictions.compared(single, predictions.predictions(single, found))
    alone = "as all outcomes are of one ground motion, and each is predicted from the others"
    expected = [f"specimen 1: no {name}, {alone}" for name in predictions.REGRESSIONS]
    half = "no outcome is of the half of the ground motions that it would be fitted to"
    if not calibrated:
        expected.insert(0, f"specimen 1: no calibrated ensemble, as {half}")
    assert predictions.left_out(one) == expected


def test_each_half_is_scored_on_its_own_tests(made: Predictions) -> None:
    """Said to overturn from a share of its mean on, of 23 members of 48: not from one of four."""
    scores = validation_page.scored(TESTS, made).set_index(["predictor", "subset"])
    sides = np.array(COUNTED[1][0]) >= 2
    right = sides == np.array(OBSERVED)
    for subset, tests in (
        ("all", slice(None)),
        ("calibration half", slice(0, 7)),
        ("other half", slice(7, 12)),
    ):
        ours = scores.loc[("ensemble", subset)]
        assert ours["specimen"] == 1
        assert ours["n"] == len(right[tests])
        assert ours["accuracy"] == pytest.approx(right[tests].mean())
    assert right[:7].mean() > 0.6 > right[7:].mean()


def test_failed_tests_are_those_all_have_wrong_with_their_own_share(made: Predictions) -> None:
    failed = validation_page.failed(TESTS, made).set_index("test")
    wrong = (np.array(COUNTED[1][0]) >= 2) != np.array(OBSERVED)
    assert set(failed.index) <= set(np.array(TESTS.number)[wrong])
    # the best guess stands in all, so that what did not fall is never among them
    assert (failed["happened"] == 1).all()
    shares = dict(zip(TESTS.number, np.array(COUNTED[1][0]) / 4, strict=True))
    assert len(failed)
    for number, share in failed["share"].items():
        assert share == shares[number]


def test_a_series_is_predicted_after_the_outcomes_of_the_others(made: Predictions) -> None:
    """By Bayes' rule, by hand: four members, each as likely as the tests that end as it does."""
    series = ("first",) * 4 + ("second",) * 8
    seen = replace(TESTS, series=series, observed={1: (*OBSERVED[:4], *(-1,) * 8)})
    found = {
        Draw(1, Role.MEMBER, member): {
            number: row(test[member])
            for number, test in zip(TESTS.number, RUNS[1].split(), strict=True)
        }
        for member in range(4)
    }
    one = predictions.predictions(replace(seen, specimens=(1,)), found)
    agree = [sum((t[m] == "o") == o for t, o in zip(RUNS[1].split()[:4], (1, 0, 0, 1), strict=True))
             for m in range(4)]  # fmt: skip
    likely = np.array([0.89**n * 0.11 ** (4 - n) for n in agree])
    likely /= likely.sum()
    for at in range(4, 12):
        test = RUNS[1].split()[at]
        expected = sum(p for p, letter in zip(likely, test, strict=True) if letter == "o")
        assert one.conditioned[0, at] == pytest.approx(expected)
        assert one.effective[0, at] == pytest.approx(1.0 / (likely**2).sum())
    # nothing is known of another series: the first is predicted as by the priors
    np.testing.assert_allclose(one.conditioned[0, :4], one.share[0, :4])
    # and its own outcomes are not used for it
    other = replace(seen, specimens=(1,), observed={1: (0, 1, 1, 0, *(-1,) * 8)})
    np.testing.assert_allclose(
        predictions.predictions(other, found).conditioned[0, :4], one.share[0, :4]
    )


def test_tests_without_an_outcome_are_predicted_and_not_scored(made: Predictions) -> None:
    some = replace(TESTS, observed={1: (*OBSERVED[:9], -1, -1, -1)})
    (one,) = predictions.compared(some, made)
    assert one.tests.number == TESTS.number[:9]
    np.testing.assert_array_equal(one.observed, np.array(OBSERVED[:9]) == 1)
    scores = validation_page.scored(some, made).set_index(["predictor", "subset"])
    assert scores.loc[("ensemble", "all"), "n"] == 9
    assert made.share.shape == (2, 12)


def test_what_is_predicted_does_not_depend_on_which_tests_have_an_outcome(
    made: Predictions,
) -> None:
    """Half of the members fell in test 21: above the mean of all, below that of those chosen."""
    chosen = [3, 4, 5, 6, 10]
    some = replace(
        TESTS, observed={1: tuple(OBSERVED[n] if n in chosen else -1 for n in range(12))}
    )
    (one,) = predictions.compared(some, made)
    shares = np.array(COUNTED[1][0]) / 4
    expected = (shares > shares.mean())[chosen]
    assert (expected != (shares[chosen] > shares[chosen].mean())).any()
    known = predictions.predictors(one)["ensemble"]
    np.testing.assert_array_equal(known.sides, expected)
    told = predictions.dataset(some, made)["predicted"].sel(specimen=1).values
    np.testing.assert_array_equal(told[chosen], expected)
    hits = sum(row["hits"] for row in validation_page.confusions(some, made)) / 2
    assert hits == (expected & (np.array(OBSERVED)[chosen] == 1)).sum()
