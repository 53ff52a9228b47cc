"""How well a model predicts rows it has not seen, and which model to use for a grid."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vsr_core.arrays import Array, Indices
from vsr_core.fragility.boundary import Boundary, Cells
from vsr_core.fragility.model import FragilityModel, Scores

N_FOLDS = 10
CLIP = 1e-3
"""Probabilities are clipped to [CLIP, 1 - CLIP] in the log loss: a few thousand runs cannot
support a stronger claim, and one cell on the wrong side of a sharp curve would otherwise
outweigh all others."""


@dataclass(frozen=True)
class Bootstrap:
    """95 % percentile intervals: of each parameter by name, and of the median boundary [g].

    Each entry is a pair (lower, upper); the median's have shape (n_ratio,).
    """

    parameters: dict[str, tuple[Array, Array]]
    median: tuple[Array, Array]


def folds(cells: Cells) -> Indices:
    """Fold of each PGV/PGA row: 0, 1, ... interleaved over the rows with runs; -1 for others.

    Interleaved, because neighbouring rows are alike: a left-out row is then predicted from
    both its neighbours, as in use. So the two end rows, which have one neighbour, always stay
    (-1) where there are four rows or more: no model here is meant to extrapolate.

    Returns
    -------
    ndarray of int, shape (n_ratio,)

    Examples
    --------
    >>> folds(Cells(np.zeros(1), np.arange(5.0), np.ones((5, 1)), np.ones((5, 1))))
    array([-1,  0,  1,  2, -1])
    """
    fold = np.full(cells.ln_ratio.size, -1)
    rows = np.flatnonzero(cells.usable)
    if rows.size >= 4:
        rows = rows[1:-1]
    fold[rows] = np.arange(rows.size) % min(N_FOLDS, rows.size)
    return fold


def held_out_probability(model: FragilityModel) -> Array:
    """P(overturned) from fits that left the cell's row out.

    Returns
    -------
    ndarray, shape (n_ratio, n_pga)
    """
    fold = folds(model.cells)
    kept = fold != np.arange(fold.max() + 1)[:, None]
    predicted = model.grid_probability(model.refit(kept.astype(np.float64)))
    return predicted[np.maximum(fold, 0), np.arange(fold.size)]


def cross_validate(model: FragilityModel) -> Scores:
    """Score a fitted model on PGV/PGA rows left out in `N_FOLDS` interleaved folds.

    Hyperparameters (the ridge of the smooth model) stay as chosen on the whole grid, so that
    model's score is slightly flattered.

    Returns
    -------
    Scores
        NaN with fewer than two rows.
    """
    cells = model.cells
    if cells.usable.sum() < 2:
        return Scores(np.nan, np.nan, np.nan, np.nan, np.empty(0))
    fold = folds(cells)
    log_loss, squared, hits = _losses(cells, held_out_probability(model))
    total = cells.trials[fold >= 0].sum()
    fold_log_loss = np.array(
        [log_loss[fold == k].sum() / cells.trials[fold == k].sum() for k in range(fold.max() + 1)]
    )
    return Scores(
        log_loss=float(log_loss[fold >= 0].sum() / total),
        log_loss_se=float(fold_log_loss.std(ddof=1) / np.sqrt(fold_log_loss.size)),
        brier=float(squared[fold >= 0].sum() / total),
        accuracy=float(hits[fold >= 0].sum() / total),
        fold_log_loss=fold_log_loss,
    )


def bootstrap(model: FragilityModel, n: int, seed: int = 0) -> Bootstrap:
    """Percentile intervals from resampling whole PGV/PGA rows.

    The runs of a row share one motion shape and are not independent, so the row is the unit.
    On a deterministic grid the interval shows how far the answer depends on which rows were
    run; for the lognormal model, whose rows need no other, where in its interval each threshold
    may lie (see `LognormalFragility.resample`). It does not hold the error of the simulation.

    Parameters
    ----------
    seed : int
        The same seed gives identical intervals.

    Returns
    -------
    Bootstrap
        NaN with fewer rows than the model takes.
    """
    cells = model.cells
    rows = np.flatnonzero(cells.usable)
    if rows.size < model.least_rows:
        empty = {name: np.full_like(v[0], np.nan) for name, v in model.named(model.coefs).items()}
        unknown = np.full(cells.ln_ratio.size, np.nan)
        return Bootstrap({name: (v, v) for name, v in empty.items()}, (unknown, unknown))
    rng = np.random.default_rng(seed)
    weights = np.zeros((n, cells.ln_ratio.size))
    weights[:, rows] = rng.multinomial(rows.size, np.full(rows.size, 1.0 / rows.size), size=n)
    coefs = model.resample(weights, rng)
    return Bootstrap(
        {name: _interval(values) for name, values in model.named(coefs).items()},
        _interval(model.grid_contour(coefs, 0.5)),
    )


def _losses(cells: Cells, probability: Array) -> tuple[Array, Array, Array]:
    """Log loss, squared error and hits of each cell, summed over its runs."""
    fell, stood = cells.toppled, cells.trials - cells.toppled
    clipped = np.clip(probability, CLIP, 1.0 - CLIP)
    log_loss = -(fell * np.log(clipped) + stood * np.log1p(-clipped))
    squared = fell * (1.0 - probability) ** 2 + stood * probability**2
    return log_loss, squared, np.where(probability >= 0.5, fell, stood)


def _interval(replicates: Array) -> tuple[Array, Array]:
    """2.5 and 97.5 % percentiles along the first axis.

    By order statistics, without interpolation: a boundary may be 0 or inf (off the grid).
    """
    low, high = np.percentile(replicates, [2.5, 97.5], axis=0, method="inverted_cdf")
    return np.asarray(low), np.asarray(high)


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
    fell = np.isfinite(boundary.upper).any()
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
        f"ln PGV/PGA (toppled clusters: {clusters}; balanced cells above a first overturning: "
        f"{islands})."
    )
