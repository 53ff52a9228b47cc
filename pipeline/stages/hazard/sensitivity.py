"""What a result would be with one assumption changed at a time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.stages.hazard.rock_fragility import OTHER_ROWS, RockFragility
from pipeline.stages.hazard.survival_analysis import BranchResults, SurvivalAnalysis
from pipeline.workflow.grammar import counted
from vsr_core.hazard.shaking import Shaking
from vsr_core.hazard.toppling import RowFragility

LARGEST_TO_AVERAGE = 1.2
"""PGA in the direction in which it is largest over that of the average component, RotD100/RotD50:
1.19 in the median of records (Boore & Kishida 2017, Bull. Seismol. Soc. Am. 107)."""

BASE_CASE = "base case"

AS_GIVEN = "rock: as given, without uncertainty"
AS_TESTED = "rock: with its uncertainty, its base as tests have found rocks"
"""The cases in which the fits of one rock replace its ensemble, or it replaces them."""

DRAWN_ANEW = "rock: drawn anew in each earthquake"
"""The case in which a draw is a rock in one earthquake, and not for all of its age."""

AS_NOW = "history: as it stands now, for all of its age"
"""The case without the stages in which a rock was exhumed."""

AGES = (5.0, 95.0)
"""Percentiles of the age for a young and an old rock."""


@dataclass(frozen=True, eq=False)
class Case:
    """The analysis with one thing changed."""

    name: str
    analysis: SurvivalAnalysis
    results: BranchResults


def cases(
    analysis: SurvivalAnalysis,
    alternatives: Mapping[str, Shaking],
    compared: Mapping[str, RockFragility],
) -> list[Case]:
    """All cases of the sensitivity study, the base case first.

    Parameters
    ----------
    alternatives : mapping, from the name of a case to the shaking then
    compared : mapping, from the name of a case to the rock's fragility then
    """
    found = [Case(BASE_CASE, analysis, analysis.results())]
    if analysis.drawn:
        anew = analysis.all_stand(analysis.shaking.rates, analysis.standing)
        found.append(Case(DRAWN_ANEW, analysis, analysis.reweighted(anew)))
    changes = _changes(analysis, alternatives, compared)
    return found + [Case(name, one, one.results()) for name, one in changes]


def _changes(
    analysis: SurvivalAnalysis,
    alternatives: Mapping[str, Shaking],
    compared: Mapping[str, RockFragility],
) -> Iterator[tuple[str, SurvivalAnalysis]]:
    first, ordered = analysis.rocks[0], _by_weakness(analysis)
    for name, fragility in compared.items():
        yield name, analysis.with_first(replace(first, fragility=fragility))
    if first.earlier:
        yield AS_NOW, analysis.with_first(replace(first, earlier=()))
    if len(ordered) > 1:
        for word, (yaw, _) in (("most", ordered[0]), ("least", ordered[-1])):
            name = f"direction: all shaking of {first.name} at yaw {yaw:g}°, the {word} fragile"
            earlier = tuple((one.towards(yaw), until) for one, until in first.earlier)
            if any(
                one is whole for (one, _), (whole, _) in zip(earlier, first.earlier, strict=True)
            ):
                name += "; earlier stages that were not shaken in it, in all of their own"
            own = replace(first, fragility=first.fragility.towards(yaw), earlier=earlier)
            yield name, analysis.with_first(own)
    factor = LARGEST_TO_AVERAGE
    yield (
        f"component: PGA at the rock is {factor:g} times that of the curves, as that of the "
        "largest horizontal direction is to the average",
        replace(analysis, shaking=analysis.shaking.times(factor)),
    )
    yield (
        f"component: PGA at the rock is 1/{factor:g} of that of the curves, as that of the average "
        "horizontal direction is to the largest",
        replace(analysis, shaking=analysis.shaking.times(1.0 / factor)),
    )
    for name, shaking in alternatives.items():
        yield name, replace(analysis, shaking=shaking)
    if len(first.ages) > 1:
        for share in AGES:
            age = np.percentile(first.ages, [share])
            name = f"age: {age[0]:,.0f} years, its {share:g} % value"
            yield name, analysis.with_first(first.aged(age))
    yield from _coarser(analysis)


def _coarser(analysis: SurvivalAnalysis) -> Iterator[tuple[str, SurvivalAnalysis]]:
    if any(len(stage.ratios) > 1 for rock in analysis.rocks for stage in rock.stages):
        for name, of in OTHER_ROWS.items():
            rocks = tuple(rock.in_each_stage(of) for rock in analysis.rocks)
            yield name, replace(analysis, rocks=rocks)


def too_coarse(found: Sequence[Case]) -> tuple[str, ...]:
    """That branches are rejected or not as the PGV/PGA of the runs lie, in words, where they are.

    Parameters
    ----------
    found : all cases, the base case first
    """
    base = found[0].results.rejected
    others = [one.results.rejected for one in found if one.name in OTHER_ROWS]
    if not (turned := int(np.any([one != base for one in others], axis=0).sum())):
        return ()
    return (coarse(f"{turned} of {counted(len(base), 'branch', 'branches')}"),)


def coarse(which: str) -> str:
    """That other PGV/PGA of the runs turn verdicts, in words."""
    return (
        "every second PGV/PGA of the runs, or all of them moved by a tenth of the gaps between, "
        f"gives another verdict on {which}: they are too far apart to say; set more of them, in "
        "equal ratios"
    )


def _by_weakness(analysis: SurvivalAnalysis) -> list[tuple[float, RowFragility]]:
    """Directions [degree] of the first rock, the one from which it topples most often first."""
    rock, shaking = analysis.rocks[0].fragility, analysis.mean_shaking
    rates = {
        yaw: float(shaking.rates(shaking.fragility(rows, rock.ratios))[0])
        for yaw, rows in rock.by_yaw.items()
    }
    return sorted(rock.by_yaw.items(), key=lambda item: -rates[item[0]])
