"""Files from outside: one way to read them, by a schema, and to refuse in one line what breaks it.

A file is opened if it is a regular one of bounded size, by `content` or `opened`; what a library
opens itself has been through `check_file`, or through `check_regular` where the key of a setting is
to be named, and not its file. Text is UTF-8. A table is a line of names, each there once, and rows
with a field for each name. A row is a `Row`: its fields, their types and ranges, as of a section of
the configuration. What is in no schema is refused, or named.
"""

from __future__ import annotations

import csv
import errno
import io
import json
import mmap
import os
import re
import stat
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from operator import attrgetter
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    ValidatorFunctionWrapHandler,
    field_validator,
)

from pipeline.config.paths import shown
from pipeline.config.problems import InputError, Problem
from pipeline.config.refusals import problem
from pipeline.config.sections import Refused, Section
from vsr_core.errors import InvalidInput
from vsr_core.motions.hdf5_heaps import damaged
from vsr_core.motions.hdf5_parts import kept_elsewhere
from vsr_core.motions.named_columns import LONGEST_LINE, is_cut

LARGEST = 64 * 1024**2
"""Bytes of a file."""

MOST_LINES = 500_000
"""Lines of a table, which take some hundreds of megabytes of memory."""

_LARGEST_SHORT, _MORE = 16 * 1024**2, 1000
"""Bytes of a table of few columns, and its lines of names and comments."""

LONGEST_FIELD = 100_000
"""Characters of a field of a table."""

SUM = 1e-3
"""How far weights may be from a sum of 1, as they are written with few digits."""

Model = TypeVar("Model", bound=BaseModel)


Share = Annotated[float, Field(ge=0, le=1)]


class Row(Section):
    """A row of a table; columns that it does not name are left to the reader of the table."""

    model_config = ConfigDict(extra="ignore")

    @field_validator("*", mode="wrap")
    @classmethod
    def _is_plain(cls, given: Any, found_in: ValidatorFunctionWrapHandler) -> Any:
        """Refuse a number with underscores, which Python would read over."""
        found = found_in(given)
        several = isinstance(given, list) and isinstance(found, list | tuple)
        for text, number in zip(given, found, strict=True) if several else [(given, found)]:
            if isinstance(text, str) and "_" in text and isinstance(number, int | float):
                raise Refused("a number has no underscores", "leave them out", "", repr(text))
        return found


def refused(path: Path, key: str, given: str, rule: str, remedy: str = "") -> InputError:
    """The refusal of a file."""
    return InputError(Problem(shown(path), key, given, rule, remedy or "export it again"))


