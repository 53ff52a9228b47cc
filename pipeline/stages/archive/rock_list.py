"""Archives as they come: a table of rocks; a row that is wrong is named, the others go on."""

from __future__ import annotations

import csv
import difflib
import math
from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from pydantic import Field, ValidationError, model_validator

from pipeline.config import outside
from pipeline.config.hazard_schema import LONGEST, YOUNGEST, refuse_wide
from pipeline.config.paths import shown
from pipeline.config.problems import Problem
from pipeline.config.refusals import problem
from pipeline.config.sections import Refused
from pipeline.config.slips import radians_of
from vsr_core.archive.photographs import Seen
from vsr_core.motions.named_columns import is_cut

LEVEL = 1.25
"""Factor between the heights of the centre of mass above both rocking points that is let pass."""

_MOST = 20_000
"""Rocks of an archive."""

SLENDER = 5.0
"""Height of a rock by that of its centre of mass, at most."""

Metres = Annotated[float, Field(gt=0.01, le=15.0)]
Angle = Annotated[float, Field(ge=3.0, le=45.0)]


class ListedRock(outside.Row):
    """A rock of an archive; an empty field is None."""

    name: str = Field(min_length=1, max_length=200, description="name of the rock")
    alpha_1_deg: Angle = Field(
        description="angle between the vertical and the line from the rocking point to the centre"
    )
    alpha_2_deg: Angle | None = Field(None, description="the same on the other side")
    r_1_m: Metres | None = Field(None, description="from the rocking point to the centre of mass")
    r_2_m: Metres | None = Field(None, description="the same on the other side, with its angle")
    height_m: float | None = Field(None, gt=0.01, le=30.0, description="height of the rock")
    azimuth_deg: float | None = Field(
        None, ge=-360.0, le=360.0, description="from the centre of mass to side 1"
    )
    friction: float | None = Field(None, ge=0.05, le=3.0, description="of rock on pedestal")
    roundness: float | None = Field(
        None, ge=0.0, le=0.4, description="radius of the base's edges by the height of the centre"
    )
    age_mean_a: float | None = Field(None, gt=0.0, le=1e7, description="for which it has stood")
    age_sd_a: float | None = Field(None, ge=0.0, le=1e7, description="its standard deviation")

    @model_validator(mode="after")
    def _is_one_rock(self) -> Self:
        if self.r_1_m is None and self.r_2_m is None and self.height_m is None:
            rule, remedy = "r_1_m, r_2_m or height_m is given", "give one: it sets the size"
            raise Refused(rule, remedy, "r_1_m", "nothing")
        weaker = min(self.alpha_1_deg, self.alpha_2_deg or math.inf)
        if weaker > 35.0:
            rule = "the weaker side's is at most 35 deg"
            raise Refused(rule, "the equations hold no broader rocks", "alpha_1_deg")
        if self.age_sd_a is not None and self.age_mean_a is None:
            rule = "a standard deviation has a mean beside it"
            raise Refused(rule, "give it, or leave both out", "age_mean_a", "nothing")
        if self.age_mean_a is not None:
            refuse_wide(self.age_mean_a, self.age_sd_a or 0.0, "age_sd_a")
        self._check_heights()
        return self

    def _check_heights(self) -> None:
        """Refuse distances that do not go with the angles, or with the height."""
        if self.r_2_m is not None and self.alpha_2_deg is None:
            rule, remedy = "a distance has its side's angle beside it", "give it, or leave both out"
            raise Refused(rule, remedy, "alpha_2_deg", "nothing")
        sides = ((self.r_1_m, self.alpha_1_deg), (self.r_2_m, self.alpha_2_deg))
        centres = [r * math.cos(math.radians(alpha)) for r, alpha in sides if r and alpha]
        if len(centres) == 2 and max(centres) > LEVEL * min(centres):
            given = f"centres of mass {centres[0]:.3g} and {centres[1]:.3g} m high"
            rule = f"r cos(alpha) of both sides agree within {LEVEL:g} times"
            raise Refused(rule, "correct a distance or an angle", "r_2_m", given)
        if centres and self.height_m is not None and max(centres) >= self.height_m:
            given = f"{self.height_m:g}, with a centre of mass {max(centres):.3g} m high"
            raise Refused("it is above the centre of mass", "correct one", "height_m", given)
        if centres and self.height_m is not None and self.height_m > SLENDER * max(centres):
            given = f"{self.height_m:g}, with a centre of mass {max(centres):.3g} m high"
            rule = f"it is at most {SLENDER:g} times that, a cone's is 4 times"
            raise Refused(rule, "correct one", "height_m", given)


@dataclass(frozen=True, eq=False)
class Archive:
    """Rocks of a table, and what is wrong with its other rows: all, and by the names in them."""

    rocks: list[ListedRock]
    problems: list[Problem]
    problem_of: dict[str, Problem]

    @property
    def doubts(self) -> Iterator[str]:
        """Columns whose numbers are usual in another unit, in words."""
        yield from radians_of("azimuth_deg", (rock.azimuth_deg for rock in self.rocks))
        ages = [rock.age_mean_a for rock in self.rocks if rock.age_mean_a is not None]
        if ages and min(ages) < YOUNGEST:
            yield f"age_mean_a from {min(ages):g} to {max(ages):g} years: thousands of years?"
        if ages and max(ages) > LONGEST:
            yield f"age_mean_a to {max(ages):,.0f} years: two ages in one field?"

    @property
    def seen(self) -> Seen:
        """What is known of the rocks."""

        def column(*names: str) -> np.ndarray:
            rows = [[getattr(rock, name) for name in names] for rock in self.rocks]
            return np.array(rows, dtype=np.float64).reshape(-1, len(names))  # None is nan

        return Seen(
            np.radians(column("alpha_1_deg", "alpha_2_deg")),
            column("r_1_m", "r_2_m"),
            column("height_m")[:, 0],
            column("friction")[:, 0],
            column("roundness")[:, 0],
        )


