"""Probability of overturning over draws: in each cell, of the boundary, and as fitted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincinv, log_ndtr

from vsr_core.arrays import Array, Indices
from vsr_core.fragility.bisection import OUTWARD
from vsr_core.fragility.lognormal import MAX_BETA
from vsr_core.fragility.model import Evaluate, maximise

LEVEL = 0.95
"""Of the sampling interval of a probability."""

BAND = (0.05, 0.5, 0.95)
"""Shares of the draws below the lower end, the middle and the upper end of the boundary's band."""


@dataclass(frozen=True, eq=False)
class Chance:
    """Probability of overturning in each cell, and its sampling interval.

    Attributes
    ----------
    probability : ndarray, share of the draws with a verdict; NaN where none has one
    """

    probability: Array
    low: Array
    high: Array


def chance(overturned: NDArray[np.int8]) -> Chance:
    """Count draws in each cell.

    The interval is that of Jeffreys, between quantiles of Beta(k + 1/2, n - k + 1/2), with 0 for
    the lower end of none and 1 for the upper end of all. It is the interval of independent draws;
    those of a Sobol sequence fill the priors more evenly, so that it is somewhat wide.

    Parameters
    ----------
    overturned : ndarray of int, shape (draws, ...), 1, 0, or -1 unresolved

    Returns
    -------
    Chance, of shape (...)

    References
    ----------
    Brown, Cai & DasGupta (2001), Statistical Science 16(2), 101-133.

    Examples
    --------
    >>> found = chance(np.array([[1], [0], [0], [-1]], np.int8))
    >>> found.probability.round(3), found.low.round(3), found.high.round(3)
    (array([0.333]), array([0.039]), array([0.823]))
    """
    fell, number = (overturned == 1).sum(axis=0), (overturned >= 0).sum(axis=0)
    tail = 0.5 * (1.0 - LEVEL)
    low = np.where(fell == 0, 0.0, betaincinv(fell + 0.5, number - fell + 0.5, tail))
    high = np.where(fell == number, 1.0, betaincinv(fell + 0.5, number - fell + 0.5, 1.0 - tail))
    known = number > 0
    share = fell / np.maximum(number, 1)
    return Chance(*(np.where(known, part, np.nan) for part in (share, low, high)))


def band(boundaries: Array) -> Array:
    """Ends and middle of the boundary over draws, by order statistics.

    Parameters
    ----------
    boundaries : ndarray, shape (draws, ...), infinite where a draw does not topple,
        NaN where no run of it is decided, which counts as infinite

    Returns
    -------
    ndarray, shape (3, ...), see ``BAND``

    Examples
    --------
    >>> band(np.array([0.1, 0.2, 0.3, np.inf])).tolist()
    [0.1, 0.2, inf]
    """
    found = np.where(np.isnan(boundaries), np.inf, boundaries)
    return np.asarray(np.quantile(found, BAND, axis=0, method="inverted_cdf"))


