"""Shaking beyond what is given, of which no rate, or only the rate, or no run is known."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator
from dataclasses import replace
from operator import itemgetter

import numpy as np

from pipeline.config.in_si import in_g
from pipeline.config.layers import Origin
from pipeline.config.problems import InputError, Problem
from pipeline.stages.hazard.open_runs import OFF, most_open, off_runs, told
from pipeline.stages.hazard.sensitivity import Case
from pipeline.stages.hazard.survival_analysis import BranchResults, SurvivalAnalysis
from vsr_core.hazard.shaking import REACH, CurveShaking, EventShaking
from vsr_core.hazard.survival import LARGEST_SCALE
from vsr_core.hazard.toppling import averaged

LOST = 0.05, 0.5
"""Shares of the survival, over the branches retained, from which on it is told that they are lost
if all shaking beyond the last levels topples the rocks, and that is refused."""

WEAK = 0.01, 0.2
"""The same of probabilities of toppling at the least PGA, as weaker shaking is left out: with 0.03
survival was 1.13 times as large as with all shaking, with 0.30 1.7 times, with 0.37 3.3 times; with
0.23 the rate of toppling was half."""


def open_ends(
    analysis: SurvivalAnalysis, results: BranchResults, origin: Origin, *, of_pgv: bool
) -> tuple[str, ...]:
    """What survival may be off by, as that is not known, in words, where it matters.

    Parameters
    ----------
    of_pgv : whether PGV/PGA is of curves of PGV, which may begin after those of PGA, or end before

    Raises
    ------
    InputError
        Where it matters so much that nothing is left of the answer.
    """
    return (
        *left_open(analysis, results, origin, of_pgv=of_pgv),
        *untested(analysis, results, origin),
        *begun_late(analysis, origin, of_pgv=of_pgv),
        *off_runs(analysis, results, origin),
    )


def begun_late(
    analysis: SurvivalAnalysis, origin: Origin, *, of_pgv: bool = False
) -> tuple[str, ...]:
    """That survival may be off, as shaking begins late.

    Raises
    ------
    InputError
        If much of the weakest topples a rock, as it stands or in an earlier stage.
    """
    late, first = _first(analysis, of_pgv=of_pgv)
    chance, name = _toppled_by(analysis, first)
    of_what = "earthquakes" if isinstance(analysis.shaking, EventShaking) else "curves"
    what = "PGV begins where PGA is" if late else "PGA begins at"
    given = f"{of_what} whose {what} {in_g(first):.3g} g, of which {chance:.0%} topples {name}"
    weaker = f"weaker shaking, {'whose PGV/PGA is not known' if late else 'which is left out'},"
    key = "hazard.events" if of_what == "earthquakes" else "hazard.curves"
    rule, remedy = (
        f"{weaker} seldom topples a rock",
        f"give the {of_what} from smaller {what[:3]} on",
    )
    line = f"{given}: {weaker} may topple it, too"
    return told(chance, WEAK, line, Problem(origin.file_of(key), key, given, rule, remedy))


def _first(analysis: SurvivalAnalysis, *, of_pgv: bool) -> tuple[bool, float]:
    """Whether PGV begins after PGA, and the least PGA [m/s^2] of which both are known."""
    shaking = analysis.shaking
    late = of_pgv and shaking.table.levels[0] > shaking.levels[0]
    return late, float((shaking.table if late else shaking).levels[0])


def _toppled_by(analysis: SurvivalAnalysis, level: float, factor: float = 1.0) -> tuple[float, str]:
    """Share of the shaking of a PGA [m/s^2], times a factor, that topples a rock; its name."""
    table, at = analysis.shaking.table, factor * np.array([level])
    scaled = replace(table, levels=factor * table.levels)
    return max(
        (averaged(one.mean, one.ratios, scaled, at * [1.0, REACH])(at).item(), rock.name)
        for rock in analysis.rocks
        for one in rock.stages
    )


def of_scale(
    analysis: SurvivalAnalysis, factor: float, *, of_pgv: bool
) -> tuple[float, tuple[str, ...]]:
    """The factor on the mean curve with which survival is least, and what it rests on.

    Shaking that is left out, as it is weaker than the first level, is multiplied, too; and much may
    then be stronger than any that was tried.

    Returns
    -------
    float, NaN where much of the shaking of the first level topples a rock with it, or no run is
        near to most of the shaking
    tuple of str
    """
    said = list(_off_with(analysis, factor)) if 0.0 < factor < np.inf else []
    if not factor > 0.0:
        return factor, ()
    with_it = min(factor, LARGEST_SCALE)
    _, first = _first(analysis, of_pgv=of_pgv)
    chance, name = _toppled_by(analysis, first, with_it)
    weak = f"{chance:.0%} of the shaking of their first level, {in_g(first):.3g} g, topples {name}"
    number, given, _ = most_open(analysis, with_it)
    is_known = True
    for part, limits, off, why in (
        (chance * (factor > 1.0), WEAK, "too large", f"{weak}, and weaker shaking is left out"),
        (number, OFF, "far off", f"there are {given}"),
    ):
        if part >= limits[1]:
            said.append(f"the factor on the mean curve is not known: with it {why}")
            is_known = False
        elif part >= limits[0]:
            of = f"the factor on the mean curve, {factor:.3g},"
            said.append(f"{of} may be {off}: with it {why}")
    return factor if is_known else np.nan, tuple(said)


def _off_with(analysis: SurvivalAnalysis, factor: float) -> Iterator[str]:
    """That a factor may be off, as stronger shaking than was tried, or is given, matters to it."""
    what, stands = f"the factor on the mean curve, {factor:.3g},", analysis.survival_scaled(factor)
    name, tested = _least_tested(analysis)
    stood = analysis.within_tested().survival_scaled(factor)
    if stood > _TWICE * stands:
        least = f"survival with it would be {stood:.2g}, if nothing more toppled there"
        yield f"{what} may be too small: no runs of {name} above {tested:.3g} g: {least}"
    shaking = analysis.mean_shaking.times(factor)
    if factor < 1.0 and isinstance(shaking, CurveShaking):
        fallen = float(analysis.survival(shaking.largest_rates)[0])
        if _lost(fallen, stands) >= LOST[0]:
            ends = "all beyond the curves' ends topples a rock"
            yield f"{what} may be too large: survival with it is {fallen:.2g} if {ends}"


_TWICE = 2.0
"""Times the survival with a factor from which on that is told to be too small."""


def left_open(
    analysis: SurvivalAnalysis, results: BranchResults, origin: Origin, *, of_pgv: bool
) -> tuple[str, ...]:
    """What survival may be too large by, as curves end early.

    Raises
    ------
    InputError
        If much of it may be.
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
    most, least = float(weights @ standing), float(weights @ fallen)
    worst = int(np.argmax(weights * (standing - fallen)))
    curve, whole = shaking.curves[worst], analysis.curves[worst]
    branch = analysis.model.branches[worst]
    rock = analysis.rocks[0]
    number = curve.rates[-1] * rock.ages.mean()
    what = "PGV ends where PGA is" if len(curve.levels) < len(whole.levels) else "PGA ends at"
    given = (
        f"a curve (branch {branch.name}) whose {what} {in_g(curve.levels[-1]):.3g} g, "
        f"which has {number:.2g} exceedances within the age of {rock.name}, on average: survival "
        f"is {fallen[worst]:.2g} if all of them topple a rock, {standing[worst]:.2g} if none does"
    )
    key, rule = "hazard.curves", "what is beyond the last level may not halve the survival"
    remedy = "give the curve to levels that are exceeded more rarely"
    refusal = Problem(origin.file_of(key), key, given, rule, remedy)
    return told(_lost(least, most), LOST, given, refusal)