def read(path: Path) -> Archive:
    """Read an archive.

    Raises
    ------
    InputError
        For a file that is no table of rocks at all, is cut, or is without a row.
    """
    text = outside.short_text(path, _MOST)
    found = _rows(text)
    rows = iter(found)
    _, names = next(rows, (0, []))
    _check_names(path, names or [])
    outside.check_comments(path, text, names or [])
    rocks: list[ListedRock] = []
    problems: list[Problem] = []
    line_of: dict[str, int] = {}
    problem_of: dict[str, Problem] = {}
    for number, fields in rows:
        where = f"{shown(path)}: line {number}"
        name = dict(zip(names or [], fields or [], strict=False)).get("name", "")
        try:
            rock = _rock(where, names or [], fields)
        except _Wrong as wrong:
            problems.append(wrong.problem)
            problem_of[name] = wrong.problem
            continue
        if rock.name in line_of:
            given = f"{rock.name!r}, which line {line_of[rock.name]} has, too"
            problem_of[name] = Problem(where, "name", given, "a rock has one row", "rename it")
            problems.append(problem_of[name])
            continue
        line_of[rock.name] = number
        rocks.append(rock)
    _check_end(path, text, [fields or [""] for _, fields in found])
    if not rocks and not problems:
        raise outside.refused(path, "", "no row", "there is a row for each rock", "add one")
    return Archive(rocks, problems, problem_of)


def _rows(text: str) -> list[tuple[int, list[str] | None]]:
    """Fields of each row, after the number of its line; None where its quotes do not close."""
    lines = outside.lines_of(text)
    odd = [number for number, line in enumerate(lines) if line.count('"') % 2]
    found: list[tuple[int, list[str] | None]] = []
    after = 0
    for number, line in enumerate(lines, 1):
        if number <= after or not _is_row(line):
            continue
        fields = _fields(line)
        if fields is None:  # they may below, and then all between is one field
            below = bisect_left(odd, number)
            close = odd[below] if below < len(odd) else number
            fields = _fields("\n".join(lines[number - 1 : close + 1]))
            after = 0 if fields is None else close + 1
        found.append((number, fields))
    return found


def _check_end(path: Path, text: str, parted: list[list[str]]) -> None:
    """Refuse a table whose last line is cut; a single row has to end its line."""
    *others, last = parted[1:] or [[""]]
    if is_cut(text, last[-1:], [fields[-1] for fields in others]):
        given, rule = f"a last line that ends in {last[-1]!r}", "the file is whole"
        raise outside.refused(path, "", given, rule, "export it again, or end its last line")


class _Wrong(Exception):
    """A row that is no rock."""

    def __init__(self, problem: Problem) -> None:
        super().__init__(str(problem))
        self.problem = problem


def _is_row(line: str) -> bool:
    return bool(line.strip(" \t,;")) and not outside.is_comment(line)


def _fields(line: str) -> list[str] | None:
    """Fields of a line; None where its quotes do not close."""
    try:
        return [field.strip() for field in next(csv.reader([line], strict=True))]
    except csv.Error:
        return None


def _check_names(path: Path, names: list[str]) -> None:
    known = list(ListedRock.model_fields)
    if len(names) == 1 and ";" in names[0]:
        raise outside.refused(path, "", "columns parted by semicolons", "commas part columns")
    for name in names:
        if name not in known:
            near = difflib.get_close_matches(name, known, 1)
            remedy = f"did you mean {near[0]}?" if near else f"the columns are {', '.join(known)}"
            raise outside.refused(
                path, name or "''", "a column of no meaning", "units are in names", remedy
            )
        if names.count(name) > 1:
            raise outside.refused(path, name, "a column twice", "a column has a name of its own")
    for name, field in ListedRock.model_fields.items():
        if field.is_required() and name not in names:
            raise outside.refused(path, name, "no such column", "it is there", "add it")


def _rock(where: str, names: list[str], fields: list[str] | None) -> ListedRock:
    if fields is None or len(fields) != len(names):
        given = "quotes that do not close" if fields is None else f"{len(fields)} fields"
        key = "" if fields is None else (*names, "")[min(len(fields), len(names))]
        raise _Wrong(Problem(where, key, given, f"each row has {len(names)}", "correct it"))
    for name, field in zip(names, fields, strict=True):
        if "\n" in field:
            raise _Wrong(Problem(where, name, repr(field), "a field is in one line", "join it"))
    cells = {name: cell for name, cell in zip(names, fields, strict=True) if cell}
    try:
        return ListedRock.model_validate(cells, strict=False)
    except ValidationError as error:
        raise _Wrong(problem(error.errors()[0], {}, where, ListedRock)) from None
