"""Two sites' folders or bundles beside each other: settings, cells and boundaries that differ."""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from pipeline.bundles.layout import RESULTS, about, names, opened, unpack
from pipeline.config.outside import check_hdf5
from pipeline.config.problems import InputError, Problem, printable
from pipeline.workflow import output, pages
from pipeline.workflow.datasets import open_below
from pipeline.workflow.grammar import counted, listed
from pipeline.workflow.parameters import changes
from pipeline.workflow.site_folder import SETTINGS, require_whole, told
from pipeline.workflow.store import Store
from pipeline.workflow.writers import text
from vsr_core.arrays import Array
from vsr_core.outcome import Outcome

BOUNDARY = "first_overturning_pga"


@dataclass(frozen=True)
class Part:
    """What was compared, and how it differs: nothing where it does not."""

    name: str
    lines: list[str]


def compare(one: Path, other: Path, page: Path) -> list[Part]:
    """Compare, and write the page."""
    output.check("--to", page, ".html", one, other)
    with ExitStack() as stack:
        first, second = (Store(stack.enter_context(_Folder(path))) for path in (one, other))
        for store, path in ((first, one), (second, other)):
            require_whole(store, str(path))
        boundary = _both(first, second, "fragility.nc", BOUNDARY)
        found = {
            "settings": _settings(first, second),
            "made of": _made_of(first, second),
            "cells": _cells(first, second),
            "boundary": _boundary(boundary),
        }
        parts = [Part(name, [*map(printable, lines)]) for name, lines in found.items()]
    facts = {"one": str(one), "other": str(other), "parts": parts}
    facts["directions"] = _directions(boundary)
    output.put("--to", page, text(pages.filled("comparison.html", facts)))
    return parts


class _Folder(tempfile.TemporaryDirectory[str]):
    """A folder of results: the one given, or that of a bundle, unpacked for a while."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._path = path

    def __enter__(self) -> Path:  # type: ignore[override]
        if not self._path.is_file():
            if not (self._path / ".stages").is_dir():
                rule = "it is the folder of a site, or a bundle of vsr export"
                remedy = "e.g. data/derived/cuboid_1x1x2"
                raise InputError(Problem("vsr compare", "", str(self._path), rule, remedy))
            return self._path
        with opened(self._path) as archive:
            about(self._path, archive)
            for name in names(archive):
                if name.startswith(f"{RESULTS}/"):
                    unpack(self._path, archive, name, Path(self.name))
        return Path(self.name, RESULTS)


def _settings(one: Store, other: Store) -> Iterator[str]:
    """Products that are not of their folder's settings; what is other in folders and products."""
    for which, store in (("first", one), ("second", other)):
        yield from (f"in the {which}, {line}" for line in told(store))
    first, second = one.manifests(), other.manifests()
    found: dict[str, list[str]] = {}
    for stage in [name for name in first if name in second]:
        was, now = (manifests[stage]["facts"]["config"] for manifests in (first, second))
        for line in changes(was, now):
            found.setdefault(line, []).append(stage)
    for line, stages in found.items():
        yield line if SETTINGS in stages else f"{line} ({listed(stages)})"


def _made_of(one: Store, other: Store) -> Iterator[str]:
    """Products in one of them only, and those made with other inputs, libraries or code."""
    first, second = one.manifests(), other.manifests()
    for stage in sorted(first.keys() ^ second.keys()):
        yield f"{stage} is in the {'first' if stage in first else 'second'} only"
    for stage in sorted((first.keys() & second.keys()) - {SETTINGS}):
        for kind in ("inputs", "versions", "code"):
            was, now = first[stage]["facts"][kind], second[stage]["facts"][kind]
            names = sorted(name for name in {*was, *now} if was.get(name) != now.get(name))
            if names:
                more = f" and {len(names) - 1} more" if names[1:] else ""
                yield f"{stage}: other {kind} ({names[0]}{more})"
        if first[stage]["key"] == second[stage]["key"]:
            yield from _unlike(one, other, stage)


def _unlike(one: Store, other: Store, stage: str) -> Iterator[str]:
    """Datasets whose values differ though the same was asked of the same code."""
    first, second = (store.manifest(stage) or {"files": {}} for store in (one, other))
    for name, checksum in sorted(first["files"].items()):
        if name.endswith(".nc") and second["files"].get(name, checksum) != checksum:
            a, b = (_read(store.folder / name, name) for store in (one, other))
            if not a.equals(b):
                yield f"{stage}: {name} holds other values, though it is made of the same"


def _cells(one: Store, other: Store) -> Iterator[str]:
    """How many cells of both end in another way, and in which."""
    found = _both(one, other, "responses.nc", "outcome")
    if found is None:
        yield "not compared: responses.nc is not in both"
        return
    yield from found.notes
    a, b = (np.nan_to_num(values.to_numpy(), nan=-1).astype(int) for values in found.values)
    differing = Counter(zip(a[a != b].tolist(), b[a != b].tolist(), strict=True))
    for (was, now), number in differing.most_common():
        yield f"{number} of {counted(a.size, 'cell')}: {_named(was)} and {_named(now)}"


def _named(code: int) -> str:
    return "not run" if code < 0 else Outcome(code).name.lower()


