"""How well probabilities and predictions of overturning fit the observed outcomes."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from scipy.stats import binomtest

from vsr_core.arrays import Array, Indices, Mask

SMALLEST_PROBABILITY = 1e-3
"""Probabilities are kept this far from 0 and 1 for the log loss: the outcome of a single test of a
rock that is set up by hand cannot be known better."""


@dataclass(frozen=True)
class PredictionScores:
    """Scores of one predictor on some tests; NaN where there is nothing to score.

    Attributes
    ----------
    brier, log_loss : float, of the probabilities; of a predictor without, NaN
    """

    n: int
    accuracy: float
    balanced_accuracy: float
    f1: float
    matthews: float
    brier: float
    log_loss: float


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
        return PredictionScores(0, *[np.nan] * 6)
    brier = loss = np.nan
    if probability is not None:
        clipped = np.clip(probability, SMALLEST_PROBABILITY, 1.0 - SMALLEST_PROBABILITY)
        brier = float(np.mean((probability - observed) ** 2))
        loss = float(metrics.log_loss(observed, clipped, labels=[False, True]))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of one outcome only: the mean of one recall
        return PredictionScores(
            len(observed),
            float(metrics.accuracy_score(observed, predicted)),
            float(metrics.balanced_accuracy_score(observed, predicted)),
            float(metrics.f1_score(observed, predicted, zero_division=0.0)),
            float(metrics.matthews_corrcoef(observed, predicted)),
            brier,
            loss,
        )


def decided(probability: Array) -> Mask:
    """Whether each test is predicted to overturn: where that is likelier than the mean of all.

    If the probabilities are right, the threshold with the largest balanced accuracy is the share of
    all tests that overturn. Its estimate before any outcome is known is the mean probability.

    Parameters
    ----------
    probability : ndarray, shape (n,)

    Returns
    -------
    ndarray of bool, shape (n,)

    Examples
    --------
    >>> decided(np.array([0.0, 0.1, 0.2, 0.4]))
    array([False, False,  True,  True])
    """
    return np.asarray(probability >= probability.mean())


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
