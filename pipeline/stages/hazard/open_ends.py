"""Shaking beyond what is given, of which no rate, or only the rate, or no run is known."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator
from dataclasses import replace
from operator import itemgetter

import numpy as np
from scipy.special import ndtr

from pipeline.config.in_si import acceleration, in_g
from pipeline.config.layers import Origin
from pipeline.config.problems import InputError, Problem
from pipeline.stages.hazard.rock_fragility import RockFragility
from pipeline.stages.hazard.sensitivity import Case
from pipeline.stages.hazard.survival_analysis import BranchResults, SurvivalAnalysis
from vsr_core.arrays import Array
from vsr_core.hazard.curve import HazardCurve
from vsr_core.hazard.ratio import RatioTable
from vsr_core.hazard.shaking import REACH, CurveShaking, EventShaking
from vsr_core.hazard.survival import LARGEST_SCALE
from vsr_core.hazard.toppling import averaged

TOLD, LEAST = 0.95, 0.5
"""Shares of the survival, over the branches retained, that are left if all shaking beyond the last
levels topples the rocks: below the first it is told, below the second the curves are refused."""

WEAK, STRONG = 0.01, 0.2
"""Probabilities of toppling at the least PGA from which on weaker shaking, which is left out, is
told, and the curves, or events, are refused: with 0.03 survival was 1.13 times as large as with all
shaking, with 0.30 1.7 times, with 0.37 3.3 times; with 0.23 the rate of toppling was half."""

TOLD_OFF, MOST_OFF = 0.1, 0.6
"""Shares of shaking that is open, as no run is near to its PGV/PGA, from which on it is told, and
refused: with 0.34 survival was 0.007, not 0.052, with 0.36 it was 0.32, with 0.72 it was 1."""

TO_TWICE = np.array([1.0, 1.4, 2.0])
"""Factors on a PGA of which that share is asked; the largest share counts."""

NEAR = np.array([0.5, 2.0]) ** 0.5
"""Factors to the ends of what a PGV/PGA of runs stands for, where each is twice the one before."""


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
        *off_runs(analysis, origin),
    )


def begun_late(
    analysis: SurvivalAnalysis, origin: Origin, *, of_pgv: bool = False
) -> tuple[str, ...]:
    """That survival may be off, as shaking begins late.

    Raises
    ------
    InputError
        If `STRONG` of the weakest topples a rock, as it stands or in an earlier stage.
    """
    late, first = _first(analysis, of_pgv=of_pgv)
    chance, name = _toppled_by(analysis, first)
    if chance < WEAK:
        return ()
    of_what = "earthquakes" if isinstance(analysis.shaking, EventShaking) else "curves"
    what = "PGV begins where PGA is" if late else "PGA begins at"
    given = f"{of_what} whose {what} {in_g(first):.3g} g, of which {chance:.0%} topples {name}"
    weaker = f"weaker shaking, {'whose PGV/PGA is not known' if late else 'which is left out'},"
    if chance >= STRONG:
        key = "hazard.events" if of_what == "earthquakes" else "hazard.curves"
        remedy = f"give the {of_what} from smaller {what[:3]} on"
        raise _refused(origin, key, given, f"{weaker} seldom topples a rock", remedy)
    return (f"{given}: {weaker} may topple it, too",)


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
    float, NaN where `STRONG` of the shaking of the first level then topples a rock
    tuple of str
    """
    name, tested = _least_tested(analysis)
    told: tuple[str, ...] = ()
    stands = analysis.survival_scaled(factor) if 0.0 < factor < np.inf else np.nan
    if not np.isnan(stands):
        stood = analysis.within_tested().survival_scaled(factor)
        if stood > _TWICE * stands:
            least = f"survival with it would be {stood:.2g}, if nothing more toppled there"
            given = f"no runs of {name} above {tested:.3g} g: {least}"
            told = (f"the factor on the mean curve, {factor:.3g}, may be too small: {given}",)
    shaking = analysis.mean_shaking.times(factor)
    if 0.0 < factor < 1.0 and isinstance(shaking, CurveShaking):
        fallen = float(analysis.survival(shaking.largest_rates)[0])
        if fallen < TOLD * stands:
            given = (
                f"survival with it is {fallen:.2g} if all beyond the curves' ends topples a rock"
            )
            told += (f"the factor on the mean curve, {factor:.3g}, may be too large: {given}",)
    _, first = _first(analysis, of_pgv=of_pgv)
    chance, name = _toppled_by(analysis, first, min(factor, LARGEST_SCALE))
    if not factor > 1.0 or chance < WEAK:
        return factor, told
    is_known = chance < STRONG
    said = f"the factor on the mean curve{f', {factor:.3g},' if is_known else ''} "
    said += "may be too large" if is_known else "is not known"
    why = f"with it {chance:.0%} of the shaking of their first level, {in_g(first):.3g} g, topples"
    late = f"{said}: {why} {name}, and weaker shaking is left out"
    return factor if is_known else np.nan, (*told, late)


_TWICE = 2.0
"""Times the survival with a factor from which on that is told to be too small."""