def _boundary(found: Both | None) -> Iterator[str]:
    """How far boundaries of both are apart, of those that both have."""
    if found is None:
        yield "not compared: fragility.nc is not in both"
        return
    yield from found.notes
    kinds = [_kinds(values.to_numpy()).ravel().tolist() for values in found.values]
    number = f"of {len(kinds[0])} first-overturning PGAs"
    for (was, now), times in Counter(zip(*kinds, strict=True)).most_common():
        if was != now:
            yield f"{times} {number}: {was} and {now}"
    apart = np.abs(_ratio(found) - 1.0)
    apart = apart[apart > 0.0]
    if apart.size:
        yield (
            f"{apart.size} {number} differ, by a median of "
            f"{100 * np.median(apart):.3g} % and {100 * apart.max():.3g} % at most"
        )


def _kinds(boundary: Array) -> Array:
    """What is known of each first-overturning PGA, in words."""
    kinds = {
        "below all that was run": boundary <= 0.0,
        "above all that was run": np.isposinf(boundary),
        "undecided": np.isnan(boundary),
    }
    return np.select([*kinds.values()], [*kinds], "known")


def _directions(found: Both | None) -> list[dict[str, Any]]:
    """The same of each direction and friction, as rows of a table."""
    if found is None or found.values[0].size == 0:
        return []
    there = [_kinds(values.to_numpy()) == "known" for values in found.values]
    ratio, places = _ratio(found), [found.values[0][name].values for name in ("yaw", "friction")]
    rows = []
    for place, (yaw, friction) in zip(np.ndindex(ratio.shape[:2]), product(*places), strict=True):
        first, second = (one[place] for one in there)
        change = 100.0 * (ratio[place][first & second] - 1.0)
        ends = np.quantile(change, (0.5, 0.0, 1.0)).tolist() if change.size else [None] * 3
        counts = [int(one.sum()) for one in (first & second, first & ~second, second & ~first)]
        at = {"yaw": float(yaw), "friction": float(friction)}
        rows.append(at | {"counts": counts, "ends": ends})
    return rows


def _ratio(found: Both) -> Array:
    """Second boundary over the first; NaN where either has none."""
    a, b = (np.where(_kinds(one.to_numpy()) == "known", one, np.nan) for one in found.values)
    return np.asarray(b / a)


@dataclass(frozen=True)
class Both:
    """A variable of two results, where their coordinates meet, and what was left out of it.

    Attributes
    ----------
    values : two arrays of the same shape
    """

    values: tuple[xr.DataArray, xr.DataArray]
    notes: list[str]


def _both(one: Store, other: Store, file: str, name: str) -> Both | None:
    """A variable of both; None where one has not made it: a file without a manifest is no result.

    Along a dimension of one value in each, such as another friction, those two are compared.
    """
    stores = (one, other)
    if not all(any(file in made["files"] for made in has.manifests().values()) for has in stores):
        return None
    paths = [store.folder / file for store in stores]
    try:
        a, b = (open_below(_read(path, name), name) for path in paths)
        if a.dims != b.dims:
            none = xr.DataArray(np.empty(0))
            first, second = (listed([str(axis) for axis in one.dims]) for one in (a, b))
            note = f"not comparable: along {first} in the first, along {second} in the second"
            return Both((none, none), [note])
        notes = []
        for axis in a.dims:
            a, b, note = _matched(a, b, str(axis))
            notes += [note] * bool(note)
    except (KeyError, ValueError, TypeError) as error:
        raise _unusable(file, name, error) from None
    return Both((a, b), notes)


def _matched(a: xr.DataArray, b: xr.DataArray, axis: str) -> tuple[xr.DataArray, xr.DataArray, str]:
    """Two arrays at the places of a dimension that both have, and what that leaves out."""
    if a[axis].equals(b[axis]):
        return a, b, ""
    if a[axis].dtype.kind == "f":
        places = [one[axis].round(9) for one in (a, b)]
        if axis == "yaw":
            places = [(place % 360.0).round(9) % 360.0 for place in places]
        if all(place.to_index().is_unique for place in places):  # a last digit parts nothing
            a, b = (one.assign_coords({axis: at}) for one, at in zip((a, b), places, strict=True))
    first, second = (one[axis].values.tolist() for one in (a, b))
    if first == second:
        return a, b, ""
    if len(first) == len(second) == 1:
        return a, b.assign_coords({axis: a[axis]}), f"{axis} {first[0]} beside {second[0]}"
    common = [value for value in first if value in second]
    if not common:
        given = f"{_spelled(first)} and {_spelled(second)}"
        return a.isel({axis: []}), b.isel({axis: []}), f"not comparable: no {axis} in both: {given}"
    left_out = f"compared at the {len(common)} of {len(first)} and {len(second)} {axis} in both"
    return a.sel({axis: common}), b.sel({axis: common}), left_out


def _spelled(values: list[Any]) -> str:
    return ", ".join(map(str, values if len(values) < 4 else [*values[:2], "...", values[-1]]))


def _read(path: Path, name: str) -> xr.Dataset:
    try:
        check_hdf5(path)
        return xr.load_dataset(path)
    except (OSError, ValueError) as error:
        raise _unusable(path.name, name, error) from None


def _unusable(file: str, name: str, error: Exception) -> InputError:
    rule, remedy = "both hold datasets of vsr", "make them again"
    return InputError(Problem(file, name, str(error), rule, remedy))
