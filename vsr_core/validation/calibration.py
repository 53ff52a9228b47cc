"""From the share of an ensemble to a probability, calibrated on half of the ground motions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsr_core.arrays import Array, Mask


@dataclass(frozen=True)
class Calibration:
    """P = 1 / (1 + exp(-(intercept + slope * log-odds of the ensemble)))."""

    intercept: float = 0.0
    slope: float = 1.0
    tests: int = 0

    def probability(self, overturned: Array, members: Array) -> Array:
        """Calibrated probabilities, shape (n,), of counts as in ``calibrate``."""
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
        One that changes nothing where all tests ended alike.
    """
    from sklearn.linear_model import LogisticRegression

    if observed.all() or not observed.any():
        return Calibration()
    score = _log_odds(overturned, members)[:, None]
    fit = LogisticRegression(C=np.inf).fit(score, observed)
    return Calibration(float(fit.intercept_[0]), float(fit.coef_[0, 0]), len(observed))
