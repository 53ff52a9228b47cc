"""Fragility models for a grid of overturning outcomes.

A grid holds one deterministic run per (PGV/PGA, PGA) cell for one yaw and one friction.
`fit_all` is the entry: it locates the boundary, fits and scores several models and names the
one to use.
"""

from __future__ import annotations

import numpy.typing as npt

from vsr_core.fragility.boundary import counted, locate
from vsr_core.fragility.cross_validation import bootstrap, cross_validate, recommend
from vsr_core.fragility.logistic import LogisticFragility
from vsr_core.fragility.lognormal import LognormalFragility
from vsr_core.fragility.model import FragilityModel, FragilityResult, ModelFit, Parameter
from vsr_core.fragility.smooth import SmoothFragility

__all__ = ["FragilityResult", "ModelFit", "fit_all"]


def fit_all(
    pga: npt.ArrayLike, pgv_pga: npt.ArrayLike, overturned: npt.ArrayLike, *, n_bootstrap: int = 200
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
    n_bootstrap : int
        Replicates, always the same ones.

    Raises
    ------
    InvalidInput
        If an axis, the shape or an outcome does not fit, or no run is decided.
    """
    cells = counted(pga, pgv_pga, overturned)
    kinds = (LogisticFragility, LognormalFragility, SmoothFragility)
    models = tuple(_fitted(kind(cells), n_bootstrap) for kind in kinds)
    boundary = locate(pga, overturned)
    recommended, reason = recommend(
        {model.name: model.scores for model in models}, boundary, separated=models[0].separated
    )
    return FragilityResult(boundary=boundary, models=models, recommended=recommended, reason=reason)


def _fitted(model: FragilityModel, n_bootstrap: int) -> ModelFit:
    """Score a fitted model and put its answers for the grid together."""
    coefs = model.coefs
    spread = bootstrap(model, n_bootstrap)
    parameters = tuple(
        Parameter(name, value[0], *spread.parameters[name])
        for name, value in model.named(coefs).items()
    )
    low, median, high = (model.grid_contour(coefs, level)[0] for level in (0.025, 0.5, 0.975))
    return ModelFit(
        name=model.name,
        method=model.method,
        separated=model.separated,
        parameters=parameters,
        scores=cross_validate(model),
        median=median,
        median_lower=spread.median[0],
        median_upper=spread.median[1],
        band_low=low,
        band_high=high,
        probability=model.grid_probability(coefs)[0],
    )
