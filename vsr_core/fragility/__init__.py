"""Fragility models for the overturning outcomes of one yaw and one friction.

`fit_all` is the entry: it locates the boundary, fits and scores several models and names the
one to use. With runs between the cells of a grid, models are fitted to the intervals of the
first overturning, and nothing follows the grid; without them, to the counts of its cells.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from vsr_core.arrays import Array
from vsr_core.fragility.bisection import Known, first_changes, middles
from vsr_core.fragility.boundary import Boundary, counted, locate
from vsr_core.fragility.censored import CensoredLogistic
from vsr_core.fragility.cross_validation import bootstrap, cross_validate, recommend
from vsr_core.fragility.logistic import Logistic, LogisticFragility
from vsr_core.fragility.lognormal import LognormalFragility
from vsr_core.fragility.model import FragilityModel, FragilityResult, ModelFit, Parameter
from vsr_core.fragility.smooth import SmoothFragility
from vsr_core.fragility.spans import shares, thresholds

__all__ = ["FragilityResult", "ModelFit", "fit_all"]


def fit_all(
    pga: npt.ArrayLike,
    pgv_pga: npt.ArrayLike,
    overturned: npt.ArrayLike,
    runs: Known | None = None,
    *,
    n_bootstrap: int = 200,
) -> FragilityResult:
    """Boundary, fitted models with intervals and scores, and the recommended model.

    Parameters
    ----------
    pga : array_like, shape (n_pga,) [g]
        Positive, strictly increasing.
    pgv_pga : array_like, shape (n_ratio,) [s]
        Positive, strictly increasing.
    overturned : array_like, shape (n_ratio, n_pga)
        1 overturned, 0 not, NaN or -1 undecided (left out of every fit and score).
    runs : Known
        Of the grid and between its cells, each row a level; without them the grid is all there is.
    n_bootstrap : int
        Replicates, always the same ones.

    Raises
    ------
    InvalidInput
        If an axis, the shape or an outcome does not fit, or no run is decided.
    """
    cells, boundary = counted(pga, pgv_pga, overturned), locate(pga, overturned)
    ln_pga = cells.ln_pga
    standing = np.where(cells.trials > cells.toppled, ln_pga, -np.inf)
    logistic: Logistic
    if runs is None:
        logistic, lognormal = LogisticFragility(cells), LognormalFragility(cells)
    else:
        first, cells = thresholds(runs, cells.ln_ratio.size), shares(runs, pgv_pga)
        boundary = _resolved(boundary, runs, standing)
        logistic, lognormal = CensoredLogistic(cells, first), LognormalFragility(cells, first)
    every = (logistic, lognormal, SmoothFragility(cells))
    models = tuple(_fitted(model, ln_pga, n_bootstrap) for model in every)
    recommended, reason = recommend(
        {model.name: model.scores for model in models}, boundary, separated=models[0].separated
    )
    return FragilityResult(boundary=boundary, models=models, recommended=recommended, reason=reason)


def _resolved(grid: Boundary, runs: Known, standing: Array) -> Boundary:
    """The boundary of all runs; clusters are those of the grid.

    Parameters
    ----------
    standing : ndarray, shape (n_ratio, n_pga) [ln g], of cells of the grid that do not topple
    """
    lower, upper = first_changes(runs, grid.lower.size)
    return replace(
        grid,
        pga=middles(lower, upper),
        lower=lower,
        upper=upper,
        censored=np.isinf(upper),
        islands=(standing > np.log(upper)[:, None]).sum(axis=1),
    )


def _fitted(model: FragilityModel, ln_pga: Array, n_bootstrap: int) -> ModelFit:
    """Score a fitted model and put its answers for the grid together."""
    coefs = model.coefs
    spread = bootstrap(model, n_bootstrap)
    ends = model.opened(spread.parameters | {"median": spread.median})
    parameters = tuple(
        Parameter(name, value[0], *ends[name]) for name, value in model.named(coefs).items()
    )
    low, median, high = (model.grid_contour(coefs, level)[0] for level in (0.025, 0.5, 0.975))
    return ModelFit(
        name=model.name,
        method=model.method,
        separated=model.separated,
        parameters=parameters,
        scores=cross_validate(model),
        median=median,
        median_lower=ends["median"][0],
        median_upper=ends["median"][1],
        band_low=low,
        band_high=high,
        probability=model.probability(model.coefs, ln_pga)[0],
    )
