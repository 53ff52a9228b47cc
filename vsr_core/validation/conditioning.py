"""An ensemble after observations: members that agree with them weigh more."""

from __future__ import annotations

import numpy as np

from vsr_core.arrays import Array, Indices

MISFIT = 0.11
"""Probability that a test ends otherwise than a member that is the true rock: of pairs of repeated
tests one in five ends differently, and 2 p (1 - p) = 0.2."""


def weights(members: Indices, observed: Indices) -> Array:
    """Weight of each member by the likelihood of the outcomes, independent but for the member.

    The likelihood of a test is 1 - `MISFIT` where the member ends as it did, `MISFIT` where it ends
    otherwise, and one half where the member is unresolved.

    Parameters
    ----------
    members : ndarray of int, shape (members, tests), 1 overturned, 0 not, -1 unresolved
    observed : ndarray of int, shape (tests,), -1 where there is no outcome

    Returns
    -------
    ndarray, shape (members,), of sum 1

    Examples
    --------
    >>> weights(np.array([[1], [0]]), np.array([1])).round(2).tolist()
    [0.89, 0.11]
    """
    known = observed >= 0
    own = members[:, known]
    chance = np.where(own == observed[known], 1.0 - MISFIT, MISFIT)
    chance = np.where(own < 0, 0.5, chance)
    logarithm = np.log(chance).sum(axis=1)
    weight = np.exp(logarithm - logarithm.max())
    return np.asarray(weight / weight.sum())


def probability(members: Indices, weight: Array) -> Array:
    """Probability of overturning in each test, over members that have a verdict; else one half.

    Parameters
    ----------
    members : ndarray of int, shape (members, tests)
    weight : ndarray, shape (members,)

    Returns
    -------
    ndarray, shape (tests,)
    """
    whole = weight @ (members >= 0)
    overturned = weight @ (members == 1)
    return np.asarray(np.where(whole > 0.0, overturned / np.where(whole > 0.0, whole, 1.0), 0.5))


def effective_number(weight: Array) -> float:
    """Number of members of equal weight that would tell as much (Kish 1965).

    Examples
    --------
    >>> effective_number(np.array([0.5, 0.5, 0.0]))
    2.0
    """
    return float(1.0 / (weight**2).sum())
