"""How the answer changes with what was assumed, one thing at a time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from pipeline.stages.hazard.question import Answer, Question
from pipeline.stages.hazard.rock_fragility import RockFragility
from pipeline.stages.hazard.shaking_ratio import ShakingRatio
from vsr_core.hazard.averaging import RowFragility
from vsr_core.hazard.toppling import toppling

LARGEST_TO_AVERAGE = 1.2
"""PGA in the direction in which it is largest over that of the average component, RotD100/RotD50:
1.19 in the median of records (Boore & Kishida 2017, Bull. Seismol. Soc. Am. 107)."""

AS_SCANNED = "the rock as scanned, nothing uncertain"
"""What is changed where the fits of one rock stand for its ensemble."""

AGES = (5.0, 95.0)
"""Percentiles of the age that stand for a young and an old rock."""


@dataclass(frozen=True, eq=False)
class Case:
    """The question with one thing changed.

    Attributes
    ----------
    what : str, what is changed, in words
    question : Question
    answer : Answer
    """

    what: str
    question: Question
    answer: Answer


def cases(
    question: Question, ratio: ShakingRatio, compared: Mapping[str, RockFragility]
) -> list[Case]:
    """All changes, the question as it is first.

    Parameters
    ----------
    question : Question
    ratio : ShakingRatio, whose table the question has
    compared : mapping, from what is changed to the rock's fragility then

    Returns
    -------
    list of Case
    """
    asked = {"as used": question} | dict(_changes(question, ratio, compared))
    return [Case(what, one, one.answer()) for what, one in asked.items()]


def _changes(
    question: Question, ratio: ShakingRatio, compared: Mapping[str, RockFragility]
) -> Iterator[tuple[str, Question]]:
    largest = f"{LARGEST_TO_AVERAGE:g}"
    yield (
        f"the rock feels the strongest horizontal direction, {largest} times the curves' PGA",
        replace(question, component=LARGEST_TO_AVERAGE),
    )
    yield (
        f"the curves are for the strongest horizontal direction, the rock feels 1/{largest} of it",
        replace(question, component=1.0 / LARGEST_TO_AVERAGE),
    )
    ordered = by_weakness(question)
    if len(ordered) > 1:
        for word, (yaw, rows) in (("weakest", ordered[0]), ("strongest", ordered[-1])):
            yield f"all shaking from the {word} direction, yaw {yaw:g}°", question.with_rows(rows)
    for what, table in ratio.doubts.items():
        yield what, replace(question, table=table)
    for what, fragility in compared.items():
        yield what, question.with_first(fragility=fragility)
    ages = question.rocks[0].ages
    if len(ages) > 1:
        for word, share in zip(("young", "old"), AGES, strict=True):
            age = np.percentile(ages, [share])
            yield (
                f"a rock {word} for its dating, {_years(age[0])} years",
                question.with_first(ages=age),
            )


def by_weakness(question: Question) -> list[tuple[float, RowFragility]]:
    """Directions of the first rock, the one from which it topples most often first.

    Parameters
    ----------
    question : Question

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


def _years(years: float) -> str:
    return f"{years:,.0f}"
