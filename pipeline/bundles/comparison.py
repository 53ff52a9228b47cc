"""Two sites' folders or bundles beside each other: settings, cells and boundaries that differ."""

from __future__ import annotations

import shutil
import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from pipeline.bundles.layout import RESULTS, about, opened
from pipeline.config.outside import check_target
from pipeline.config.problems import InputError, Problem
from pipeline.workflow import pages
from pipeline.workflow.grammar import counted
from pipeline.workflow.parameters import changes
from pipeline.workflow.site_folder import SETTINGS
from pipeline.workflow.store import Store, writing
from vsr_core.outcome import Outcome

BOUNDARY = "first_overturning_pga"


@dataclass(frozen=True)
class Part:
    """What was compared, and how it differs: nothing where it does not."""

    name: str
    lines: list[str]


def compare(one: Path, other: Path, page: Path) -> list[Part]:
    """Compare, and write the page."""
    check_target(page)
    with ExitStack() as stack:
        stores = [Store(stack.enter_context(_Folder(path))) for path in (one, other)]
        for store, path in zip(stores, (one, other), strict=True):
            _require_whole(store, path)
        parts = [
            Part("settings", list(_settings(*stores))),
            Part("made of", list(_made_of(*stores))),
            Part("cells", list(_cells(*stores))),
            Part("boundary", list(_boundary(*stores))),
        ]
    with writing(page.parent):
        facts = {"one": str(one), "other": str(other), "parts": parts}
        page.write_text(pages.filled("comparison.html", facts), encoding="utf-8")
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
            for name in archive.namelist():
                if name.startswith(f"{RESULTS}/"):
                    into = Path(self.name, name)
                    into.parent.mkdir(parents=True, exist_ok=True)
                    with archive.open(name) as source, into.open("wb") as target:
                        shutil.copyfileobj(source, target)
        return Path(self.name, RESULTS)


def _require_whole(store: Store, path: Path) -> None:
    for stage in store.manifests():
        if damage := store.damage(stage):
            raise InputError(
                Problem(str(path), stage, damage, "results are whole", "make it again")
            )


def _settings(one: Store, other: Store) -> Iterator[str]:
    kept = [
        (store.manifest(SETTINGS) or {"facts": {"config": {}}})["facts"] for store in (one, other)
    ]
    yield from changes(kept[0]["config"], kept[1]["config"])


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
        return
    a, b = (np.nan_to_num(values.to_numpy(), nan=-1).astype(int) for values in found)
    differing = Counter(zip(a[a != b].tolist(), b[a != b].tolist(), strict=True))
    if a.size == 0:
        yield "no cell is in both"
    for (was, now), number in differing.most_common():
        yield f"{number} of {counted(a.size, 'cell')}: {_named(was)} and {_named(now)}"


def _named(code: int) -> str:
    return "not run" if code < 0 else Outcome(code).name.lower()


def _boundary(one: Store, other: Store) -> Iterator[str]:
    """How far boundaries of both are apart, of those that both have."""
    found = _both(one, other, "fragility.nc", BOUNDARY)
    if found is None:
        return
    a, b = (values.to_numpy() for values in found)
    known = np.isfinite(a) & np.isfinite(b)
    if alone := int((np.isfinite(a) != np.isfinite(b)).sum()):
        yield f"{alone} of {a.size} first-overturning PGAs are in one of them only"
    apart = np.abs(b[known] / a[known] - 1.0)
    if (apart > 0.0).any():
        yield (
            f"{int((apart > 0).sum())} of {a.size} first-overturning PGAs differ, by a median of "
            f"{100 * np.median(apart):.2g} % and {100 * apart.max():.2g} % at most"
        )


def _both(one: Store, other: Store, file: str, name: str) -> tuple[xr.DataArray, ...] | None:
    """A variable of both, where their coordinates meet."""
    paths = [store.folder / file for store in (one, other)]
    if not all(path.is_file() for path in paths):
        return None
    try:
        found = [_read(path, name)[name] for path in paths]
        if found[0].dims != found[1].dims:
            return None
        return xr.align(*found, join="inner")
    except (KeyError, ValueError) as error:
        raise _unusable(file, name, error) from None


def _read(path: Path, name: str) -> xr.Dataset:
    try:
        return xr.load_dataset(path)
    except (OSError, ValueError) as error:
        raise _unusable(path.name, name, error) from None


def _unusable(file: str, name: str, error: Exception) -> InputError:
    rule, remedy = "both hold datasets of vsr", "make them again"
    return InputError(Problem(file, name, str(error), rule, remedy))
