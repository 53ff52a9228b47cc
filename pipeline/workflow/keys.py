"""Digests of values and files, and versions of libraries: what keys are made of."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Iterable, Sequence
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from pipeline.config.outside import held, opened
from pipeline.config.paths import shown
from pipeline.config.problems import InputError, edited_since

_SIZE = 16


def digest(value: Any) -> str:
    """Digest of plain data by its canonical JSON; refuses NaN and what JSON cannot hold.

    Parameters
    ----------
    value : numbers, texts, and lists and dicts of them

    Examples
    --------
    The order of keys does not count:

    >>> digest({"a": 1, "b": 2}) == digest({"b": 2, "a": 1})
    True
    """
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.blake2b(text.encode(), digest_size=_SIZE).hexdigest()


def digest_bytes(*parts: bytes) -> str:
    """Digest of byte strings, each with its length.

    Examples
    --------
    Where one ends counts:

    >>> digest_bytes(b"ab", b"c") == digest_bytes(b"a", b"bc")
    False
    """
    state = hashlib.blake2b(digest_size=_SIZE)
    for part in parts:
        state.update(len(part).to_bytes(8, "little"))
        state.update(part)
    return state.hexdigest()


LARGEST = 64 * 1024**3
"""Bytes of a file: of the largest that any reader takes."""


def digest_file(path: Path) -> str:
    """SHA-256 of a file's content."""
    with opened(path, LARGEST) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def content_of(path: Path, known: str, largest: int) -> bytes:
    """What a file holds, which is what its digest was taken of.

    Raises
    ------
    InvalidInput, InputError
        For a file that cannot be read, and for one that was written over since.
    """
    found = held(path, largest)
    if hashlib.sha256(found).hexdigest() != known:
        raise _written_over(path)
    return found


def check_same(path: Path, files: Iterable[Path], known: Sequence[str]) -> None:
    """Refuse files, or a folder of them, of which some were written over since their digests."""
    if [*map(digest_file, files)] != [*known]:
        raise _written_over(path)


def _written_over(path: Path) -> InputError:
    return edited_since(shown(path), "what was edited while a command that reads it was at work")


def digests_of(paths: Sequence[Path]) -> dict[str, str]:
    """Digests of files by their names, those of one name by their numbers, too."""
    return dict(zip(names_of(paths), map(digest_file, paths), strict=True))


def names_of(paths: Sequence[Path]) -> tuple[str, ...]:
    """Names of files, those of one name with their numbers.

    >>> names_of([Path("a/r.csv"), Path("b/r.csv"), Path("s.csv")])
    ('0/r.csv', '1/r.csv', 's.csv')
    """
    twice = Counter(path.name for path in paths)
    return tuple(f"{n}/" * (twice[path.name] > 1) + path.name for n, path in enumerate(paths))


@cache
def installed_version(name: str) -> str:
    """Version of a library, or that it is not installed: an engine may be an extra."""
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


RUN_CODE = (
    "vsr_core.run.cases:prepare",
    "vsr_core.run.overturning:simulate",
    "vsr_core.judge.proofs:barrier",
    "vsr_core.motions.pulses:CosinePulse",
)
"""What determines a run on a flat pedestal, besides its engine and its kind of motion."""

TERRAIN_CODE = (
    *RUN_CODE,
    "vsr_core.run.displacement:displace",
    "vsr_core.run.movement:air_share",
    "pipeline.stages.runs.scenes:terrain_case",
)
"""The same on a terrain."""

ENGINES = ("vsr_core.engines.bullet", "vsr_core.engines.mujoco", "vsr_core.engines.nonsmooth")
"""Modules of all engines, which are found by name only."""

RECORD_CODE = ("vsr_core.motions.records.trace:RecordedMotion",)
COMPONENT_CODE = ("vsr_core.motions.records.components:Components",)
TABLE_CODE = ("vsr_core.motions.sampled:SampledMotion",)
AXIS_CODE = ("vsr_core.motions.six_axes:AxisPulses", "vsr_core.motions.six_axes:AxisPulse")
VALIDATION_CODE = (
    "vsr_core.validation.specimen:standing_case",
    "vsr_core.validation.specimen:shaken",
    "vsr_core.validation.specimen:drawn",
    "vsr_core.validation.specimen:amplified",
    "vsr_core.judge.proofs:barrier",
    "vsr_core.engines.nonsmooth:build",
)
"""What determines the runs of recorded shake-table tests; ``amplified`` names all their motions."""
