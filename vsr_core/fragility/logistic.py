"""Logistic regression of the outcome on ln PGA and ln PGV/PGA (Purvance's form)."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
from scipy.optimize import linprog
from scipy.special import expit, logit

from vsr_core.arrays import Array, Indices
from vsr_core.fragility.boundary import Cells
from vsr_core.fragility.model import Evaluate, FragilityModel, maxima, maximise


class Logistic(FragilityModel):
    """logit P(overturned) = b0 + b1 ln(PGA / 1 g) + b2 ln((PGV/PGA) / 1 s)."""

    name = "logistic"

    @abstractmethod
    def _solve(self, row_weights: Array, tolerance: float) -> Array:
        """Scaled coefficients for each row of weights, shape (batch, p)."""

    @abstractmethod
    def _unscaled(self, beta: Array) -> Array:
        """Undo the centring and scaling: shape (batch, p) -> (batch, 3)."""

    def refit(self, row_weights: Array) -> Array:
        return self._unscaled(self._solve(row_weights, tolerance=1e-6))

    def named(self, coefs: Array) -> dict[str, Array]:
        return dict(zip(("b0", "b1", "b2"), coefs.T, strict=True))

    def probability(self, coefs: Array, ln_pga: Array) -> Array:
        b0, b1, b2 = coefs.T[..., None, None]
        return expit(b0 + b1 * ln_pga + b2 * self.cells.ln_ratio[:, None])

    def grid_contour(self, coefs: Array, probability: float) -> Array:
        """As of the base; without a rising P: 0 if it is at the level everywhere, else inf."""
        b0, b1, b2 = coefs.T[..., None]
        missing = logit(probability) - b0 - b2 * self.cells.ln_ratio
        rising = b1 > 0
        with np.errstate(over="ignore"):
            pga = np.exp(missing / np.where(rising, b1, 1.0))
        return np.where(rising, pga, np.where((b1 < 0) | (missing <= 0), 0.0, np.inf))


class LogisticFragility(Logistic):
    """logit P(overturned) = b0 + b1 ln(PGA / 1 g) + b2 ln((PGV/PGA) / 1 s).

    Unpenalised maximum likelihood where it exists. When a line separates the outcomes (as on
    almost every deterministic grid) the likelihood has no maximum; a linear program detects
    this exactly and Firth's penalised likelihood is used instead, which is always finite. A
    slope that the data do not determine (one PGA, one PGV/PGA or one outcome only) is 0.

    References
    ----------
    Purvance, M. D. (2005), PhD thesis, University of Nevada, Reno: the form, as cited by Chen
    et al. (2024); its exact text and coefficients could not be read.
    Firth, D. (1993), Biometrika 80(1), 27-38.
    Heinze, G. & Schemper, M. (2002), Statistics in Medicine 21, 2409-2419: Firth's penalty as
    the remedy for separation.
    Konis, K. (2007), DPhil thesis, University of Oxford: separation by linear programming.
    """

    def __init__(self, cells: Cells) -> None:
        self.cells = cells
        self._row, column = np.nonzero(cells.trials)
        raw = np.stack([cells.ln_pga[column], cells.ln_ratio[self._row]], axis=1)
        self._centre, spread = raw.mean(axis=0), raw.std(axis=0)
        self._known = (spread > 1e-12) & cells.varied
        self._slope_scale = np.where(self._known, 1.0 / np.where(self._known, spread, 1.0), 0.0)
        scaled = (raw - self._centre) * self._slope_scale
        self._design = np.column_stack([np.ones(len(raw)), scaled[:, self._known]])
        self._toppled = cells.toppled[self._row, column]
        self._trials = cells.trials[self._row, column]

        self.separated = is_separated(self._design, self._toppled, self._trials - self._toppled)
        self._start = np.zeros((1, self._design.shape[1]))
        self._start = self._solve(np.ones((1, cells.ln_ratio.size)), tolerance=1e-9)
        self.coefs = self._unscaled(self._start)
        self.method = (
            "Firth's penalised likelihood (the outcomes are separated)"
            if self.separated
            else "maximum likelihood"
        )
        if not cells.varied:
            self.method += "; only one outcome: no slope is known, both are set to 0"
        elif not self._known.all():
            self.method += "; only one PGA or PGV/PGA: its slope is not known and set to 0"
        if self.coefs[0, 1] < 0:
            self.method += "; P falls with PGA: there is no boundary to read"

    def _solve(self, row_weights: Array, tolerance: float) -> Array:
        """Scaled coefficients for each row of weights, shape (batch, p)."""
        weights = row_weights[:, self._row]
        start = np.repeat(self._start, len(weights), axis=0)
        if self.separated:
            return maxima(self._likelihood(weights, firth=True), start, tolerance=tolerance)
        beta, converged = maximise(
            self._likelihood(weights, firth=False), start, tolerance=tolerance
        )
        # rows left out can separate what the whole grid did not; Newton then never settles
        lost = ~converged
        if lost.any():
            firth = self._likelihood(weights[lost], firth=True)
            beta[lost] = maxima(firth, start[lost], tolerance=tolerance)
        return beta

    def _likelihood(self, weights: Array, *, firth: bool) -> Evaluate:
        """Return the value-and-step function of the (penalised) likelihood for `maximise`."""
        design = self._design
        n_coef = design.shape[1]
        outer = (design[:, :, None] * design[:, None, :]).reshape(len(design), -1)

        def evaluate(beta: Array, which: Indices) -> tuple[Array, Array]:
            trials, toppled = weights[which] * self._trials, weights[which] * self._toppled
            eta = beta @ design.T
            prob = expit(eta)
            variance = trials * prob * (1.0 - prob)
            eigenvalue, vector = np.linalg.eigh((variance @ outer).reshape(-1, n_coef, n_coef))
            known = eigenvalue > 1e-12 * eigenvalue[:, -1:]
            inverse_value = np.where(known, 1.0 / np.where(known, eigenvalue, 1.0), 0.0)
            inverse = (vector * inverse_value[:, None, :]) @ vector.transpose(0, 2, 1)
            residual = toppled - trials * prob
            value = (toppled * eta - trials * np.logaddexp(0.0, eta)).sum(axis=1)
            if firth:
                # Firth 1993, eq. 4: the hat diagonal pulls each fitted probability to 1/2
                leverage = variance * (inverse.reshape(len(beta), -1) @ outer.T)
                residual = residual + leverage * (0.5 - prob)
                value = value + 0.5 * np.log(np.where(known, eigenvalue, 1.0)).sum(axis=1)
            step = np.einsum("bij,bj->bi", inverse, residual @ design)
            if firth:
                # the pull bends the likelihood, too: by as much again where a cell fits itself
                step /= 1.0 + leverage.max(axis=1, keepdims=True)
            return value, step

        return evaluate

    def _unscaled(self, beta: Array) -> Array:
        """Undo the centring and scaling: shape (batch, p) -> (batch, 3)."""
        slopes = np.zeros((len(beta), 2))
        slopes[:, self._known] = beta[:, 1:]
        slopes *= self._slope_scale
        return np.column_stack([beta[:, 0] - slopes @ self._centre, slopes])


def is_separated(points: Array, toppled: Array, balanced: Array) -> bool:
    """Whether a plane through the origin separates the outcomes, completely or quasi.

    Solves max mean s_i x_i.b subject to s_i x_i.b >= 0 and |b_j| <= 1, with s = +1 for
    overturned and -1 for balanced: the optimum is positive exactly when the outcomes are
    separated (Konis 2007).

    Parameters
    ----------
    points : ndarray, shape (n, p)
        A first column of ones makes it a plane anywhere in the other p - 1 coordinates.
    toppled, balanced : ndarray, shape (n,)
        Overturned and balanced runs of each point.

    Examples
    --------
    >>> line = np.array([[1.0, 0.1], [1.0, 0.2], [1.0, 0.3]])
    >>> is_separated(line, np.array([0, 0, 1]), np.array([1, 1, 0]))
    True
    >>> is_separated(line, np.array([0, 1, 0]), np.array([1, 0, 1]))
    False
    """
    signed = np.concatenate([points[toppled > 0], -points[balanced > 0]])
    found = linprog(
        -signed.mean(axis=0),
        A_ub=-signed,
        b_ub=np.zeros(len(signed)),
        bounds=(-1.0, 1.0),
        method="highs",
    )
    return bool(-found.fun > 1e-6)
