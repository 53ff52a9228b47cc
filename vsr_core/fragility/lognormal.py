"""A lognormal fragility curve for each PGV/PGA row, interpolated between the rows."""

from __future__ import annotations

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.special import log_ndtr, ndtr, ndtri

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.fragility.bisection import OUTWARD
from vsr_core.fragility.boundary import Cells
from vsr_core.fragility.model import Evaluate, FragilityModel, maximise
from vsr_core.fragility.spans import STEP, Thresholds, in_reach

MAX_BETA = 2.0
"""Largest beta: P then rises from 2.5 % to 97.5 % over a factor 2500 in PGA. A row that exceeds it
does not order its outcomes by PGA."""

SLOPES = 41
"""Slopes at which the likelihood of a row is known."""

STATUS = ("probit", "interval", "above", "below", "flat", "undecided")
"""How a row was decided, see `LognormalFragility`."""


class LognormalFragility(FragilityModel):
    """P(overturned) = Phi(ln(PGA / theta) / beta), with theta and beta for each PGV/PGA row.

    Where a row's outcomes overlap, maximum likelihood, that is probit regression on ln PGA with
    beta = 1/b1 and theta = exp(-b0/b1) (Baker 2015). Where they separate, the likelihood has no
    maximum and only its interval is informative: ln theta is taken as uniform on the interval from
    the last balanced to the first overturned PGA, so theta is their geometric mean and beta the
    standard deviation of that uniform, width / sqrt(12). A row that never topples (or always
    does) gets the interval of one further step beyond its last (first) PGA. With thresholds, rows
    that change more than once are those that overlap, unless their outcomes mix in one cell
    alone, or their changes are no farther apart than a cell is wide, which no slope can be told
    from: ln theta is then uniform from the first to the last of these. A row that is undecided
    or left out gets ln theta and ln beta linear in ln PGV/PGA between its neighbours, constant
    beyond the outermost; what is undecided goes by rows with both outcomes, where there are
    any. Coefficients are ln theta and ln beta, shape (batch, n_ratio, 2).

    Attributes
    ----------
    status : tuple of str, length n_ratio
        Of each row: "probit", outcomes overlap, maximum likelihood; "interval", all balanced below
        all overturned; "above", never topples, theta may be any larger value; "below", topples from
        its first PGA on, theta may be any smaller value;
        "flat", toppling does not rise with PGA, beta is held at `MAX_BETA`; "undecided", no decided
        cell, interpolated from the neighbouring rows.

    References
    ----------
    Baker, J. W. (2015), Earthquake Spectra 31(1), 579-599, eq. 11: the likelihood.
    """

    name = "lognormal"
    least_rows = 1

    def __init__(self, cells: Cells, thresholds: Thresholds | None = None) -> None:
        self.cells = cells
        self._own = cells if thresholds is None else in_reach(cells, thresholds)
        every = range(cells.ln_ratio.size)
        rows = [
            self._threshold(row) if thresholds is None else self._resolved(thresholds, row)
            for row in every
        ]
        status = np.array([name for name, _, _ in rows])
        # the interval of ln theta; for overlapping rows filled in below
        low, high = (np.array(side) for side in list(zip(*rows, strict=True))[1:])
        ln_theta, ln_beta = (low + high) / 2, np.log((high - low) / np.sqrt(12.0))
        self._overlap = overlap = np.flatnonzero(status == "probit")
        if overlap.size:
            ln_theta[overlap], ln_beta[overlap], self._slopes = self._probit(overlap)
            status[overlap[ln_beta[overlap] == np.log(MAX_BETA)]] = "flat"
        self._ends = low, high
        self._half_width = np.where(status == "interval", (high - low) / 2, 0.0)
        self._row_values = np.stack([ln_theta, ln_beta], axis=1)
        self.status = tuple(status.tolist())
        self.separated = overlap.size == 0
        self._decided = status != "undecided"
        closed = self._decided & ~np.isin(status, ("above", "below"))
        self._sources = closed if closed.any() else self._decided
        self.coefs = self._row_values[None].copy()
        self._fill(self.coefs[0], ~self._decided, self._sources)
        counts = {key: self.status.count(key) for key in STATUS if key in self.status}
        self.method = "by row: " + ", ".join(f"{n} {key}" for key, n in counts.items())

    def refit(self, row_weights: Array) -> Array:
        """Interpolate again from the rows of positive weight only: no row's curve needs another."""
        values = np.repeat(self._row_values[None], len(row_weights), axis=0)
        for member, weights in zip(values, row_weights, strict=True):
            kept = (weights > 0) & self._decided
            self._fill(member, ~kept, kept)
        return values

    def resample(self, row_weights: Array, rng: np.random.Generator) -> Array:
        """Each row drawn from what it leaves open; what is resampled fills rows without a verdict.

        Ln theta is uniform on the row's interval, or with ln beta as likely as the row's outcomes
        make it. Others are filled by rows with both outcomes: theta of others is an assumption.
        """
        shape = row_weights.shape
        values = np.repeat(self._row_values[None], len(row_weights), axis=0)
        values[..., 0] += self._half_width * rng.uniform(-1.0, 1.0, shape)
        if self._overlap.size:
            values[:, self._overlap] = self._likely(len(row_weights), rng)
        for member, weights in zip(values, row_weights, strict=True):
            kept = self._sources & (weights > 0)
            self._fill(member, ~self._decided, kept if kept.any() else self._sources)
        return values

    def named(self, coefs: Array) -> dict[str, Array]:
        with np.errstate(over="ignore"):  # open above where an outcome hardly depends on PGA
            return dict(zip(("theta", "beta"), np.exp(np.moveaxis(coefs, -1, 0)), strict=True))

    def opened(self, ends: dict[str, tuple[Array, Array]]) -> dict[str, tuple[Array, Array]]:
        """As of the base: theta of what never topples is above the last PGA at which it stood.

        That of a row without a verdict has no end where such a row is beside it, nor its median.
        The median of what never topples is beyond the grid if it stood at its last PGA.
        """
        above, below = (np.equal(self.status, name) for name in ("above", "below"))
        bottom, top = self._beside(below), self._beside(above)
        found = {
            name: (np.where(bottom, 0.0, ends[name][0]), np.where(top, np.inf, ends[name][1]))
            for name in ("theta", "median")
        }
        (low, high), (last, first) = found["theta"], np.exp(self._ends)
        found["theta"] = np.where(above, last, low), np.where(below, first, high)
        within, (low, high) = np.exp(self.cells.ln_pga[[0, -1]]), found["median"]
        low = np.where(above & (last < within[1]), last, low)
        found["median"] = low, np.where(below & (first > within[0]), first, high)
        return ends | found

    def _beside(self, rows: Mask) -> Mask:
        """Rows, and those without a verdict between which and these there is no other."""
        decided, ln_ratio = self._decided, self.cells.ln_ratio
        if not decided.any():
            return rows
        share = _means(ln_ratio[decided], rows[decided].astype(np.float64))
        return rows | (~decided & (np.interp(ln_ratio, *share) > 0.0))

    def probability(self, coefs: Array, ln_pga: Array) -> Array:
        ln_theta, ln_beta = np.moveaxis(coefs[..., None], 2, 0)
        return ndtr((ln_pga - ln_theta) / np.exp(ln_beta))

    def grid_contour(self, coefs: Array, probability: float) -> Array:
        """As of the base; 0 and inf where the grid does not reach."""
        ln_level = coefs[..., 0] + np.exp(coefs[..., 1]) * ndtri(probability)
        ln_pga = self.cells.ln_pga
        level = np.where(ln_level > ln_pga[-1], np.inf, np.exp(np.minimum(ln_level, ln_pga[-1])))
        level = np.where(ln_level < ln_pga[0], 0.0, level)
        above, below = (np.equal(self.status, name) for name in ("above", "below"))
        return np.where(above, np.inf, np.where(below, 0.0, level))

    def _fill(self, values: Array, rows: Mask, by: Mask) -> None:
        """Interpolate the values, shape (n_ratio, 2), of rows; those of one PGV/PGA count alike."""
        ln_ratio = self.cells.ln_ratio
        for column in values.T if by.any() else ():
            column[rows] = np.interp(ln_ratio[rows], *_means(ln_ratio[by], column[by]))

    def _threshold(self, row: int) -> tuple[str, float, float]:
        """Status of a row and its interval of ln theta (NaN where there is none)."""
        ln_pga, toppled = self.cells.ln_pga, self.cells.toppled[row]
        balanced = self.cells.trials[row] - toppled
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

    def _resolved(self, thresholds: Thresholds, row: int) -> tuple[str, float, float]:
        """The same where the first overturning of each row was looked for by itself."""
        low, high, further = thresholds.lower[row], thresholds.upper[row], np.log(OUTWARD)
        if np.isnan(low) and np.isnan(high):
            return "undecided", np.nan, np.nan
        if np.isinf(high):
            return "above", low, low + further
        toppled, trials = self._own.toppled[row], self._own.trials[row]
        fell, stood = np.flatnonzero(toppled > 1e-9), np.flatnonzero(trials - toppled > 1e-9)
        if not thresholds.single[row] and fell.size and stood.size:  # both in reach
            last = thresholds.last[row]
            if fell[0] < stood[-1] and not last - low <= STEP:
                return "probit", np.nan, np.nan
            high = high if np.isnan(low) else np.fmax(high, last)
        return ("below", high - further, high) if np.isnan(low) else ("interval", low, high)

    def _probit(self, rows: Indices) -> tuple[Array, Array, Array]:
        """Maximum likelihood of the given rows: ln theta, ln beta, and slopes to draw from.

        The latter, shape (rows, `SLOPES`), reach over six standard errors of ln slope to either
        side, but to no beta beyond `MAX_BETA` or below that of an interval of one cell.
        """
        centre = self.cells.ln_pga.mean()
        centred = self.cells.ln_pga - centre
        toppled, trials = self._own.toppled[rows], self._own.trials[rows]
        slope = np.full(len(rows), 1.0 / MAX_BETA)
        both = np.column_stack([np.ones(centred.size), centred])
        free, converged = maximise(
            probit_likelihood(both, np.zeros((len(rows), 1)), toppled, trials),
            np.column_stack([np.zeros(len(rows)), slope]),
        )
        flat = ~converged | (free[:, 1] < slope)
        b0, b1 = free.T
        level = self._levels(rows[flat], slope[flat, None], np.zeros((flat.sum(), 1)))[0]
        b0[flat], b1[flat] = level[:, 0], slope[flat]
        weight = _information(b0[:, None] + b1[:, None] * centred, trials)[0]
        mean = (weight @ centred) / weight.sum(axis=1)
        spread = (weight * (centred - mean[:, None]) ** 2).sum(axis=1)
        reach = np.where(flat, 0.0, 6.0 / (np.sqrt(spread) * b1))
        cell = np.diff(self.cells.ln_pga).min(initial=np.log(2.0))
        steepest = np.maximum(b1, np.sqrt(12.0) / cell)
        ends = np.clip(np.log(b1) + np.stack([-reach, reach]), np.log(slope), np.log(steepest))
        slopes = np.exp(np.linspace(ends[0], ends[1], SLOPES, axis=-1))
        return centre - b0 / b1, np.where(flat, np.log(MAX_BETA), -np.log(b1)), slopes

    def _levels(self, rows: Indices, slopes: Array, near: Array) -> tuple[Array, Array, Array]:
        """The most likely level at each slope, shape (rows, n), its standard error, and how likely.

        P = Phi(level + slope (ln PGA - its mean)). It is looked for from levels near it, and known
        to within the span of the PGA at least.
        """
        ln_pga, times = self.cells.ln_pga, slopes.shape[1]
        toppled, trials = (
            np.repeat(part[rows], times, axis=0) for part in (self._own.toppled, self._own.trials)
        )
        offset = slopes.reshape(-1, 1) * (ln_pga - ln_pga.mean())
        fits = probit_likelihood(np.ones((ln_pga.size, 1)), offset, toppled, trials)
        # of a steep one it may go to and fro by 1e-4
        level, _ = maximise(fits, near.reshape(-1, 1))
        most = 1.25 + np.ptp(offset, axis=1) / np.sqrt(12.0)
        information = _information(level + offset, trials)[0].sum(axis=1)
        error = 1.0 / np.sqrt(np.maximum(information, most**-2))
        value = fits(level, np.arange(len(level)))[0]
        return level.reshape(slopes.shape), error.reshape(slopes.shape), value.reshape(slopes.shape)

    def _likely(self, count: int, rng: np.random.Generator) -> Array:
        """Draws of ln theta and ln beta of rows that overlap, shape (count, rows, 2).

        From the likelihood as it is over ln slope, and normal over the level at each slope.
        """
        drawn = np.empty((count, self._overlap.size, 2))
        theta = self._row_values[self._overlap, :1] - self.cells.ln_pga.mean()
        found = self._levels(self._overlap, self._slopes, -theta * self._slopes)
        fits = zip(self._slopes, *found, strict=True)
        for row, (slopes, levels, errors, value) in enumerate(fits):
            density = np.exp(value - value.max()) * errors / slopes
            share = cumulative_trapezoid(density, initial=0.0)
            slope = np.interp(rng.random(count), share / share[-1], slopes)
            error = np.interp(slope, slopes, errors) * rng.standard_normal(count)
            level = np.interp(slope, slopes, levels) + error
            drawn[:, row] = np.column_stack(
                [self.cells.ln_pga.mean() - level / slope, -np.log(slope)]
            )
        return drawn


