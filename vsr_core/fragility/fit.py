"""Fit every fragility model to one grid of outcomes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.fragility.boundary import locate
from vsr_core.fragility.cells import outcomes, positive
from vsr_core.fragility.cross_validation import bootstrap, cross_validate
from vsr_core.fragility.logistic import LogisticFragility
from vsr_core.fragility.lognormal import LognormalFragility
from vsr_core.fragility.recommend import recommend
from vsr_core.fragility.result import FragilityResult, ModelFit, Parameter
from vsr_core.fragility.smooth import SmoothFragility


def fit_all(
    pga: npt.ArrayLike,
    pgv_pga: npt.ArrayLike,
    overturned: npt.ArrayLike,
    *,
    seed: int = 0,
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
    seed : int
        Of the bootstrap; the same seed gives identical results.
    n_bootstrap : int
        Replicates; 0 leaves the intervals NaN.
    """
    # scikit-learn and scipy take a second to import

    columns, rows = _axis(pga, "pga"), _axis(pgv_pga, "pgv_pga")
    grid = outcomes(overturned)
    if grid.shape != (rows.size, columns.size):
        raise InvalidInput(
            f"overturned of shape {grid.shape} for {rows.size} PGV/PGA and {columns.size} PGA",
            "its shape is (n_ratio, n_pga)",
            "transpose or reshape it",
        )
    flat_pga, flat_ratio = (axis.ravel() for axis in np.meshgrid(columns, rows))
    models = [
        _fitted(model.fit(flat_pga, flat_ratio, grid.ravel()), seed, n_bootstrap)
        for model in (LogisticFragility(), LognormalFragility(), SmoothFragility())
    ]
    boundary = locate(columns, grid)
    recommended, reason = recommend(
        {model.name: model.scores for model in models},
        boundary,
        separated=models[0].separated,
    )
    undecided = int(np.isnan(grid).sum())
    return FragilityResult(
        pga=columns,
        pgv_pga=rows,
        n_decided=grid.size - undecided,
        n_undecided=undecided,
        boundary=boundary,
        models=tuple(models),
        recommended=recommended,
        reason=reason,
    )


def _axis(values: npt.ArrayLike, name: str) -> Array:
    axis = positive(values, name)
    if axis.ndim != 1 or axis.size == 0 or (np.diff(axis) <= 0).any():
        raise InvalidInput(
            f"{name} of shape {axis.shape} that is not one strictly increasing axis",
            "the grid's axes increase",
            f"sort the grid along {name} and merge repeated values",
        )
    return axis


def _fitted(
    model: LogisticFragility | LognormalFragility | SmoothFragility, seed: int, n_bootstrap: int
) -> ModelFit:
    """Score a fitted estimator and put its answers for the grid together."""
    coefs = model.coefs_
    spread = bootstrap(model, n_bootstrap, seed)
    parameters = tuple(
        Parameter(name, model.parameter_units[name], value[0], *spread.parameters[name])
        for name, value in model.named(coefs).items()
    )
    low, median, high = (model.grid_contour(coefs, level)[0] for level in (0.025, 0.5, 0.975))
    return ModelFit(
        name=model.name,
        method=model.method_,
        separated=model.separated_,
        parameters=parameters,
        scores=cross_validate(model),
        median=median,
        median_lower=spread.median[0],
        median_upper=spread.median[1],
        band_low=low,
        band_high=high,
        probability=model.grid_probability(coefs)[0],
        row_status=getattr(model, "status_", ()),
    )
