"""How the trajectory of an overturned rock depends on the shaking: regression of ensemble means.

An ensemble is all overturned runs of one PGA, or of one PGV/PGA (Chen et al. 2024, section 5.4).
The line is fitted to the means of the ensembles, each counted once whatever its number of runs,
as in the paper; the shares of variance say how much of the runs' scatter the means leave out.

Runs are rows of a table with the columns ``REGRESSORS`` and ``STATISTICS``: ``pga`` [g],
``pgv_pga`` [s], ``trajectory_length`` [m] (path of the centre of mass), ``largest_speed`` [m/s] and
``terminal_distance`` [m] (from the start to the end of the centre of mass).
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from itertools import permutations
from typing import TypeAlias

import numpy as np
import pandas as pd
from scipy import stats

from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput

STATISTICS = ("trajectory_length", "largest_speed", "terminal_distance")
REGRESSORS = ("pga", "pgv_pga")

LEVEL = 0.95
"""Of every interval and band."""

FEWEST = 3
"""Ensembles that a line with an error needs."""

_ALIKE = 1e-12  # relative range below which means differ by rounding only


@dataclass(frozen=True)
class Line:
    """Ordinary least squares of the ensembles' means on the regressor; NaN if undetermined.

    Attributes
    ----------
    r2 : float, share of the variance of the means that the line explains
    p : float, two-sided, of a slope of zero (t test)
    centre : float, mean of the regressor over the ensembles
    spread : float, sum of its squared distances from ``centre``
    residual : float, standard deviation of the means about the line (n_groups - 2)
    """

    n_groups: int
    slope: float = math.nan
    intercept: float = math.nan
    r2: float = math.nan
    p: float = math.nan
    centre: float = math.nan
    spread: float = math.nan
    residual: float = math.nan

    @property
    def t(self) -> float:
        """Quantile of Student's t that a two-sided interval of ``LEVEL`` takes."""
        return float(stats.t.ppf(0.5 + 0.5 * LEVEL, self.n_groups - 2))

    def mean(self, at: Array) -> Array:
        """Value of the line."""
        return self.intercept + self.slope * at

    def band(self, at: Array) -> tuple[Array, Array]:
        """95 % confidence band of the line."""
        leverage = 1.0 / self.n_groups + (at - self.centre) ** 2 / self.spread
        half = self.t * self.residual * np.sqrt(leverage)
        return self.mean(at) - half, self.mean(at) + half


@dataclass(frozen=True, eq=False)
class Correlation:
    """One statistic of the runs against one measure of the shaking; numbers NaN if undetermined.

    Attributes
    ----------
    spearman, spearman_p : float, rank correlation of the ensembles' means, and its two-sided p
    between, within : float, shares of the runs' variance between the ensembles (eta squared) and
        inside them
    reason : str, why the numbers are NaN; empty if they are not
    """

    statistic: str
    regressor: str
    ensembles: pd.DataFrame
    line: Line
    spearman: float = math.nan
    spearman_p: float = math.nan
    spearman_runs: float = math.nan
    spearman_runs_p: float = math.nan
    between: float = math.nan
    within: float = math.nan
    reason: str = ""


def correlations(runs: pd.DataFrame) -> tuple[Correlation, ...]:
    """Correlate every statistic with every regressor.

    Parameters
    ----------
    runs : DataFrame
        The overturned runs, with the columns ``REGRESSORS`` and ``STATISTICS``.

    Raises
    ------
    InvalidInput
        If a value is not finite.
    """
    for name in (*REGRESSORS, *STATISTICS):
        lost = int((~np.isfinite(runs[name])).sum())
        if lost:
            rule, remedy = "an overturned run has a trajectory", "leave out unresolved runs"
            raise InvalidInput(f"{lost} values of {name} that are not finite", rule, remedy)
    return tuple(
        correlate(runs[regressor].to_numpy(), runs[statistic].to_numpy(), statistic, regressor)
        for statistic in STATISTICS
        for regressor in REGRESSORS
    )


