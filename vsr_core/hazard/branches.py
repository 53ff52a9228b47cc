"""Branches of a hazard model, weighed anew by the survival of a rock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vsr_core.arrays import Array, Mask
from vsr_core.errors import InvalidInput
from vsr_core.hazard.curve import HazardCurve


@dataclass(frozen=True, eq=False)
class Reweighed:
    """Weights of branches after a rock was asked.

    Attributes
    ----------
    rejected : ndarray of bool, shape (n,), branches with too little chance of survival
    weights : ndarray, shape (n,), 0 where rejected; the others, if any, sum to 1
    """

    rejected: Mask
    weights: Array


def reweighed(weights: Array, survival: Array, least: float) -> Reweighed:
    """Weigh branches by the chance that they leave a rock to stand, and drop the least.

    By Bayes' rule w' is proportional to w S. That branches below ``least`` are dropped is a rule of
    practice.

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
    >>> new = reweighed(np.array([0.5, 0.3, 0.2]), np.array([0.9, 0.3, 0.01]), 0.05)
    >>> new.weights.round(3).tolist(), new.rejected.tolist()
    ([0.833, 0.167, 0.0], [False, False, True])
    """
    if not ((weights >= 0.0).all() and abs(weights.sum() - 1.0) < 1e-6):
        raise InvalidInput(
            f"weights that sum to {weights.sum():g}", "they sum to 1", "look at the realizations"
        )
    rejected = survival < least
    product = np.where(rejected, 0.0, weights * survival)
    total = product.sum()
    return Reweighed(rejected, product / total if total > 0.0 else product)


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
    mean = weights @ _rates(curves, levels)
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
    """
    rates = _rates(curves, levels)
    order = np.argsort(rates, axis=0)
    risen = np.take_along_axis(rates, order, axis=0)
    reached = np.cumsum(weights[order], axis=0)
    rows = [(reached < share * (1.0 - 1e-12)).sum(axis=0) for share in shares]
    return np.stack([np.take_along_axis(risen, row[None], axis=0)[0] for row in rows])


def _rates(curves: Sequence[HazardCurve], levels: Array) -> Array:
    return np.stack([np.nan_to_num(curve.rate_at(levels)) for curve in curves])
