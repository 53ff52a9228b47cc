"""Recorded motions of a site: which files, and what they are after reading, checks and filters."""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np

from pipeline.config.layers import Origin
from pipeline.config.motion_schema import RecordConfig
from pipeline.config.outside import check_regular
from pipeline.config.paths import is_text, located, shown
from pipeline.config.problems import InputError, Problem, not_found
from pipeline.workflow.grammar import listed
from pipeline.workflow.keys import content_of, digest
from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.motions.records import formats
from vsr_core.motions.records.components import Components
from vsr_core.motions.records.directions import check_directions
from vsr_core.motions.records.doubts import doubts
from vsr_core.motions.records.formats import COMPONENTS, SUFFIXES
from vsr_core.motions.records.processing import process
from vsr_core.motions.records.record import Record, check_rest, repaired
from vsr_core.motions.records.trace import Measures, Trace, measures

Loaded = TypeVar("Loaded")

_BESIDE = (".md", ".xml", ".yaml", ".json")
"""Endings of files that lie beside records."""

_NAMED = 5

_FILES, _RESPONSE = "motion.files", "motion.response.file"

LARGEST_FILE = 128 * 1024**2
"""Bytes of a file of motions: of eight channels of a million samples in text."""

_ALIKE = 1e-3
"""Share by which what a scale leaves differs at two scales, in samples of few digits."""

_PEAKS = 0.04
"""The same of accelerations that positions of few digits have."""

LARGEST_RESPONSE = 64 * 1024**2
"""Bytes of the responses of instruments: of a whole network's."""


@dataclass(frozen=True, eq=False)
class Ready:
    """A record that runs can take.

    Attributes
    ----------
    digest : str, of its file and channel, whatever is done to it and beside it
    record, trace, measures : of the larger horizontal component, as read and as processed
    components : of a record along several axes
    told : str, these in words
    doubts : where channels may point otherwise than they are taken
    """

    name: str
    file: str
    digest: str
    record: Record
    trace: Trace
    measures: Measures
    components: Components | None = None
    told: str = ""
    doubts: tuple[str, ...] = ()

    @property
    def at_any_scale(self) -> Scaled:
        """What it has in common with itself at another scale."""
        ratio, step = self.measures.pgv_pga, self.trace.interval
        if self.components is None:
            return Scaled(self.file, ratio, step, self.trace.acceleration)
        along = self.components
        return Scaled(self.file, ratio, step, along.acceleration, along.azimuth)


def find(origin: Origin, files: tuple[str, ...]) -> list[Path]:
    """The files named as ``motion.files``, those of folders by name."""
    found: list[Path] = []
    for name in files:
        path = located(origin.folder_of(_FILES), name, origin.file_of(_FILES), _FILES)
        inside = sorted(p for p in path.glob("[!.]*") if p.suffix.lower() in SUFFIXES)
        if not path.exists():
            raise not_found(origin.file_of(_FILES), _FILES, shown(path))
        if path.is_dir() and not inside:
            rule, remedy = f"they end in {' '.join(SUFFIXES)}", "put records there"
            raise _problem(origin, f"{shown(path)}, a folder without records", rule, remedy)
        found += inside if path.is_dir() else [path]
    each(origin.file_of(_FILES), _FILES, found, check_file)
    refuse_twice(origin.file_of(_FILES), _FILES, list(map(name_of, found)))
    return found


def name_of(path: Path) -> str:
    """What the motion in a file is called: with the ending where that is its component's.

    >>> name_of(Path("mine/RSN316.AT2")), name_of(Path("AKT0011809060308.EW"))
    ('RSN316', 'AKT0011809060308.EW')
    """
    return path.name if path.suffix.lower() in COMPONENTS else path.stem


def unread(origin: Origin, files: tuple[str, ...]) -> Iterator[str]:
    """What the folders named as ``motion.files`` hold beside records, in words."""
    for name in files:
        path = located(origin.folder_of(_FILES), name, origin.file_of(_FILES), _FILES)
        others = [
            one.name
            for one in sorted(path.glob("[!.]*"))
            if one.is_dir() or one.suffix.lower() not in (*SUFFIXES, *_BESIDE)
        ]
        if others:
            some = listed([*others[:_NAMED], *["others"] * (len(others) > _NAMED)])
            yield f"of {shown(path)} not read: {some}; records end in {' '.join(SUFFIXES)}"


def refuse_twice(file: str, key: str, names: list[str]) -> None:
    """Refuse records of one name."""
    twice = [name for name, times in Counter(names).items() if times > 1]
    if twice:
        given, rule = f"{', '.join(twice)} more than once", "a record has a name of its own"
        raise InputError(Problem(file, key, given, rule, "rename it"))


def each(file: str, key: str, paths: list[Path], load: Callable[[Path], Loaded]) -> list[Loaded]:
    """Load every file that a key names."""
    found, problems = [], []
    for path in paths:
        try:
            found.append(load(path))
        except InvalidInput as error:
            given = f"{shown(path)}, {error.given}"
            problems.append(Problem(file, key, given, error.rule, error.remedy))
    if problems:
        raise InputError(*problems)
    return found