def correlate(
    regressor_values: Array, values: Array, statistic: str = "", regressor: str = ""
) -> Correlation:
    """Ensembles, line, rank correlation and shares of variance of ``values``.

    Parameters
    ----------
    regressor_values, values : ndarray, shape (n,)
        Of the runs; equal values of the regressor make an ensemble.

    Examples
    --------
    >>> found = correlate(np.array([0.4, 0.4, 0.6, 0.8]), np.array([3.0, 5.0, 6.0, 8.0]))
    >>> round(found.line.slope, 9), found.line.n_groups
    (10.0, 3)
    """
    groups = ensembles(regressor_values, values)
    reason = _undetermined(groups)
    if reason:
        return Correlation(statistic, regressor, groups, Line(len(groups)), reason=reason)
    between = _variance_between(groups, values)
    return Correlation(
        statistic,
        regressor,
        groups,
        _fitted(groups),
        *_spearman(groups.index.to_numpy(), groups["mean"].to_numpy()),
        *_spearman(regressor_values, values),
        between,
        1.0 - between,
    )


def ensembles(regressor_values: Array, values: Array) -> pd.DataFrame:
    """Put runs of equal ``regressor_values`` together.

    Parameters
    ----------
    regressor_values, values : ndarray, shape (n,)

    Returns
    -------
    DataFrame
        Over the values of the regressor, ascending: ``n`` runs, their ``mean`` and their
        standard ``deviation`` (n - 1; NaN for one run).

    Examples
    --------
    >>> ensembles(np.array([0.2, 0.1, 0.2]), np.array([3.0, 1.0, 5.0]))["mean"].to_dict()
    {0.1: 1.0, 0.2: 4.0}
    """
    groups = pd.Series(values).groupby(regressor_values)
    return groups.agg(["size", "mean", "std"]).set_axis(["n", "mean", "deviation"], axis=1)


def row(found: Correlation) -> dict[str, str | int | float]:
    """One row of the table of correlations, by the names of its columns."""
    line = asdict(found.line)
    return {
        "statistic": found.statistic,
        "regressor": found.regressor,
        "n_groups": found.line.n_groups,
        "n_runs": int(found.ensembles["n"].sum()),
        **{name: line[name] for name in ("slope", "intercept", "r2", "p")},
        "spearman": found.spearman,
        "spearman_p": found.spearman_p,
        "spearman_runs": found.spearman_runs,
        "variance_between": found.between,
        "variance_within": found.within,
    }


def _fitted(groups: pd.DataFrame) -> Line:
    """Least squares line through the means of at least three ensembles that differ."""
    value = groups.index.to_numpy()
    fit = stats.linregress(value, groups["mean"])
    centre = float(value.mean())
    spread = float(((value - centre) ** 2).sum())
    return Line(
        len(groups),
        float(fit.slope),
        float(fit.intercept),
        float(fit.rvalue) ** 2,
        float(fit.pvalue),
        centre,
        spread,
        float(fit.stderr) * math.sqrt(spread),
    )


def _undetermined(groups: pd.DataFrame) -> str:
    if groups.empty:
        return "no run overturned"
    if len(groups) < FEWEST:
        return f"{len(groups)} of the {FEWEST} ensembles that a line needs"
    if np.ptp(groups["mean"]) <= _ALIKE * groups["mean"].abs().max():
        return "all ensembles have the same mean"
    return ""


def _variance_between(groups: pd.DataFrame, values: Array) -> float:
    """Eta squared: the sum of squares between the ensembles over the whole."""
    middle = values.mean()
    between = float(groups["n"] @ (groups["mean"] - middle) ** 2)
    return between / float(((values - middle) ** 2).sum())


MOST_COUNTED = 8
"""Values of which all orders are counted for a p-value; for more, Student's t is near enough."""


def _spearman(one: Array, other: Array) -> tuple[float, float]:
    found = stats.spearmanr(one, other)
    if len(one) > MOST_COUNTED or np.isnan(found.statistic):
        return float(found.statistic), float(found.pvalue)
    left, right = (ranks - ranks.mean() for ranks in map(stats.rankdata, (one, other)))
    every = np.abs(right[np.array([*permutations(range(len(right)))])] @ left)
    return float(found.statistic), float((every >= abs(left @ right) - 1e-9).mean())


