"""Hazard curves: how often a year the ground shakes more strongly than a level; their branches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vsr_core.arrays import Array, Mask
from vsr_core.errors import InvalidInput


@dataclass(frozen=True, eq=False)
class HazardCurve:
    """Annual rates of exceedance; between its levels ln rate is linear in ln level.

    Attributes
    ----------
    levels : ndarray, shape (n,) [m/s^2], or [m/s] of PGV, ascending
    rates : ndarray, shape (n,) [1/year], positive and not rising

    Raises
    ------
    InvalidInput
        If levels or rates break these rules.
    """

    levels: Array
    rates: Array

    def __post_init__(self) -> None:
        if len(self.levels) < 2 or len(self.levels) != len(self.rates):
            given = f"{len(self.levels)} levels and {len(self.rates)} rates"
            rule = "a curve has two or more, and a rate for each"
            raise InvalidInput(given, rule, "look at the curve")
        _check_levels(self.levels)
        if not ((self.rates > 0.0).all() and np.isfinite(self.rates).all()):
            raise InvalidInput("a rate that is not positive", "rates are above 0", "cut it off")
        rising = np.flatnonzero(np.diff(self.rates) > 0.0)
        if len(rising):
            given = f"a rate that rises after level {rising[0] + 1} of {len(self.levels)}"
            raise InvalidInput(given, "stronger shaking is not more frequent", "look at the curve")

    def rate_at(self, level: Array) -> Array:
        """Annual rates at which levels are exceeded.

        Parameters
        ----------
        level : ndarray [m/s^2]

        Returns
        -------
        ndarray [1/year], NaN outside the levels of the curve
        """
        x, y = np.log(self.levels), np.log(self.rates)
        return np.exp(np.interp(np.log(level), x, y, left=np.nan, right=np.nan))

    def level_at(self, rate: float) -> float:
        """The level that is exceeded at a rate; for 1/2475 a year that of 2,475 years.

        Parameters
        ----------
        rate : float [1/year]

        Returns
        -------
        float [m/s^2], NaN outside the rates of the curve
        """
        x, y = np.log(self.levels[::-1]), np.log(self.rates[::-1])
        return float(np.exp(np.interp(np.log(rate), y, x, left=np.nan, right=np.nan)))

    def up_to(self, level: float) -> HazardCurve:
        """The same without the levels beyond one [m/s^2], but for the first two."""
        number = max(2, int(np.searchsorted(self.levels, level, side="right")))
        return HazardCurve(self.levels[:number], self.rates[:number])


def _check_levels(levels: Array) -> None:
    if not (np.diff(levels, prepend=0.0) > 0.0).all():
        raise InvalidInput("levels out of order", "they ascend from above 0", "sort them")


def curve_of_probabilities(levels: Array, probabilities: Array, years: float) -> HazardCurve:
    """A curve from probabilities of exceedance in some years, earthquakes being Poissonian.

    Levels that are never exceeded end the curve; it begins with the first one whose probability is
    below 1, which by the digits of a file may be that of the weakest shaking, and has no rate.

    Parameters
    ----------
    levels : ndarray, shape (n,) [m/s^2]
    probabilities : ndarray, shape (n,)

    Raises
    ------
    InvalidInput
        For a probability outside 0 to 1.
    """
    if not ((probabilities >= 0.0).all() and (probabilities <= 1.0).all()):
        given = f"probabilities from {probabilities.min():g} to {probabilities.max():g}"
        raise InvalidInput(given, "they are from 0 to 1", "look at the curve")
    _check_levels(levels)
    certain = int(np.argmin(np.append(probabilities, 0.0) == 1.0))
    levels, probabilities = levels[certain:], probabilities[certain:]
    if (probabilities == 1.0).any():
        raise InvalidInput("a probability that rises to 1", "it falls", "look at the curve")
    return curve_of_rates(levels, -np.log1p(-probabilities) / years)


def curve_of_rates(levels: Array, rates: Array) -> HazardCurve:
    """A curve without the levels at its end that are never exceeded.

    Parameters
    ----------
    levels : ndarray, shape (n,) [m/s^2]
    rates : ndarray, shape (n,) [1/year]
    """
    _check_levels(levels)
    number = len(rates)
    while number and rates[number - 1] == 0.0:
        number -= 1
    return HazardCurve(levels[:number], rates[:number])


@dataclass(frozen=True, eq=False)
class PosteriorWeights:
    """Posterior weights of branches, given that a rock has survived.

    Attributes
    ----------
    rejected : ndarray of bool, shape (n,), branches below the minimum survival probability
    weights : ndarray, shape (n,), 0 where rejected; the others, if any, sum to 1
    """

    rejected: Mask
    weights: Array


def posterior_weights(weights: Array, survival: Array, minimum: float) -> PosteriorWeights:
    """Weights of branches by the survival probability of a rock under each; the least are rejected.

    By Bayes' rule w' is proportional to w S. The rejection of branches below ``minimum`` is a rule
    of practice.

    Parameters
    ----------
    weights : ndarray, shape (n,)
    survival : ndarray, shape (n,)

    Raises
    ------
    InvalidInput
        For weights that do not sum to 1.

    References
    ----------
    Stirling, Abbott, Rood et al. (2021), Bull. Seismol. Soc. Am. 111: the rule of 5 %.

    Examples
    --------
    >>> new = posterior_weights(np.array([0.5, 0.3, 0.2]), np.array([0.9, 0.3, 0.01]), 0.05)
    >>> new.weights.round(3).tolist(), new.rejected.tolist()
    ([0.833, 0.167, 0.0], [False, False, True])
    """
    if not ((weights >= 0.0).all() and abs(weights.sum() - 1.0) < 1e-6):
        raise InvalidInput(
            f"weights that sum to {weights.sum():g}", "they sum to 1", "look at the realizations"
        )
    rejected = survival < minimum
    product = np.where(rejected, 0.0, weights * survival)
    total = product.sum()
    return PosteriorWeights(rejected, product / total if total > 0.0 else product)


def effective_number(weights: Array) -> float:
    """How many branches of equal weight say as much, 1 / sum of squares (Kish 1965).

    Parameters
    ----------
    weights : ndarray, shape (n,), that sum to 1, or are all 0

    Examples
    --------
    >>> effective_number(np.full(4, 0.25)), effective_number(np.array([1.0, 0.0]))
    (4.0, 1.0)
    """
    squares = float((weights**2).sum())
    return 1.0 / squares if squares > 0.0 else 0.0


def mean_curve(curves: Sequence[HazardCurve], weights: Array, levels: Array) -> HazardCurve:
    """Mean of rates over branches.

    Parameters
    ----------
    weights : ndarray, shape (n,)
    levels : ndarray, shape (m,) [m/s^2]

    Returns
    -------
    HazardCurve, where some branch has a rate; beyond its end a branch has none
    """
    mean = np.minimum.accumulate(weights @ _rates(curves, levels))  # equal rates, but for rounding
    return HazardCurve(levels[mean > 0.0], mean[mean > 0.0])


def fractiles(
    curves: Sequence[HazardCurve], weights: Array, levels: Array, shares: Sequence[float]
) -> Array:
    """Rates below which the curves of some share of the weight lie, level by level.

    Parameters
    ----------
    weights : ndarray, shape (n,)
    levels : ndarray, shape (m,) [m/s^2]

    Returns
    -------
    ndarray, shape (len(shares), m) [1/year]: the least rate at which the weight of the branches
        not above it reaches the share
    """
    rates = _rates(curves, levels)
    order = np.argsort(rates, axis=0)
    risen = np.take_along_axis(rates, order, axis=0)
    reached = np.cumsum(weights[order], axis=0)
    rows = [(reached < share * (1.0 - 1e-12)).sum(axis=0) for share in shares]
    return np.stack([np.take_along_axis(risen, row[None], axis=0)[0] for row in rows])


def _rates(curves: Sequence[HazardCurve], levels: Array) -> Array:
    return np.stack([np.nan_to_num(curve.rate_at(levels)) for curve in curves])
