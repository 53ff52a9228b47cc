"""Ages that a configuration names by a file of samples, read when it is."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from statistics import median_low
from typing import TypeVar

from pydantic import Field

from pipeline.config.hazard_schema import (
    MOST_SAMPLES,
    YOUNGEST,
    Age,
    EarlierStage,
    HazardConfig,
    HazardRock,
    SampledAge,
    Years,
)
from pipeline.config.outside import Row, refused, rows, short_text, table
from pipeline.config.problems import InputError, Problem

Dated = TypeVar("Dated", HazardRock, EarlierStage)


OLDEST = 100.0
"""How many times as old as the median sample the oldest may be: far more than any method leaves
open."""


SUMMED = 6
"""Ages from which on one that is the sum of the others is no age: three in thousands of years are
so by chance."""


class DatedSample(Row):
    """A row of a table of ages."""

    age_a: Years = Field(description="age [year]")


def with_samples(
    hazard: HazardConfig, path_of: Callable[[str, str], Path], file_of: Callable[[str], str]
) -> HazardConfig:
    """The same with the samples of its ages in place of their files.

    Parameters
    ----------
    path_of : callable, from a dotted key and what is given there to a path
    file_of : callable, from a dotted key to where it stands, for messages
    """

    def read(age: Age, key: str) -> Age:
        if not isinstance(age, SampledAge) or (age.values and age.file is None):
            return age
        if age.file is None or age.values:
            given = "both" if age.file else "neither"
            rule, remedy = "samples have values or a file", "give one of the two"
            raise InputError(Problem(file_of(key), key, given, rule, remedy))
        values = samples(path_of(f"{key}.file", age.file))
        source = age.source or Path(age.file).name[:400]
        return SampledAge(kind="samples", values=values, source=source)

    def each(name: str, stages: tuple[Dated, ...], key: str) -> tuple[Dated, ...]:
        return tuple(
            one.model_copy(update={key: read(getattr(one, key), f"hazard.{name}")})
            for one in stages
        )

    return hazard.model_copy(
        update={
            "age": hazard.age and read(hazard.age, "hazard.age"),
            "history": each("history", hazard.history, "until"),
            "rocks": each("rocks", hazard.rocks, "age"),
        }
    )


def samples(path: Path) -> tuple[float, ...]:
    """Equally likely ages [year] of a table."""
    cells = table(path, short_text(path, MOST_SAMPLES))
    if not 1 <= len(cells) <= MOST_SAMPLES:
        rule = f"there are 1 to {MOST_SAMPLES:,} ages"
        raise refused(path, "", f"{len(cells)} rows", rule, "give one a row, or thin them out")
    ages = tuple(row.age_a for row in rows(path, DatedSample, cells))
    if max(ages) < YOUNGEST:
        rule = f"some are of {YOUNGEST} years or more; fewer are thousands of years"
        given = f"ages up to {max(ages):g}"
        raise refused(path, "age_a", given, rule, "give years, or values in place of the file")
    if max(ages) > OLDEST * median_low(ages):
        given, rule = f"{max(ages):g}", f"it is at most {OLDEST:g} times the median"
        raise refused(path, "age_a", given, rule, "correct it: two ages may stand in one line")
    if len(ages) >= SUMMED and math.isclose(2.0 * max(ages), math.fsum(ages), rel_tol=1e-6):
        given, rule = f"{max(ages):g}, the sum of the others", "each is an age"
        raise refused(path, "age_a", given, rule, "leave the sum out")
    if more := [name for name in cells[0] if name != "age_a"]:
        rule, remedy = "samples are equally likely, in a column age_a alone", "draw by the weights"
        raise refused(path, more[0], "another column", rule, f"{remedy}, or leave it out")
    return ages
