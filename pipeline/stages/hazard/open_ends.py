"""Shaking outside the levels of curves, of which not the rate, or nothing but the rate is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import xarray as xr

from pipeline.config.in_si import in_g
from pipeline.config.layers import Origin
from pipeline.config.problems import InputError, Problem
from pipeline.stages.hazard.survival_analysis import BranchResults, SurvivalAnalysis
from vsr_core.hazard.shaking import CurveShaking

TOLD, LEAST = 0.95, 0.5
"""Shares of the survival, over the branches retained, that are left if all shaking beyond the last
levels topples the rocks: below the first it is told, below the second the curves are refused."""

WEAK, STRONG = 0.01, 0.25
"""Probabilities of toppling at the first level from which on weaker shaking, which is left out, is
told, and the curves are refused: with 0.03 survival was 1.13 times as large as that of curves that
began earlier, with 0.30 1.7 times, with 0.37 3.3 times."""


def begun_late(hazard: xr.Dataset, origin: Origin) -> tuple[str, ...]:
    """That survival may be too large, as curves begin late, in words, where it matters.

    Raises
    ------
    InputError
        If `STRONG` of that shaking topples the rock.
    """
    first, probability = hazard["pga"][0].item(), hazard["probability_at_first_level"].item()
    if probability < WEAK:
        return ()
    given = f"curves that begin at {first:.3g} g, of which {probability:.0%} topples the rock"
    if probability >= STRONG:
        rule = "weaker shaking, which is left out, seldom does"
        raise _refused(origin, given, rule, "give the curves from smaller levels on")
    return (f"{given}: survival may be smaller, as weaker shaking is left out",)


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
    shaking, standing = analysis.shaking, results.survival
    if of_pgv:
        last = float(shaking.table.levels[-1])
        shaking = replace(shaking, curves=tuple(one.up_to(last) for one in shaking.curves))
        standing = analysis.survival(shaking.rates)
    fallen = analysis.survival(shaking.largest_rates)
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
        raise _refused(origin, given, rule, remedy)
    return (given,)


def _refused(origin: Origin, given: str, rule: str, remedy: str) -> InputError:
    key = "hazard.curves"
    return InputError(Problem(origin.file_of(key), key, given, rule, remedy))
