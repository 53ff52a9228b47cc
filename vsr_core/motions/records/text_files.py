"""Text files of strong-motion networks that ObsPy does not read: PEER NGA (.AT2) and COSMOS V2.

AT2: four lines of header, then samples in g. The fourth line gives the number of samples and the
time step, as ``NPTS=   7812, DT=   .0050 SEC`` or ``7812    0.0050    NPTS, DT``.

COSMOS V2 files: text, integer and real headers, comments, then a block of samples.

Each block begins with a line of how many entries follow and in which columns. What counts here:
integers 1 to 3 (stage of processing, 1 for acceleration, unit), 54 (azimuth of the sensor), reals
62 to 64 (time step [ms], length [s], peak). Unknown numbers and further series are passed over.

References
----------
COSMOS Strong Motion Data Format, version 1.20 (2001), tables 1 and 2.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice

import numpy as np

from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.motions.named_columns import (
    is_cut,
    plain_number,
    refuse_cut_lines,
    refuse_lost_exponents,
)
from vsr_core.motions.records.record import (
    UPWARD,
    Record,
    check_sampling,
    factor,
    is_acceleration,
    is_near,
    side_by_side,
    stated,
)

_NUMBER = r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?)"
_NAMED = re.compile(rf"NPTS\s*=\s*(\d+)\s*,?\s*DT\s*=\s*{_NUMBER}", re.IGNORECASE)
_PLAIN = re.compile(rf"^\s*(\d+)\s+{_NUMBER}\s+NPTS\s*,\s*DT", re.IGNORECASE)
_UNIT = re.compile(r"IN UNITS OF\s+(\S+)", re.IGNORECASE)
_SECONDS = re.compile(
    r"\s*+(?:[\[(]?\s*(?:SEC[A-Z]*|S)\b|[,;)\]]|\.(?!\d)|[\[(]\s*\d|$)", re.IGNORECASE
)
"""What may follow the time step: its unit, remarks, or nothing."""

_STATED = re.compile(r"\b(NPTS|DT)\s*=", re.IGNORECASE)
_WORD = re.compile(r"\S+")
_UPWARD = re.compile(r"(?:.*[\W_])?[UV]\d?\s*(?:\(.*)?", re.IGNORECASE)
"""Components that PEER NGA calls vertical, where other files may have u and v to the sides."""

HEADER, HEAD = 4, 2000
"""Lines of the header, and characters that they have at most."""


def is_at2(start: str) -> bool:
    r"""Whether a text is such a file.

    Examples
    --------
    >>> is_at2("PEER\nevent\nACCELERATION\nNPTS=  100, DT= .0050 SEC")
    True
    """
    lines = start.splitlines()
    return len(lines) >= HEADER and bool(_NAMED.search(lines[3]) or _PLAIN.search(lines[3]))


def read_at2(text: str, unit: str | None) -> Record:
    """The record in a file's text.

    Parameters
    ----------
    unit : str or None
        Checked against the file's own.

    Raises
    ------
    InvalidInput
        If the file is no acceleration, or holds another number of samples than it says.
    """
    lines = text[:HEAD].splitlines(keepends=True)[:HEADER]
    found = _NAMED.search(lines[3]) or _PLAIN.search(lines[3])
    quantity = lines[2].strip()
    is_series = quantity.upper().startswith("ACCELERATION") and "SPECTR" not in quantity.upper()
    if found is None or not is_series:
        given = f"an AT2 file whose third line is {quantity[:40]!r}"
        rule = "it says ACCELERATION TIME SERIES IN UNITS OF G"
        raise InvalidInput(given, rule, "use the acceleration (.AT2), not velocity or displacement")
    keys = [word.upper() for word in _STATED.findall(lines[3])]
    if not _SECONDS.match(lines[3], found.end()) or len({*keys}) < len(keys):
        given = f"an AT2 file that says {lines[3].strip()[:50]!r}"
        rule = "NPTS and DT stand there once, DT in seconds"
        raise InvalidInput(given, rule, "change it")
    number, interval = float(found[1]), float(found[2].upper().replace("D", "E"))
    check_sampling(interval, number)
    in_file = _UNIT.search(quantity)
    name = stated(in_file[1].strip("().,;") if in_file else None, unit)
    words = [word.strip("().,;") for word in quantity[in_file.end() if in_file else 0 :].split()]
    others = [word for word in words if _is_other(word, name)]
    start = sum(map(len, lines))
    count = sum(1 for _ in islice(_WORD.finditer(text, start), int(number) + 1))
    if count > number:
        raise _other_count(count, number)
    words = text[start:].split()
    try:
        values = np.array([plain_number(word) for word in words])
    except ValueError as error:
        given = f"an AT2 file with a word among its samples ({error})"
        raise InvalidInput(given, "they are numbers", "download it again") from None
    if is_cut(text, words[-1:], words[:-1]):
        given = f"an AT2 file that ends in {words[-1]!r}, formed like no other number"
        raise InvalidInput(given, "it is whole", "download it again, or end its last line")
    if len(values) != number:
        raise _other_count(count, number)
    refuse_lost_exponents(words, values)
    refuse_cut_lines(text[start:].splitlines())
    event = [part.strip() for part in lines[1].split(",")]
    station = event[-2] if len(event) > 2 else ""
    channel = event[-1] if len(event) > 1 else "1"
    upward = not channel and station.upper() in ("U", "V", "UP")  # before a comma
    source = f"PEER NGA file: {lines[1].strip()}"
    instruments = (", ".join(event[:-1]),) if station else ()
    values *= factor(name)
    return Record(
        values,
        interval,
        (channel,),
        station,
        source,
        name,
        repairs=tuple(f"its third line names {other}, too; taken in {name}" for other in others),
        instruments=instruments,
        directions=(UPWARD,) if _UPWARD.fullmatch(channel) or upward else (),
    )


def _is_other(word: str, unit: str) -> bool:
    """Whether a word is a unit of acceleration, and not this one."""
    return is_acceleration(word) and factor(word) != factor(unit)


def _other_count(count: int, number: float) -> InvalidInput:
    more = " or more" if count > number else ""
    given = f"an AT2 file of {count} samples{more} that says NPTS = {number:.0f}"
    return InvalidInput(given, "it holds as many as it says", "download it again")


TEXT_LINES = 13
_UNITS = {2: "g", 4: "cm/s2", 10: "gal", 11: "mg", 50: "counts", 51: "volts", 52: "mv"}
_DIRECTIONS = {400: "up", 401: "down", 402: "vertical", 700: "H1", 701: "H2"}
_UNKNOWN = -999.0
"""In a header."""

_TEXTS = re.compile(r"with\s+(\d+)\s+text\s+lines", re.IGNORECASE)
_COUNT = re.compile(r"^\s*(\d+)\s+(\S+)")
_END = re.compile(r"(/&[\s-]*)?end[- ]of[- ]data", re.IGNORECASE)
_SCNL = re.compile(r"\|\s*<SCNL>\w+\.(\w+)\.")
DIGITS = 9
"""Digits read of a number in a header: more than any file has lines."""

_UNIT_ABOVE = re.compile(
    r"units\s*=\s*([^(,=]*[^(,=\s])?\s*(?:\(\s*(\d{1,9})\s*\))?", re.IGNORECASE
)
"""The unit in words, and its number, in the heading of the samples."""

_NO_ACCELERATION = re.compile(r"[cm]?m(/s(ec)?)?", re.IGNORECASE)

_PLAIN_WORDS = ("0", "-0", "-999")
"""Numbers that mean the same with a point."""

_QUANTITIES = {1: "accel", 2: "veloc", 3: "displ"}
"""What integer 2 of a header says, as titles and headings begin it."""

_FORMAT = re.compile(r"\(\s*(\d+)\s*[IFE]\s*(\d+)(?:\.(\d+)E?)?\s*\)", re.IGNORECASE)


def is_cosmos(start: str) -> bool:
    """Whether a text is such a file.

    Examples
    --------
    >>> is_cosmos("Corrected acceleration    (Format v01.20 with 13 text lines)")
    True
    """
    first = start.split("\n", 1)[0].lower()
    return "(format v" in first and ("accel" in first or "velocity" in first or "displ" in first)


def read_cosmos(text: str, unit: str | None) -> Record:
    """The accelerations in a file's text, one channel each.

    Parameters
    ----------
    unit : str or None
        Checked against the file's own.

    Raises
    ------
    InvalidInput
        If the file breaks its own headers, or holds no acceleration at one time step.
    """
    lines = iter(text.splitlines())
    found = []
    while title := next((line for line in lines if line.strip() and not _END.match(line)), None):
        series = _series(title, lines)
        if series is not None:
            found.append(series)
    if not found:
        raise InvalidInput(
            "a COSMOS file without an acceleration", "a motion is made of one", "use the .V2 of it"
        )
    if len({(len(one.acceleration), round(one.interval, 9), one.unit) for one in found}) > 1:
        given = "a COSMOS file whose channels differ in length, time step or unit"
        raise InvalidInput(given, "they belong to one instrument", "keep one channel in the file")
    values = side_by_side([one.acceleration for one in found])
    first = found[0]
    return replace(
        first,
        acceleration=values * factor(stated(first.unit, unit)),
        channels=_distinct([one.channels[0] for one in found]),
        instruments=tuple(one.station for one in found),
    )


def _series(title: str, lines: Iterator[str]) -> Record | None:
    """The series under a title, its acceleration in the file's unit; None if it is none."""
    texts = _TEXTS.search(title)
    number = int(texts[1][:DIGITS]) if texts else TEXT_LINES
    header = [title, *(_line(lines) for _ in range(number - 1))]
    integers, reals = (_block(lines, _line(lines)) for _ in range(2))
    comments = _COUNT.search(_line(lines))
    said = [_line(lines) for _ in range(int(comments[1][:DIGITS]) if comments else 0)]
    heading = _line(lines)
    values = _block(lines, heading)
    if len(integers) < 54 or len(reals) < 63:
        raise _broken(f"has {len(integers)} integer and {len(reals)} real header values")
    if not (np.isfinite(integers).all() and np.isfinite(reals).all()):
        raise _broken("has header values that are no numbers")
    _check_quantity(int(integers[1]), title, heading)
    if int(integers[1]) != 1:
        return None
    interval, length = 1e-3 * float(reals[61]), float(reals[62])
    if not 0.0 < interval < 1.0 or abs(length - len(values) * interval) > 1.5 * interval:
        raise _broken(
            f"has {len(values)} samples of {1e3 * interval:g} ms, and says {length:g} s of them"
        )
    code, azimuth = int(integers[2]), int(integers[53])
    if code not in _UNITS:
        raise InvalidInput(
            f"a COSMOS file in unit {code}", "accelerations are in g, cm/s2 or gal", "convert it"
        )
    above = _UNIT_ABOVE.search(heading)
    if above and (int(above[2] or code) != code or _differ(above[1] or "", _UNITS[code])):
        raise _broken(f"has unit {code} in its header, and {above[0]} above its samples")
    code_told = _code(said)
    level = 1 <= azimuth <= 360 and not re.fullmatch("[A-Z]{2}Z", code_told)
    channel = _DIRECTIONS.get(azimuth) or (str(azimuth) if level else code_told)
    station = " ".join(header[4].split()) if len(header) > 4 else ""
    source = f"COSMOS file: {title.strip()}"
    stated_peak = float(reals[63]) if len(reals) > 63 else _UNKNOWN
    peak = float(np.abs(values).max(initial=0.0))
    agrees = stated_peak in (0.0, _UNKNOWN) or is_near(abs(stated_peak), peak)
    doubts = () if agrees else (f"{channel}: its header says a peak of {stated_peak:g}",)
    return Record(values, interval, (channel,), station, source, _UNITS[code], doubts)


