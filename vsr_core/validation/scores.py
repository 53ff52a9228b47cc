"""How well probabilities of overturning fit the outcomes: scores and fragility curves."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr, logsumexp
from scipy.stats import binomtest, norm

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.fragility.lognormal import probit_likelihood
from vsr_core.fragility.model import maximise
from vsr_core.validation.regression import regressed

ONE_OUTCOME = "A single label was found", "y_pred contains classes not in y_true"
"""Beginnings of scikit-learn's warnings where all tests end alike: scores are of that one."""

SMALLEST_PROBABILITY = 1e-3
"""Probabilities are kept this far from 0 and 1 for the log loss: the outcome of a single test of a
rock that is set up by hand cannot be known better."""


@dataclass(frozen=True)
class PredictionScores:
    """Scores of one predictor on some tests; NaN where there is nothing to score.

    Attributes
    ----------
    brier, log_loss : float, of the probabilities; of a predictor without, NaN
    spiegelhalter_z : float
        Of their calibration: standard normal if each test overturns with its probability.
    intercept, slope : float
        Of a logistic regression of the outcomes on the log-odds: 0 and 1 of calibrated ones. NaN
        where the outcomes have none, see ``regressed``.
    """

    n: int
    accuracy: float
    balanced_accuracy: float
    f1: float
    matthews: float
    brier: float
    log_loss: float
    spiegelhalter_z: float
    intercept: float
    slope: float


def scored(observed: Mask, predicted: Mask, probability: Array | None = None) -> PredictionScores:
    """Scores of predictions, and of probabilities where there are some.

    Parameters
    ----------
    observed : ndarray of bool, shape (n,), whether the rock overturned
    predicted : ndarray of bool, shape (n,)
    probability : ndarray, shape (n,), of overturning
    """
    from sklearn import metrics

    if not len(observed):
        return PredictionScores(0, *[np.nan] * 9)
    brier = loss = z = intercept = slope = np.nan
    if probability is not None:
        clipped = np.clip(probability, SMALLEST_PROBABILITY, 1.0 - SMALLEST_PROBABILITY)
        brier = float(np.mean((probability - observed) ** 2))
        loss = float(metrics.log_loss(observed, clipped, labels=[False, True]))
        z = spiegelhalter(observed, clipped)
        intercept, slope = regressed(np.log(clipped / (1.0 - clipped)), observed)
    with warnings.catch_warnings():
        for expected in ONE_OUTCOME:
            warnings.filterwarnings("ignore", expected)
        return PredictionScores(
            len(observed),
            float(metrics.accuracy_score(observed, predicted)),
            float(metrics.balanced_accuracy_score(observed, predicted)),
            float(metrics.f1_score(observed, predicted, zero_division=0.0)),
            float(metrics.matthews_corrcoef(observed, predicted)),
            brier,
            loss,
            z,
            intercept,
            slope,
        )


def spiegelhalter(observed: Mask, probability: Array) -> float:
    """Distance of a Brier score from its expectation, in its standard deviations.

    Parameters
    ----------
    observed : ndarray of bool, shape (n,)
    probability : ndarray, shape (n,)

    Returns
    -------
    float
        NaN where all probabilities are one half, 0 or 1.

    References
    ----------
    Spiegelhalter, D. J. (1986). Probabilistic prediction in patient management and clinical trials.
    Statistics in Medicine 5(5), 421-433.

    Examples
    --------
    >>> spiegelhalter(np.array([True, False]), np.array([0.8, 0.2])).__round__(3)
    -0.707
    """
    away = 1.0 - 2.0 * probability
    variance = float((away**2 * probability * (1.0 - probability)).sum())
    return (
        float(((observed - probability) * away).sum() / np.sqrt(variance)) if variance else np.nan
    )


