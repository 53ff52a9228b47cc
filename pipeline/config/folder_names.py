"""Files of a folder that nothing reads, as they have other names than those that are read."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from pipeline.config.outside import refused

NOTES = ("", ".md", ".txt", ".json", ".pdf", ".png", ".jpg")
"""Ends of names of files that are for people."""


def check_names(folder: Path, names: Iterable[str]) -> None:
    """Refuse a file whose name is nearly that of one that may be there and is not.

    It begins alike, but for the number and case, and has an end that begins alike, as
    ``Record (1).nc4`` for ``records.nc``, or ``table.yml.txt`` for ``table.yaml``.

    Raises
    ------
    InputError
        If there is one.
    """
    for name in map(Path, names):
        begin, end = name.stem.rstrip("s"), name.suffix[:2]
        for other in sorted(folder.iterdir()) if not (folder / name).exists() else ():
            alike = other.name.lower()
            if alike.startswith(begin) and end in alike and other.is_file():
                raise refused(other, "", "a file that is not read", f"it is {name}", "rename it")


def check_links(paths: Iterable[Path]) -> None:
    """Refuse a link that leads nowhere, as to a file that is still to be fetched.

    It would pass for a file that is not there, where one may be or not.

    Raises
    ------
    InputError
        If one of the paths is such a link.
    """
    for path in paths:
        if path.is_symlink() and not path.exists():
            given = f"{path.name}, a link that leads nowhere"
            rule, remedy = "it leads to what is read", "get that, or remove the link"
            raise refused(path.parent, "", given, rule, remedy)


def unread(folder: Path, read: Iterable[Path]) -> Iterator[str]:
    """Files but for notes that are not read, in words."""
    known = {path.name for path in read}
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() not in NOTES and path.name not in known:
            yield f"{path.name} left out, as nothing reads a file of that name"