def check_file(path: Path) -> None:
    """Refuse what is no file or too large to be read, and names that no product can hold."""
    if not is_text(path.name):
        raise InvalidInput("whose name is not in UTF-8", "products name it", "rename it")
    check_regular(path, LARGEST_FILE)


def load(
    origin: Origin, motion: RecordConfig, paths: Sequence[Path], known: Mapping[Path, str]
) -> tuple[Ready, ...]:
    """The records of a site in files of which the digests are known, processed."""
    files = tuple((path, known[path]) for path in paths)
    response = response_of(origin, motion, known)
    return _loaded(origin.file_of(_FILES), files, response, motion)


@lru_cache(maxsize=4)
def _loaded(
    file: str, files: tuple[tuple[Path, str], ...], response: bytes | None, motion: RecordConfig
) -> tuple[Ready, ...]:
    known = dict(files)
    ready = in_order(
        each(file, _FILES, [*known], lambda path: _ready(path, known[path], response, motion))
    )
    refuse_copies(file, _FILES, [one.at_any_scale for one in ready])
    return tuple(ready)


class Scaled(NamedTuple):
    """A motion that another may be at another scale.

    Attributes
    ----------
    left : float, a number of it that a scale leaves, of few motions the same
    samples : ndarray, shape (n, ...), of positions or accelerations
    azimuth : float, of what its axes are [rad]
    peak : float, of what of it shakes, by the largest sample, where that is told beside these
    """

    file: str
    left: float
    interval: float
    samples: Array
    azimuth: float = 0.0
    peak: float = 0.0

    def differs_in_scale_only(self, other: Scaled) -> bool:
        """Whether the one is the other times a positive number."""
        first, second = self.samples, other.samples
        if first.shape != second.shape or self.azimuth != other.azimuth:
            return False
        if not np.isclose(self.interval, other.interval, rtol=1e-6):
            return False
        if not np.isclose(self.peak, other.peak, rtol=_PEAKS):
            return False
        first, second = (values / np.abs(values).max() for values in (first, second))
        return bool(np.allclose(first, second, rtol=0.0, atol=1e-5))


def refuse_copies(file: str, key: str, motions: Iterable[Scaled]) -> None:
    """Refuse one motion under two names."""
    found = sorted(motions, key=lambda one: one.left)
    numbers = [one.left for one in found]
    for place, one in enumerate(found):
        for other in found[place + 1 : bisect_right(numbers, (1.0 + _ALIKE) * one.left)]:
            if one.differs_in_scale_only(other):
                equal = np.isclose(np.abs(one.samples).max(), np.abs(other.samples).max())
                what = "the same motion" if equal else "one motion at two scales"
                given = f"{one.file} and {other.file}, which are {what}"
                rule = "each is named once, and scaled to every PGA"
                raise InputError(Problem(file, key, given, rule, "leave one out"))


def in_order(ready: list[Ready]) -> list[Ready]:
    """Records by ascending PGV/PGA."""
    return sorted(ready, key=lambda one: (one.measures.pgv_pga, one.name))


def _ready(path: Path, content: str, response: bytes | None, motion: RecordConfig) -> Ready:
    record = repaired(read(path, content, response, motion).channel(motion.component))
    check_directions({"x": record})
    trace, doubtful = processed(record, motion), tuple(doubts({"x": record}))
    own = identity(content, record)
    return Ready(name_of(path), shown(path), own, record, trace, measures(trace), doubts=doubtful)


def identity(content: str, record: Record) -> str:
    """What a record is known by: its file, by its digest, and its channel."""
    return digest([content, record.channels[0]])


def read(path: Path, known: str, response: bytes | None, motion: RecordConfig) -> Record:
    """All channels of a file of which the digest is known."""
    corners = None if motion.response is None else motion.response.corners
    reading = formats.Reading(motion.component, motion.unit, response, corners)
    return formats.read_all(content_of(path, known, LARGEST_FILE), path.suffix, reading)


def processed(record: Record, motion: RecordConfig) -> Trace:
    """The motion of a repaired record, at rest where it ends."""
    trace = process(record.acceleration, record.interval, motion.processing.how())
    check_rest(trace)
    return trace


def response_of(origin: Origin, motion: RecordConfig, known: Mapping[Path, str]) -> bytes | None:
    """The responses of the instruments, where they are to be removed."""
    path = response_file(origin, motion)
    if path is None:
        return None
    file, load = origin.file_of(_RESPONSE), partial(content_of, largest=LARGEST_RESPONSE)
    return each(file, _RESPONSE, [path], lambda one: load(one, known[one]))[0]


def response_file(origin: Origin, motion: RecordConfig) -> Path | None:
    """The file with the responses of the instruments, where they are to be removed."""
    if motion.response is None:
        return None
    file = origin.file_of(_RESPONSE)
    path = located(origin.folder_of(_RESPONSE), motion.response.file, file, _RESPONSE)
    if not path.exists():
        raise not_found(file, _RESPONSE, shown(path))
    each(file, _RESPONSE, [path], partial(check_regular, largest=LARGEST_RESPONSE))
    return path


def _problem(origin: Origin, given: str, rule: str, remedy: str) -> InputError:
    return InputError(Problem(origin.file_of(_FILES), _FILES, given, rule, remedy))