def chance_of_z(observed: Mask, members: Indices) -> float:
    """Chance that Spiegelhalter's z is as far from 0 where a member is the true rock.

    z is a standard normal number for tests that are independent given their probabilities. Tests of
    one rock are not: what is unknown of it is the same in all. So each member of the ensemble is
    taken for the rock in turn, and its outcomes are compared with the others' shares.

    Parameters
    ----------
    observed : ndarray of bool, shape (n,)
    members : ndarray of int, shape (members, n), 1 overturned, 0 not, -1 unresolved

    Returns
    -------
    float
        Probability p of the test, no less than 1 / (members + 1); NaN of fewer than three members.

    Examples
    --------
    Two kinds of rock, of which one topples always: that all tests topple is nothing rare.

    >>> members = np.repeat([[1] * 9, [0] * 9], 5, axis=0)
    >>> chance_of_z(np.ones(9, dtype=bool), members)
    1.0
    """
    count = len(members)
    if count < 3:
        return float("nan")
    sides = np.where(members < 0, 0.5, members)
    whole = sides.sum(axis=0)

    def away(outcome: Mask, share: Array) -> float:
        kept = np.clip(share, SMALLEST_PROBABILITY, 1.0 - SMALLEST_PROBABILITY)
        return float(np.nan_to_num(abs(spiegelhalter(outcome, kept))))

    own = away(observed, whole / count)
    others = [away(side >= 0.5, (whole - side) / (count - 1)) for side in sides]
    return (1 + int(sum(other >= own - 1e-9 for other in others))) / (1 + count)


def predicted_to_overturn(probability: Array) -> Mask:
    """Whether each test is predicted to overturn: where that is likelier than the mean of all.

    If the probabilities are right, the threshold with the largest balanced accuracy is the share of
    all tests that overturn. Its estimate before any outcome is known is the mean probability. Where
    all are alike, or of one test, none is above it: then it is one half.

    Returns
    -------
    ndarray of bool, shape (n,), as the probabilities

    Examples
    --------
    >>> predicted_to_overturn(np.array([0.0, 0.1, 0.2, 0.4]))
    array([False, False,  True,  True])
    """
    limit = probability.mean() if np.ptp(probability) > 0.0 else 0.5
    return np.asarray(probability > limit)


def mcnemar(observed: Mask, one: Mask, other: Mask) -> float:
    """Probability of so uneven a split of the tests that only one of two predictors has right.

    Exact and two-sided (McNemar 1947, with the binomial distribution).

    Parameters
    ----------
    observed, one, other : ndarray of bool, shape (n,)

    Returns
    -------
    float
        1 where there is no such test.

    Examples
    --------
    >>> mcnemar(np.ones(3, bool), np.ones(3, bool), np.zeros(3, bool))
    0.25
    """
    right, other_right = one == observed, other == observed
    only_one, only_other = int((right & ~other_right).sum()), int((other_right & ~right).sum())
    if only_one + only_other == 0:
        return 1.0
    return float(binomtest(only_one, only_one + only_other).pvalue)


@dataclass(frozen=True)
class Reliability:
    """Observed shares in classes of predicted probability.

    Attributes
    ----------
    predicted, observed : ndarray, shape (k,), mean probability and share that overturned
    low, high : ndarray, shape (k,), 95 % interval of the share (Wilson 1927)
    count : ndarray of int, shape (k,)
    """

    predicted: Array
    observed: Array
    low: Array
    high: Array
    count: Indices


def reliability(observed: Mask, probability: Array, classes: int = 8) -> Reliability:
    """Observed shares in evenly spaced classes of probability.

    Parameters
    ----------
    observed : ndarray of bool, shape (n,)
    probability : ndarray, shape (n,)
    classes : int
        Empty ones are left out.
    """
    number = np.minimum((probability * classes).astype(int), classes - 1)
    rows = []
    for k in np.unique(number):
        inside = number == k
        hits, count = int(observed[inside].sum()), int(inside.sum())
        low, high = binomtest(hits, count).proportion_ci(method="wilson")
        rows.append((probability[inside].mean(), hits / count, low, high, count))
    predicted, share, lower, upper, counts = np.array(rows).reshape(-1, 5).T
    return Reliability(predicted, share, lower, upper, counts.astype(np.int64))


