"""The index page in the folder of results, renewed when anything in the folder changed."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from pipeline.workflow.keys import digest
from pipeline.workflow.owner import settle
from pipeline.workflow.stage import named

PAGE, KNOWN = "index.html", ".index.json"

DEEPEST = 4
"""Folders below that of the results in which products are: a member of a study of a site."""


def renew(derived: Path) -> Path | None:
    """Write the index of all that is in a folder of results, where it is not up to date.

    Returns
    -------
    Path or None
        None where there is nothing to list, or the folder cannot be written to: the products are
        there all the same.
    """
    folders = list(product_folders(derived))
    page = derived / PAGE
    with suppress(OSError):
        if not folders:
            for path in (page, derived / KNOWN):
                path.unlink(missing_ok=True)
            return None
        stamp = digest(
            [str(path.relative_to(derived)) + _stamp(path) for path in manifests(folders)]
        )
        known = _known(derived)
        if known.get("stamp") != stamp or not page.is_file():
            text, facts = named("pipeline.workflow.front_page_text:text")(
                derived, folders, known.get("facts", {})
            )
            _put(page, text)
            _put(derived / KNOWN, json.dumps({"stamp": stamp, "facts": facts}))
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


def manifests(folders: list[Path]) -> list[Path]:
    """Files that tell what was made, and whether it has a verdict."""
    return [path for folder in folders for path in sorted((folder / ".stages").glob("*.json"))]


def _stamp(path: Path) -> str:
    state = path.stat()
    return f" {state.st_mtime_ns} {state.st_size}"


def _known(derived: Path) -> dict[str, Any]:
    """Stamp and facts of the last index; nothing where they cannot be read."""
    with suppress(OSError, ValueError, TypeError):
        return dict(json.loads((derived / KNOWN).read_text(encoding="utf-8")))
    return {}


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
