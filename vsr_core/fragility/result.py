"""What a fragility fit returns: plain frozen records of numpy arrays.

Conventions shared by every record: rows are PGV/PGA values [s], columns PGA values [g].
A level PGA (median or band edge) of 0 means "below the smallest PGA tested" and inf "above the
largest one"; being ordered numbers, they keep percentiles meaningful. NaN means "not known".
"""

from __future__ import annotations

from dataclasses import dataclass

from vsr_core.arrays import Array, Indices, Mask


@dataclass(frozen=True)
class Boundary:
    """First-overturning PGA of each PGV/PGA row, read off the grid without a model.

    Attributes
    ----------
    pga : ndarray, shape (n_ratio,) [g]
        Geometric middle of the interval; inf in a row that never topples, NaN in a row without
        decided cells.
    lower : ndarray, shape (n_ratio,) [g]
        Largest balanced PGA below the first overturned one. NaN when the first decided cell
        already overturned. In a censored row: the largest balanced PGA.
    upper : ndarray, shape (n_ratio,) [g]
        First overturned PGA; inf in a row that never topples, NaN in a row without decided cells.
    censored : ndarray of bool, shape (n_ratio,)
        The row has decided cells and none overturned: the boundary lies above the grid.
    islands : ndarray of int, shape (n_ratio,)
        Balanced cells above the first overturned one.
    cluster_sizes : ndarray of int, shape (n_clusters,)
        Cells in each group of toppled cells that balanced cells separate from the others.
    """

    pga: Array
    lower: Array
    upper: Array
    censored: Mask
    islands: Indices
    cluster_sizes: Indices


@dataclass(frozen=True)
class Parameter:
    """One fitted parameter with its 95 % bootstrap interval.

    `value`, `lower` and `upper` have shape () for a parameter of the whole grid and (n_ratio,)
    for one that each PGV/PGA row has of its own. `lower` and `upper` are NaN where the data
    give no interval.
    """

    name: str
    value: Array
    lower: Array
    upper: Array


@dataclass(frozen=True)
class Scores:
    """Cross-validation scores over left-out PGV/PGA rows; NaN with fewer than two rows.

    Attributes
    ----------
    log_loss : float
        Mean negative log probability of the observed outcome [nat per run].
    log_loss_se : float
        Its standard error from the spread between folds.
    brier : float
        Mean squared difference between probability and outcome.
    accuracy : float
        Share of runs on the right side of P = 0.5.
    fold_log_loss : ndarray, shape (n_folds,)
        Log loss of each fold; models are compared fold by fold.
    """

    log_loss: float
    log_loss_se: float
    brier: float
    accuracy: float
    fold_log_loss: Array


@dataclass(frozen=True)
class ModelFit:
    """One model fitted to one grid.

    Attributes
    ----------
    name : str
        "logistic", "lognormal" or "smooth".
    method : str
        How it was estimated, in words.
    separated : bool
        A straight line (logistic), or every row's threshold (lognormal), divides the outcomes
        without error, so the transition width comes from the grid and not from scatter. False
        for "smooth", whose penalty makes the question moot.
    parameters : tuple of Parameter
        Empty for "smooth", whose spline coefficients mean nothing one by one.
    median, median_lower, median_upper : ndarray, shape (n_ratio,) [g]
        Smallest PGA with P >= 0.5 and its 95 % bootstrap interval. The logistic line goes on
        beyond the tested PGA; the other models say 0 or inf there.
    band_low, band_high : ndarray, shape (n_ratio,) [g]
        PGA at P = 0.025 and P = 0.975: the 95 % band of the fitted model.
    probability : ndarray, shape (n_ratio, n_pga)
        P(overturned) at the grid cells.
    """

    name: str
    method: str
    separated: bool
    parameters: tuple[Parameter, ...]
    scores: Scores
    median: Array
    median_lower: Array
    median_upper: Array
    band_low: Array
    band_high: Array
    probability: Array


@dataclass(frozen=True)
class FragilityResult:
    """Everything learnt from one grid: boundary, fitted models, and the recommended one.

    `recommended` is a name out of `models`, or "none" when the outcomes do not vary; `reason`
    is one sentence.
    """

    boundary: Boundary
    models: tuple[ModelFit, ...]
    recommended: str
    reason: str

    def model(self, name: str) -> ModelFit:
        """Return the fitted model called `name`."""
        return next(fitted for fitted in self.models if fitted.name == name)