def check_regular(path: Path, largest: int) -> None:
    """Refuse what is no regular file that one may read, or too large, before it is opened.

    Raises
    ------
    InvalidInput
    """
    try:
        state = path.stat()
        if not stat.S_ISREG(state.st_mode):
            raise InvalidInput("no regular file", "it is a file", "correct the path")
        if not os.access(path, os.R_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    except OSError as error:
        raise _unreadable(error) from None
    if state.st_size > largest:
        given, rule = f"a file of {_size(state.st_size)}", f"it has at most {_size(largest)}"
        raise InvalidInput(given, rule, "leave out what is not needed")


def check_file(path: Path, largest: int) -> None:
    """The same, the file named."""
    try:
        check_regular(path, largest)
    except InvalidInput as error:
        raise InputError.from_invalid(shown(path), "", error) from None


@contextmanager
def opened(path: Path, largest: int) -> Iterator[io.BufferedReader]:
    """A regular file to read, which is named where the disk does not give it."""
    check_file(path, largest)
    try:
        with path.open("rb") as file:
            yield file
    except OSError as error:
        raise InputError.from_invalid(shown(path), "", _unreadable(error)) from None


def content(path: Path, largest: int = LARGEST) -> bytes:
    """What a regular file holds."""
    try:
        return held(path, largest)
    except InvalidInput as error:
        raise InputError.from_invalid(shown(path), "", error) from None


def held(path: Path, largest: int) -> bytes:
    """The same for who names the key of a setting, and not the file.

    Raises
    ------
    InvalidInput
    """
    check_regular(path, largest)
    try:
        with path.open("rb") as file:
            return file.read(largest)
    except OSError as error:
        raise _unreadable(error) from None


def damaged_heap(path: Path) -> int | None:
    """Place of a heap in a file that HDF5 would read for ever; None if there is none."""
    if not path.stat().st_size:
        return None
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as held:
        return damaged(held)


def check_hdf5(path: Path) -> None:
    """Refuse a file that HDF5 would read for ever, or of which a part is kept in another."""
    at = damaged_heap(path)
    if at is not None:
        rule = "what is in it follows each other to its end"
        raise refused(path, f"heap at byte {at}", "a damaged one", rule, "copy it again")
    if name := kept_elsewhere(path):
        rule, remedy = "all of it is in one file", "copy into it what it leads to"
        raise refused(path, name, "a part that is kept in another file", rule, remedy)


def _unreadable(error: OSError) -> InvalidInput:
    given = f"a file that cannot be read ({error.strerror})"
    return InvalidInput(given, "it is a file that you may read", "correct it")


def _size(number: int) -> str:
    """A number of bytes in words.

    >>> _size(100_000), _size(64 * 1024**2), _size(1 << 40)
    ('97.66 KiB', '64 MiB', '1 TiB')
    """
    power = min((number.bit_length() - 1) // 10, 4) if number else 0
    return f"{number / 1024**power:.4g} {('bytes', 'KiB', 'MiB', 'GiB', 'TiB')[power]}"


def text(path: Path, largest: int = LARGEST) -> str:
    """What a file of text holds."""
    try:
        found = content(path, largest).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        given = f"byte {error.start + 1}, which is not in UTF-8"
        raise refused(path, "", given, "it is text in UTF-8", "save it so") from None
    if "\0" in found:
        raise refused(path, "", "a character of no text (NUL)", "it is text", "export it again")
    return found


def short_text(path: Path, most: int) -> str:
    """The same of a table of so many rows of few columns at most."""
    found = text(path, _LARGEST_SHORT)
    _check_lines(path, found, 2 * most + _MORE)  # every second may be blank
    return found


def _check_lines(path: Path, text: str, most: int) -> None:
    """Refuse a table of more lines, or of a longer one, before room is made for its fields."""
    if (number := text.count("\n")) > most:
        raise refused(path, "", f"{number:,} lines", f"at most {most:,}", "thin it out")
    if (longest := max(map(len, text.splitlines()), default=0)) > LONGEST_LINE:
        rule = f"at most {LONGEST_LINE:,}"
        raise refused(path, "", f"a line of {longest:,} characters", rule, "leave columns out")


def by_key(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Values by their keys.

    Raises
    ------
    ValueError
        If a key stands there twice.
    """
    if len(found := dict(pairs)) < len(pairs):
        raise ValueError("a key that stands there twice")
    return found


def of_json(text: str | bytes) -> Any:
    """What a text of JSON holds, in no object of which a key stands twice.

    Raises
    ------
    ValueError
    """
    return json.loads(text, object_pairs_hook=by_key)


def lines_of(text: str) -> list[str]:
    r"""Lines of a text as editors count them.

    >>> lines_of("a\r\nb\f\u2028c\n\nd")
    ['a', 'b\x0c\u2028c', '', 'd']
    """
    return [line.rstrip("\n") for line in io.StringIO(text, newline=None)]


_ERRORS = ("#N/A", "#VALUE!", "#REF!", "#DIV/0!", "#NAME?", "#NUM!", "#NULL!")
"""What a spreadsheet has for a number that it cannot tell."""


def is_comment(line: str) -> bool:
    """Whether a line of a table begins with #, in quotes only where nothing else is in it.

    >>> [is_comment(line) for line in ("# made by us", '"# by A, B",,', '"#2 fault",7', "#REF!")]
    [True, True, False, False]
    """
    start = line.lstrip(' "')
    if not start.startswith("#") or start.startswith(_ERRORS):
        return False
    try:
        return line.lstrip().startswith("#") or not any(next(csv.reader([line]))[1:])
    except csv.Error:
        return True


def _is_row(line: str, names: Sequence[str]) -> bool:
    """Whether what is behind the # may be a row: of one column, a number."""
    return len(names) > 1 or line.strip(' "#\r\n').replace(".", "", 1).isdecimal()


_HIDDEN = re.compile(r'[\s"]*#[^\s,]').match


def check_comments(path: Path, lines: str, names: Sequence[str]) -> None:
    """Refuse a comment that looks like a row: one whose name begins with #."""
    for line in filter(_HIDDEN, lines_of(lines)):
        if is_comment(line) and line.count(",") == len(names) - 1 and _is_row(line, names):
            given = f"{line[:40]!r}, a row or a comment"
            remedy = "put a name that begins with # in quotes, or a blank behind the # of a comment"
            raise refused(path, names[0], given, "it is one of them", remedy)


def table(path: Path, lines: str, named: Callable[[str], str] = str.strip) -> list[dict[str, str]]:
    """Rows of a table by its names, separated by commas; lines that begin with # are left out.

    Parameters
    ----------
    named : function, from how a column is written to its name

    Raises
    ------
    InputError
        For a row with another number of fields than there are names, a field over several lines, as
        of single quotes in two rows, a name given twice, or a last line that is cut.
    """
    csv.field_size_limit(LONGEST_FIELD)
    _check_lines(path, lines, MOST_LINES)
    plain = "".join(line for line in io.StringIO(lines, newline="") if not is_comment(line))
    try:
        rows = [
            [field.strip() for field in row]
            for row in csv.reader(io.StringIO(plain, newline=""), strict=True)
            if row
        ]
    except csv.Error as error:
        given = f"a table that cannot be read ({error})"
        raise refused(path, "", given, "it is a table in CSV") from None
    names = [named(name) for name in rows[0]] if rows else []
    check_comments(path, lines, names)
    if twice := [name for name, times in Counter(names).items() if times > 1]:
        raise refused(path, twice[0], "a column twice", "a column has a name of its own")
    for number, row in enumerate(rows[1:], start=1):
        if len(row) != len(names):
            given, rule = f"{len(row)} fields in row {number}", f"each row has {len(names)}"
            raise refused(path, "", given, rule)
        if any("\n" in field or "\r" in field for field in row):
            given, rule = f"a field over several lines in row {number}", "a field is in one line"
            raise refused(path, "", given, rule, "join it, or close its quotes")
    last = rows[-1] if rows else []
    if is_cut(plain, last[-1:], [row[-1] for row in rows[1:-1]] or last[:-1]):
        given, rule = f"a last line that ends in {last[-1]!r}", "the file is whole"
        raise refused(path, "", given, rule, "export it again, or end its last line")
    return [dict(zip(names, row, strict=True)) for row in rows[1:]]


def rows(
    path: Path,
    model: type[Model],
    cells: Sequence[dict[str, Any]],
    *,
    once: Sequence[str] = (),
    only: bool = False,
) -> list[Model]:
    """Rows of a table by their schema; an empty field is none.

    Parameters
    ----------
    once : fields that together are in one row only
    only : bool, whether there are no columns beside those of the schema
    """
    needed = [name for name, field in model.model_fields.items() if field.is_required()]
    if cells and (missing := [name for name in needed if name not in cells[0]]):
        rule = f"there are columns {', '.join(needed)}"
        raise refused(path, missing[0], "no such column", rule, "add it, or export it again")
    others = [name for name in (cells[0] if cells and only else ()) if name]
    if unknown := [name for name in others if name not in model.model_fields]:
        rule = f"the columns are {', '.join(model.model_fields)}"
        raise refused(path, unknown[0], "a column of no meaning", rule, "leave it out")
    found = []
    for number, row in enumerate(cells, start=1):
        given = {name: cell for name, cell in row.items() if cell != ""}
        try:
            found.append(model.model_validate(given, strict=False))
        except ValidationError as error:
            raise in_row(path, error, model, number) from None
    if once:
        twice = [key for key, times in Counter(map(attrgetter(*once), found)).items() if times > 1]
        if twice:
            what = ", ".join(once)
            raise refused(path, what, f"{twice[0]} twice", "it is in one row", "leave one out")
    return found


def in_row(path: Path, error: ValidationError, model: type[BaseModel], number: int) -> InputError:
    """The refusal of a row of a table."""
    said = problem(error.errors()[0], {}, shown(path), model)
    return InputError(replace(said, given=f"{said.given or 'nothing'} in row {number}"))


def checked(path: Path, model: type[Model], values: dict[str, Any], *, text: bool = False) -> Model:
    """Values of a file by their schema.

    Parameters
    ----------
    text : bool, whether numbers are given as text
    """
    try:
        return model.model_validate(values, strict=False if text else None)
    except ValidationError as error:
        raise InputError(problem(error.errors()[0], {}, shown(path), model)) from None


def check_sum(path: Path, key: str, weights: Sequence[float]) -> None:
    """Refuse weights that do not sum to 1."""
    if not abs(sum(weights) - 1.0) <= SUM:
        given = f"weights that sum to {sum(weights):g}"
        raise refused(path, key, given, "those of all branches sum to 1", "export all realizations")
