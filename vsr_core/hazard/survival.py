"""The chance that a rock has stood for its age, alone and together with others."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtr, ndtri

from vsr_core.arrays import Array, Indices
from vsr_core.errors import InvalidInput
from vsr_core.hazard.toppling import Fragility, any_of

AGES = 2000
"""Ages that stand for a distribution, in the middle of parts of equal probability."""

DRAWS = 20_000
"""Draws of several ages, of which there are all combinations if these are no more."""

_MIDDLES = (np.arange(AGES) + 0.5) / AGES

LARGEST_SCALE = 1e3
"""Largest factor on a curve's accelerations that is tried; its inverse is the smallest."""


@dataclass(frozen=True, eq=False)
class Stage:
    """A rock as it stood before more of it came out of the ground.

    Attributes
    ----------
    until : ndarray, shape (n,) [years before present], when that ended, a value for each age
    """

    fragility: Fragility
    until: Array


@dataclass(frozen=True, eq=False)
class Standing:
    """A rock that stands.

    Attributes
    ----------
    ages : ndarray, shape (n,) [years], equally likely, for which it has stood
    earlier : tuple of Stage, the latest first; before the last of them there was no rock
    """

    fragility: Fragility
    ages: Array
    earlier: tuple[Stage, ...] = ()

    @property
    def fragilities(self) -> tuple[Fragility, ...]:
        """As it stands now, and in its earlier stages, the latest first."""
        return (self.fragility, *(one.fragility for one in self.earlier))

    @property
    def back_to(self) -> Array:
        """Years before present to which each of them reaches back, shape (n, stages)."""
        return np.column_stack([*(one.until for one in self.earlier), self.ages])


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


def in_order(times: Sequence[Array], seed: int = 1) -> Array:
    """Draws of times that are unknown independently of each other but for their order.

    Parameters
    ----------
    times : sequence of ndarray [years before present], each of equally likely values

    Returns
    -------
    ndarray, shape (n, times), ascending along each row; draws in another order are left out

    Examples
    --------
    >>> in_order([np.array([8.0]), np.array([20.0])]).tolist()
    [[8.0, 20.0]]
    """
    turns = independent([len(one) for one in times], seed)
    drawn = np.column_stack([one[turn] for one, turn in zip(times, turns, strict=True)])
    return np.asarray(drawn[(np.diff(drawn, axis=1) > 0.0).all(axis=1)])


def independent(lengths: Sequence[int], seed: int = 1) -> Indices:
    """Places in several lists that do not depend on each other, each equally often in its list.

    Returns
    -------
    ndarray of int, shape (lists, n): all combinations, or ``DRAWS`` and more of them at random, in
        which those of a shorter list come equally often to one, wherever they are in it

    Examples
    --------
    >>> independent([1, 2, 2]).tolist()
    [[0, 0, 0, 0], [0, 0, 1, 1], [0, 1, 0, 1]]
    """
    if math.prod(lengths) <= DRAWS:
        return np.indices(lengths).reshape(len(lengths), -1)
    rng, longest = np.random.default_rng(seed), max(lengths)
    number = longest * math.ceil(DRAWS / longest)
    return np.array([rng.permutation(np.arange(number) * one // number) for one in lengths])


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
    return in_stages([rate], ages[:, None])


def in_stages(rates: Sequence[float | Array], years: Array) -> Array:
    """The same through stages, S = E[exp(-sum of nu_k T_k)].

    Parameters
    ----------
    rates : of toppling in each stage, as of ``survival``
    years : ndarray, shape (n, stages), that each lasted, rows equally likely
    """
    each = np.stack(np.broadcast_arrays(*rates), axis=-1)
    flat = each.reshape(-1, len(rates))  # one at a time: ages may be many
    return np.array([np.exp(-(years @ own)).mean() for own in flat]).reshape(each.shape[:-1])


Rates = Callable[[Fragility], Array]
"""Annual rates of toppling under each branch, shape (branches,), of what has a fragility."""


@dataclass(frozen=True, eq=False)
class Spell:
    """Years in which, under each draw of the rocks' ages, none of their stages began or ended.

    Attributes
    ----------
    standing : list of tuple of bool, for each stage of each rock, sets of those that stood then
    which : ndarray of int, shape (n,), the set of each draw
    years : ndarray, shape (n,), that it lasted
    """

    standing: list[tuple[bool, ...]]
    which: Indices
    years: Array


def spells(rocks: Sequence[Standing]) -> list[Spell]:
    """The past of several rocks from today on, by their ages, which are independent."""
    turns = independent([len(rock.ages) for rock in rocks])
    drawn = np.hstack([rock.back_to[own] for rock, own in zip(rocks, turns, strict=True)])
    now = np.concatenate([np.arange(len(rock.fragilities)) == 0 for rock in rocks])
    order = np.argsort(drawn, axis=1)
    place = np.argsort(order, axis=1)
    begun_at = np.where(now, -1, np.roll(place, 1, axis=1))
    found, begun = [], np.zeros(len(drawn))
    for step in range(len(now)):
        until = np.take_along_axis(drawn, order[:, step : step + 1], axis=1)[:, 0]
        stood = (place >= step) & (begun_at < step)
        sets, which = np.unique(stood, axis=0, return_inverse=True)
        found.append(Spell([*map(tuple, sets.tolist())], which, until - begun))
        begun = until
    return found


def survival_of(
    rates: Rates, rocks: Sequence[Standing], through: Sequence[Spell] | None = None
) -> Array:
    """Chance that a rock stands, or that all of several rocks do, which felt the same earthquakes.

    In the years before present in which only some of them stood, only these could topple, each as
    it stood then.

    Parameters
    ----------
    through : of Spell, where those of several rocks of these ages are known

    Returns
    -------
    ndarray, shape (branches,)
    """
    if len(rocks) == 1:
        years = np.diff(rocks[0].back_to, axis=1, prepend=0.0)
        return in_stages([rates(one) for one in rocks[0].fragilities], years)
    stages = [one for rock in rocks for one in rock.fragilities]

    @cache
    def rate(standing: tuple[bool, ...]) -> Array:
        return rates(any_of([one for one, on in zip(stages, standing, strict=True) if on]))

    exposed: float | Array = 0.0
    for spell in through or spells(rocks):
        of_sets = np.array([rate(one) for one in spell.standing])
        exposed = exposed + of_sets[spell.which] * spell.years[:, None]
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
