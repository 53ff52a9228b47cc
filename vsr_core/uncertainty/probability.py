"""Probability of overturning over draws: in each cell, of the boundary, and as fitted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincinv, log_ndtr

from vsr_core.arrays import Array, Indices
from vsr_core.fragility.bisection import OUTWARD
from vsr_core.fragility.lognormal import MAX_BETA

LEVEL = 0.95
"""Of the sampling interval of a probability."""

BAND = (0.05, 0.5, 0.95)
"""Shares of the draws below the lower end, the middle and the upper end of the boundary's band."""


STEPS = 300
"""Of a fit in which draws are censored."""


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
    Tobin, climbed by expectation and maximisation. Where no draw topples, the median is taken to
    lie in one further step. A row without verdict lies between its neighbours in PGV/PGA.

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
    Tobin (1958), Econometrica 26(1), 24-36; Baker (2015), Earthquake Spectra 31(1), eq. 10.

    Examples
    --------
    >>> theta, beta = lognormal(np.array([[[0.1]], [[0.4]]]), np.ones(1), 0.01, (0.001, 4.0))
    >>> theta.round(3).tolist(), beta.round(3).tolist()
    ([[0.2]], [[0.693]])
    """
    known, last = ~np.isnan(boundaries), np.log(bounds[1])
    number, stands = known.sum(axis=0), np.isinf(boundaries)
    x = np.log(np.where(known & ~stands, boundaries, bounds[1]))
    least = np.log1p(width) / np.sqrt(12.0)
    mean, beta = _moments(np.where(known, x, 0.0), np.where(known, x, 0.0) ** 2, number, least)
    for _ in range(STEPS if stands.any() else 0):
        z = (last - mean) / beta
        rate = np.exp(-0.5 * z**2 - log_ndtr(-z)) / np.sqrt(2.0 * np.pi)
        one = np.where(stands, mean + beta * rate, x)
        square = np.where(stands, mean**2 + beta**2 + beta * (last + mean) * rate, x**2)
        mean, beta = _moments(
            np.where(known, one, 0.0), np.where(known, square, 0.0), number, least
        )
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


def _moments(one: Array, square: Array, number: Indices, least: float) -> tuple[Array, Array]:
    """Mean and standard deviation over draws, of the sums of what is expected of them."""
    count = np.maximum(number, 1)
    mean = one.sum(axis=0) / count
    spread = np.sqrt(np.maximum(square.sum(axis=0) / count - mean**2, 0.0))
    return mean, np.clip(spread, least, MAX_BETA)
