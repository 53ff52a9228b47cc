"""How the answer changes with what was assumed, one thing at a time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from pipeline.stages.hazard.question import Answer, Question
from pipeline.stages.hazard.rock_fragility import DRAWN, RockFragility
from pipeline.stages.hazard.shaking_ratio import ShakingRatio
from vsr_core.arrays import Array
from vsr_core.hazard.averaging import RowFragility
from vsr_core.hazard.toppling import toppling

LARGEST_TO_AVERAGE = 1.2
"""PGA in the direction in which it is largest over that of the average component, RotD100/RotD50:
1.19 in the median of records (Boore & Kishida 2017, Bull. Seismol. Soc. Am. 107)."""

AS_SCANNED = "rock: as scanned, nothing drawn"
"""What is changed where the fits of one rock stand for its ensemble."""

SAME_ROCK = "rock: the same draw in all earthquakes, mean survival of the draws"
"""What is changed where a draw stands for a rock, not for a rock in one earthquake."""

AGES = (5.0, 95.0)
"""Percentiles of the age that stand for a young and an old rock."""


@dataclass(frozen=True, eq=False)
class Case:
    """The question with one thing changed."""

    what: str
    question: Question
    answer: Answer


def cases(
    question: Question, others: Array, ratio: ShakingRatio, compared: Mapping[str, RockFragility]
) -> list[Case]:
    """All changes, the question as it is first.

    Parameters
    ----------
    others : ndarray, shape (n, branches), survival with each other fragility
    compared : mapping, from what is changed to the rock's fragility then
    """
    found = [Case("as used", question, question.answer())]
    if all(rock.fragility.source == DRAWN for rock in question.rocks):
        found.append(Case(SAME_ROCK, question, question.weighed(others.mean(axis=0))))
    changes = _changes(question, ratio, compared)
    return found + [Case(what, one, one.answer()) for what, one in changes]


def _changes(
    question: Question, ratio: ShakingRatio, compared: Mapping[str, RockFragility]
) -> Iterator[tuple[str, Question]]:
    for what, fragility in compared.items():
        yield what, question.with_first(fragility=fragility)
    ordered = by_weakness(question)
    if len(ordered) > 1:
        for word, (yaw, rows) in (("most", ordered[0]), ("least", ordered[-1])):
            what = f"direction: all shaking at yaw {yaw:g}°, which topples it {word} often"
            yield what, question.with_rows(rows)
    factor = LARGEST_TO_AVERAGE
    yield (
        f"component: the rock is shaken by {factor:g} times the curves' PGA, the largest of all "
        "horizontal directions",
        replace(question, component=factor),
    )
    yield (
        f"component: the rock is shaken by 1/{factor:g} of the curves' PGA, as if they were for "
        "the largest",
        replace(question, component=1.0 / factor),
    )
    for what, table in ratio.doubts.items():
        yield what, replace(question, table=table)
    ages = question.rocks[0].ages
    if len(ages) > 1:
        for share in AGES:
            age = np.percentile(ages, [share])
            yield (
                f"age: {age[0]:,.0f} years, its {share:g} % value",
                question.with_first(ages=age),
            )


def by_weakness(question: Question) -> list[tuple[float, RowFragility]]:
    """Directions of the first rock, the one from which it topples most often first.

    Returns
    -------
    list of direction [degree] and RowFragility
    """
    rock = question.rocks[0]
    rates = {
        yaw: toppling(question.before, question.one_measure(rock, rows)).rate
        for yaw, rows in rock.fragility.by_yaw.items()
    }
    return sorted(rock.fragility.by_yaw.items(), key=lambda item: -rates[item[0]])
