"""Predictors that know no mechanics, to compare with."""

from __future__ import annotations

import zlib

import numpy as np
from numpy.typing import NDArray

from vsr_core.arrays import Array, Mask

FOLDS = 10
"""Parts into which the ground motions are divided; each is predicted from the others."""


def logistic(features: Array, happened: Mask, motions: NDArray[np.str_]) -> Array:
    """Probabilities of a logistic regression, cross-validated by ground motion.

    Every test is predicted by a fit that saw no test of its motion. No penalty, as the fit is
    published (Purvance et al. 2008); a separated part would show as probabilities of 0 and 1.

    Parameters
    ----------
    features : ndarray, shape (n, k)
    happened : ndarray of bool, shape (n,)
    motions : ndarray of str, shape (n,)

    Returns
    -------
    ndarray, shape (n,)
    """
    from sklearn.linear_model import LogisticRegression
    from sklearn.model_selection import GroupKFold

    probability = np.full(len(happened), happened.mean())
    parts = min(FOLDS, len(np.unique(motions)))
    if parts < 2 or happened.all() or not happened.any():
        return probability
    for train, rest in GroupKFold(parts).split(features, happened, motions):
        if len(np.unique(happened[train])) == 2:
            fit = LogisticRegression(C=np.inf).fit(features[train], happened[train])
            probability[rest] = fit.predict_proba(features[rest])[:, 1]
    return probability


def first_half(motions: NDArray[np.str_]) -> Mask:
    """Tests whose ground motion belongs to the half on which things may be calibrated, shape (n,).

    Fixed: by the parity of the CRC-32 of the motion's name, whatever tests there are.
    """
    return np.array([zlib.crc32(name.encode()) % 2 == 0 for name in motions.tolist()], dtype=bool)
