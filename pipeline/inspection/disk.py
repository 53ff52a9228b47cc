"""How much room results take, and how old they are."""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path

from pipeline.workflow.grammar import counted

DAY = 86400.0
"""Seconds."""


def folders(derived: Path) -> list[Path]:
    """Folders of results, of a site or a variant each; of archives, those a folder below."""
    found: list[Path] = []
    for folder in sorted(derived.glob("*/")):
        inside = [folder] if _has_products(folder) else sorted(folder.glob("*/"))
        found += filter(_has_products, inside)
    return found


def _has_products(folder: Path) -> bool:
    return (folder / ".stages").is_dir()


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
