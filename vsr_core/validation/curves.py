"""Fragility curves of tests and of predictions, with intervals over ground motions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SAMPLES = 200
"""Bootstrap samples of whole ground motions."""

STEEPEST = 50.0
"""Slope of a curve that is a step."""


@dataclass(frozen=True)
class Curve:
    """Probability of overturning over an intensity measure.

    Attributes
    ----------
    intensity, probability, low, high : ndarray, shape (k,); the last two a 95 % interval
    median : float, intensity at a probability of one half
    """

    intensity: Array
    probability: Array
    low: Array
    high: Array
    median: float


def curve(
    intensity: Array, share: Array, motions: NDArray[np.str_], at: Array, seed: int = 1
) -> Curve:
    """Lognormal fragility by maximum likelihood, with a bootstrap over ground motions.

    Parameters
    ----------
    intensity : ndarray, shape (n,), above 0
    share : ndarray, shape (n,), 0 or 1 of a test, a probability of a prediction
    motions : ndarray of str, shape (n,)
    at : ndarray, shape (k,), intensities to tell it at

    References
    ----------
    Baker, J. W. (2015). Efficient analytical fragility function fitting using dynamic structural
    analysis. Earthquake Spectra 31(1), Eq. 11.
    """
    from scipy.stats import norm

    logs, names = np.log(intensity), np.unique(motions)
    rng = np.random.default_rng(seed)
    groups = [np.flatnonzero(motions == name) for name in names]
    median, slope = _probit(logs, share)
    drawn = []
    for _ in range(SAMPLES):
        rows = np.concatenate([groups[k] for k in rng.integers(0, len(groups), len(groups))])
        centre, steep = _probit(logs[rows], share[rows])
        drawn.append(norm.cdf(steep * (np.log(at) - centre)))
    low, high = np.percentile(drawn, [2.5, 97.5], axis=0)
    return Curve(at, norm.cdf(slope * (np.log(at) - median)), low, high, float(np.exp(median)))


def _probit(logs: Array, share: Array) -> tuple[float, float]:
    """Logarithm of the median and the slope of most likelihood."""
    from scipy.optimize import minimize
    from scipy.stats import norm

    def loss(given: Array) -> float:
        score = given[1] * (logs - given[0])
        return -float(np.sum(share * norm.logcdf(score) + (1.0 - share) * norm.logcdf(-score)))

    start = np.array([float(np.median(logs)), 2.0])
    bounds = [(float(logs.min()) - 2.0, float(logs.max()) + 2.0), (0.05, STEEPEST)]
    found = minimize(loss, start, bounds=bounds, method="L-BFGS-B").x
    return float(found[0]), float(found[1])
