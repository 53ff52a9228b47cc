"""Named columns of numbers with the units that they state: from a table of text, or from NetCDF."""

from __future__ import annotations

import io
import math
import re
from array import array
from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import takewhile
from typing import Any, NamedTuple

import netCDF4
import numpy as np

from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput, reason
from vsr_core.motions.hdf5_heaps import damaged
from vsr_core.motions.hdf5_parts import kept_elsewhere

_BRACKETS = re.compile(r"((?:.*[\])])?[^\[(\])]*)[\[(]([^\])]*)[\])]")
"""A name and its unit, in the last brackets. Each character is in one of its parts alone: 60,000
blanks took half a minute."""

_WITH_UNIT = re.compile(r"[^\s\[(]+(?:\s*[\[(][^\[(\])]*[\])])?")
"""A name among names apart by blanks."""

_DIGIT, _EXPONENT = re.compile(r"\d"), re.compile(r"[\d.][eE][-+\d]")
_WORD = re.compile(r"\S+")
_BLANK_EXPONENT = re.compile(r"(?<!\S)([-+]?\d*\.\d*) {4}(?=\s|$)")

_FEW = 2
"""Lines out of column, or one in a hundred, among others that stand in columns."""


def _apart_by_blanks(line: str) -> list[str]:
    """Names with their units, where each has one of its own or none.

    >>> _apart_by_blanks("t [s]  a (m/s2)"), _apart_by_blanks("t [s] [m/s2]")
    (['t [s]', 'a (m/s2)'], ['t', '[s]', '[m/s2]'])
    """
    plain, found = line.split(), _WITH_UNIT.findall(line)
    return found if "".join("".join(found).split()) == "".join(plain) else plain


LONGEST_LINE, LONGEST_NAME = 1_000_000, 500
"""Characters of a line, and of the name of a column."""


class Column(NamedTuple):
    """Values of shape (n,), nan where one is missing; no unit where none is stated."""

    name: str
    unit: str | None
    values: Array


class NetCDF(NamedTuple):
    """Columns of numbers along time, names of all other variables, and attributes of the file."""

    columns: list[Column]
    others: list[str]
    attributes: dict[str, str]


MOST_SAMPLES = 1_000_000
"""Samples of a motion: over an hour at 200 a second. Three components are made into motions of runs
in 0.7 GB."""

MOST_NUMBERS = 10_000_000
"""Numbers of a file along its time."""


def is_cut(text: str, last: Sequence[str], others: Iterable[str]) -> bool:
    r"""Whether a text ends without an end of line, in nothing or a word formed like no other.

    Examples
    --------
    >>> is_cut("0.25\n0.2", ["0.2"], ["0.25"]), is_cut("0.25\n-1.25", ["-1.25"], ["0.25"])
    (True, False)
    >>> is_cut("a,1\nb,\nc,", [""], ["1", ""])
    True
    """
    if text.endswith(("\n", "\r")) or not last:
        return False
    form = _form(last[-1])
    return not form or all(_form(word) != form for word in others)


def _form(word: str) -> str:
    """A word with its digits alike and without a sign."""
    return _DIGIT.sub("0", word.strip(" +-"))


