"""Files of a folder that nothing reads, as they have other names than those that are read."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from pathlib import Path

from pipeline.config.outside import refused
from pipeline.config.problems import printable

NOTES = (".md", ".pdf", ".png", ".jpg")
"""Ends of names of files that are for people, where no other end stands before."""

NOT_READ = "not read"
"""Stands for such a file where others have a digest."""

_DEEP = ("*", "*/*", "*/*/*")
"""How deep a folder is looked through."""


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


def unread(folder: Path, read: Iterable[Path]) -> tuple[str, ...]:
    """Names of files but for notes and hidden ones that are not read."""
    known = set(read)
    return tuple(
        printable(path.relative_to(folder).as_posix())
        for path in sorted(chain.from_iterable(map(folder.glob, _DEEP)))
        if path not in known and not path.is_dir() and not _is_for_people(path)
    )


def marked(names: Sequence[str]) -> dict[str, str]:
    """Files that are not read among the digests of others, so that one is told when one comes."""
    return {f"{name} ({NOT_READ})": NOT_READ for name in names}


def in_a_line(names: Sequence[str]) -> Iterator[str]:
    """Files that are not read, in a line."""
    if names:
        others = f" and {len(names) - 3} more" if len(names) > 4 else ""
        shown = ", ".join(f"'{name}'" for name in (names[:3] if others else names))
        yield f"{shown}{others} left out, as nothing reads a file of that name there"


def _is_for_people(path: Path) -> bool:
    ends = path.suffixes
    return path.name.startswith(".") or (len(ends) == 1 and ends[0].lower() in NOTES)