def lognormal(
    boundaries: Array, ratio: Array, width: float, bounds: tuple[float, float]
) -> tuple[Array, Array]:
    """Lognormal distribution of the first-overturning PGA over draws, by maximum likelihood.

    A draw that does not topple up to the upper bound is censored there; the likelihood is that of
    Tobin, which is concave as Olsen writes it. Where no draw topples, the median is taken to lie in
    one further step. A row without verdict lies between its neighbours in PGV/PGA.

    Parameters
    ----------
    boundaries : ndarray, shape (draws, yaws, rows) [g], infinite where a draw does not topple,
        NaN where no run of it is decided
    ratio : ndarray, shape (rows,) [s]
    width : float, relative, of a bracket: the deviation is that of a uniform one at the least
    bounds : tuple of float [g], between which boundaries were looked for

    Returns
    -------
    theta : ndarray, shape (yaws, rows) [g], median
    beta : ndarray, shape (yaws, rows), logarithmic standard deviation

    References
    ----------
    Tobin (1958), Econometrica 26(1), 24-36; Olsen (1978), Econometrica 46(5), 1211-1215; Baker
    (2015), Earthquake Spectra 31(1), eq. 10.

    Examples
    --------
    >>> theta, beta = lognormal(np.array([[[0.1]], [[0.4]]]), np.ones(1), 0.01, (0.001, 4.0))
    >>> theta.round(3).tolist(), beta.round(3).tolist()
    ([[0.2]], [[0.693]])
    """
    known, last = ~np.isnan(boundaries), np.log(bounds[1])
    number, stands = known.sum(axis=0), np.isinf(boundaries)
    below = np.log(np.where(known & ~stands, boundaries, bounds[1])) - last
    least = np.log1p(width) / np.sqrt(12.0)
    mean, beta = _censored(below, (known & ~stands).sum(axis=0), stands.sum(axis=0), least)
    mean += last
    none = (stands.sum(axis=0) == number) & (number > 0)
    mean = np.where(none, last + 0.5 * np.log(OUTWARD), mean)
    beta = np.where(none, np.log(OUTWARD) / np.sqrt(12.0), beta)
    order = np.argsort(ratio, kind="stable")
    for one, other, decided in zip(mean, beta, number > 0, strict=True):
        if decided.any() and not decided.all():
            kept = order[decided[order]]
            for part in (one, other):
                part[~decided] = np.interp(ratio[~decided], ratio[kept], part[kept])
    nothing = ~(number > 0).any(axis=1)
    mean[nothing] = beta[nothing] = np.nan
    return np.exp(mean), beta


def _censored(x: Array, toppled: Indices, stand: Indices, least: float) -> tuple[Array, Array]:
    """Mean and deviation of normal values of which those above 0 are censored; `least` at least.

    Parameters
    ----------
    x : ndarray, shape (draws, ...), 0 where a draw is censored or not there
    toppled, stand : ndarray, shape (...), numbers of values and of censored ones
    """
    count = np.maximum(toppled + stand, 1)
    mean, square = x.sum(axis=0) / count, (x**2).sum(axis=0) / count
    unit = np.clip(np.sqrt(np.maximum(square - mean**2, 0.0)), least, MAX_BETA)
    fits = (toppled > 0) & (stand > 0)
    beta = unit.copy()
    if fits.any():
        k, c, scale = (part[fits].astype(np.float64) for part in (toppled, stand, unit))
        one, two = (part[fits] / scale**n for n, part in ((1, mean * count), (2, square * count)))
        start = np.column_stack([np.ones(k.size), mean[fits] / scale])
        free, _ = maximise(_likelihood(k, c, one, two, np.ones(2)), start)
        inverse = np.clip(free[:, 0], scale / MAX_BETA, scale / least)
        held = np.column_stack([inverse, free[:, 1]])
        held, _ = maximise(_likelihood(k, c, one, two, np.array([0.0, 1.0])), held)
        beta[fits] = scale / inverse
        mean[fits] = beta[fits] * held[:, 1]
    return mean, beta


def _likelihood(k: Array, c: Array, one: Array, two: Array, moved: Array) -> Evaluate:
    """Of k values with sums of their first and second powers, and of c above 0 (Olsen 1978).

    By the inverse of the deviation and the mean over the deviation; those with 1 are moved.
    """

    def evaluate(beta: Array, which: Indices) -> tuple[Array, Array]:
        inverse, mean = beta.T
        n, m, first, second = (part[which] for part in (k, c, one, two))
        log_share = log_ndtr(mean)
        rate = np.exp(-0.5 * mean**2 - log_share) / np.sqrt(2.0 * np.pi)
        with np.errstate(invalid="ignore", divide="ignore"):  # a step too far is halved
            value = n * np.log(inverse) + m * log_share
        value -= 0.5 * (inverse**2 * second - 2.0 * inverse * mean * first + n * mean**2)
        slope = np.column_stack(
            [n / inverse - inverse * second + mean * first, inverse * first - n * mean + m * rate]
        )
        bend = np.array([[n / inverse**2 + second, -first], [-first, n + m * rate * (mean + rate)]])
        bend = np.moveaxis(bend, 2, 0) * np.outer(moved, moved) + np.diag(1.0 - moved)
        return value, np.asarray(np.linalg.solve(bend, (slope * moved)[..., None])[..., 0])

    return evaluate
