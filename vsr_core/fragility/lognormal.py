"""A lognormal fragility curve for each PGV/PGA row, interpolated between the rows."""

from __future__ import annotations

from typing import ClassVar, Self

import numpy as np
import numpy.typing as npt
from scipy.special import log_ndtr, ndtr, ndtri
from sklearn.base import BaseEstimator

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.errors import InvalidInput
from vsr_core.fragility.cells import tabulate
from vsr_core.fragility.newton import Evaluate, maximise

STATUS = {
    "probit": "outcomes overlap: maximum likelihood",
    "interval": "all balanced below all overturned: from the grid interval between them",
    "above": "never topples: theta is the least value that the row allows",
    "below": "topples from its first PGA on: theta is the largest value that the row allows",
    "flat": "toppling does not rise with PGA: beta held at its largest allowed value",
    "undecided": "no decided cell: interpolated from the neighbouring rows",
}


class LognormalFragility(BaseEstimator):
    """P(overturned) = Phi(ln(PGA / theta) / beta), with theta and beta for each PGV/PGA row.

    Where a row's outcomes overlap, maximum likelihood, that is probit regression on ln PGA with
    beta = 1/b1 and theta = exp(-b0/b1) (Baker 2015). Where they separate, the likelihood has no
    maximum and only the grid is informative: ln theta is taken as uniform on the interval from
    the last balanced to the first overturned PGA, so theta is their geometric mean and beta the
    standard deviation of that uniform, width / sqrt(12). A row that never topples (or always
    does) gets the interval of one further grid step beyond its last (first) PGA. ln theta and
    ln beta are linear in ln PGV/PGA between rows and constant beyond the outermost.

    Parameters
    ----------
    max_beta : float
        Largest allowed beta. A row that would exceed it does not order its outcomes by PGA
        (2.0: P rises from 2.5 % to 97.5 % over a factor 2500 in PGA).

    Attributes
    ----------
    theta_ : ndarray, shape (n_ratio,) [g]
    beta_ : ndarray, shape (n_ratio,) [1]
    status_ : tuple of str, length n_ratio
        A key of `STATUS` for each row.
    separated_ : bool
        No row's outcomes overlap.
    method_ : str
    cells_ : Cells

    References
    ----------
    Baker, J. W. (2015), Earthquake Spectra 31(1), 579-599, eq. 11: the likelihood.
    """

    name = "lognormal"
    parameter_units: ClassVar[dict[str, str]] = {"theta": "g", "beta": "1"}

    def __init__(self, max_beta: float = 2.0) -> None:
        self.max_beta = max_beta

    def fit(self, pga: npt.ArrayLike, pgv_pga: npt.ArrayLike, overturned: npt.ArrayLike) -> Self:
        """Fit flat run arrays, each of shape (n_runs,): PGA [g], PGV/PGA [s], outcome."""
        if not self.max_beta > 0:
            raise InvalidInput(
                f"max_beta {self.max_beta}", "it must be above 0", "the default is 2.0"
            )
        self.cells_ = cells = tabulate(pga, pgv_pga, overturned)
        rows = [self._threshold(row) for row in range(cells.ln_ratio.size)]
        status = np.array([name for name, _, _ in rows])
        # the interval of ln theta; for overlapping rows filled in below
        low, high = (np.array(side) for side in list(zip(*rows, strict=True))[1:])
        ln_theta, ln_beta = (low + high) / 2, np.log((high - low) / np.sqrt(12.0))
        self._ln_theta_se = np.zeros(len(rows))
        overlap = np.flatnonzero(status == "probit")
        if overlap.size:
            fitted = self._probit(overlap)
            ln_theta[overlap], ln_beta[overlap], self._ln_theta_se[overlap], flat = fitted
            status[overlap[flat]] = "flat"
        self._half_width = np.where(status == "interval", (high - low) / 2, 0.0)
        self._row_values = np.stack([ln_theta, ln_beta], axis=1)
        self.status_ = tuple(status.tolist())
        self.separated_ = overlap.size == 0
        self.theta_, self.beta_ = np.exp(self.coefs_[0].T)
        counts = {key: self.status_.count(key) for key in STATUS if key in self.status_}
        self.method_ = "by row: " + ", ".join(f"{n} {key}" for key, n in counts.items())
        return self

    def predict_proba(self, pga: npt.ArrayLike, pgv_pga: npt.ArrayLike) -> Array:
        """P(overturned) at PGA [g] and PGV/PGA [s], broadcast against each other."""
        ln_theta, beta = self._curve(pgv_pga)
        return ndtr((np.log(pga) - ln_theta) / beta)

    def contour(self, pgv_pga: npt.ArrayLike, probability: float = 0.5) -> Array:
        """PGA [g] with P = `probability` at PGV/PGA [s]."""
        ln_theta, beta = self._curve(pgv_pga)
        return np.exp(ln_theta + beta * ndtri(probability))

    @property
    def coefs_(self) -> Array:
        """Rows' ln theta and ln beta as a batch of one, shape (1, n_ratio, 2)."""
        return self.refit(np.ones((1, self.cells_.ln_ratio.size)))

    def refit(self, row_weights: Array, rng: np.random.Generator | None = None) -> Array:
        """Interpolate again from the rows of positive weight only.

        A row's own curve does not depend on the others, so resampling rows alone would show
        the error of interpolation and nothing else. With `rng`, ln theta of each kept row is
        also drawn from what the row leaves open: uniform on its grid interval, or normal with
        the standard error of the maximum-likelihood fit.

        Parameters
        ----------
        row_weights : ndarray, shape (batch, n_ratio)
        rng : Generator, optional

        Returns
        -------
        ndarray, shape (batch, n_ratio, 2)
            ln theta and ln beta.
        """
        ln_ratio = self.cells_.ln_ratio
        values = np.repeat(self._row_values[None], len(row_weights), axis=0)
        if rng is not None:
            shape = values.shape[:2]
            values[..., 0] += self._half_width * rng.uniform(-1.0, 1.0, shape)
            values[..., 0] += self._ln_theta_se * rng.standard_normal(shape)
        for member, weights in zip(values, row_weights, strict=True):
            kept = (weights > 0) & self.cells_.usable
            for column in range(2):
                member[:, column] = np.interp(ln_ratio, ln_ratio[kept], member[kept, column])
        return values

    def named(self, coefs: Array) -> dict[str, Array]:
        """Return the parameters of a batch by name, each of shape (batch, n_ratio)."""
        return dict(zip(self.parameter_units, np.exp(np.moveaxis(coefs, -1, 0)), strict=True))

    def grid_probability(self, coefs: Array) -> Array:
        """P(overturned) at the grid cells, shape (batch, n_ratio, n_pga)."""
        ln_theta, ln_beta = np.moveaxis(coefs[..., None], 2, 0)
        return ndtr((self.cells_.ln_pga - ln_theta) / np.exp(ln_beta))

    def grid_contour(self, coefs: Array, probability: float) -> Array:
        """PGA [g] of a probability at the grid's rows; 0 and inf where the grid does not reach.

        Returns
        -------
        ndarray, shape (batch, n_ratio)
        """
        ln_level = coefs[..., 0] + np.exp(coefs[..., 1]) * ndtri(probability)
        ln_pga = self.cells_.ln_pga
        level = np.where(ln_level > ln_pga[-1], np.inf, np.exp(np.minimum(ln_level, ln_pga[-1])))
        return np.where(ln_level < ln_pga[0], 0.0, level)

    def _curve(self, pgv_pga: npt.ArrayLike) -> tuple[Array, Array]:
        """Return ln theta and beta at PGV/PGA values."""
        ln_ratio, (ln_theta, ln_beta) = self.cells_.ln_ratio, self.coefs_[0].T
        where = np.log(pgv_pga)
        return np.interp(where, ln_ratio, ln_theta), np.exp(np.interp(where, ln_ratio, ln_beta))

    def _threshold(self, row: int) -> tuple[str, float, float]:
        """Status of a row and its interval of ln theta (NaN where there is none)."""
        ln_pga, toppled = self.cells_.ln_pga, self.cells_.toppled[row]
        balanced = self.cells_.trials[row] - toppled
        fell, stood = ln_pga[toppled > 0], ln_pga[balanced > 0]
        # one PGA only: no step to go by, so a factor of 2
        steps = np.diff(ln_pga) if ln_pga.size > 1 else np.array([np.log(2.0)])
        if not fell.size and not stood.size:
            return "undecided", np.nan, np.nan
        if not fell.size:
            return "above", stood[-1], max(stood[-1], ln_pga[-1]) + steps[-1]
        if not stood.size:
            return "below", min(fell[0], ln_pga[0]) - steps[0], fell[0]
        if stood[-1] < fell[0]:
            return "interval", stood[-1], fell[0]
        return "probit", np.nan, np.nan

    def _probit(self, rows: Indices) -> tuple[Array, Array, Array, Mask]:
        """Maximum likelihood of the given rows: ln theta, ln beta, s.e. of ln theta, flat."""
        ln_pga = self.cells_.ln_pga
        centre = ln_pga.mean()
        centred = ln_pga - centre
        toppled, trials = self.cells_.toppled[rows], self.cells_.trials[rows]
        slope = np.full(len(rows), 1.0 / self.max_beta)
        both = np.column_stack([np.ones(centred.size), centred])
        free, converged = maximise(
            probit_likelihood(both, np.zeros((len(rows), 1)), toppled, trials),
            np.column_stack([np.zeros(len(rows)), slope]),
        )
        flat = ~converged | (free[:, 1] < slope)
        level, _ = maximise(
            probit_likelihood(both[:, :1], slope[:, None] * centred, toppled, trials),
            np.zeros((len(rows), 1)),
        )
        b0, b1 = np.where(flat, level[:, 0], free[:, 0]), np.where(flat, slope, free[:, 1])
        information = _information(b0[:, None] + b1[:, None] * centred, trials)[0]
        # delta method: ln theta = -b0/b1; a flat row's slope is not estimated
        fisher = np.einsum("ri,ij,ik->rjk", information, both, both)
        gradient = np.stack([-1.0 / b1, np.where(flat, 0.0, b0 / b1**2)], axis=1)
        error = np.sqrt(np.einsum("ri,rij,rj->r", gradient, np.linalg.pinv(fisher), gradient))
        return centre - b0 / b1, -np.log(b1), error, flat


def _information(eta: Array, trials: Array) -> tuple[Array, Array, Array]:
    """Expected information of eta and the derivatives of ln P and ln (1 - P), cell by cell."""
    ln_density = -0.5 * eta**2 - 0.5 * np.log(2 * np.pi)
    rise = np.exp(ln_density - log_ndtr(eta))
    fall = np.exp(ln_density - log_ndtr(-eta))
    return trials * rise * fall, rise, fall


def probit_likelihood(design: Array, offset: Array, toppled: Array, trials: Array) -> Evaluate:
    """Value and Fisher-scoring step of independent probit fits, one for each row of counts."""

    def evaluate(beta: Array, which: Indices) -> tuple[Array, Array]:
        eta = beta @ design.T + offset[which]
        fell, balanced = toppled[which], trials[which] - toppled[which]
        value = (fell * log_ndtr(eta) + balanced * log_ndtr(-eta)).sum(axis=1)
        information, rise, fall = _information(eta, trials[which])
        score = (fell * rise - balanced * fall) @ design
        fisher = np.einsum("ri,ij,ik->rjk", information, design, design)
        return value, np.einsum("rij,rj->ri", np.linalg.pinv(fisher, hermitian=True), score)

    return evaluate
