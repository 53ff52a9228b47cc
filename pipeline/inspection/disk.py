"""How much room results take, how old they are, and their removal."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from itertools import chain
from pathlib import Path

from pipeline.workflow.grammar import counted
from pipeline.workflow.owner import LOCK, Ownership
from pipeline.workflow.store import Store, writing

DAY = 86400.0
"""Seconds."""

COMPARED = "compared/*/*"
"""In a site's folder, the same rock with the settings that its hazard is compared with."""

_BESIDE = re.compile(
    r"\.stages/.*|\.(part|try|owner)-.*|\.owner|log\.jsonl|config\.yaml"
    r"|runs\.sqlite(\.damaged-\d+)?(-wal|-shm|-journal)?",
    re.DOTALL,
)
"""Names of what stands in a folder of results beside what stages write."""


def folders(derived: Path) -> list[Path]:
    """Folders of results, of a site or a variant each; of archives, those a folder below."""
    found: list[Path] = []
    for folder in sorted(derived.glob("*/")):
        inside = [folder] if _has_products(folder) else sorted(folder.glob("*/"))
        found += filter(_has_products, inside)
    return found


def _has_products(folder: Path) -> bool:
    return (folder / ".stages").is_dir()


def is_linked(folder: Path, derived: Path) -> bool:
    """Whether a folder of results is a link, or behind one."""
    inside = folder.relative_to(derived)
    above = (derived / one for one in inside.parents[:-1])
    return any(path.is_symlink() for path in (folder / ".stages", folder, *above))


def parted(folder: Path) -> tuple[list[Path], list[Path]]:
    """Files that results are made of, and all else that is in their folder; no link is followed."""
    inside = chain.from_iterable(map(folder.glob, ("studies/*", "studies/*/*", COMPARED)))
    homes = {home: Store(home).names() for home in (folder, *inside) if _has_products(home)}
    results: list[Path] = []
    others: list[Path] = []
    for place, below, files in os.walk(folder, onerror=_raise):
        at = Path(place)
        home = next(one for one in (at, *at.parents) if one in homes)
        links = [name for name in below if (at / name).is_symlink()]
        for path in (at / name for name in sorted((*files, *links))):
            name = path.relative_to(home).as_posix()
            known = name in homes[home] or _BESIDE.fullmatch(name)
            (results if known and not path.is_symlink() else others).append(path)
    return results, others


def _raise(error: OSError) -> None:
    raise error


def remove(folder: Path) -> None:
    """Remove the results in a folder, and it where nothing else is there.

    Refused while a command is at work in it, which for a variant owns its site's folder, and for a
    comparison the folder of that.
    """
    # where a variant begins is not told: the name of a site may have an @, too
    before = [at.start() for at in re.finditer("@", folder.name) if at.start()]
    sites = [folder.with_name(folder.name[:at]) for at in before]
    with writing(folder):
        with ExitStack() as owned:
            for site in [one for one in sites if one.is_dir()] + [folder]:
                owned.enter_context(Ownership(site))
            with ExitStack() as inside:
                for compared in filter(_has_products, folder.glob(COMPARED)):
                    if not is_linked(compared, folder):
                        inside.enter_context(Ownership(compared))
                for path in parted(folder)[0]:
                    if path.name != LOCK:
                        path.unlink(missing_ok=True)
            for empty in _from_below(folder):
                with suppress(OSError):  # it is not
                    empty.rmdir()
        with suppress(OSError):  # or the next command has come already
            folder.rmdir()


def _from_below(folder: Path) -> Iterator[Path]:
    for place, below, _ in os.walk(folder, topdown=False):
        yield from (Path(place, name) for name in below)


def size(folder: Path) -> int:
    """Bytes of all files in a folder."""
    found = 0
    for path in folder.rglob("*"):
        with suppress(OSError):  # what a command removes meanwhile
            found += path.lstat().st_size if path.is_file() else 0
    return found


def age(folder: Path) -> float | None:
    """Days since the newest product in a folder was made; None where there is none."""
    times = [path.stat().st_mtime for path in folder.rglob(".stages/*.json")]
    return max(0.0, time.time() - max(times)) / DAY if times else None


def told(number: int, days: float | None) -> str:
    """Size and age in words.

    >>> told(1_234_567, 3.2), told(2_000_000, 0.1), told(0, None)
    ('1.2 MB, last made 3 days ago', '2.0 MB, last made 2 hours ago', '0.0 MB')
    """
    made = "" if days is None else f", last made {_ago(days)}"
    return f"{number / 1e6:.1f} MB{made}"


def _ago(days: float) -> str:
    minutes = days * 1440.0
    for unit, length in (("day", 1440.0), ("hour", 60.0), ("minute", 1.0)):
        if minutes >= length:
            return f"{counted(int(minutes / length), unit)} ago"
    return "less than a minute ago"
