"""Long tables of numbers from outside, read in parts as arrays, by the schema of a row."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pydantic import ValidationError

from pipeline.config.outside import Row, in_row, lines_of, opened, refused
from vsr_core.errors import reason

LARGEST = 64 * 1024**3
"""Bytes of a table, of which a part is held at a time."""

PART = 500_000
"""Rows of a part."""

_FIRST = 64 * 1024
"""Bytes in which the line of names ends."""

_KINDS = {"int": np.int64, "float": np.float64, "float | None": np.float64, "str | None": str}

_LIMITS = {"ge": np.less, "gt": np.less_equal, "le": np.greater, "lt": np.greater_equal}
"""What is beyond the limits of a field."""


def header(path: Path) -> tuple[str, list[str], int]:
    """What stands before the rows of a table.

    Returns
    -------
    remarks : str, the lines that begin with #
    names : list of str, of the columns, without their types
    number : int, of lines that these are
    """
    with opened(path, LARGEST) as file:
        first = file.read(_FIRST)
        file.seek(-min(len(first), 1), os.SEEK_END)
        ended = file.read(1) in (b"\n", b"")
    if not ended:
        raise refused(path, "", "a last line without its end", "each line is ended")
    try:
        lines = lines_of(first[: first.rfind(b"\n") + 1].decode("utf-8-sig"))
    except UnicodeDecodeError:
        raise refused(path, "", "a header that is not in UTF-8", "it is text in UTF-8") from None
    number = next((n for n, line in enumerate(lines) if line.lstrip('"')[:1] != "#"), len(lines))
    if number == len(lines):
        raise refused(path, "", "no line of names", "names of columns stand before the rows")
    names = [name.strip(' "').split(":")[0] for name in lines[number].split(",")]
    if twice := [name for name in names if names.count(name) > 1]:
        raise refused(path, twice[0], "a column twice", "a column has a name of its own")
    return "\n".join(lines[:number]), names, number + 1


def parts(path: Path, model: type[Row]) -> Iterator[dict[str, Any]]:
    """Columns of a table that are fields of a row, as arrays, a part of the rows at a time.

    Raises
    ------
    InputError
        For a column that is missing, a row with another number of fields than there are names, and
        a number that is none, or outside the range of its field.
    """
    _, names, number = header(path)
    needed = [name for name, field in model.model_fields.items() if field.is_required()]
    if missing := [name for name in needed if name not in names]:
        rule = f"there are columns {', '.join(needed)}"
        raise refused(path, missing[0], "no such column", rule)
    kinds = {name: kind for name, of in model.__annotations__.items() if (kind := _KINDS.get(of))}
    begun = 0
    try:
        for part in pd.read_csv(
            path, names=names, skiprows=number, dtype=kinds, chunksize=PART, low_memory=False,
            keep_default_na=False, na_values=[], encoding="utf-8",
        ):  # fmt: skip
            if not isinstance(part.index, pd.RangeIndex):
                raise refused(path, "", "more fields than names", f"each row has {len(names)}")
            found = {name: part[name].to_numpy() for name in names if name in model.model_fields}
            last = part[names[-1]]
            short = np.zeros(len(part), bool) if last.dtype.kind in "if" else last == ""
            check(path, model, found, short, begun)
            yield found
            begun += len(part)
    except (ValueError, OverflowError) as error:
        given = f"a table that cannot be read ({reason(error)})"
        raise refused(path, "", given, "each row has a number or text under each name") from None


def check(path: Path, model: type[Row], found: dict[str, Any], short: Any, begun: int) -> None:
    """Refuse the first row that is short, or that the schema does not take."""
    wrong = np.array(short, dtype=bool)
    for name, values in found.items():
        if values.dtype.kind in "if":
            wrong |= ~np.isfinite(values)
            for rule in model.model_fields[name].metadata:
                for limit, beyond in _LIMITS.items():
                    if hasattr(rule, limit):
                        wrong |= beyond(values, getattr(rule, limit))
    if wrong.any():
        at = int(np.argmax(wrong))
        try:
            model.model_validate(
                {name: row[at : at + 1].tolist()[0] for name, row in found.items()}
            )
        except ValidationError as error:
            raise in_row(path, error, model, begun + at + 1) from None
        raise refused(path, "", f"fewer fields in row {begun + at + 1}", "each row has all")
