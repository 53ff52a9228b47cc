"""Which unknown decides where the boundary lies: Sobol indices by a model of few draws.

Some tens of draws are too few for indices themselves. A Gaussian process of the logarithm of the
boundary over what was drawn stands for them, with a length for each unknown and a share of noise,
and the indices are those of its mean. What the process does not explain of draws that it has not
seen is told beside them; where that is more than `SUPPORTED` leaves, there are no indices.

References
----------
Le Gratiet, L., Cannamela, C. & Iooss, B. (2014), SIAM/ASA J. Uncertainty Quantification 2, 336-363:
indices by a Gaussian process.
Saltelli, A. et al. (2010), Computer Physics Communications 181, 259-270: their estimators.
Rasmussen, C. E. & Williams, C. K. I. (2006), Gaussian Processes for Machine Learning: the process.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.stats import qmc, sobol_indices
from threadpoolctl import threadpool_limits

from vsr_core.arrays import Array, Indices

SUPPORTED = 0.5
"""Least share of the variance of draws left out that the process must explain."""

POINTS, REPLICATES = 1024, 100
"""Points of each sample of the priors, and bootstrap samples of the draws."""

LENGTHS = (1.0, 4.0)
"""Lengths at which the search for those of the process begins, in standard deviations."""

SEED = 11
"""Of the samples."""

FEWEST = 16
"""Draws with which a process is tried: with 8 it explained noise in 4 of 60 tries."""

FOLDS = 10
"""Parts in which draws are left out."""


@dataclass(frozen=True, eq=False)
class Unknown:
    """What was drawn of one unknown.

    Attributes
    ----------
    values : ndarray, shape (draws, k), its numbers in each draw, of about unit variance
    prior : callable, from uniform numbers on (0, 1), shape (n, k), to its numbers, of that shape
    """

    name: str
    values: Array
    prior: Callable[[Array], Array]


@dataclass(frozen=True, eq=False)
class Shares:
    """Indices of each unknown; NaN where the draws do not support any.

    Attributes
    ----------
    explained : float, share of the variance of draws left out that the process explains; NaN where
        none was tried
    variance : float, of the number over the draws
    first, total : ndarray, shape (1 + REPLICATES, unknowns)
        From all draws, then from bootstrap samples of them, with the process refitted at its
        lengths.
    """

    explained: float
    variance: float
    first: Array
    total: Array


def interval(replicates: Array) -> Array:
    """From 5 to 95 % of the bootstrap, shape (unknowns, 2)."""
    return np.asarray(np.percentile(replicates[1:], [5.0, 95.0], axis=0).T)


def joined(parts: Sequence[Shares]) -> Shares:
    """Indices of several numbers of the same draws together, each with the weight of its variance.

    Returns
    -------
    Shares
        Indices of those that have any; the share explained is of all for which a process was tried.

    References
    ----------
    Gamboa, F. et al. (2014), Electronic Journal of Statistics 8, 575-603.
    """
    tried = [part for part in parts if np.isfinite(part.explained)]
    if not tried:
        return parts[0]
    weights = np.array([part.variance for part in tried])
    explained, variance = (
        float(np.average([getattr(part, name) for part in tried], weights=weights))
        for name in ("explained", "variance")
    )
    first, total = (
        _mean_of_known(np.array([getattr(part, name) for part in tried]), weights)
        for name in ("first", "total")
    )
    return Shares(explained, variance, first, total)


def shares(unknowns: Sequence[Unknown], output: Array) -> Shares:
    """Sobol indices of a number that each draw has.

    Parameters
    ----------
    output : ndarray, shape (draws,)
    """
    count = len(unknowns)
    if not count or len(output) < FEWEST or not np.isfinite(output).all() or np.ptp(output) == 0.0:
        return _unsupported(count, np.nan, np.nan)
    with threadpool_limits(1):  # its matrices are so small that threads only wait for each other
        return _by_process(unknowns, output)


def _by_process(unknowns: Sequence[Unknown], output: Array) -> Shares:
    """Indices of the mean of a Gaussian process of the output."""
    count, number = len(unknowns), len(output)
    design = np.hstack([unknown.values for unknown in unknowns])
    explained, variance = _explained(design, output), float(output.var())
    if explained < SUPPORTED:
        return _unsupported(count, explained, variance)
    kernel, noise = _fitted(design, output)
    samples = _samples(unknowns)
    across = kernel(samples.reshape(-1, samples.shape[-1]), design)
    rng = np.random.default_rng(SEED)
    picks = [np.arange(number), *rng.integers(0, number, (REPLICATES, number))]
    covariance = kernel(design)
    predicted = np.array([across[:, p] @ _weights(covariance, noise, output, p) for p in picks])
    values = predicted.reshape(len(picks), count + 2, POINTS)
    return Shares(explained, variance, *_indices(values))


def _mean_of_known(indices: Array, weights: Array) -> Array:
    """Weighted mean of the parts that have indices, NaN if none has; shape without the parts."""
    known = np.isfinite(indices).all(axis=(1, 2))
    if not known.any():
        return indices[0]
    return np.asarray(np.average(indices[known], axis=0, weights=weights[known]))


def _unsupported(count: int, explained: float, variance: float) -> Shares:
    none = np.full((1 + REPLICATES, count), np.nan)
    return Shares(explained, variance, none, none)


def _fitted(design: Array, output: Array) -> tuple[Callable[..., Array], float]:
    """Covariance of a Gaussian process without its noise, and the variance of the noise.

    Both as shares of the variance of the output, which does not matter to what is predicted.
    """
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    tried = []
    for length in LENGTHS:
        lengths = RBF(np.full(design.shape[1], length), (0.3, 100.0))
        start = ConstantKernel(1.0, (1e-2, 1e3)) * lengths + WhiteKernel(0.05, (1e-6, 1.0))
        with warnings.catch_warnings():
            # A length without end belongs to an unknown without effect.
            warnings.simplefilter("ignore", ConvergenceWarning)
            tried.append(GaussianProcessRegressor(start, normalize_y=True).fit(design, output))
    best = max(tried, key=lambda process: process.log_marginal_likelihood_value_)
    return best.kernel_.k1, float(best.kernel_.k2.noise_level)


def _explained(design: Array, output: Array) -> float:
    """Share of the variance that is predicted of draws left out, 0 where their mean does better.

    Without a fold of them the process is fitted anew: lengths follow the noise of the draws that
    they are found with, which looks explained by them. Draws in a row of a sequence of Sobol are
    spread over the priors, and make a fold.
    """
    every, error = np.arange(len(output)), np.empty(len(output))
    for out in np.array_split(every, FOLDS):
        rest = np.setdiff1d(every, out)
        kernel, noise = _fitted(design[rest], output[rest])
        weights = _weights(kernel(design), noise, output, rest)
        error[out] = output[out] - output[rest].mean() - kernel(design[out], design[rest]) @ weights
    return max(0.0, float(1.0 - (error**2).mean() / output.var()))


def _weights(covariance: Array, noise: float, output: Array, picks: Indices) -> Array:
    """Weights of the picked draws in what is predicted, less their mean."""
    inside = covariance[np.ix_(picks, picks)] + noise * np.eye(len(picks))
    return np.linalg.solve(inside, output[picks] - output[picks].mean())


def _samples(unknowns: Sequence[Unknown]) -> Array:
    """Two samples of the priors, and the first with each unknown from the second.

    Shape (unknowns + 2, POINTS, numbers).
    """
    ends = np.cumsum([0, *(unknown.values.shape[1] for unknown in unknowns)]).tolist()
    even = np.clip(qmc.Sobol(2 * ends[-1], rng=SEED).random(POINTS), 1e-6, 1.0 - 1e-6)
    spans = list(pairwise(ends))
    one, other = (
        np.hstack([u.prior(half[:, slice(*span)]) for u, span in zip(unknowns, spans, strict=True)])
        for half in np.hsplit(even, 2)
    )
    mixed = np.repeat(one[None], len(unknowns), axis=0)
    for at, span in enumerate(spans):
        mixed[at, :, slice(*span)] = other[:, slice(*span)]
    return np.concatenate([[one, other], mixed])


def _indices(values: Array) -> tuple[Array, Array]:
    """First-order and total indices of values on the samples, each shape (replicates, unknowns)."""
    one, other, mixed = values[:, 0], values[:, 1], np.moveaxis(values[:, 2:], 1, 0)
    found = sobol_indices(func={"f_A": one, "f_B": other, "f_AB": mixed}, n=POINTS)
    kinds = (found.first_order, found.total_order)  # without the axis of a single unknown
    first, total = (np.clip(kind, 0.0, 1.0).reshape(len(values), -1) for kind in kinds)
    return first, total
