"""The index page: title, main result and picture of each page, state and error of each dataset."""

from __future__ import annotations

import base64
import html
import io
import json
import re
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any
from urllib.parse import quote

import netCDF4
from PIL import Image

from pipeline.workflow import pages
from pipeline.workflow.products import DELIVERABLES

TEMPLATE = "front_page.html"

WIDEST = 320
"""Size [px] of the longer side of a small picture."""

_TITLE = re.compile(r"<title>(.*?)</title>", re.DOTALL)
_ANSWER = re.compile(r'<p class="answer">(.*?)</p>', re.DOTALL)
_PICTURE = re.compile(r'<img[^>]*\ssrc="data:image/png;base64,([^"]+)"')
_DRAWING = re.compile(r'<img[^>]*\ssrc="(data:image/svg\+xml[^"]+)"')
_TAG = re.compile(r"<[^>]+>")
_LARGEST_DRAWING = 150_000
_DATA = (".nc", ".csv", ".png", ".pdf", ".svg")

Facts = dict[str, Any]


def text(derived: Path, folders: list[Path], known: Facts) -> tuple[str, Facts]:
    """The index page, and what was read for it, to be known the next time.

    Parameters
    ----------
    folders : list of Path, with products, each before those below it
    known : dict, what was read the last time, by path and checksum
    """
    read: Facts = {}

    def pages_of(folder: Path, made: dict[str, str]) -> Iterator[Facts]:
        for name, checksum in _in_order(made):
            key = f"{(folder / name).relative_to(derived)} {checksum}"
            with suppress(OSError):
                read[key] = known.get(key) or _page(folder / name)
                yield {"name": name, "href": _href(derived, folder / name), **read[key]}

    sites: dict[str, list[Facts]] = {}
    for folder in folders:
        manifests = _manifests(folder)
        made = {name: sum_ for one in manifests for name, sum_ in one["files"].items()}
        stale = {
            name: one["stale"] for one in manifests if one.get("stale") for name in one["files"]
        }
        place = folder.relative_to(derived)
        entry = {
            "name": " / ".join(place.parts),
            "pages": list(pages_of(folder, {n: s for n, s in made.items() if n.endswith(".html")})),
            "stale": stale,
            "data": [
                {"name": name, "href": _href(derived, folder / name), "stale": name in stale}
                for name in sorted(made)
                if name.endswith(_DATA) and (folder / name).is_file()
            ],
            "undecided": max((int(one["unresolved"]) for one in manifests), default=0),
            **_dataset(derived, folder, made, known, read),
        }
        sites.setdefault(place.parts[0], []).append(entry)
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
    return pages.filled(TEMPLATE, {"groups": with_page, "runs": without, "up": ""}), read


def _manifests(folder: Path) -> list[Facts]:
    found = []
    for path in sorted((folder / ".stages").glob("*.json")):
        with suppress(OSError, ValueError):
            one = json.loads(path.read_text(encoding="utf-8"))
            if isinstance(one, dict) and isinstance(one.get("files"), dict) and "unresolved" in one:
                found.append(one)
    return found


def _in_order(made: dict[str, str]) -> list[tuple[str, str]]:
    """Pages in the order in which their products are listed, others after them."""
    shown = [name for product in DELIVERABLES.values() for name in product.shown]
    rank = {name: place for place, name in reversed(list(enumerate(shown)))}
    return sorted(made.items(), key=lambda item: (rank.get(item[0], len(shown)), item[0]))


def _href(derived: Path, path: Path) -> str:
    return quote(path.relative_to(derived).as_posix())


def _page(path: Path) -> Facts:
    """Title, first answer, a small picture and the date of a page."""
    content = path.read_text(encoding="utf-8", errors="replace")
    title, answer = _TITLE.search(content), _ANSWER.search(content)
    return {
        "title": _plain(title[1]) if title else path.stem,
        "answer": _plain(answer[1]) if answer else "",
        "picture": _small(content),
        "made": _day(path),
    }


def _plain(fragment: str) -> str:
    """Words of a piece of a page.

    >>> _plain("A <strong>rock</strong> &amp; its  base")
    'A rock & its base'
    """
    return " ".join(html.unescape(_TAG.sub("", fragment)).split())


def _small(content: str) -> str:
    """The first picture of a page, small, as a data URI; none where it has none."""
    found = _PICTURE.search(content)
    if found is None:
        drawing = _DRAWING.search(content)
        return drawing[1] if drawing and len(drawing[1]) < _LARGEST_DRAWING else ""
    with suppress(OSError, ValueError):
        picture = Image.open(io.BytesIO(base64.b64decode(found[1]))).convert("RGB")
        picture.thumbnail((WIDEST, WIDEST))
        small = io.BytesIO()
        picture.save(small, "png", optimize=True)
        return f"data:image/png;base64,{base64.b64encode(small.getvalue()).decode()}"
    return ""


def _dataset(derived: Path, folder: Path, made: dict[str, str], known: Facts, read: Facts) -> Facts:
    """Source of the rock's shape, error of the boundary, and the date of the inputs."""
    facts: Facts = {"source": "", "error": "", "inputs": ""}
    if "config.yaml" in made and (folder / "config.yaml").is_file():
        facts["inputs"] = _day(folder / "config.yaml")
    for name, take in (("rock.nc", _source), ("responses.nc", _error)):
        if name in made:
            key = f"{(folder / name).relative_to(derived)} {made[name]}"
            with suppress(OSError, LookupError, AttributeError):  # it has no such variable, or fact
                read[key] = known.get(key) or take(folder / name)
                facts |= read[key]
    return facts


def _source(path: Path) -> Facts:
    with netCDF4.Dataset(path) as data:
        return {"source": str(data.getncattr("shape_source"))}


def _error(path: Path) -> Facts:
    """Least and largest error of the boundary over frictions, and whether all were measured."""
    with netCDF4.Dataset(path) as data:
        errors = data["boundary_error"][:].filled(float("nan")).ravel().tolist()
    known = sorted(100.0 * error for error in errors if error == error)
    if not known:
        return {"error": "not measured"}
    span = " to ".join(dict.fromkeys(f"{error:.2g}" for error in (known[0], known[-1])))
    missing = len(errors) - len(known)
    return {"error": f"{span} %" + f", not measured at {missing} of {len(errors)}" * bool(missing)}


def _day(path: Path) -> str:
    return time.strftime("%Y-%m-%d %H:%M", time.localtime(path.stat().st_mtime))