def _means(places: Array, values: Array) -> tuple[Array, Array]:
    """Places in ascending order, and the mean of all values at each."""
    at, place, times = np.unique(places, return_inverse=True, return_counts=True)
    return at, np.bincount(place, values) / times


def _information(eta: Array, trials: Array) -> tuple[Array, Array, Array]:
    """Expected information of eta and the derivatives of ln P and ln (1 - P), cell by cell."""
    ln_density = -0.5 * eta**2 - 0.5 * np.log(2 * np.pi)
    rise = np.exp(ln_density - log_ndtr(eta))
    fall = np.exp(ln_density - log_ndtr(-eta))
    return trials * rise * fall, rise, fall


def probit_likelihood(design: Array, offset: Array, toppled: Array, trials: Array) -> Evaluate:
    """Value and Fisher-scoring step of independent probit fits, one for each row of counts.

    P = Phi(design @ beta + offset), the likelihood of Baker (2015), eq. 11.

    Parameters
    ----------
    design : ndarray, shape (n, p)
    offset : ndarray, shape (batch, n) or (batch, 1)
    toppled, trials : ndarray, shape (batch, n)

    Returns
    -------
    callable
        What `maximise` takes, with beta of shape (batch, p).
    """

    def evaluate(beta: Array, which: Indices) -> tuple[Array, Array]:
        eta = beta @ design.T + offset[which]
        fell, balanced = toppled[which], trials[which] - toppled[which]
        value = (fell * log_ndtr(eta) + balanced * log_ndtr(-eta)).sum(axis=1)
        information, rise, fall = _information(eta, trials[which])
        score = (fell * rise - balanced * fall) @ design
        fisher = np.einsum("ri,ij,ik->rjk", information, design, design)
        fisher[np.abs(fisher) < 1e-290] = 0.0  # the inverse of what is less is no number
        return value, np.einsum("rij,rj->ri", np.linalg.pinv(fisher, hermitian=True), score)

    return evaluate
