"""The index page: title, main result and picture of each page, state and error of each dataset."""

from __future__ import annotations

import base64
import html
import io
import json
import re
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any
from urllib.parse import quote

import netCDF4
import numpy as np
from PIL import Image

from pipeline.config.outside import check_file, check_hdf5, content
from pipeline.config.problems import printable
from pipeline.workflow import pages
from pipeline.workflow.front_page import DATA, stamp
from pipeline.workflow.products import DELIVERABLES
from pipeline.workflow.store import read_manifest

TEMPLATE = "front_page.html"

WIDEST = 320
"""Size [px] of the longer side of a small picture."""

_PICTURE = re.compile(r'<img[^<>]*\ssrc="data:image/png;base64,([^"]+)"')
_DRAWING = re.compile(r'<img[^<>]*\ssrc="(data:image/svg\+xml[^"]+)"')
_TAG = re.compile(r"<[^<>]+>")
"""Each looks no farther than the next tag, so that a page is read in a time like its length."""

_LARGEST_DRAWING = 150_000

Facts = dict[str, Any]
Known = dict[str, dict[str, str]]

_LARGEST_PAGE = 512 * 1024**2
_LARGEST_DATASET = 64 * 1024**3
"""Bytes of a file."""

_LARGEST_PICTURE = 40_000_000
"""Pixels of a picture in a page."""

_MOST_ERRORS = 1_000_000
"""Frictions of a boundary."""


def text(derived: Path, folders: list[Path], known: Known) -> tuple[str, Known, list[str]]:
    """The index page, what was read for it, to be known the next time, and what could not be.

    Parameters
    ----------
    folders : list of Path, with products, each before those below it
    known : dict, what was read the last time, by path and stamp
    """
    reader = _Reader(derived, known)
    sites: dict[str, list[Facts]] = {}
    for folder in folders:
        place = folder.relative_to(derived)
        if str(place).isprintable():
            sites.setdefault(place.parts[0], []).append(reader.entry(folder))
        else:
            reader.left_out.append(printable(str(place)))
    groups: list[Facts] = [
        {
            "site": site,
            "entries": [one for one in entries if one["pages"] or one["name"] == site],
            "parts": [one for one in entries if not one["pages"] and one["name"] != site],
        }
        for site, entries in sorted(sites.items())
    ]
    with_page = [one for one in groups if any(entry["pages"] for entry in one["entries"])]
    without = [entry for one in groups if one not in with_page for entry in one["entries"]]
    found = {"groups": with_page, "runs": without, "left_out": reader.left_out}
    return pages.filled(TEMPLATE, found, ""), reader.read, reader.left_out


class _Reader:
    """Reads what folders of products hold; each file that it cannot read is left out, and named.

    Attributes
    ----------
    read : dict, facts of files by path and stamp
    left_out : list of str, relative to the folder of all results
    """

    def __init__(self, derived: Path, known: Known) -> None:
        self._derived, self._known = derived, known
        self.read: Known = {}
        self.left_out: list[str] = []

    def entry(self, folder: Path) -> Facts:
        """What the index says of a folder."""
        manifests = [
            manifest
            for path in sorted((folder / ".stages").glob("*.json"))
            if (manifest := self._taken(path, _manifest)) is not None
        ]
        made = {name for one in manifests for name in one["files"]}
        stale = {
            name: one["stale"] for one in manifests if one.get("stale") for name in one["files"]
        }
        shown = [
            {"name": name, "href": self._href(folder / name), **facts}
            for name in _in_order(name for name in made if name.endswith(".html"))
            if (facts := self._facts(folder / name, _page)) is not None
        ]
        entry = {
            "name": " / ".join(folder.relative_to(self._derived).parts),
            "pages": shown,
            "stale": stale,
            "data": [
                {"name": name, "href": self._href(folder / name), "stale": name in stale}
                for name in sorted(made)
                if name.endswith(DATA) and (folder / name).is_file()
            ],
            "undecided": max((one["unresolved"] for one in manifests), default=0),
            "source": "",
            "error": "",
            "inputs": "",
        }
        if "config.yaml" in made and (folder / "config.yaml").is_file():
            entry["inputs"] = _day(folder / "config.yaml")
        for name, take in (("rock.nc", _source), ("responses.nc", _error)):
            if name in made:
                entry |= self._facts(folder / name, take) or {}
        return entry

    def _facts(self, path: Path, take: Callable[[Path], dict[str, str]]) -> dict[str, str] | None:
        """Facts of a file that is there, as they are known, or read anew."""
        if not path.exists():
            return None
        key = str(path.relative_to(self._derived)) + stamp(path)
        found = self._known.get(key) or self._taken(path, take)
        if found is not None:
            self.read[key] = found
        return found

    def _taken(self, path: Path, take: Callable[[Path], Any]) -> Any:
        """What is read of a file; None of one that cannot be read."""
        try:
            found = take(path)
        except Exception:  # noqa: BLE001 (one file that is broken leaves the index of all others)
            found = None
        if found is None:
            self.left_out.append(printable(str(path.relative_to(self._derived))))
        return found

    def _href(self, path: Path) -> str:
        return quote(path.relative_to(self._derived).as_posix())


