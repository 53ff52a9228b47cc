"""Shaking whose PGV/PGA no run is near, so that it is open whether it topples a rock."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from operator import itemgetter
from typing import NamedTuple

import numpy as np
from scipy.special import ndtr

from pipeline.config.in_si import acceleration, in_g
from pipeline.config.layers import Origin
from pipeline.config.problems import InputError, Problem
from pipeline.stages.hazard.rock_fragility import RockFragility
from pipeline.stages.hazard.survival_analysis import BranchResults, DatedRock, SurvivalAnalysis
from vsr_core.arrays import Array
from vsr_core.hazard.curve import HazardCurve
from vsr_core.hazard.ratio import RatioTable

OFF = 0.2, 2.0
"""Numbers of earthquakes within an age that are open, as no run is near to their PGV/PGA, from
which on that is told, and refused: with 0.43 survival was 0.18, not 0.28, with 1.0 it was 0.39, not
0.25, with 4.0 0.20, not 0.02. Of shipped sites and of dense grids they are below 0.19."""

NEAR = np.array([0.5, 2.0]) ** 0.5
"""Factors to the ends of what a PGV/PGA of runs stands for, where each is twice the one before."""


def told(share: float, limits: tuple[float, float], line: str, refusal: Problem) -> tuple[str, ...]:
    """A line on what is not known, where the share that rests on it reaches the first limit.

    Raises
    ------
    InputError
        Where it reaches the second.
    """
    if share >= limits[1]:
        raise InputError(refusal)
    return (line,) if share >= limits[0] else ()


def off_runs(analysis: SurvivalAnalysis, results: BranchResults, origin: Origin) -> tuple[str, ...]:
    """That whether earthquakes topple a rock is open, as no run is of their PGV/PGA.

    Of the mean curve they are many, or under a branch enough to turn its verdict.

    Raises
    ------
    InputError
        If they are many.
    """
    number, given, key = most_open(analysis)
    line = f"{given}: each counts as of the nearest run, and survival may be far off"
    found = told(number, OFF, line, off_all_runs(origin, given, key))
    return found or tuple(_turned(analysis, results, given))


def _turned(analysis: SurvivalAnalysis, results: BranchResults, given: str) -> Iterator[str]:
    """Branches whose verdicts would be others if what is open under them ended otherwise."""
    numbers = np.max([of_branches(analysis, rock) for rock in analysis.rocks], axis=0)
    low, high = results.survival * np.exp([-numbers, numbers])
    turns = (low < analysis.minimum) & (high >= analysis.minimum) & (numbers >= _SOME)
    if turns.any():
        at = int(np.argmax(np.where(turns, numbers, 0.0)))
        branch = analysis.model.branches[at].name
        yield (
            f"{given}, and {numbers[at]:.2g} under branch {branch}: each counts as of the nearest "
            "run, and its verdict may be another"
        )


_SOME = 0.05
"""Open earthquakes within an age from which on they may turn a verdict."""


def of_branches(analysis: SurvivalAnalysis, rock: DatedRock) -> Array:
    """Mean number of earthquakes within the age that are open of a rock, under each branch."""
    last, found = max(curve.levels[-1] for curve in analysis.curves), np.zeros(len(analysis.curves))
    for one, years in _timed(rock):
        least = max(acceleration(one.static), analysis.before.levels[0])
        if least < last:
            levels = np.geomspace(least, last, _PARTS)
            shares = _shares(one, analysis.shaking.table, levels)
            rates = (_rates_from(curve, levels) for curve in analysis.curves)
            found += [_summed(shares, years * each) for each in rates]
    return found


def _rates_from(curve: HazardCurve, levels: Array) -> Array:
    """Rates of a curve, none beyond its end, and before its first level that of the first."""
    known = np.nan_to_num(curve.rate_at(levels))
    return np.asarray(np.maximum.accumulate(known[::-1])[::-1])


def _timed(rock: DatedRock) -> Iterator[tuple[RockFragility, float]]:
    """A rock in each of its stages, and how long it was in it, on average [year]."""
    ends = [0.0, *(until.mean() for _, until in rock.earlier), rock.ages.mean()]
    yield from zip(rock.stages, np.diff(ends).tolist(), strict=True)


def off_all_runs(origin: Origin, given: str, key: str = "motion") -> Problem:
    """The refusal of runs that are near to too little of the shaking."""
    rule = f"runs are of the PGV/PGA of all but {OFF[1]:g} earthquakes within an age"
    return Problem(origin.file_of(key), key, given, rule, "set more of them")


def most_open(analysis: SurvivalAnalysis, factor: float = 1.0) -> tuple[float, str, str]:
    """Number of earthquakes, times a factor, that are open of a rock, in words, and its key."""
    own, before = analysis.shaking.table, analysis.before
    table = replace(own, levels=factor * own.levels)
    curve = replace(before, levels=factor * before.levels)
    found = []
    for at, rock in enumerate(analysis.rocks):
        each = [_open_in(one, table, curve, years) for one, years in _timed(rock)]
        number, worst = (
            sum(one.number for one in each),
            int(np.argmax([one.number for one in each])),
        )
        name = f"{rock.name} in an earlier stage" if worst else rock.name
        key = "hazard.rocks" if at else "hazard.history" if worst else "motion"
        found.append((number, in_words(rock.stages[worst], name, number, each[worst]), key))
    return max(found, key=itemgetter(0))


def _open_in(one: RockFragility, table: RatioTable, curve: HazardCurve, years: float) -> Open:
    """What is open of a rock in some years."""
    least = max(acceleration(one.static), curve.levels[0])
    if least >= curve.levels[-1]:
        return Open(0.0, 0.0, least, np.nan)
    levels = np.append(np.geomspace(least, curve.levels[-1], _PARTS)[:-1], curve.levels[-1])
    return open_number(one, table, levels, years * curve.rate_at(levels))


_PARTS = 200
"""Levels of PGA over which what is open is summed up."""


class Open(NamedTuple):
    """Earthquakes of which it is open whether they topple a rock.

    Attributes
    ----------
    number : float, on average
    share, level, median : float, of the shaking of a PGA [m/s^2] that is open, where that comes
        most often, and its median PGV/PGA [s]
    """

    number: float
    share: float
    level: float
    median: float


def open_number(one: RockFragility, table: RatioTable, levels: Array, exceeded: Array) -> Open:
    """Earthquakes that are open of a rock.

    What no run is near to is shorter than the first of them and topples it less often, or is
    longer than the last and topples it more often, or between two of them in both.

    Parameters
    ----------
    levels : ndarray, shape (n,) [m/s^2], ascending
    exceeded : ndarray, shape (n,), how often each of them is, on average
    """
    shares = _shares(one, table, levels)
    at = int(np.argmax(shares * exceeded))
    median = float(table.at(levels[[at]])[0][0])
    return Open(_summed(shares, exceeded), float(shares[at]), float(levels[at]), median)


def in_words(one: RockFragility, name: str, number: float, most: Open) -> str:
    """So many open earthquakes of a rock, most of which are as those are."""
    return (
        f"earthquakes whose PGV/PGA is more than a factor of {NEAR[1]:.2g} off all runs of {name} "
        f"({len(one.ratios)}, from {one.ratios[0]:.3g} to {one.ratios[-1]:.3g} s), {number:.2g} on "
        f"average, as {most.share:.0%} of the shaking of {in_g(most.level):.3g} g, whose median is "
        f"{most.median:.3g} s"
    )


def _shares(one: RockFragility, table: RatioTable, levels: Array) -> Array:
    """Share of the shaking of each level that is open."""
    medians, log_sds = table.at(levels)
    ends = np.log(np.multiply.outer(one.ratios, NEAR).ravel()[:, None] / medians) / log_sds
    gaps = np.diff(ndtr(ends), prepend=0.0, append=1.0, axis=0)[::2]
    changes = np.diff(one.mean(levels), prepend=0.0, append=1.0, axis=0)
    return np.asarray((np.maximum(gaps, 0.0) * np.abs(changes)).sum(axis=0))


def _summed(shares: Array, exceeded: Array) -> float:
    """Of all earthquakes, between levels and beyond the last."""
    between = 0.5 * (shares[1:] + shares[:-1]) @ -np.diff(exceeded)
    return float(between + shares[-1] * exceeded[-1])
