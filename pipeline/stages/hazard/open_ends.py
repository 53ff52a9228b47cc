"""Shaking weaker or stronger than what is given, of which no rate, or only the rate is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.config.in_si import in_g
from pipeline.config.layers import Origin
from pipeline.config.problems import InputError, Problem
from pipeline.stages.hazard.survival_analysis import BranchResults, SurvivalAnalysis
from vsr_core.hazard.shaking import REACH, CurveShaking, EventShaking
from vsr_core.hazard.toppling import averaged

TOLD, LEAST = 0.95, 0.5
"""Shares of the survival, over the branches retained, that are left if all shaking beyond the last
levels topples the rocks: below the first it is told, below the second the curves are refused."""

WEAK, STRONG = 0.01, 0.2
"""Probabilities of toppling at the least PGA from which on weaker shaking, which is left out, is
told, and the curves, or events, are refused: with 0.03 survival was 1.13 times as large as with all
shaking, with 0.30 1.7 times, with 0.37 3.3 times; with 0.23 the rate of toppling was half."""

_CURVES = "curves", "curves"
"""The key and the word of a source of shaking."""


def begun_late(analysis: SurvivalAnalysis, origin: Origin) -> tuple[str, ...]:
    """That survival may be too large, as shaking begins late, in words, where it matters.

    Raises
    ------
    InputError
        If `STRONG` of the weakest topples a rock, as it stands or in an earlier stage.
    """
    shaking = analysis.shaking
    first = shaking.levels[:1]
    span = first * [1.0, REACH]
    chance, name = max(
        (averaged(one.mean, one.ratios, shaking.table, span)(first).item(), rock.name)
        for rock in analysis.rocks
        for one in rock.stages
    )
    if chance < WEAK:
        return ()
    kind, of_what = ("events", "earthquakes") if isinstance(shaking, EventShaking) else _CURVES
    given = f"{of_what} whose PGA begins at {in_g(first[0]):.3g} g, of which {chance:.0%} "
    given += f"topples {name}"
    if chance >= STRONG:
        rule = "weaker shaking, which is left out, seldom topples a rock"
        raise _refused(origin, kind, given, rule, f"give the {of_what} from smaller PGA on")
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
        f"which has {number:.2g} exceedances within the age, on average: survival is "
        f"{fallen[worst]:.2g} if all of them topple the rock, {standing[worst]:.2g} if none does"
    )
    if least < LEAST * most:
        rule = "what is beyond the last level may not halve the survival"
        remedy = "give the curve to levels that are exceeded more rarely"
        raise _refused(origin, _CURVES[0], given, rule, remedy)
    return (given,)


def _refused(origin: Origin, kind: str, given: str, rule: str, remedy: str) -> InputError:
    key = f"hazard.{kind}"
    return InputError(Problem(origin.file_of(key), key, given, rule, remedy))
