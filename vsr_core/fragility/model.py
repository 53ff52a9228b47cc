"""What every fragility model offers, how it is fitted, and what a fit returns.

Rows are PGV/PGA values [s], columns PGA values [g]. A level PGA (median or band edge) of 0 means
"below the smallest PGA tested" and inf "above the largest one"; being ordered numbers, they keep
percentiles meaningful. NaN means "not known".
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.fragility.boundary import Boundary, Cells


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


Evaluate = Callable[[Array, Indices], tuple[Array, Array]]

MAX_STEP = 10.0
"""Largest component of a step, relative to the largest of the unknowns where that exceeds 1: the
cap keeps a first step from a flat likelihood finite, and steps grow with unknowns that do."""

MANY = 10_000
"""Steps within which a function that has a maximum comes to it: some hundreds at most."""


def maximise(
    evaluate: Evaluate, start: Array, *, tolerance: float = 1e-8, max_iterations: int = 50
) -> tuple[Array, Mask]:
    """Maximise a batch of functions, halving any step that makes its function worse.

    Parameters
    ----------
    evaluate : callable
        `evaluate(beta, which)` with beta (n, p) for the batch members `which` (n,) gives their
        values (n,) and Newton steps (n, p).
    start : ndarray, shape (batch, p)
    tolerance : float
        A member is done when the largest component of its next step is below this, relative to
        its largest unknown where that exceeds 1.

    Returns
    -------
    beta : ndarray, shape (batch, p)
    converged : ndarray of bool, shape (batch,)
    """
    beta = np.array(start, dtype=np.float64)
    value, step = evaluate(beta, np.arange(len(beta)))
    step = _capped(step, beta)
    converged = _size(step) < tolerance * _scale(beta)
    for _ in range(max_iterations):
        busy = np.flatnonzero(~converged)
        if busy.size == 0:
            break
        trial = beta[busy] + step[busy]
        trial_value, trial_step = evaluate(trial, busy)
        # rounding in the sum over cells may hide a gain in the last digits
        better = trial_value >= value[busy] - 1e-10 * (1.0 + np.abs(value[busy]))
        taken = busy[better]
        beta[taken], value[taken] = trial[better], trial_value[better]
        step[taken] = _capped(trial_step[better], beta[taken])
        step[busy[~better]] /= 2
        converged[busy] = _size(step[busy]) < tolerance * _scale(beta[busy])
    return beta, converged


def maxima(evaluate: Evaluate, start: Array, *, tolerance: float) -> Array:
    """Maxima of functions that have one, as `maximise` finds them; to come to none is an error."""
    beta, converged = maximise(evaluate, start, tolerance=tolerance, max_iterations=MANY)
    if not converged.all():
        raise ArithmeticError(f"{(~converged).sum()} of {len(beta)} fits came to no maximum")
    return beta


def _size(vectors: Array) -> Array:
    return np.abs(vectors).max(axis=1)


def _scale(beta: Array) -> Array:
    return np.maximum(_size(beta), 1.0)


def _capped(step: Array, beta: Array) -> Array:
    most = MAX_STEP * _scale(beta)
    return step * (most / np.maximum(_size(step), most))[:, None]


class FragilityModel(ABC):
    """A model fitted to the cells of one grid; many fits are one batch, the leading axis.

    Attributes
    ----------
    coefs : ndarray, shape (1, ...)
        Coefficients of the fit, as a batch of one.
    method : str
        How the model was estimated, in words.
    least_rows : int
        Rows with a verdict that it takes for intervals.
    """

    name: ClassVar[str]
    least_rows: ClassVar[int] = 2
    cells: Cells
    coefs: Array
    separated: bool
    method: str

    @abstractmethod
    def refit(self, row_weights: Array) -> Array:
        """Fit again with PGV/PGA row r counted `row_weights[:, r]` times.

        Parameters
        ----------
        row_weights : ndarray, shape (batch, n_ratio)

        Returns
        -------
        ndarray, shape (batch, ...)
        """

    def resample(self, row_weights: Array, rng: np.random.Generator) -> Array:
        """Bootstrap replicates; shapes as of `refit`, which they are if nothing else is random."""
        return self.refit(row_weights)

    def named(self, coefs: Array) -> dict[str, Array]:
        """Parameters of a batch by name, each of shape (batch,) or (batch, n_ratio).

        None where coefficients mean nothing one by one.
        """
        return {}

    def opened(self, ends: dict[str, tuple[Array, Array]]) -> dict[str, tuple[Array, Array]]:
        """Ends of intervals, of parameters and the median, 0 or inf where no run bounds one."""
        return ends

    @abstractmethod
    def probability(self, coefs: Array, ln_pga: Array) -> Array:
        """P(overturned) at PGAs, shape (n,) [ln g], of each row: shape (batch, n_ratio, n)."""

    def grid_probability(self, coefs: Array) -> Array:
        """P(overturned) at the model's cells, shape (batch, n_ratio, n_pga)."""
        return self.probability(coefs, self.cells.ln_pga)

    @abstractmethod
    def grid_contour(self, coefs: Array, probability: float) -> Array:
        """Smallest PGA [g] with a probability at the grid's rows, shape (batch, n_ratio)."""
