"""Shaking beyond the last levels of curves, of which only the rate is known, or the PGA as well."""

from __future__ import annotations

from dataclasses import replace

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
    analysis: SurvivalAnalysis, results: BranchResults, origin: Origin, *, of_pgv: bool
) -> tuple[str, ...]:
    """What survival may be too large by, in words, where it matters.

    Parameters
    ----------
    of_pgv : whether PGV/PGA is of curves of PGV, which may end before those of PGA

    Raises
    ------
    InputError
        If less than `LEAST` of it may be left.
    """
    if not isinstance(analysis.shaking, CurveShaking):
        return ()
    shaking, last = analysis.shaking, float(analysis.shaking.table.levels[-1])
    if of_pgv:
        shaking = replace(shaking, curves=tuple(one.up_to(last) for one in shaking.curves))
    standing, fallen = map(analysis.survival, (shaking.rates, shaking.largest_rates))
    weights = np.where(results.rejected, 0.0, analysis.weights)
    most, least = weights @ standing, weights @ fallen
    if least >= TOLD * most:
        return ()
    worst = int(np.argmax(weights * (standing - fallen)))
    curve, whole = shaking.curves[worst], analysis.curves[worst]
    branch = analysis.model.branches[worst]
    number = curve.rates[-1] * np.mean(analysis.rocks[0].ages)
    what = "PGV ends where PGA is" if len(curve.levels) < len(whole.levels) else "PGA ends at"
    given = (
        f"a curve (branch {branch.name}) whose {what} {in_g(curve.levels[-1]):.3g} g, "
        f"which is exceeded {number:.2g} times within the age: survival is {standing[worst]:.2g}, "
        f"but {fallen[worst]:.2g} if all of that shaking topples the rock"
    )
    if least < LEAST * most:
        rule = "what is beyond the last level may not halve the survival"
        remedy = "give the curve to levels that are exceeded more rarely"
        key = "hazard.curves"
        raise InputError(Problem(origin.file_of(key), key, given, rule, remedy))
    return (given,)