Interval: TypeAlias = tuple[float, float]

SHARE = 0.05
"""Share of an ensemble that must have gone as far, for a bound that no single run decides."""


@dataclass(frozen=True)
class LowerBound:
    """Least shaking that carries a rock as far as observed; NaN where nothing says so.

    All values in the unit of the regressor.

    Attributes
    ----------
    observed : float [m]
    reached : int, runs that went at least as far
    first_run : float, smallest value at which any run did
    first_ensemble : float, smallest value at which ``SHARE`` of the runs did
    regression : float, where the line through the ensembles' means says ``observed``
    of_mean : (float, float), values whose 95 % prediction interval of an ensemble's mean holds it
    of_run : (float, float), the same for a single run, as an observed rock is one
    reason : str, why a number is missing or not to be trusted; empty if none is
    """

    regressor: str
    observed: float
    reached: int
    first_run: float
    first_ensemble: float
    regression: float
    of_mean: Interval
    of_run: Interval
    reason: str


def lower_bound(
    regressor_values: Array, distances: Array, observed: float, regressor: str
) -> LowerBound:
    """Least shaking under which overturned rocks went at least as far as ``observed``.

    The line is inverted with Fieller's interval: the values x at which ``observed`` lies within
    t sqrt(v + s^2 (1/k + (x - centre)^2/spread)) of the line. v is s^2, the variance of the means
    about the line, for the mean of an ensemble, and that of the runs about it for one run.

    Parameters
    ----------
    regressor_values : ndarray, shape (n,)
        PGA [g] or PGV/PGA [s] of the overturned runs.
    distances : ndarray, shape (n,) [m]
        Their trajectory length or terminal distance.
    observed : float [m]

    References
    ----------
    Fieller, E. C. (1954), Journal of the Royal Statistical Society B 16(2), 175-185.
    """
    far = distances >= observed
    share = pd.Series(far).groupby(regressor_values).mean()
    middle, of_mean, of_run, reason = _by_the_line(regressor_values, distances, observed)
    return LowerBound(
        regressor,
        observed,
        int(far.sum()),
        float(share.index[share > 0.0].min()),
        float(share.index[share >= SHARE].min()),
        middle,
        of_mean,
        of_run,
        "; ".join(filter(None, ["" if far.any() else "no run went as far", reason])),
    )


def _by_the_line(
    regressor_values: Array, distances: Array, observed: float
) -> tuple[float, Interval, Interval, str]:
    """Where the line says ``observed``, its intervals for a mean and for a run, and the reason."""
    fit = correlate(regressor_values, distances)
    line = fit.line
    if fit.reason:
        return math.nan, (math.nan, math.nan), (math.nan, math.nan), fit.reason
    if line.p >= 1.0 - LEVEL:
        everything = (-math.inf, math.inf)
        return math.nan, everything, everything, "the slope may be zero: no bound"
    middle = (observed - line.intercept) / line.slope
    about = distances - line.mean(regressor_values)
    scatter = max(float(about @ about) / (len(about) - 2), line.residual**2)
    reason = ""
    if line.slope < 0.0:
        reason = "the distance falls with the shaking: no lower bound"
    elif not fit.ensembles.index[0] <= middle <= fit.ensembles.index[-1]:
        reason = "the line is read beyond the ensembles that it was fitted to"
    of_mean = _inverted(line, observed, line.residual**2)
    return middle, of_mean, _inverted(line, observed, scatter), reason


def _inverted(line: Line, observed: float, variance: float) -> Interval:
    """Ends of Fieller's interval; the slope differs from zero, so that it is bounded."""
    t2, s2 = line.t**2, line.residual**2
    above = observed - float(line.mean(np.array(line.centre)))
    square = line.slope**2 - t2 * s2 / line.spread
    half = line.slope * above
    constant = above**2 - t2 * (variance + s2 / line.n_groups)
    root = math.sqrt(half**2 - square * constant)
    return line.centre + (half - root) / square, line.centre + (half + root) / square