def _check_quantity(number: int, title: str, heading: str) -> None:
    """Refuse a series that is called another one than the number in its header says."""
    for said in (title, heading):
        called = [key for key, word in _QUANTITIES.items() if word in said.lower()]
        if called and number in _QUANTITIES and number not in called:
            words = said.split("(")[0].strip()[:50]
            raise _broken(f"has quantity {number} in its header, and is called {words!r}")


def _differ(words: str, unit: str) -> bool:
    """Whether a unit in words is another than that of the header's number."""
    if is_acceleration(words) and is_acceleration(unit):
        return factor(words) != factor(unit)
    return bool(_NO_ACCELERATION.fullmatch(words.strip()))


def _code(comments: list[str]) -> str:
    """SEED's code of a channel, where its azimuth is not told: north is 360, and 0 nothing."""
    found = filter(None, map(_SCNL.match, comments))
    return next((one[1] for one in found), "unknown")


def _block(lines: Iterator[str], heading: str) -> Array:
    """The numbers in a block's columns, after its heading."""
    count, columns = _COUNT.search(heading), _FORMAT.search(heading)
    if count is None or columns is None:
        raise _broken(f"has a block headed {heading.strip()[:50]!r}")
    number, each, width = (int(word[:DIGITS]) for word in (count[1], columns[1], columns[2]))
    words: list[str] = []
    while len(words) < number:
        line = _line(lines)
        taken = min(each, number - len(words))
        if len(line.rstrip()) < taken * width:
            raise _broken(f"has a short line under {heading.strip()[:50]!r}")
        if len(line.rstrip()) > taken * width:
            raise _broken(f"has a line of more columns than {heading.strip()[:50]!r} has")
        words += [line[i * width : (i + 1) * width] for i in range(taken)]
    whole = next(
        (word for word in words if "." not in word and word.strip() not in _PLAIN_WORDS), ""
    )
    if int(columns[3] or 0) and whole:
        raise _broken(f"has {whole.strip()!r}, without a point, under {heading.strip()[:50]!r}")
    try:
        return np.array([plain_number(word) for word in words])
    except ValueError:
        raise _broken(f"has no {number} numbers under {heading.strip()[:50]!r}") from None


def _line(lines: Iterator[str]) -> str:
    line = next(lines, None)
    if line is None:
        raise _broken("ends early")
    return line


def _distinct(names: list[str]) -> tuple[str, ...]:
    return tuple(
        name if names.count(name) == 1 else f"{name} ({place})"
        for place, name in enumerate(names, start=1)
    )


def _broken(what: str) -> InvalidInput:
    return InvalidInput(
        f"a COSMOS file that {what}", "its headers and samples agree", "download it again"
    )
