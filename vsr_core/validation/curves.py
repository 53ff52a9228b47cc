"""Fragility curves of tests and of predictions, with intervals over ground motions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from vsr_core.arrays import Array
from vsr_core.fragility.lognormal import probit_likelihood
from vsr_core.fragility.newton import maximise

SAMPLES = 200
"""Bootstrap samples of whole ground motions."""

SEED = 1
"""Of the bootstrap samples."""

FLATTEST, STEEPEST = 0.05, 50.0
"""Least and largest slope: of a curve that is nearly level, and of one that is a step."""


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


def curve(intensity: Array, share: Array, motions: NDArray[np.str_], at: Array) -> Curve:
    """Lognormal fragility by maximum likelihood, with a bootstrap over ground motions.

    Parameters
    ----------
    intensity : ndarray, shape (n,), above 0
    share : ndarray, shape (n,), 0 or 1 of a test, a probability of a prediction
    motions : ndarray of str, shape (n,)
    at : ndarray, shape (k,), intensities at which it is evaluated

    References
    ----------
    Baker, J. W. (2015). Efficient analytical fragility function fitting using dynamic structural
    analysis. Earthquake Spectra 31(1), Eq. 11.
    """
    names, group = np.unique(motions, return_inverse=True)
    chosen = np.random.default_rng(SEED).integers(0, len(names), (SAMPLES, len(names)))
    counts = np.array([np.bincount(row, minlength=len(names)) for row in chosen])
    weights = np.vstack([np.ones(len(share)), counts[:, group]])
    centre = float(np.log(intensity).mean())
    design = np.column_stack([np.ones(len(share)), np.log(intensity) - centre])
    likelihood = probit_likelihood(design, np.zeros((len(weights), 1)), weights * share, weights)
    fitted, _ = maximise(likelihood, np.tile([0.0, 1.0], (len(weights), 1)))
    level, slope = fitted[:, :1], np.clip(fitted[:, 1:], FLATTEST, STEEPEST)
    drawn = norm.cdf(level + slope * (np.log(at) - centre))
    low, high = np.percentile(drawn[1:], [2.5, 97.5], axis=0)
    median = float(np.exp(centre - level[0, 0] / slope[0, 0]))
    return Curve(at, drawn[0], low, high, median)
