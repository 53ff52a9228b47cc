"""COSMOS V2 files: text, integer and real headers, comments, then a block of samples.

Each block begins with a line of how many entries follow and in which columns. What counts here:
integers 1 to 3 (stage of processing, 1 for acceleration, unit), 54 (azimuth of the sensor), reals
62 and 63 (time step [ms], length [s]). Unknown numbers and further series are passed over.

References
----------
COSMOS Strong Motion Data Format, version 1.20 (2001), tables 1 and 2.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.motions.records.record import Record, factor, stated

TEXT_LINES = 13
_UNITS = {2: "g", 4: "cm/s2", 10: "gal", 11: "mg", 50: "counts", 51: "volts", 52: "mv"}
_TURNS = {400: "up", 401: "down", 402: "vertical", 700: "H1", 701: "H2"}
_TEXTS = re.compile(r"with\s+(\d+)\s+text\s+lines", re.IGNORECASE)
_COUNT = re.compile(r"^\s*(\d+)\s+(\S+)")
_FORMAT = re.compile(r"\(\s*(\d+)\s*[IFE]\s*(\d+)(?:\.\d+)?\s*\)", re.IGNORECASE)


def is_one(start: str) -> bool:
    """Whether a text that begins so is such a file."""
    first = start.split("\n", 1)[0].lower()
    return "(format v" in first and ("accel" in first or "velocity" in first or "displ" in first)


@dataclass
class _Lines:
    """A file's lines, and how far it was read."""

    lines: list[str]
    at: int = 0

    def next(self) -> str:
        if self.at >= len(self.lines):
            raise _broken("ends early")
        self.at += 1
        return self.lines[self.at - 1]

    @property
    def over(self) -> bool:
        return not any(line.strip() for line in self.lines[self.at :])

    def numbers(self) -> tuple[str, Array]:
        """A block: its heading, and the numbers in its columns."""
        heading = self.next()
        count, columns = _COUNT.search(heading), _FORMAT.search(heading)
        if count is None or columns is None:
            raise _broken(f"has a block headed {heading.strip()[:50]!r}")
        number, each, width = int(count[1]), int(columns[1]), int(columns[2])
        words: list[str] = []
        while len(words) < number:
            line = self.next().rstrip("\n")
            taken = min(each, number - len(words))
            words += [line[i * width : (i + 1) * width] for i in range(taken)]
        try:
            return heading, np.array([float(word) for word in words])
        except ValueError:
            raise _broken(f"has no {number} numbers under {heading.strip()[:50]!r}") from None


def read(text: str, unit: str | None) -> Record:
    """The accelerations in a file's text, one channel each; ``unit`` is checked against the file's.

    Raises
    ------
    InvalidInput
        If the file breaks its own headers, or holds no acceleration at one time step.
    """
    lines = _Lines(text.splitlines())
    found: list[_Series] = []
    while not lines.over:
        series = _series(lines)
        if series is not None:
            found.append(series)
    if not found:
        raise InvalidInput(
            "a COSMOS file without an acceleration", "a motion is made of one", "use the .V2 of it"
        )
    first = found[0]
    alike = {(len(s.values), round(s.interval, 9), s.unit) for s in found}
    if len(alike) > 1:
        raise InvalidInput(
            "a COSMOS file whose channels differ in length, time step or unit",
            "they belong to one instrument",
            "keep one channel in the file",
        )
    name = stated(first.unit, unit)
    values = np.column_stack([s.values for s in found]) * factor(name)
    channels = _distinct([s.channel for s in found])
    if len(found) == 1:
        values = values[:, 0]
    return Record(values, first.interval, channels, first.station, first.source, name)


@dataclass(frozen=True)
class _Series:
    values: Array
    interval: float
    unit: str
    channel: str
    station: str
    source: str


def _series(lines: _Lines) -> _Series | None:
    """The next series with its headers; None if it is no acceleration."""
    title = lines.next()
    texts = _TEXTS.search(title)
    number = int(texts[1]) if texts else TEXT_LINES
    header = [title, *(lines.next() for _ in range(number - 1))]
    integers, reals = lines.numbers()[1], lines.numbers()[1]
    comments = _COUNT.search(lines.next())
    for _ in range(int(comments[1]) if comments else 0):
        lines.next()
    values = lines.numbers()[1]
    while lines.at < len(lines.lines) and not lines.lines[lines.at].strip():
        lines.next()
    if lines.at < len(lines.lines) and lines.lines[lines.at].lower().startswith("end-of-data"):
        lines.next()
    if len(integers) < 54 or len(reals) < 63:
        raise _broken(f"has {len(integers)} integer and {len(reals)} real header values")
    if int(integers[1]) != 1:
        return None
    interval, length = 1e-3 * float(reals[61]), float(reals[62])
    if not 0.0 < interval < 1.0 or abs(length - len(values) * interval) > 1.5 * interval:
        raise _broken(
            f"has {len(values)} samples of {1e3 * interval:g} ms, and says {length:g} s of them"
        )
    code = int(integers[2])
    if code not in _UNITS:
        raise InvalidInput(
            f"a COSMOS file in unit {code}", "accelerations are in g, cm/s2 or gal", "convert it"
        )
    azimuth = int(integers[53])
    station = " ".join(header[4].split()) if len(header) > 4 else ""
    source = f"COSMOS file: {title.strip()}"
    return _Series(
        values, interval, _UNITS[code], _TURNS.get(azimuth, str(azimuth)), station, source
    )


def _distinct(names: list[str]) -> tuple[str, ...]:
    return tuple(
        name if names.count(name) == 1 else f"{name} ({place})"
        for place, name in enumerate(names, start=1)
    )


def _broken(what: str) -> InvalidInput:
    return InvalidInput(
        f"a COSMOS file that {what}", "its headers and samples agree", "download it again"
    )
