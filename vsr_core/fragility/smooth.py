"""A smooth logit surface that can hold several toppled clusters and balanced islands."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Self

import numpy as np
import numpy.typing as npt
from scipy.special import expit, logit
from sklearn.base import BaseEstimator
from sklearn.preprocessing import SplineTransformer

from vsr_core.arrays import Array, Indices
from vsr_core.errors import InvalidInput
from vsr_core.fragility.boundary import first_crossing
from vsr_core.fragility.cells import tabulate
from vsr_core.fragility.cross_validation import held_out_log_loss
from vsr_core.fragility.newton import maximise

RIDGE = 1e-4  # on every coefficient: keeps a grid with one outcome finite


class SmoothFragility(BaseEstimator):
    """logit P(overturned) = s(ln PGA, ln PGV/PGA), a penalised tensor-product cubic spline.

    Logistic regression on products of B-splines with a ridge on the differences of neighbouring
    coefficients (P-splines). The knots are quantiles of the grid's own values, so resolution
    follows the grid. Nothing makes P rise with PGA: an island stays an island. The strength of
    the ridge is the one with the least log loss on left-out PGV/PGA rows; it is then kept for
    folds and replicates. On a grid the information matrix factors into row and column parts
    (array regression), which makes a fit about 50 times cheaper than the flat regression.
    Beyond the grid the surface is constant: no extrapolation.

    Parameters
    ----------
    n_knots : int
        Knots along each direction, fewer where the grid has fewer values.
    penalties : sequence of float
        Candidates for the strength of the ridge.

    Attributes
    ----------
    coefs_ : ndarray, shape (1, n_basis)
    penalty_ : float
    effective_parameters_ : float
        Trace of the hat matrix: how many free parameters the penalised surface spends.
    separated_ : bool
        Always False: the penalised fit is finite whether or not the outcomes separate.
    method_ : str
    cells_ : Cells

    References
    ----------
    Eilers, P. H. C. & Marx, B. D. (1996), Statistical Science 11(2), 89-121: P-splines.
    Currie, I. D., Durban, M. & Eilers, P. H. C. (2006), J. R. Statist. Soc. B 68(2), 259-280:
    generalised linear array models.
    """

    name = "smooth"
    parameter_units: ClassVar[dict[str, str]] = {}

    def __init__(
        self,
        n_knots: int = 10,
        penalties: Sequence[float] = (1.0, 0.1, 0.03, 0.01, 3e-3, 1e-3, 3e-4),
    ) -> None:
        self.n_knots = n_knots
        self.penalties = penalties

    def fit(self, pga: npt.ArrayLike, pgv_pga: npt.ArrayLike, overturned: npt.ArrayLike) -> Self:
        """Fit flat run arrays, each of shape (n_runs,): PGA [g], PGV/PGA [s], outcome."""
        if self.n_knots < 2 or not len(self.penalties) or min(self.penalties) <= 0:
            raise InvalidInput(
                f"n_knots {self.n_knots}, penalties {tuple(self.penalties)}",
                "at least 2 knots and one penalty above 0",
                "leave both at their defaults",
            )
        self.cells_ = cells = tabulate(pga, pgv_pga, overturned)
        self._row_spline = self._spline(cells.ln_ratio)
        self._column_spline = self._spline(cells.ln_pga)
        self._row_basis = self._row_spline.transform(cells.ln_ratio[:, None])
        self._column_basis = self._column_spline.transform(cells.ln_pga[:, None])
        self._roughness = roughness(self._row_basis.shape[1], self._column_basis.shape[1])

        everything = np.ones((1, cells.ln_ratio.size))
        start = np.zeros((1, len(self._roughness)))
        tried: list[tuple[float, float, Array]] = []
        for penalty in sorted(self.penalties, reverse=True):  # each starts from the one before
            self.penalty_ = penalty
            self.coefs_ = start = self._solve(everything, start, tolerance=1e-6)
            tried.append((held_out_log_loss(self), penalty, start))
        # too few rows to leave any out: all losses are NaN and the smoothest is kept
        _, self.penalty_, self.coefs_ = min(tried, key=lambda entry: np.nan_to_num(entry[0]))
        prob = self.grid_probability(self.coefs_)
        fisher = self._fisher(cells.trials * prob * (1.0 - prob))[0]
        hat = np.linalg.solve(fisher + self._ridge(), fisher)
        self.effective_parameters_ = float(np.trace(hat))
        self.separated_ = False
        self.method_ = (
            f"penalised likelihood, ridge {self.penalty_:g} by cross-validation, "
            f"{self.effective_parameters_:.0f} effective parameters"
        )
        return self

    def predict_proba(self, pga: npt.ArrayLike, pgv_pga: npt.ArrayLike) -> Array:
        """P(overturned) at PGA [g] and PGV/PGA [s], broadcast against each other."""
        pga_values, ratio_values = np.broadcast_arrays(
            np.asarray(pga, dtype=np.float64), np.asarray(pgv_pga, dtype=np.float64)
        )
        rows = self._row_spline.transform(np.log(ratio_values).reshape(-1, 1))
        columns = self._column_spline.transform(np.log(pga_values).reshape(-1, 1))
        table = self.coefs_.reshape(rows.shape[1], columns.shape[1])
        return expit(((rows @ table) * columns).sum(axis=1)).reshape(pga_values.shape)

    def contour(self, pgv_pga: npt.ArrayLike, probability: float = 0.5) -> Array:
        """Smallest grid-range PGA [g] with P >= `probability`; 0 or inf outside the grid."""
        ratio = np.asarray(pgv_pga, dtype=np.float64)
        rows = self._row_spline.transform(np.log(ratio).reshape(-1, 1))
        margin = self._logit(self.coefs_, rows)[0] - logit(probability)
        return first_crossing(self.cells_.ln_pga, margin).reshape(ratio.shape)

    def refit(self, row_weights: Array, rng: np.random.Generator | None = None) -> Array:
        """Fit again, at the chosen ridge, with row r counted row_weights[:, r] times.

        Parameters
        ----------
        row_weights : ndarray, shape (batch, n_ratio)
        rng : unused; part of the protocol of `scores`.

        Returns
        -------
        ndarray, shape (batch, n_basis)
        """
        start = np.repeat(self.coefs_, len(row_weights), axis=0)
        return self._solve(np.asarray(row_weights, dtype=np.float64), start, tolerance=1e-2)

    def named(self, coefs: Array) -> dict[str, Array]:
        """Nothing: spline coefficients have no meaning one by one."""
        return {}

    def grid_probability(self, coefs: Array) -> Array:
        """P(overturned) at the grid cells, shape (batch, n_ratio, n_pga)."""
        return expit(self._logit(coefs, self._row_basis))

    def grid_contour(self, coefs: Array, probability: float) -> Array:
        """Smallest PGA [g] at a probability at the grid's rows, shape (batch, n_ratio)."""
        margin = self._logit(coefs, self._row_basis) - logit(probability)
        return first_crossing(self.cells_.ln_pga, margin)

    def _spline(self, values: Array) -> SplineTransformer:
        """Cubic B-splines on quantiles of the values; of lower degree on fewer than 4 values."""
        degree = min(3, values.size - 1)
        knots: str | Array = "quantile"
        if values.size == 1:  # a constant: one basis function around the only value
            knots = np.array([[values[0] - 1.0], [values[0] + 1.0]])
        n_knots = min(self.n_knots, max(values.size - degree + 1, 2))
        spline = SplineTransformer(n_knots, degree=degree, knots=knots, extrapolation="constant")
        # scikit-learn wants two samples; a repeated one changes nothing
        return spline.fit(np.resize(values, (max(values.size, 2), 1)))

    def _ridge(self) -> Array:
        return self.penalty_ * self._roughness + RIDGE * np.eye(len(self._roughness))

    def _logit(self, coefs: Array, rows: Array) -> Array:
        table = coefs.reshape(len(coefs), rows.shape[1], self._column_basis.shape[1])
        return rows @ table @ self._column_basis.T

    def _fisher(self, variance: Array) -> Array:
        """Information matrices from cell variances (batch, n_ratio, n_pga), by array algebra."""
        row_pairs, column_pairs = _pairs(self._row_basis), _pairs(self._column_basis)
        n_row, n_column = self._row_basis.shape[1], self._column_basis.shape[1]
        paired = row_pairs.T @ (variance @ column_pairs)
        split = paired.reshape(-1, n_row, n_row, n_column, n_column).transpose(0, 1, 3, 2, 4)
        return split.reshape(len(variance), n_row * n_column, n_row * n_column)

    def _solve(self, weights: Array, start: Array, tolerance: float) -> Array:
        """Penalised maximum likelihood for each row of weights, shape (batch, n_basis)."""
        ridge = self._ridge()

        def evaluate(beta: Array, which: Indices) -> tuple[Array, Array]:
            eta = self._logit(beta, self._row_basis)
            prob = expit(eta)
            trials = weights[which, :, None] * self.cells_.trials
            toppled = weights[which, :, None] * self.cells_.toppled
            pull = beta @ ridge
            value = (toppled * eta - trials * np.logaddexp(0.0, eta)).sum(axis=(1, 2))
            value -= 0.5 * (beta * pull).sum(axis=1)
            residual = self._row_basis.T @ (toppled - trials * prob) @ self._column_basis
            score = residual.reshape(beta.shape) - pull
            curvature = self._fisher(trials * prob * (1.0 - prob)) + ridge
            return value, np.linalg.solve(curvature, score[..., None])[..., 0]

        return maximise(evaluate, start, tolerance=tolerance)[0]


def _pairs(basis: Array) -> Array:
    """Products of all pairs of columns, shape (n, k) -> (n, k * k)."""
    return (basis[:, :, None] * basis[:, None, :]).reshape(len(basis), -1)


def roughness(n_row: int, n_column: int) -> Array:
    """Sum of squared differences of neighbouring coefficients of a table, as a matrix.

    Examples
    --------
    >>> roughness(1, 2)
    array([[ 1., -1.],
           [-1.,  1.]])
    """
    down, across = (np.diff(np.eye(n), axis=0) for n in (n_row, n_column))
    return np.kron(down.T @ down, np.eye(n_column)) + np.kron(np.eye(n_row), across.T @ across)