def off_runs(analysis: SurvivalAnalysis, origin: Origin) -> tuple[str, ...]:
    """That whether much of the shaking topples a rock is open, as no run is of its PGV/PGA.

    Raises
    ------
    InputError
        If it is `MOST_OFF` of the shaking of some PGA.
    """
    shaking = analysis.shaking
    each = (
        open_share(stage, rock.name, shaking.table, level)
        for rock in analysis.rocks
        for stage in rock.stages
        for level in _asked(stage, _exceeded_once(analysis.before, rock.ages), shaking.levels[-1])
    )
    share, given = max(each, key=itemgetter(0))
    if share < TOLD_OFF:
        return ()
    if share >= MOST_OFF:
        rule = "runs are of the PGV/PGA of most of the shaking"
        raise _refused(origin, "motion", given, rule, "set more of them")
    return (f"{given}: it counts as of the nearest of them, and survival may be far off",)


def _exceeded_once(curve: HazardCurve, ages: Array) -> float:
    """PGA [m/s^2] that is exceeded once within an age [year], or the first or last of a curve."""
    return curve.level_at(float(np.clip(1.0 / ages.mean(), *curve.rates[[-1, 0]])))


def _asked(one: RockFragility, once: float, last: float) -> Array:
    """PGA [m/s^2] at which shorter or longer shaking may matter, from some to the last.

    That, and from the least that topples half of a rock in some run to twice as much.
    """
    levels = np.geomspace(once, max(once, acceleration(one.tested[1])), 200)
    half = levels[(one.mean(levels).max(axis=0) >= 0.5).argmax()]
    return np.minimum(np.append(once, half * TO_TWICE), last)


def open_share(one: RockFragility, name: str, table: RatioTable, level: float) -> tuple[float, str]:
    """Share of the shaking of a PGA [m/s^2] of which it is open whether it topples; and in words.

    What no run is near to is shorter than the first of them and topples it less often, or is
    longer than the last and topples it more often, or between two of them in both.
    """
    (median,), (log_sd,) = table.at(np.array([level]))
    ends = ndtr(np.log(np.multiply.outer(one.ratios, NEAR) / median) / log_sd).ravel()
    gaps = np.maximum(np.diff(ends, prepend=0.0, append=1.0)[::2], 0.0)
    changes = np.diff(one.mean(np.array([level]))[:, 0], prepend=0.0, append=1.0)
    share = float(gaps @ np.abs(changes))
    return share, (
        f"runs of {name} at {len(one.ratios)} PGV/PGA, {one.ratios[0]:.3g} to "
        f"{one.ratios[-1]:.3g} s, that are more than a factor of {NEAR[1]:.2g} off {share:.0%} of "
        f"the shaking of {in_g(level):.3g} g, whose median is {median:.3g} s"
    )


def left_open(
    analysis: SurvivalAnalysis, results: BranchResults, origin: Origin, *, of_pgv: bool
) -> tuple[str, ...]:
    """What survival may be too large by, as curves end early.

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
    rock = analysis.rocks[0]
    number = curve.rates[-1] * rock.ages.mean()
    what = "PGV ends where PGA is" if len(curve.levels) < len(whole.levels) else "PGA ends at"
    given = (
        f"a curve (branch {branch.name}) whose {what} {in_g(curve.levels[-1]):.3g} g, "
        f"which has {number:.2g} exceedances within the age of {rock.name}, on average: survival "
        f"is {fallen[worst]:.2g} if all of them topple a rock, {standing[worst]:.2g} if none does"
    )
    if least < LEAST * most:
        rule = "what is beyond the last level may not halve the survival"
        remedy = "give the curve to levels that are exceeded more rarely"
        raise _refused(origin, "hazard.curves", given, rule, remedy)
    return (given,)


def untested(analysis: SurvivalAnalysis, results: BranchResults, origin: Origin) -> tuple[str, ...]:
    """What survival may be too small by, as no stronger shaking was tried.

    Beyond the largest PGA that was tried the fits go on, and what stood there topples just above.

    Raises
    ------
    InputError
        If less than `LEAST` of it is left with that.
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
    if least >= TOLD * most:
        return ()
    given = f"no runs of {name} above {tested:.3g} g: survival is {least:.2g} with what its fits "
    given += f"take to topple there, and {most:.2g} without"
    if least < LEAST * most:
        rule = "what was not tried may not halve the survival"
        raise _refused(origin, "fragility.highest", given, rule, "raise it, and motion.pga")
    return (given,)


def open_cases(found: Iterable[Case], compared: Container[str], origin: Origin) -> Iterator[str]:
    """What is not known of cases of other runs than the rock's, in words; none is refused.

    Parameters
    ----------
    compared : names of these cases
    """
    for case in found:
        if case.name in compared:
            try:
                told = (
                    *off_runs(case.analysis, origin),
                    *untested(case.analysis, case.results, origin),
                )
            except InputError as error:
                told = tuple(one.given for one in error.problems)
            yield from (f"{case.name}: {one}" for one in told)


def _refused(origin: Origin, key: str, given: str, rule: str, remedy: str) -> InputError:
    return InputError(Problem(origin.file_of(key), key, given, rule, remedy))