def _lost(least: float, most: float) -> float:
    """Share of the larger survival that the smaller one lacks."""
    return 1.0 - least / most if most > 0.0 else 0.0


def untested(analysis: SurvivalAnalysis, results: BranchResults, origin: Origin) -> tuple[str, ...]:
    """What survival may be too small by, as no stronger shaking was tried.

    Beyond the largest PGA that was tried the fits go on, and what stood there topples just above.

    Raises
    ------
    InputError
        If much of it is lost with that.
    """
    most = float(analysis.weights @ analysis.within_tested().survival(analysis.shaking.rates))
    least = float(analysis.weights @ results.survival)
    return told_of_untested(least, most, *_least_tested(analysis), origin)


def _least_tested(analysis: SurvivalAnalysis) -> tuple[str, float]:
    """The rock, or its stage, of whose runs the largest PGA [g] is least, and that."""
    each = ((rock.name, one.tested[1]) for rock in analysis.rocks for one in rock.stages)
    return min(each, key=itemgetter(1))


def told_of_untested(
    least: float, most: float, name: str, tested: float, origin: Origin
) -> tuple[str, ...]:
    """The same of a survival with and without what topples beyond a PGA [g] that was tried."""
    given = f"no runs of {name} above {tested:.3g} g: survival is {least:.2g} with what its fits "
    given += f"take to topple there, and {most:.2g} without"
    key, rule = "fragility.highest", "what was not tried may not halve the survival"
    refusal = Problem(origin.file_of(key), key, given, rule, "raise it, and motion.pga")
    return told(_lost(least, most), LOST, given, refusal)


def open_cases(
    found: Iterable[Case], compared: Container[str], said: Container[str], origin: Origin
) -> Iterator[str]:
    """What is not known of cases of other runs than the rock's, in words; none is refused.

    Parameters
    ----------
    compared : names of these cases
    said : what is not known of the rock's own runs, which is not said again
    """
    for case in found:
        if case.name in compared:
            try:
                doubts = (
                    *off_runs(case.analysis, case.results, origin),
                    *untested(case.analysis, case.results, origin),
                )
            except InputError as error:
                doubts = tuple(one.given for one in error.problems)
            yield from (f"{case.name}: {one}" for one in doubts if one not in said)