SAMPLES = 200
"""Bootstrap samples of whole ground motions."""

SEED = 1
"""Of the bootstrap samples."""

_HALVINGS = 40  # of the range of a level: of a few hundred, to less than 1e-9

FLATTEST, STEEPEST = 0.05, 50.0
"""Least and largest slope: of a curve that is nearly level, and of one that is a step."""


@dataclass(frozen=True)
class Curve:
    """Probability of overturning over an intensity measure.

    Attributes
    ----------
    intensity, probability, low, high : ndarray, shape (k,); the last two a 95 % interval
    median : float, intensity at a probability of one half
    """

    intensity: Array
    probability: Array
    low: Array
    high: Array
    median: float


def curve(intensity: Array, share: Array, motions: NDArray[np.str_], at: Array) -> Curve:
    """Lognormal fragility by maximum likelihood, with a bootstrap over ground motions.

    Parameters
    ----------
    intensity : ndarray, shape (n,), above 0
    share : ndarray, shape (n,), 0 or 1 of a test, a probability of a prediction
    motions : ndarray of str, shape (n,)
    at : ndarray, shape (k,), intensities at which it is evaluated

    References
    ----------
    Baker, J. W. (2015). Efficient analytical fragility function fitting using dynamic structural
    analysis. Earthquake Spectra 31(1), Eq. 11.
    """
    names, group = np.unique(motions, return_inverse=True)
    chosen = np.random.default_rng(SEED).integers(0, len(names), (SAMPLES, len(names)))
    counts = np.array([np.bincount(row, minlength=len(names)) for row in chosen])
    weights = np.vstack([np.ones(len(share)), counts[:, group]])
    centre = float(np.log(intensity).mean())
    design = np.column_stack([np.ones(len(share)), np.log(intensity) - centre])
    likelihood = probit_likelihood(design, np.zeros((len(weights), 1)), weights * share, weights)
    fitted, _ = maximise(likelihood, np.tile([0.0, 1.0], (len(weights), 1)))
    level, slope = fitted[:, :1], np.clip(fitted[:, 1:], FLATTEST, STEEPEST)
    held = slope[:, 0] != fitted[:, 1]  # the likeliest level is that of the slope that is held
    level[held] = _level(slope[held] * design[:, 1], share, weights[held])
    drawn = norm.cdf(level + slope * (np.log(at) - centre))
    low, high = np.percentile(drawn[1:], [2.5, 97.5], axis=0)
    median = float(np.exp(centre - level[0, 0] / slope[0, 0]))
    return Curve(at, drawn[0], low, high, median)


def _level(offset: Array, share: Array, weights: Array) -> Array:
    """Likeliest level of probit fits P = Phi(level + offset), shape (batch, 1).

    As the level rises, what fell adds less and less to the slope of the likelihood, and what stood
    takes more and more off it. They are compared by their logarithms, as far from all tests both
    are too small for a number.

    Parameters
    ----------
    offset, weights : ndarray, shape (batch, n)
    share : ndarray, shape (n,), 0 or 1 of a test, a probability of a prediction
    """
    low, high = -offset.max(axis=1, keepdims=True) - 9.0, 9.0 - offset.min(axis=1, keepdims=True)
    for _ in range(_HALVINGS):
        middle = (low + high) / 2.0
        eta = middle + offset
        fell, stood = (
            logsumexp(-0.5 * eta**2 - log_ndtr(side), 1, counts, keepdims=True)
            for side, counts in ((eta, weights * share), (-eta, weights * (1.0 - share)))
        )
        low, high = np.where(fell > stood, middle, low), np.where(fell > stood, high, middle)
    return (low + high) / 2.0
