"""How well probabilities and predictions of overturning fit what happened."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from vsr_core.arrays import Array, Mask

SMALLEST_PROBABILITY = 1e-3
"""Probabilities are kept this far from 0 and 1 for the log loss: nobody is surer of a single test
of a rock that is set up by hand."""


@dataclass(frozen=True)
class Scores:
    """Scores of one predictor on some tests; NaN where there is nothing to score.

    Attributes
    ----------
    n : int, tests
    accuracy, balanced_accuracy, f1, matthews : float, of the predictions
    brier, log_loss : float, of the probabilities; of a predictor without, NaN
    """

    n: int
    accuracy: float
    balanced_accuracy: float
    f1: float
    matthews: float
    brier: float
    log_loss: float


def scored(happened: Mask, predicted: Mask, probability: Array | None = None) -> Scores:
    """Scores of predictions, and of probabilities where there are some.

    Parameters
    ----------
    happened : ndarray of bool, shape (n,), whether the rock overturned
    predicted : ndarray of bool, shape (n,)
    probability : ndarray, shape (n,), of overturning
    """
    from sklearn import metrics

    if not len(happened):
        return Scores(0, *[np.nan] * 6)
    brier = loss = np.nan
    if probability is not None:
        sure = np.clip(probability, SMALLEST_PROBABILITY, 1.0 - SMALLEST_PROBABILITY)
        brier = float(np.mean((probability - happened) ** 2))
        loss = float(metrics.log_loss(happened, sure, labels=[False, True]))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of one outcome only: the mean of one recall
        return Scores(
            len(happened),
            float(metrics.accuracy_score(happened, predicted)),
            float(metrics.balanced_accuracy_score(happened, predicted)),
            float(metrics.f1_score(happened, predicted, zero_division=0.0)),
            float(metrics.matthews_corrcoef(happened, predicted)),
            brier,
            loss,
        )


def decided(probability: Array) -> Mask:
    """Whether each test is predicted to overturn: where it is likelier than the mean of all.

    Of right probabilities, the limit that makes the balanced accuracy largest is the share of all
    tests that overturn. Its estimate before any outcome is known is the mean probability.
    """
    return np.asarray(probability >= probability.mean())


def mcnemar(happened: Mask, one: Mask, other: Mask) -> float:
    """Probability of so uneven a split of the tests on which only one of two predictors is right.

    Exact and two-sided (McNemar 1947, with the binomial distribution); 1 where there is none.
    """
    only_one = int(((one == happened) & (other != happened)).sum())
    only_other = int(((one != happened) & (other == happened)).sum())
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
    count: NDArray[np.int64]


def reliability(happened: Mask, probability: Array, classes: int = 8) -> Reliability:
    """Observed shares in evenly spaced classes of probability; empty classes are left out."""
    number = np.minimum((probability * classes).astype(int), classes - 1)
    rows = []
    for k in range(classes):
        inside = number == k
        if not inside.any():
            continue
        hits, count = int(happened[inside].sum()), int(inside.sum())
        low, high = binomtest(hits, count).proportion_ci(method="wilson")
        rows.append((probability[inside].mean(), hits / count, low, high, count))
    predicted, observed, lower, upper, counts = np.array(rows).reshape(-1, 5).T
    return Reliability(predicted, observed, lower, upper, counts.astype(np.int64))
