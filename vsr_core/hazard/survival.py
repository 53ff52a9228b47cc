"""The chance that a rock has stood for its age, alone and together with others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtr, ndtri

from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.hazard.toppling import Fragility, any_of

AGES = 2000
"""Ages that stand for a distribution, in the middle of parts of equal probability."""

_MIDDLES = (np.arange(AGES) + 0.5) / AGES

LARGEST_SCALE = 1e3
"""Largest factor on a curve's accelerations that is tried; its inverse is the smallest."""


@dataclass(frozen=True, eq=False)
class Standing:
    """A rock that stands.

    Attributes
    ----------
    ages : ndarray, shape (n,) [years], equally likely, for which it has stood as it stands
    """

    fragility: Fragility
    ages: Array


def normal_ages(mean: float, sd: float) -> Array:
    """Equally likely ages of a normal distribution, cut at zero.

    Parameters
    ----------
    mean, sd : float [years]

    Returns
    -------
    ndarray, shape (n,) [years], one age where it is known exactly

    Raises
    ------
    InvalidInput
        For an age that is not positive, or a negative deviation.

    Examples
    --------
    >>> normal_ages(20000.0, 0.0).tolist()
    [20000.0]
    """
    _check(mean, sd)
    if sd == 0.0:
        return np.array([mean])
    below = ndtr(-mean / sd)  # what is cut off
    return np.asarray(mean + sd * ndtri(below + (1.0 - below) * _MIDDLES))


def lognormal_ages(median: float, log_sd: float) -> Array:
    """Equally likely ages of a lognormal distribution.

    Parameters
    ----------
    median : float [years]

    Returns
    -------
    ndarray, shape (n,) [years]

    Raises
    ------
    InvalidInput
        As of ``normal_ages``.
    """
    _check(median, log_sd)
    return np.asarray(median * np.exp(log_sd * ndtri(_MIDDLES)))


def uniform_ages(low: float, high: float) -> Array:
    """Equally likely ages between bounds.

    Parameters
    ----------
    low, high : float [years]

    Returns
    -------
    ndarray, shape (n,) [years]

    Raises
    ------
    InvalidInput
        If the bounds are not positive and in order.
    """
    _check(low, high - low)
    return low + (high - low) * _MIDDLES


def _check(age: float, spread: float) -> None:
    if not (age > 0.0 and spread >= 0.0 and np.isfinite(age + spread)):
        given = f"an age of {age:g} years with a spread of {spread:g}"
        rule = "ages are positive and finite, and spreads not negative"
        raise InvalidInput(given, rule, "give them in years before present")


def survival(rate: float | Array, ages: Array) -> Array:
    """Chance of no earthquake that topples a rock in its age, S = E[exp(-nu T)].

    Parameters
    ----------
    rate : float, or ndarray of any shape [1/year], of toppling
    ages : ndarray, shape (n,) [years], equally likely

    Returns
    -------
    ndarray, of the shape of the rate
    """
    return np.asarray(np.exp(-np.multiply.outer(rate, ages)).mean(axis=-1))


Rates = Callable[[Fragility], Array]
"""Annual rates of toppling under each branch, shape (branches,), of what has a fragility."""


def survival_of(rates: Rates, rocks: Sequence[Standing], seed: int = 1) -> Array:
    """Chance that a rock stands, or that all of several rocks do, which felt the same earthquakes.

    In the years before present in which only some of them stood, only these could topple. Ages are
    unknown independently of each other.

    Returns
    -------
    ndarray, shape (branches,)
    """
    if len(rocks) == 1:
        return survival(rates(rocks[0].fragility), rocks[0].ages)

    @cache
    def rate(standing: frozenset[int]) -> Array:
        return rates(any_of([rocks[i].fragility for i in sorted(standing)]))

    rng, number = np.random.default_rng(seed), max(len(rock.ages) for rock in rocks)
    drawn = np.column_stack([rng.permutation(np.resize(rock.ages, number)) for rock in rocks])
    order = np.argsort(drawn, axis=1)
    exposed: float | Array = 0.0
    begun = np.zeros(number)
    for youngest in range(len(rocks)):
        until = np.take_along_axis(drawn, order[:, youngest : youngest + 1], axis=1)[:, 0]
        of_years = np.array([rate(frozenset(row[youngest:].tolist())) for row in order])
        exposed = exposed + of_years * (until - begun)[:, None]
        begun = until
    return np.asarray(np.exp(-exposed).mean(axis=0))


def largest_scale(chance: Callable[[float], float], least: float) -> float:
    """Largest factor on accelerations that leaves a chance of survival.

    Parameters
    ----------
    chance : callable, from the factor to the chance then, which does not rise with it

    Returns
    -------
    float, infinite or 0 where no factor tried makes a difference
    """

    def spare(log_scale: float) -> float:
        return chance(float(np.exp(log_scale))) - least

    most = float(np.log(LARGEST_SCALE))
    if spare(most) >= 0.0:
        return np.inf
    if spare(-most) < 0.0:
        return 0.0
    return float(np.exp(brentq(spare, -most, most, xtol=1e-6)))