def _in_order(names: Iterable[str]) -> list[str]:
    """Pages in the order in which their products are listed, others after them."""
    shown = [name for product in DELIVERABLES.values() for name in product.shown]
    rank = {name: place for place, name in reversed(list(enumerate(shown)))}
    return sorted(names, key=lambda name: (rank.get(name, len(shown)), name))


def _manifest(path: Path) -> dict[str, Any] | None:
    """What a manifest says, all of which can be written to a page."""
    found = read_manifest(path)
    json.dumps(found, ensure_ascii=False).encode()
    return found


def _page(path: Path) -> dict[str, str]:
    """Title, first answer, a small picture and the date of a page."""
    page = content(path, _LARGEST_PAGE).decode(errors="replace")
    title = _between(page, "<title>", "</title>")
    return {
        "title": path.stem if title is None else _plain(title),
        "answer": _plain(_between(page, '<p class="answer">', "</p>") or ""),
        "picture": _small(page),
        "made": _day(path),
    }


def _between(page: str, start: str, end: str) -> str | None:
    _, _, after = page.partition(start)
    found, closed, _ = after.partition(end)
    return found if closed else None


def _plain(fragment: str) -> str:
    """Words of a piece of a page.

    >>> _plain("A <strong>rock</strong> &amp; its  base")
    'A rock & its base'
    """
    return " ".join(html.unescape(_TAG.sub("", fragment)).split())


def _small(page: str) -> str:
    """The first picture of a page, small, as a data URI; none where it has none."""
    found = _PICTURE.search(page)
    if found is None:
        drawing = _DRAWING.search(page)
        return drawing[1] if drawing and len(drawing[1]) < _LARGEST_DRAWING else ""
    picture = Image.open(io.BytesIO(base64.b64decode(found[1])), formats=["png"])
    if picture.width * picture.height > _LARGEST_PICTURE:
        raise ValueError(f"{picture.width} x {picture.height} pixels")
    small = picture.convert("RGB")
    small.thumbnail((WIDEST, WIDEST))
    saved = io.BytesIO()
    small.save(saved, "png", optimize=True)
    return f"data:image/png;base64,{base64.b64encode(saved.getvalue()).decode()}"


def _source(path: Path) -> dict[str, str]:
    with _dataset(path) as data:
        return {"source": str(data.getncattr("shape_source"))}


def _error(path: Path) -> dict[str, str]:
    """Least and largest error of the boundary over frictions, and whether all were measured."""
    with _dataset(path) as data:
        found = data["boundary_error"]
        if found.size > _MOST_ERRORS:
            raise ValueError(f"{found.size} errors")
        errors = np.ma.filled(found[...].astype(np.float64), np.nan).ravel().tolist()
    known = sorted(100.0 * error for error in errors if error == error)
    if not known:
        return {"error": "not measured"}
    span = " to ".join(dict.fromkeys(f"{error:.2g}" for error in (known[0], known[-1])))
    missing = len(errors) - len(known)
    return {"error": f"{span} %" + f", not measured at {missing} of {len(errors)}" * bool(missing)}


def _dataset(path: Path) -> netCDF4.Dataset:
    check_file(path, _LARGEST_DATASET)
    check_hdf5(path)
    return netCDF4.Dataset(path)


def _day(path: Path) -> str:
    return time.strftime("%Y-%m-%d %H:%M", time.localtime(path.stat().st_mtime))
