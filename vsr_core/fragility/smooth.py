"""A smooth logit surface that can hold several toppled clusters and balanced islands."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline
from scipy.special import expit, logit

from vsr_core.arrays import Array, Indices
from vsr_core.fragility.boundary import Cells, first_crossing
from vsr_core.fragility.cross_validation import cross_validate
from vsr_core.fragility.model import FragilityModel, maxima

N_KNOTS = 10
"""Knots along each direction, fewer where the grid has fewer values."""

PENALTIES = (1.0, 0.1, 0.03, 0.01, 3e-3, 1e-3, 3e-4)
"""Candidates for the strength of the ridge, descending: each fit starts from the one before."""

AT_ONCE = 1_000_000
"""Cells of all replicates that are fitted at once: a table of them takes 8 MB."""

RIDGE = 1e-4
"""On every coefficient: keeps a grid with one outcome finite."""


class SmoothFragility(FragilityModel):
    """logit P(overturned) = s(ln PGA, ln PGV/PGA), a penalised tensor-product cubic spline.

    Logistic regression on products of B-splines with a ridge on the differences of neighbouring
    coefficients (P-splines). The knots are quantiles of the grid's own values, so resolution
    follows the grid. Nothing makes P rise with PGA: an island stays an island. The strength of
    the ridge is the one with the least log loss on left-out PGV/PGA rows; it is then kept for
    folds and replicates. On a grid the information matrix factors into row and column parts
    (array regression), which makes a fit about 50 times cheaper than the flat regression.

    Attributes
    ----------
    effective_parameters : float
        Trace of the hat matrix: how many free parameters the penalised surface spends.

    References
    ----------
    Eilers, P. H. C. & Marx, B. D. (1996), Statistical Science 11(2), 89-121: P-splines.
    Currie, I. D., Durban, M. & Eilers, P. H. C. (2006), J. R. Statist. Soc. B 68(2), 259-280:
    generalised linear array models.
    """

    name = "smooth"
    separated = False  # the penalised fit is finite whether or not the outcomes separate

    def __init__(self, cells: Cells) -> None:
        self.cells = cells
        self._rows = _splines(cells.ln_ratio, cells.ln_ratio)
        self._columns = _splines(cells.ln_pga, cells.ln_pga)
        self._roughness = _roughness(self._rows.shape[1], self._columns.shape[1])
        everything = np.ones((1, cells.ln_ratio.size))
        start = np.zeros((1, len(self._roughness)))
        tried: list[tuple[float, float, Array]] = []
        for self._penalty in PENALTIES:
            self.coefs = start = self._solve(everything, start, tolerance=1e-6)
            tried.append((cross_validate(self).log_loss, self._penalty, start))
        # too few rows to leave any out: all losses are NaN and the smoothest is kept
        _, self._penalty, self.coefs = min(tried, key=lambda entry: np.nan_to_num(entry[0]))
        prob = self.grid_probability(self.coefs)
        fisher = self._fisher(cells.trials * prob * (1.0 - prob))[0]
        hat = np.linalg.solve(fisher + self._ridge(), fisher)
        self.effective_parameters = float(np.trace(hat))
        self.method = (
            f"penalised likelihood, ridge {self._penalty:g} by cross-validation, "
            f"{self.effective_parameters:.0f} effective parameters"
        )

    def refit(self, row_weights: Array) -> Array:
        """As of the base, at the ridge that was chosen."""
        return np.concatenate(
            [
                self._solve(part, np.repeat(self.coefs, len(part), axis=0), tolerance=1e-4)
                for part in self._some(row_weights)
            ]
        )

    def probability(self, coefs: Array, ln_pga: Array) -> Array:
        """As of the base; beyond the model's cells that of the outermost ones."""
        inside = np.clip(ln_pga, *self.cells.ln_pga[[0, -1]])
        return expit(self._logit(coefs, _splines(self.cells.ln_pga, inside)))

    def grid_contour(self, coefs: Array, probability: float) -> Array:
        """As of the base; 0 and inf where the grid does not reach."""
        level = logit(probability)
        columns = self.cells.ln_pga
        return np.concatenate(
            [
                first_crossing(columns, self._logit(part, self._columns) - level)
                for part in self._some(coefs)
            ]
        )

    def _some(self, members: Array) -> list[Array]:
        """Members of a batch, as many at a time as may be at once; replicates know no others."""
        number = max(AT_ONCE // self.cells.trials.size, 1)
        return [members[start : start + number] for start in range(0, len(members), number)]

    def _ridge(self) -> Array:
        return self._penalty * self._roughness + RIDGE * np.eye(len(self._roughness))

    def _logit(self, coefs: Array, columns: Array) -> Array:
        table = coefs.reshape(len(coefs), self._rows.shape[1], self._columns.shape[1])
        return self._rows @ table @ columns.T

    def _fisher(self, variance: Array) -> Array:
        """Information matrices from cell variances (batch, n_ratio, n_pga), by array algebra."""
        n_row, n_column = self._rows.shape[1], self._columns.shape[1]
        paired = _pairs(self._rows).T @ (variance @ _pairs(self._columns))
        split = paired.reshape(-1, n_row, n_row, n_column, n_column).transpose(0, 1, 3, 2, 4)
        return split.reshape(len(variance), n_row * n_column, n_row * n_column)

    def _solve(self, weights: Array, start: Array, tolerance: float) -> Array:
        """Penalised maximum likelihood for each row of weights, shape (batch, n_basis)."""
        ridge = self._ridge()

        def evaluate(beta: Array, which: Indices) -> tuple[Array, Array]:
            eta = self._logit(beta, self._columns)
            prob = expit(eta)
            trials = weights[which, :, None] * self.cells.trials
            toppled = weights[which, :, None] * self.cells.toppled
            pull = beta @ ridge
            value = (toppled * eta - trials * np.logaddexp(0.0, eta)).sum(axis=(1, 2))
            value -= 0.5 * (beta * pull).sum(axis=1)
            residual = self._rows.T @ (toppled - trials * prob) @ self._columns
            score = residual.reshape(beta.shape) - pull
            curvature = self._fisher(trials * prob * (1.0 - prob)) + ridge
            return value, np.linalg.solve(curvature, score[..., None])[..., 0]

        return maxima(evaluate, start, tolerance=tolerance)


def _splines(values: Array, there: Array) -> Array:
    """Cubic B-splines on quantiles of values, at others; of lower degree on fewer than 4."""
    known = np.unique(values)
    degree = min(3, known.size - 1)
    if known.size == 1:  # a constant: one basis function around the only value
        knots = np.array([known[0] - 1.0, known[0] + 1.0])
    else:
        n_knots = min(N_KNOTS, max(known.size - degree + 1, 2))
        knots = np.percentile(known, 100.0 * np.linspace(0.0, 1.0, n_knots))
    low, high = knots[1] - knots[0], knots[-1] - knots[-2]  # go on evenly beyond the ends
    before = np.linspace(knots[0] - degree * low, knots[0] - low, degree)
    after = np.linspace(knots[-1] + high, knots[-1] + degree * high, degree)
    every = np.concatenate([before, knots, after])
    return np.asarray(BSpline(every, np.eye(knots.size + degree - 1), degree)(there))


def _pairs(basis: Array) -> Array:
    """Products of all pairs of columns, shape (n, k) -> (n, k * k)."""
    return (basis[:, :, None] * basis[:, None, :]).reshape(len(basis), -1)


def _roughness(n_row: int, n_column: int) -> Array:
    """Sum of squared differences of neighbouring coefficients of a table, as a matrix.

    Examples
    --------
    >>> _roughness(1, 2)
    array([[ 1., -1.],
           [-1.,  1.]])
    """
    down, across = (np.diff(np.eye(n), axis=0) for n in (n_row, n_column))
    return np.kron(down.T @ down, np.eye(n_column)) + np.kron(np.eye(n_row), across.T @ across)
