"""Draws of a rock weighed by what was observed of it, and what a further test would teach.

A draw whose threshold t of a test is known explains an observation with the likelihood

    moved at v:      exp(-((v - t) / sd)^2 / 2) Phi((s - v) / sd)
    stood up to v:   Phi((min(t, s) - v) / sd)

where s is what it slides at, and sd the error of the observed value. Observations are independent
of each other but for the draw: their likelihoods multiply, in any order.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from scipy.special import log_ndtr

from vsr_core.arrays import Array, Indices
from vsr_core.validation.conditioning import effective_number

LEAST = -8.0
"""Logarithm of a likelihood, relative to that of a draw that agrees wholly, below which a draw does
not explain an observation: four standard deviations."""

BAND = (0.05, 0.5, 0.95)
"""Quantiles of a band and its middle."""


def of_threshold(value: float, sd: float, tips: Array, slides: Array, *, moved: bool) -> Array:
    """Logarithm of the likelihood of a threshold test, 0 where a draw agrees wholly.

    Parameters
    ----------
    value, sd : float, in the unit of the test
    tips, slides : ndarray, shape (draws,), thresholds of the draws

    Examples
    --------
    >>> tips, slides = np.array([9.0, 12.0, 30.0]), np.full(3, 35.0)
    >>> of_threshold(9.0, 1.0, tips, slides, moved=True).round(2).tolist()
    [-0.0, -4.5, -220.5]
    >>> of_threshold(10.0, 1.0, tips, slides, moved=False).round(2).tolist()
    [-1.84, -0.02, -0.0]
    """
    if moved:
        return np.asarray(-0.5 * ((value - tips) / sd) ** 2 + log_ndtr((slides - value) / sd))
    return np.asarray(log_ndtr((np.minimum(tips, slides) - value) / sd))


def weights(log_likelihoods: Array) -> Array:
    """Weights of draws, the same in whatever order the observations are.

    Parameters
    ----------
    log_likelihoods : ndarray, shape (observations, draws)

    Returns
    -------
    ndarray, shape (draws,), of sum 1
    """
    total = np.sort(log_likelihoods, axis=0).sum(axis=0)
    found = np.exp(total - total.max())
    return np.asarray(found / found.sum())


def unexplained(log_likelihoods: Array, least: float = LEAST) -> list[int]:
    """Numbers of the observations that no draw explains."""
    return np.flatnonzero(~(log_likelihoods.max(axis=1) > least)).tolist()


def left(log_likelihood: Array) -> Array:
    """Weights of draws by one observation alone, shape (draws,), of those that were tried.

    Parameters
    ----------
    log_likelihood : ndarray, shape (draws,), minus infinity where a draw was not tried
    """
    return weights(log_likelihood[np.isfinite(log_likelihood)][None])


def contradiction(log_likelihoods: Array) -> tuple[int, ...]:
    """The two observations that are hardest to explain together, or all, where no draw does.

    Of all together half a unit more is allowed for each, as errors add up.

    Examples
    --------
    >>> contradiction(np.array([[0.0, -50.0], [-50.0, 0.0], [0.0, 0.0]]))
    (0, 1)
    >>> contradiction(np.array([[0.0, -7.0, -7.0], [-7.0, 0.0, -7.0], [-7.0, -7.0, 0.0]]))
    (0, 1, 2)
    """
    best = log_likelihoods.max(axis=1)

    def agreement(some: tuple[int, ...]) -> float:
        return float(log_likelihoods[list(some)].sum(axis=0).max() - best[list(some)].sum())

    every = tuple(range(len(log_likelihoods)))
    worst = min(combinations(every, 2), key=agreement, default=())
    if worst and agreement(worst) < LEAST:
        return worst
    return every if agreement(every) < LEAST - 0.5 * len(every) else ()


def resampled(weight: Array, count: int) -> Indices:
    """Numbers of draws that stand for the weights with one and the same weight each.

    Evenly spaced quantiles of the weights (systematic resampling, Kitagawa 1996).

    Examples
    --------
    >>> resampled(np.array([0.5, 0.0, 0.25, 0.25]), 4).tolist()
    [0, 0, 2, 3]
    """
    ends = np.cumsum(weight)
    found = np.searchsorted(ends / ends[-1], (np.arange(count) + 0.5) / count)
    return np.asarray(np.minimum(found, len(weight) - 1))


def quantiles(values: Array, weight: Array, shares: tuple[float, ...] = BAND) -> Array:
    """Quantiles of weighed values in each column, shape (shares, columns).

    By Weibull's plotting positions i / (n + 1), n being the effective number: a further draw lies
    below a quantile with its probability, also where few draws are left.

    Parameters
    ----------
    values : ndarray, shape (draws, columns)
    weight : ndarray, shape (draws,)

    Examples
    --------
    >>> values = np.array([[3.0], [1.0], [2.0], [9.0]])
    >>> quantiles(values, np.array([1.0, 1.0, 1.0, 0.0]) / 3.0, (0.05, 0.25, 0.5)).tolist()
    [[1.0], [1.0], [2.0]]
    """
    below = effective_number(weight)
    order = np.argsort(values, axis=0)
    place = np.cumsum(weight[order], axis=0) * below / (below + 1.0)
    sorted_values = np.take_along_axis(values, order, axis=0)
    columns = zip(place.T, sorted_values.T, strict=True)
    return np.column_stack([np.interp(shares, at, column) for at, column in columns])


def width(values: Array, weight: Array) -> Array:
    """Width of the band in each column: its upper end less its lower one, shape (columns,)."""
    low, _, high = quantiles(values, weight)
    return np.asarray(high - low)


def expected_widths(boundary: Array, angle: Array, weight: Array, sd: float) -> Array:
    """Width of the band that is to be expected once the rock has been tilted in one direction.

    That of jointly normal quantities: a test with the error sd of an angle of deviation s, which
    goes with the boundary at a correlation r, leaves sqrt(1 - r^2 s^2 / (s^2 + sd^2)) of its width.

    Parameters
    ----------
    boundary : ndarray, shape (draws, directions), of which the band is
    angle : ndarray, shape (draws, directions), at which the draws tip
    sd : float, error of an observed angle, in its unit

    Returns
    -------
    ndarray, shape (directions, directions), of the test and of the band

    Examples
    --------
    A test as uncertain as what it measures leaves 1 / sqrt(2) of that band, and all of others:

    >>> one = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]])
    >>> alike = np.full(4, 0.25)
    >>> (expected_widths(one, one, alike, 1.0) / width(one, alike)).round(3).tolist()
    [[0.707, 1.0], [1.0, 0.707]]
    """
    far, of_angle = boundary - weight @ boundary, angle - weight @ angle
    spread = weight @ of_angle**2
    joint = (of_angle * weight[:, None]).T @ far
    least = np.finfo(float).tiny
    told = joint**2 / ((spread + sd**2)[:, None] * np.maximum(weight @ far**2, least))
    return np.asarray(width(boundary, weight) * np.sqrt(1.0 - np.minimum(told, 1.0)))


def shares(output: Array, unknowns: Array, weight: Array) -> Array:
    """Share of the variance of an output that goes with each unknown, and with none of them.

    The covariance of the output with each term of its linear regression on the unknowns (covariance
    decomposition: Li et al. 2010, J. Phys. Chem. A 114, 6022), which holds for unknowns that
    observations have made dependent; a share may then be below zero.

    Parameters
    ----------
    output : ndarray, shape (draws,)
    unknowns : ndarray, shape (draws, k)

    Returns
    -------
    ndarray, shape (k + 1,), of sum 1; NaN where nothing varies

    Examples
    --------
    >>> x = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]])
    >>> shares(2.0 * x[:, 0] + x[:, 1], x, np.full(4, 0.25)).round(6).tolist()
    [0.8, 0.2, 0.0]
    """
    root = np.sqrt(weight)[:, None]
    x, y = unknowns - weight @ unknowns, (output - weight @ output)[:, None]
    variance = float((root * y * root * y).sum())
    if not variance > 0.0:
        return np.full(unknowns.shape[1] + 1, np.nan)
    slope = np.linalg.lstsq(root * x, root * y, rcond=None)[0]
    parts = (weight[:, None] * (x * slope.T) * y).sum(axis=0) / variance
    return np.append(parts, 1.0 - parts.sum())
