"""Logistic regressions of the outcomes of tests, on an ensemble's log-odds and on the motions."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vsr_core.arrays import Array, Mask
from vsr_core.fragility.logistic import is_separated

if TYPE_CHECKING:
    from sklearn.pipeline import Pipeline


@dataclass(frozen=True)
class Calibration:
    """P = 1 / (1 + exp(-(intercept + slope * log-odds of the ensemble))).

    Attributes
    ----------
    intercept, slope : float, NaN where there is none
    tests : int, those with an outcome that it is of
    """

    intercept: float
    slope: float
    tests: int

    @property
    def known(self) -> bool:
        """Whether there is one."""
        return not np.isnan(self.slope)

    def probability(self, overturned: Array, members: Array) -> Array:
        """Calibrated probabilities, shape (n,), of counts as in ``calibrate``; NaN without one."""
        score = self.intercept + self.slope * _log_odds(overturned, members)
        return np.asarray(1.0 / (1.0 + np.exp(-score)))


def _log_odds(overturned: Array, members: Array) -> Array:
    """Log-odds of overturning with half a member more on each side (Jeffreys), shape (n,)."""
    return np.asarray(np.log((overturned + 0.5) / (members - overturned + 0.5)))


def calibrate(overturned: Array, members: Array, observed: Mask) -> Calibration:
    """Logistic regression of outcomes on the ensemble's log-odds (Platt 1999).

    Parameters
    ----------
    overturned, members : ndarray, shape (n,), members that overturned and that have a verdict
    observed : ndarray of bool, shape (n,)

    Returns
    -------
    Calibration
        Of NaN where the outcomes have no such regression, see ``regressed``.
    """
    return Calibration(*regressed(_log_odds(overturned, members), observed), len(observed))


def regressed(score: Array, observed: Mask) -> tuple[float, float]:
    """Intercept and slope of a logistic regression on one score by maximum likelihood.

    Parameters
    ----------
    score : ndarray, shape (n,)
    observed : ndarray of bool, shape (n,)

    Returns
    -------
    tuple of float
        NaN where the likelihood has no single maximum: all tests ended alike or have the same
        score, or a value of it divides those that overturned from the others.

    Examples
    --------
    >>> regressed(np.array([-1.0, 0.0, 1.0]), np.array([False, False, True]))
    (nan, nan)
    """
    if _is_divided(score[:, None], observed) or np.ptp(score) == 0.0:
        return float("nan"), float("nan")
    scaler, fit = _fitted(score[:, None], observed)
    slope = float(fit.coef_[0, 0] / scaler.scale_[0])
    return float(fit.intercept_[0] - slope * scaler.mean_[0]), slope


def _is_divided(features: Array, observed: Mask) -> bool:
    """Whether no logistic regression has a maximum: one outcome at most, or a plane between two."""
    points = np.column_stack([np.ones(len(features)), features])
    toppled = observed.astype(np.float64)
    return not len(observed) or is_separated(points, toppled, 1.0 - toppled)


def _fitted(features: Array, observed: Mask) -> Pipeline:
    from sklearn.linear_model import LogisticRegression
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    # a solver ends by the slope of the likelihood, which is small where features vary little
    fit = LogisticRegression(C=np.inf, solver="newton-cholesky", tol=1e-9)
    return make_pipeline(StandardScaler(), fit).fit(features, observed)


FOLDS = 10
"""Parts into which the ground motions are divided; each is predicted from the others."""


def logistic(features: Array, observed: Mask, motions: NDArray[np.str_]) -> Array:
    """Probabilities of a logistic regression, cross-validated by ground motion.

    Every test is predicted by a fit that saw no test of its motion. There is no penalty, as in the
    published fit (Purvance et al. 2008).

    Parameters
    ----------
    features : ndarray, shape (n, k)
    observed : ndarray of bool, shape (n,)
    motions : ndarray of str, shape (n,)

    Returns
    -------
    ndarray, shape (n,)
        NaN in a part without a fit: the other motions are none, all their tests ended alike, or a
        plane divides those that overturned from the others.
    """
    from sklearn.model_selection import GroupKFold

    probability = np.full(len(observed), np.nan)
    parts = min(FOLDS, len(np.unique(motions)))
    if parts < 2:
        return probability
    for train, rest in GroupKFold(parts).split(features, observed, motions):
        if not _is_divided(features[train], observed[train]):
            fit = _fitted(features[train], observed[train])
            probability[rest] = fit.predict_proba(features[rest])[:, 1]
    return probability


def first_half(motions: NDArray[np.str_]) -> Mask:
    """Tests whose ground motion belongs to the half that is used for calibration.

    The half is fixed by the parity of the CRC-32 of the motion's name, whatever tests there are.

    Parameters
    ----------
    motions : ndarray of str, shape (n,)

    Returns
    -------
    ndarray of bool, shape (n,)

    Examples
    --------
    >>> first_half(np.array(["RSN3", "RSN316", "RSN316"]))
    array([False,  True,  True])
    """
    return np.array([zlib.crc32(name.encode()) % 2 == 0 for name in motions.tolist()], dtype=bool)
