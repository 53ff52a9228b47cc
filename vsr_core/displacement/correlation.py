"""How the shaking and the way of an overturned rock go together: means of ensembles, regressed.

An ensemble is all overturned runs of one PGA, or of one PGV/PGA (Chen et al. 2024, section 5.4).
The line is fitted to the means of the ensembles, each counted once whatever its number of runs,
as the paper does; ``Variance`` says how much of the runs' scatter such means leave out.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray
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


@dataclass(frozen=True, eq=False)
class Runs:
    """Runs whose rock overturned; all arrays of shape (n,).

    Attributes
    ----------
    pga : ndarray [g]
    pgv_pga : ndarray [s]
    trajectory_length : ndarray [m], path of the centre of mass
    largest_speed : ndarray [m/s]
    terminal_distance : ndarray [m], from the start to the end of the centre of mass

    Raises
    ------
    InvalidInput
        If the arrays are not of one length, or hold a value that is not finite.
    """

    pga: Array
    pgv_pga: Array
    trajectory_length: Array
    largest_speed: Array
    terminal_distance: Array

    def __post_init__(self) -> None:
        names = (*REGRESSORS, *STATISTICS)
        shapes = {getattr(self, name).shape for name in names}
        if len(shapes) > 1 or len(self.pga.shape) != 1:
            raise InvalidInput(
                f"arrays of shapes {sorted(shapes)}",
                "each overturned run has one value of each",
                "give flat arrays of equal length",
            )
        for name in names:
            lost = int((~np.isfinite(getattr(self, name))).sum())
            if lost:
                raise InvalidInput(
                    f"{lost} values of {name} that are not finite",
                    "an overturned run has a path",
                    "leave out runs without a verdict",
                )


@dataclass(frozen=True, eq=False)
class Ensembles:
    """Runs put together by their value of the regressor; all arrays of shape (k,).

    Attributes
    ----------
    value : ndarray [unit of the regressor], ascending
    n : ndarray of int, runs
    mean : ndarray [unit of the statistic]
    deviation : ndarray [unit of the statistic], standard deviation (n - 1); NaN for one run
    """

    value: Array
    n: NDArray[np.int64]
    mean: Array
    deviation: Array


@dataclass(frozen=True)
class Line:
    """Ordinary least squares of the ensembles' means on the regressor; NaN if undetermined.

    Attributes
    ----------
    slope, intercept : float
    r2 : float, share of the variance of the means that the line explains
    p : float, two-sided, of a slope of zero (t test)
    n_groups : int
    centre : float, mean of the regressor over the ensembles
    spread : float, sum of its squared distances from ``centre``
    residual : float, standard deviation of the means about the line (n_groups - 2)
    """

    slope: float
    intercept: float
    r2: float
    p: float
    n_groups: int
    centre: float
    spread: float
    residual: float

    @property
    def t(self) -> float:
        """Quantile of Student's t that a two-sided interval of ``LEVEL`` takes."""
        return float(stats.t.ppf(0.5 + 0.5 * LEVEL, self.n_groups - 2))

    def mean(self, at: Array) -> Array:
        """Value of the line at ``at``, any shape."""
        return self.intercept + self.slope * at

    def band(self, at: Array) -> tuple[Array, Array]:
        """95 % confidence band of the mean line at ``at``, each end of the shape of ``at``."""
        leverage = 1.0 / self.n_groups + (at - self.centre) ** 2 / self.spread
        half = self.t * self.residual * np.sqrt(leverage)
        return self.mean(at) - half, self.mean(at) + half


@dataclass(frozen=True, eq=False)
class Correlation:
    """One statistic of the runs against one measure of the shaking.

    Attributes
    ----------
    statistic, regressor : str
    ensembles : Ensembles
    line : Line
    spearman, spearman_p : float, rank correlation of the ensembles' means, and its two-sided p
    spearman_runs, spearman_runs_p : float, the same over the runs
    between, within : float, shares of the runs' variance between the ensembles (eta squared) and
        inside them
    reason : str, why the numbers are NaN; empty if they are not
    """

    statistic: str
    regressor: str
    ensembles: Ensembles
    line: Line
    spearman: float
    spearman_p: float
    spearman_runs: float
    spearman_runs_p: float
    between: float
    within: float
    reason: str = ""


def correlations(runs: Runs) -> tuple[Correlation, ...]:
    """Every statistic against every regressor, statistic by statistic."""
    return tuple(
        correlate(getattr(runs, regressor), getattr(runs, statistic), statistic, regressor)
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
    statistic, regressor : str
        Names that the result carries.
    """
    groups = ensembles(regressor_values, values)
    reason = _undetermined(groups)
    if reason:
        nan = math.nan
        line = Line(nan, nan, nan, nan, len(groups.n), nan, nan, nan)
        numbers = (nan,) * 6
        return Correlation(statistic, regressor, groups, line, *numbers, reason)
    between = _variance_between(groups, values)
    return Correlation(
        statistic,
        regressor,
        groups,
        fitted(groups),
        *_spearman(groups.value, groups.mean),
        *_spearman(regressor_values, values),
        between,
        1.0 - between,
    )


def ensembles(regressor_values: Array, values: Array) -> Ensembles:
    """Put runs of equal ``regressor_values`` together; both arrays of shape (n,)."""
    value, group, n = np.unique(regressor_values, return_inverse=True, return_counts=True)
    mean = np.bincount(group, values, len(value)) / n
    squares = np.bincount(group, (values - mean[group]) ** 2, len(value))
    freedom = np.where(n > 1, n - 1.0, np.nan)
    return Ensembles(value, n.astype(np.int64), mean, np.sqrt(squares / freedom))


def fitted(groups: Ensembles) -> Line:
    """Least squares line through the means of at least three ensembles that differ."""
    fit = stats.linregress(groups.value, groups.mean)
    centre = float(groups.value.mean())
    spread = float(((groups.value - centre) ** 2).sum())
    return Line(
        float(fit.slope),
        float(fit.intercept),
        float(fit.rvalue) ** 2,
        float(fit.pvalue),
        len(groups.n),
        centre,
        spread,
        float(fit.stderr) * math.sqrt(spread),
    )


def row(found: Correlation) -> dict[str, str | int | float]:
    """One row of the table of correlations, by the names of its columns."""
    line = asdict(found.line)
    return {
        "statistic": found.statistic,
        "regressor": found.regressor,
        "n_groups": found.line.n_groups,
        "n_runs": int(found.ensembles.n.sum()),
        **{name: line[name] for name in ("slope", "intercept", "r2", "p")},
        "spearman": found.spearman,
        "spearman_p": found.spearman_p,
        "spearman_runs": found.spearman_runs,
        "variance_between": found.between,
        "variance_within": found.within,
    }


def _undetermined(groups: Ensembles) -> str:
    if len(groups.n) == 0:
        return "no run overturned"
    if len(groups.n) < FEWEST:
        return f"{len(groups.n)} of the {FEWEST} ensembles that a line needs"
    if np.ptp(groups.mean) <= _ALIKE * np.abs(groups.mean).max():
        return "the ensembles have one and the same mean"
    return ""


def _variance_between(groups: Ensembles, values: Array) -> float:
    """Eta squared: the sum of squares between the ensembles over the whole."""
    middle = values.mean()
    between = float(groups.n @ (groups.mean - middle) ** 2)
    return between / float(((values - middle) ** 2).sum())


def _spearman(one: Array, other: Array) -> tuple[float, float]:
    found = stats.spearmanr(one, other)
    return float(found.statistic), float(found.pvalue)
