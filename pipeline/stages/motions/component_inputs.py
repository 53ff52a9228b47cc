"""Recorded motions along several axes: their files, and what they are after reading and checks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import islice
from pathlib import Path

import numpy as np

from pipeline.config import in_si
from pipeline.config.layers import Origin
from pipeline.config.motion_schema import ComponentsConfig, RecordConfig
from pipeline.config.paths import located, shown
from pipeline.config.problems import InputError, Problem, not_found
from pipeline.stages.motions.record_inputs import (
    Ready,
    check_file,
    each,
    identity,
    in_order,
    name_of,
    processed,
    read,
    refuse_copies,
    refuse_twice,
    response_of,
)
from vsr_core.errors import InvalidInput
from vsr_core.motions.records.components import Components, check_together
from vsr_core.motions.records.doubts import doubts
from vsr_core.motions.records.record import Record, repaired
from vsr_core.motions.records.trace import measures

_KEY = "motion.records"

_CODES = {"E": "x", "N": "y", "Z": "z"}
"""Axes of channels, by the last letters of their SEED codes."""


def find(origin: Origin, motion: RecordConfig) -> list[Path]:
    """The files of all components."""
    return [path for one in motion.records or () for path in _files(origin, one)]


def load(
    origin: Origin, motion: RecordConfig, paths: Sequence[Path], known: Mapping[Path, str]
) -> tuple[Ready, ...]:
    """The records of a site in files of which the digests are known, processed."""
    of_files = iter((path, known[path]) for path in paths)
    files = tuple(tuple(islice(of_files, len(one.files))) for one in motion.records or ())
    return _loaded(origin.file_of(_KEY), files, response_of(origin, motion, known), motion)


def _files(origin: Origin, one: ComponentsConfig) -> list[Path]:
    """The files of a record, each readable."""
    file, folder = origin.file_of(_KEY), origin.folder_of(_KEY)
    found = [located(folder, name, file, _KEY) for name in one.files]
    for path in found:
        if not path.exists():
            raise not_found(file, _KEY, shown(path))
    each(file, _KEY, found, check_file)
    return found


@lru_cache(maxsize=4)
def _loaded(
    file: str,
    files: tuple[tuple[tuple[Path, str], ...], ...],
    response: bytes | None,
    motion: RecordConfig,
) -> tuple[Ready, ...]:
    ready, problems = [], []
    for one, found in zip(motion.records or (), files, strict=True):
        try:
            ready.append(_ready(one, found, response, motion))
        except InvalidInput as error:
            given = f"{', '.join(shown(path) for path, _ in found)}: {error.given}"
            problems.append(Problem(file, _KEY, given, error.rule, error.remedy))
    if problems:
        raise InputError(*problems)
    refuse_twice(file, _KEY, [one.name for one in ready])
    ready = in_order(ready)
    refuse_copies(file, _KEY, [one.at_any_scale for one in ready])
    return tuple(ready)


def _ready(
    one: ComponentsConfig,
    files: Sequence[tuple[Path, str]],
    response: bytes | None,
    motion: RecordConfig,
) -> Ready:
    """A record, each of its components repaired and processed as one alone."""
    found = _channels(one, files, response, motion)
    check_together(found)
    fixed, traces = {}, {}
    for axis, record in found.items():
        try:
            fixed[axis] = repaired(record)
            traces[axis] = processed(fixed[axis], motion)
        except InvalidInput as error:
            raise InvalidInput(f"{axis}, {error.given}", error.rule, error.remedy) from None
    peaks = {axis: float(np.abs(trace.acceleration).max()) for axis, trace in traces.items()}
    main = max((axis for axis in "xy" if axis in traces), key=peaks.__getitem__)
    still = np.zeros_like(traces[main].acceleration)
    along = np.column_stack([traces[a].acceleration if a in traces else still for a in "xyz"])
    repairs = [f"{axis}: {text}" for axis in fixed for text in fixed[axis].repairs]
    told = ", ".join(
        f"{axis} ({record.channels[0]}) with {in_si.in_g(peaks[axis]):.3g} g"
        for axis, record in fixed.items()
    )
    return Ready(
        name_of(files[0][0]),
        ", ".join(shown(path) for path, _ in files),
        identity(files[0][1], next(iter(found.values()))),
        replace(fixed[main], repairs=tuple(repairs)),
        traces[main],
        measures(traces[main]),
        Components(along, traces[main].interval, in_si.angle(one.azimuth)),
        told,
        tuple(doubts(found)),
    )


def _channels(
    one: ComponentsConfig,
    files: Sequence[tuple[Path, str]],
    response: bytes | None,
    motion: RecordConfig,
) -> dict[str, Record]:
    """The components as read, by their axes, x first."""
    if one.file is None:
        assert one.components is not None
        return {
            axis: read(*file, response, motion).channel(motion.component)
            for axis, file in zip(one.components.named, files, strict=True)
        }
    whole = read(*files[0], response, motion)
    named = _by_code(whole.channels) if one.components is None else one.components.named
    return {axis: whole.channel(name) for axis, name in named.items()}


def _by_code(channels: tuple[str, ...]) -> dict[str, str]:
    """Channels by their axes, where their names say so."""
    found = {_CODES[name[-1]]: name for name in channels if name[-1:] in _CODES}
    if len(found) < len(channels) or found.keys() <= {"z"}:
        given, rule = f"the channels {', '.join(channels)}", "those of a record end in E, N and Z"
        raise InvalidInput(given, rule, "name them as components, e.g. {x: HN2, y: HN1, z: HNZ}")
    return dict(sorted(found.items()))
