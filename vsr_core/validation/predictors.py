"""Predictors without mechanics, for comparison."""

from __future__ import annotations

import zlib

import numpy as np
from numpy.typing import NDArray

from vsr_core.arrays import Array, Mask

FOLDS = 10
"""Parts into which the ground motions are divided; each is predicted from the others."""


def logistic(features: Array, observed: Mask, motions: NDArray[np.str_]) -> Array:
    """Probabilities of a logistic regression, cross-validated by ground motion.

    Every test is predicted by a fit that saw no test of its motion. There is no penalty, as in the
    published fit (Purvance et al. 2008); a part that separates would show as probabilities of 0
    and 1.

    Parameters
    ----------
    features : ndarray, shape (n, k)
    observed : ndarray of bool, shape (n,)
    motions : ndarray of str, shape (n,)

    Returns
    -------
    ndarray, shape (n,)
    """
    from sklearn.linear_model import LogisticRegression
    from sklearn.model_selection import GroupKFold

    probability = np.full(len(observed), observed.mean())
    parts = min(FOLDS, len(np.unique(motions)))
    if parts < 2 or observed.all() or not observed.any():
        return probability
    for train, rest in GroupKFold(parts).split(features, observed, motions):
        if len(np.unique(observed[train])) == 2:
            fit = LogisticRegression(C=np.inf).fit(features[train], observed[train])
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
