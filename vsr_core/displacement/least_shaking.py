"""Lower bound of the shaking, from how far an overturned rock travelled.

The idea is that of Chen et al. (2024), section 6.2. The same runs are read in three ways: the
weakest run that went as far, the weakest ensemble of which some share did, and the line through the
ensembles' means, read backwards.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import pandas as pd

from vsr_core.arrays import Array
from vsr_core.displacement.correlation import LEVEL, Line, correlate

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