def refuse_cut_lines(lines: Sequence[str]) -> None:
    """Refuse a line that lost characters, where numbers end in columns wherever they begin.

    So they do if hardly a line is shorter; one is longer where a number outgrows its column, and
    by Fortran's G four blanks follow a number without an exponent.

    Raises
    ------
    InvalidInput
    """
    if any("E" in line for line in lines):
        lines = [_BLANK_EXPONENT.sub(r"\1E+00", line) for line in lines]
    spans = [[word.span() for word in _WORD.finditer(line)] for line in lines]
    ends = [tuple(end for _, end in of) for of in spans]
    usual = Counter(ends).most_common(1)[0][0] if ends else ()
    begins = {
        tuple(begin for begin, _ in of) for of, its in zip(spans, ends, strict=True) if its == usual
    }
    off = [at for at, its in enumerate(ends) if its != usual[: len(its)]]
    if off[:1] == [0] and not lines[0].startswith(" "):
        del off[0]  # its blanks may be lost with those around the whole text
    if len(begins) > 1 and 0 < len(off) <= max(_FEW, len(lines) // 100):
        shorter = [at for at in off if ends[at][-1:] < usual[: len(ends[at])][-1:]]
        if shorter:
            given = f"a line {lines[shorter[0]].strip()[-40:]!r}, out of column"
            raise InvalidInput(given, "it is whole", "download it again")


def refuse_lost_exponents(words: Sequence[str], values: Array) -> None:
    """Refuse numbers without an exponent where others, of any size, have one.

    Programs that write it where it makes a number shorter do so below 1e-4, or R of 5e-04; Fortran
    below 0.1, by G and by ``*``.

    Parameters
    ----------
    values : ndarray, shape (n,), of the words

    Raises
    ------
    InvalidInput
    """
    with_one = np.array(["e" in word or "E" in word for word in words], bool)
    size = np.abs(values)
    always = with_one & (size >= 1e-3) & (size < 1e5)
    bare = ~with_one & (size > 0.0)
    by_size = (size[always] < 0.1).all() and (size[bare] >= 0.1).all()
    if always.any() and bare.any() and not by_size:
        one, other = (words[int(found.argmax())].strip() for found in (bare, always))
        given = f"{one} without an exponent, which others have, as {other}"
        raise InvalidInput(given, "all numbers are formed alike", "write the file again")


def plain_number(word: str) -> float:
    """The number that a word of a file is; Python's own takes underscores, and other digits.

    Raises
    ------
    ValueError
    """
    if "_" in word or not word.isascii():
        raise ValueError(f"could not convert string to float: {word!r}")
    return float(word)


def of_text(text: str) -> list[Column]:
    r"""The columns of a table with a first line of names.

    Columns are separated by commas, semicolons, tabs or blanks; lines that begin with # are left
    out, but for names above a first line of numbers, as NumPy writes them.

    Raises
    ------
    InvalidInput
        If a row has another number of cells than there are names, or a cell is no number.

    Examples
    --------
    >>> [(one.name, one.unit, one.values.tolist()) for one in of_text("time,x [mm]\n0.5,7")]
    [('time', None, [0.5]), ('x', 'mm', [7.0])]
    """
    check_size(max(map(text.count, "\n\r")))
    lines = _with_names([line for line in text.splitlines() if line.strip()])
    if not lines:
        return []
    if (longest := max(map(len, lines))) > LONGEST_LINE:
        rule = f"lines are of {LONGEST_LINE:,} at most"
        raise InvalidInput(f"a line of {longest:,} characters", rule, "leave columns out")
    separator = next((mark for mark in ",;\t" if mark in lines[0]), None)
    words = lines[0].split(separator) if separator else _apart_by_blanks(lines[0])
    names = [_name(word) for word in words]
    if (longest := max(map(len, words))) > LONGEST_NAME:
        rule = f"names are of {LONGEST_NAME} at most"
        raise InvalidInput(f"a name of {longest:,} characters", rule, "shorten it")
    check_size(len(lines))
    _check_numbers(len(lines) * len(names))
    flat = array("d")
    for place, line in enumerate(lines[1:], start=2):
        cells = line.split(separator)
        if len(cells) != len(names):
            given = f"{len(cells)} values in row {place} of a table"
            raise InvalidInput(given, f"each row has {len(names)}", "correct it")
        try:
            flat.extend([plain_number(cell) if cell.strip() else math.nan for cell in cells])
        except ValueError:
            raise InvalidInput(
                f"row {place} of a table, {line.strip()[:40]!r}", "values are numbers", "correct it"
            ) from None
    last = lines[-1].split(separator)[-1]
    if len(lines) > 2 and is_cut(text, [last], (one.split(separator)[-1] for one in lines[1:-1])):
        given = f"a table that ends in {last.strip()!r}, formed like no other number above it"
        raise InvalidInput(given, "it is whole", "write it again, or end its last line")
    table = np.array(flat).reshape(-1, len(names)).T
    if _EXPONENT.search(text):
        for at, values in enumerate(table):
            refuse_lost_exponents([line.split(separator)[at] for line in lines[1:]], values)
    return [Column(*name, values) for name, values in zip(names, table, strict=True)]


def _with_names(lines: list[str]) -> list[str]:
    """Lines of a table from that of its names on, which may be the last remark above it."""
    above = list(takewhile(lambda line: line.startswith("#"), lines))
    first = lines[len(above) : len(above) + 1]
    if above and first and _are_numbers(first[0]):
        first.insert(0, above[-1].lstrip("# "))
    return [*first, *(line for line in lines[len(above) + 1 :] if not line.startswith("#"))]


def _are_numbers(line: str) -> bool:
    try:
        return bool([plain_number(word) for word in re.split(r"[,;\s]+", line.strip())])
    except ValueError:
        return False


def of_netcdf(content: bytes) -> NetCDF:
    """The columns of a NetCDF file.

    Raises
    ------
    InvalidInput
        If it is no whole NetCDF in one file, has groups, has no coordinate ``time``, or is of an
        older format.
    """
    check_format(content)
    if damaged(content) is not None:
        given = "a NetCDF file with a damaged heap, which HDF5 may read for ever"
        raise InvalidInput(given, "it is whole", "write or download it again")
    if name := kept_elsewhere(io.BytesIO(content)):
        given = f"a NetCDF file with a part, {name}, that is kept in another file"
        raise InvalidInput(given, "all of it is in one file", "copy into it what it leads to")
    try:
        with netCDF4.Dataset("motion.nc", memory=content) as data:
            return _along_time(data)
    except InvalidInput:
        raise
    except Exception as error:  # noqa: BLE001 (of a broken file, whatever HDF5 meets first)
        given = f"a NetCDF file that cannot be read ({reason(error)})"
        raise InvalidInput(given, "it is whole", "write or download it again") from None


def check_format(content: bytes) -> None:
    """Refuse NetCDF before 4: what is lost at its end is read as zeros, and no sizes are checked.

    Parameters
    ----------
    content : bytes, its first ones at least

    Raises
    ------
    InvalidInput
    """
    if content.startswith(b"CDF"):
        given, rule = "a NetCDF file of a format before 4", "it is NetCDF-4, of which a cut is seen"
        raise InvalidInput(given, rule, "convert it: nccopy -k nc4 old.nc new.nc")


def _along_time(data: netCDF4.Dataset) -> NetCDF:
    if data.groups:
        given = f"a NetCDF file with the groups {', '.join(data.groups)[:80]}"
        raise InvalidInput(given, "all variables are at its root", "move or leave out the others")
    if "time" not in data.variables or data["time"].ndim != 1:
        given = f"a NetCDF file with the variables {', '.join(data.variables)[:80]}, without time"
        raise InvalidInput(given, "one of them is the coordinate time", "name it so")
    along = {
        name: variable
        for name, variable in data.variables.items()
        if np.dtype(variable.dtype).kind in "iuf" and variable.dimensions == data["time"].dimensions
    }
    check_size(data["time"].size, "samples")  # few bytes may stand for all
    _check_numbers(len(along) * data["time"].size)
    columns = []
    for name, variable in along.items():
        unit = getattr(variable, "units", None)
        columns.append(Column(name, None if unit is None else str(unit), _filled(variable)))
    others = [name for name in data.variables if name not in along]
    return NetCDF(columns, others, {name: str(data.getncattr(name)) for name in data.ncattrs()})


def check_size(number: int, what: str = "rows") -> None:
    """Refuse a table that is longer than any recorded or commanded motion.

    Raises
    ------
    InvalidInput
        If there are more than ``MOST_SAMPLES``.
    """
    if number > MOST_SAMPLES:
        raise InvalidInput(
            f"{number} {what}",
            f"a motion has at most {MOST_SAMPLES}",
            "cut it to the shaking, or resample it",
        )


def _check_numbers(number: int) -> None:
    if number > MOST_NUMBERS:
        given, rule = f"{number} numbers along time", f"a file has at most {MOST_NUMBERS}"
        raise InvalidInput(given, rule, "leave out columns that are not needed")


def _filled(variable: Any) -> Array:
    check_range(variable)
    return np.asarray(np.ma.filled(variable[:].astype(np.float64), np.nan))


_ROUNDED = 1e-5
"""How far a range may be off, as a share: by six digits of text."""


def check_range(variable: Any) -> None:
    """Refuse numbers of NetCDF that are not of the range that the file states.

    It is that of all numbers, unpacked, by "CF Metadata Conventions 1.11" (2023), appendix A.

    Raises
    ------
    InvalidInput
    """
    told = np.ravel(getattr(variable, "actual_range", ()))
    if told.size != 2 or {told.dtype.kind, np.dtype(variable.dtype).kind} - {*"iuf"}:
        return  # as none that is a number
    values = np.ma.masked_invalid(variable[...], copy=False)
    held = np.array([values.min(), values.max()]) if values.count() else told
    if np.abs(held - told).max() > _ROUNDED * np.abs(told).max():
        given = f"{variable.name} from {held[0]:g} to {held[1]:g}"
        rule = f"the file's actual_range of it is {told[0]:g} to {told[1]:g}"
        raise InvalidInput(given, rule, "correct the numbers, or leave out the attribute")


def _name(word: str) -> tuple[str, str | None]:
    """A column's name without its unit, and the unit."""
    word = word.strip().strip('"').strip()
    found = _BRACKETS.fullmatch(word)
    return (found[1].strip(), found[2].strip()) if found else (word, None)
