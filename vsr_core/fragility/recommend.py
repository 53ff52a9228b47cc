"""Which model to use for a grid, and why, in one sentence."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vsr_core.fragility.result import Boundary, Scores

SIMPLEST = "logistic"
MATERIAL = 0.005
"""Smallest difference in log loss worth a less simple model [nat per run]."""


def recommend(
    scores: Mapping[str, Scores], boundary: Boundary, *, separated: bool
) -> tuple[str, str]:
    """Name the logistic model unless another one predicts left-out rows clearly better.

    Clearly is by more than one standard error of the difference between folds (the
    one-standard-error rule: Hastie, Tibshirani & Friedman 2009, section 7.10) and by more than
    `MATERIAL`. Then the model with the least log loss is named.

    Parameters
    ----------
    scores : mapping of str to Scores
        By model name; "logistic" among them.
    separated : bool
        Whether a straight line in ln PGA and ln PGV/PGA divides the outcomes without error.

    Returns
    -------
    name, reason : str
        The name is "none" when only one outcome occurred.
    """
    fell = boundary.cluster_sizes.sum()
    stood = np.isfinite(boundary.lower).any() or boundary.islands.any()
    if not fell:
        return "none", "Nothing toppled: the boundary lies above the tested motions."
    if not stood:
        return "none", "Every decided run toppled: the boundary lies below the tested motions."
    if not all(np.isfinite(entry.log_loss) for entry in scores.values()):
        return SIMPLEST, "Too few PGV/PGA levels to compare models; the simplest model is given."
    best = min(scores, key=lambda name: scores[name].log_loss)
    chosen = best if _clearly_worse(scores[SIMPLEST], scores[best]) else SIMPLEST
    return chosen, _reason(chosen, scores, boundary, separated=separated)


def _clearly_worse(scores: Scores, best: Scores) -> bool:
    """Whether the mean excess over the best, fold by fold, exceeds its error and `MATERIAL`."""
    excess = scores.fold_log_loss - best.fold_log_loss
    return bool(excess.mean() > max(excess.std(ddof=1) / np.sqrt(excess.size), MATERIAL))


def _reason(
    chosen: str, scores: Mapping[str, Scores], boundary: Boundary, *, separated: bool
) -> str:
    loss = {name: f"{entry.log_loss:.3g}" for name, entry in scores.items()}
    clusters, islands = boundary.cluster_sizes.size, int(boundary.islands.sum())
    if chosen == SIMPLEST:
        how = " (a straight line divides the outcomes without error)" if separated else ""
        return (
            f"The simplest model predicts left-out levels as well as any, within one standard "
            f"error{how}: log loss {loss[chosen]}."
        )
    return (
        f"Log loss on left-out levels {loss[chosen]} against {loss[SIMPLEST]} for the logistic "
        f"model, more than one standard error: the boundary is not one straight line in ln PGA and "
        f"ln PGV/PGA ({clusters} toppled cluster(s), {islands} balanced cell(s) above a first "
        "overturning)."
    )
