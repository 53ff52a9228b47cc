"""Probability of overturning over draws: in each cell, of the boundary, and as a fitted surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincinv

from vsr_core.arrays import Array
from vsr_core.fragility.boundary import Cells
from vsr_core.fragility.lognormal import LognormalFragility

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


def surface(pga: Array, pgv_pga: Array, overturned: NDArray[np.int8]) -> tuple[Array, Array, Array]:
    """Lognormal fragility of each PGV/PGA, fitted to the draws of one direction.

    It rises with PGA by its form, see ``LognormalFragility``.

    Parameters
    ----------
    pga : ndarray, shape (n,) [g]
    pgv_pga : ndarray, shape (rows,) [s]
    overturned : ndarray of int, shape (draws, rows, n)

    Returns
    -------
    probability : ndarray, shape (rows, n)
    theta : ndarray, shape (rows,) [g], median
    beta : ndarray, shape (rows,), logarithmic standard deviation
    """
    fell = (overturned == 1).sum(axis=0).astype(np.float64)
    number = (overturned >= 0).sum(axis=0).astype(np.float64)
    if not number.any():
        unknown = np.full(len(pgv_pga), np.nan)
        return np.full(fell.shape, np.nan), unknown, unknown
    model = LognormalFragility(Cells(np.log(pga), np.log(pgv_pga), fell, number))
    theta, beta = np.exp(np.moveaxis(model.coefs[0], -1, 0))
    return model.grid_probability(model.coefs)[0], theta, beta
