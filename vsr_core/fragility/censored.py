"""The logistic model fitted to intervals of the first overturning."""

from __future__ import annotations

import numpy as np
from scipy.special import expit, logit

from vsr_core.arrays import Array, Indices
from vsr_core.fragility.boundary import Cells
from vsr_core.fragility.logistic import Logistic, is_separated
from vsr_core.fragility.model import Evaluate, maxima, maximise
from vsr_core.fragility.spans import Thresholds

NARROWEST = 1e-4
"""Width of an interval [ln g] that the slope is bounded by at the least."""

FLAT = 1e-12
"""Share of the largest curvature below which the data do not tell a direction."""


class CensoredLogistic(Logistic):
    """logit P(overturned) = b0 + b1 ln(PGA / 1 g) + b2 ln((PGV/PGA) / 1 s), from thresholds.

    The first overturning of a row is taken as logistic about a line in ln PGA and ln PGV/PGA; its
    likelihood is the probability of its interval, P(upper) - P(lower), whose logarithm is concave
    in the coefficients (Burridge 1981). A row that never topples, or topples from its first PGA on,
    is censored. Where a line goes through all intervals the likelihood has no maximum; b1 then has
    an exponential prior times b1, whose mode is as steep as a uniform distribution on the median
    interval. Where one outcome occurs only, both slopes are 0.

    References
    ----------
    Burridge, J. (1981), J. R. Statist. Soc. B 43(1), 41-45: grouped and censored observations.
    """

    def __init__(self, cells: Cells, thresholds: Thresholds) -> None:
        self.cells = cells
        low, high = thresholds.lower, np.where(np.isinf(thresholds.upper), np.nan, thresholds.upper)
        self._row = np.flatnonzero(~(np.isnan(low) & np.isnan(high)))
        low, high, ratio = low[self._row], high[self._row], cells.ln_ratio[self._row]
        ends = np.concatenate([low, high])
        self._varied = bool(np.isfinite(high).any() and np.isfinite(low).any())
        centre, spread = np.nanmean(ends), np.nanstd(ends)
        self._known = np.array([self._varied, self._varied and np.ptp(ratio) > 1e-12])
        spreads = np.array([spread if spread > 0 else 1.0, ratio.std() if self._known[1] else 1.0])
        self._centre = np.array([centre, ratio.mean()])
        self._slope_scale = np.where(self._known, 1.0 / spreads, 0.0)
        self._low, self._high = (low - centre) / spreads[0], (high - centre) / spreads[0]
        self._ratio = (ratio - self._centre[1]) / spreads[1]
        widths = self._high - self._low
        widths = widths[np.isfinite(widths)]
        # the standard deviation of a logistic of slope b is pi / sqrt(3) / b
        least = NARROWEST / spreads[0]
        self._steepest = 2.0 * np.pi / (max(np.median(widths), least) if widths.size else 1.0)
        self.separated = self._varied and self._is_separated()
        self._start = np.array([[0.0, 1.0, 0.0]])[:, [True, True, bool(self._known[1])]]
        self._start = self._solve(np.ones((1, cells.ln_ratio.size)), tolerance=1e-9)
        self.coefs = self._unscaled(self._start)
        self.method = "interval-censored likelihood of the first overturning"
        if self.separated:
            self.method += ", with a prior of the slope (a line goes through all intervals)"
        if not self._varied:
            self.method += "; only one outcome: no slope is known, both are set to 0"
        elif not self._known[1]:
            self.method += "; only one PGV/PGA: its slope is not known and set to 0"

    def _is_separated(self) -> bool:
        ends = np.concatenate([self._low, self._high])
        ones, ratio = np.ones(ends.size), np.tile(self._ratio, 2)
        points, toppled = (
            np.column_stack([ones, ends, ratio]),
            np.arange(ends.size) >= ends.size // 2,
        )
        known = np.isfinite(ends)
        return is_separated(points[known], toppled[known], ~toppled[known])

    def _solve(self, row_weights: Array, tolerance: float) -> Array:
        weights = row_weights[:, self._row]
        start = np.repeat(self._start, len(weights), axis=0)
        fell, stood = (weights @ np.isfinite(ends) for ends in (self._high, self._low))
        beta = np.zeros_like(start)
        beta[:, 0] = logit((fell + 0.5) / (weights.sum(axis=1) + 1.0))
        left = np.flatnonzero((fell > 0) & (stood > 0))
        if not self.separated:
            plain = self._likelihood(weights[left], prior=False)
            beta[left], converged = maximise(plain, start[left], tolerance=tolerance)
            left = left[~converged]  # rows left out can let a line through all others
        steep = self._likelihood(weights[left], prior=True)
        beta[left] = maxima(steep, start[left], tolerance=tolerance)
        return beta

    def _likelihood(self, weights: Array, *, prior: bool) -> Evaluate:
        """Value-and-step function for `maximise`."""
        known = np.isfinite(self._low), np.isfinite(self._high)
        designs = [
            np.column_stack([np.ones(end.size), np.where(own, end, 0.0), self._ratio])[
                :, : self._start.shape[1]
            ]
            for end, own in zip((self._low, self._high), known, strict=True)
        ]
        both = known[0] & known[1]
        width = np.where(both, self._high - self._low, 1.0)

        def evaluate(beta: Array, which: Indices) -> tuple[Array, Array]:
            own, slope = weights[which], np.maximum(beta[:, 1:2], 1e-12)
            at_low, at_high = (beta @ design.T for design in designs)
            # P(upper) - P(lower) = P(upper) (1 - P(lower)) (1 - exp(lower - upper))
            rise = slope * width
            value = -np.where(known[0], np.logaddexp(0.0, at_low), 0.0)
            value -= np.where(known[1], np.logaddexp(0.0, -at_high), 0.0)
            value += np.where(both, np.log(-np.expm1(-rise)), 0.0)
            low, high = own * known[0] * expit(at_low), own * known[1] * expit(-at_high)
            score = -low @ designs[0] + high @ designs[1]
            curved = [low * expit(-at_low), high * expit(at_high)]
            hessian = sum(
                np.einsum("bi,ij,ik->bjk", part, design, design)
                for part, design in zip(curved, designs, strict=True)
            )
            falling = np.exp(-np.minimum(rise, 500.0))
            share = width * falling / -np.expm1(-rise)
            score[:, 1] += (own * both * share).sum(axis=1)
            hessian[:, 1, 1] += (own * both * share * width / -np.expm1(-rise)).sum(axis=1)
            total = (own * value).sum(axis=1)
            if prior:
                total += np.log(slope[:, 0]) - slope[:, 0] / self._steepest
                score[:, 1] += 1.0 / slope[:, 0] - 1.0 / self._steepest
                hessian[:, 1, 1] += 1.0 / slope[:, 0] ** 2
            total = np.where(beta[:, 1] > 0.0, total, -np.inf)
            inverse = np.linalg.pinv(hessian, FLAT, hermitian=True)
            return total, np.einsum("bij,bj->bi", inverse, score)

        return evaluate

    def _unscaled(self, beta: Array) -> Array:
        slopes = np.zeros((len(beta), 2))
        if self._varied:
            slopes[:, 0] = beta[:, 1]
        if self._known[1]:
            slopes[:, 1] = beta[:, 2]
        slopes *= self._slope_scale
        return np.column_stack([beta[:, 0] - slopes @ self._centre, slopes])
