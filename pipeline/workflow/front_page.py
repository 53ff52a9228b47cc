"""The index page in the folder of results, renewed when anything in the folder changed."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from hashlib import sha256
from pathlib import Path

from pydantic import BaseModel, Field

from pipeline.config.outside import content
from pipeline.config.problems import InputError, Problem
from pipeline.workflow.keys import digest
from pipeline.workflow.log import complain
from pipeline.workflow.owner import settle
from pipeline.workflow.stage import named

PAGE, KNOWN = "index.html", ".index.json"

MARK = b"/* Index of results, written by vsr. */"
"""Stands in the head of each index, as another ``index.html`` may be anybody's."""

_LARGEST = 256 * 1024**2
"""Bytes of an index: of thousands of pages with a small picture each."""

DATA = (".nc", ".csv", ".png", ".pdf", ".svg")
"""Endings of what an index leads to beside pages."""

DEEPEST = 4
"""Folders below that of the results in which products are: a member of a study of a site."""


def renew(derived: Path) -> Path | None:
    """Write the index of all that is in a folder of results, where it is not up to date.

    What cannot be read is left out, and told.

    Returns
    -------
    Path or None
        None where there is nothing to list, or the folder cannot be written to: the products are
        there all the same.

    Raises
    ------
    InputError
        If something stands there that is no index of results; it is left as it is.
    """
    page = derived / PAGE
    with suppress(OSError):
        folders, known = list(product_folders(derived)), _known(derived)
        stands = content(page, _LARGEST) if page.exists() else b""
        others = bool(stands) and MARK not in stands
        if not folders:
            for path in () if others else (page, derived / KNOWN):
                path.unlink(missing_ok=True)
            return None
        if others:
            given, rule = "a page of another kind", "an index of results would take its place"
            remedy = "give it another name, or give another folder with --derived"
            raise InputError(Problem(str(page), "", given, rule, remedy))
        now = digest([ascii(path.relative_to(derived)) + stamp(path) for path in _shown(folders)])
        if known.stamp != now or known.page != sha256(stands).hexdigest():
            text, facts, left_out = named("pipeline.workflow.front_page_text:text")(
                derived, folders, known.facts
            )
            for one in left_out:
                complain(f"vsr: warning: index: {one} cannot be read and is left out")
            _put(page, text)
            written = sha256(text.encode()).hexdigest()
            known = _Known(stamp=now, page=written, facts=facts, seal=digest(facts))
            with suppress(OSError):  # without it all is read again the next time
                _put(derived / KNOWN, known.model_dump_json())
        return page
    return None


def product_folders(derived: Path) -> Iterator[Path]:
    """Folders with products, each before those below it."""
    for place, below, _ in os.walk(derived):
        folder = Path(place)
        below[:] = sorted(name for name in below if not name.startswith("."))
        if len(folder.relative_to(derived).parts) >= DEEPEST:
            below.clear()
        if folder != derived and (folder / ".stages").is_dir():
            yield folder


def _shown(folders: list[Path]) -> list[Path]:
    """Files that decide what an index says: pages, data, and what tells how they were made."""
    every = (one for folder in folders for part in ("*", "*/*") for one in folder.glob(part))
    return sorted(one for one in every if one.suffix in (".json", ".html", *DATA) and one.is_file())


def stamp(path: Path) -> str:
    """What tells a file from another of its name."""
    state = path.stat()
    return f" {state.st_mtime_ns} {state.st_size}"


class _Known(BaseModel):
    """Stamp of the last index, its page's checksum, and what was read for it."""

    stamp: str = ""
    page: str = ""
    facts: dict[str, dict[str, str]] = Field(default_factory=dict)
    seal: str = ""


def _known(derived: Path) -> _Known:
    """What is known of the last index; nothing where it cannot be read."""
    with suppress(InputError, ValueError):
        known = _Known.model_validate_json(content(derived / KNOWN), strict=True)
        if known.seal == digest(known.facts):
            return known
    return _Known()


def _put(path: Path, text: str) -> None:
    part = path.with_name(f".part-{os.getpid()}-{path.name}")
    try:
        with part.open("w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
        settle(path.parent)
    finally:
        part.unlink(missing_ok=True)
