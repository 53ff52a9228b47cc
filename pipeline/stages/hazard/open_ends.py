"""Shaking beyond the last levels of curves, of which only the rate is known."""

from __future__ import annotations

import numpy as np

from pipeline.config.in_si import in_g
from pipeline.config.layers import Origin
from pipeline.config.problems import InputError, Problem
from pipeline.stages.hazard.survival_analysis import BranchResults, SurvivalAnalysis
from vsr_core.hazard.shaking import CurveShaking

TOLD, LEAST = 0.95, 0.5
"""Shares of the survival, over the branches retained, that are left if all shaking beyond the last
levels topples the rocks: below the first it is told, below the second the curves are refused."""


def left_open(
    analysis: SurvivalAnalysis, results: BranchResults, origin: Origin
) -> tuple[str, ...]:
    """What survival may be too large by, in words, where it matters.

    Raises
    ------
    InputError
        If less than `LEAST` of it may be left.
    """
    if not isinstance(analysis.shaking, CurveShaking):
        return ()
    fallen = analysis.survival(analysis.shaking.largest_rates)
    weights = np.where(results.rejected, 0.0, analysis.weights)
    most, least = weights @ results.survival, weights @ fallen
    if least >= TOLD * most:
        return ()
    worst = int(np.argmax(weights * (results.survival - fallen)))
    curve, branch = analysis.curves[worst], analysis.model.branches[worst]
    number = curve.rates[-1] * np.mean(analysis.rocks[0].ages)
    given = (
        f"a curve (branch {branch.name}) that ends at {in_g(curve.levels[-1]):.3g} g, which is "
        f"exceeded {number:.2g} times within the age: survival is {results.survival[worst]:.2g}, "
        f"but {fallen[worst]:.2g} if all of that shaking topples the rock"
    )
    if least < LEAST * most:
        rule = "what is beyond the last level may not halve the survival"
        remedy = "give the curve to levels that are exceeded more rarely"
        key = "hazard.curves"
        raise InputError(Problem(origin.file_of(key), key, given, rule, remedy))
    return (given,)
