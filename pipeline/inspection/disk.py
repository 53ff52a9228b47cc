"""How much room results take, and how old they are."""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path

from pipeline.workflow.grammar import counted

DAY = 86400.0
"""Seconds."""


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

    >>> told(1_234_567, 3.2), told(0, None)
    ('1.2 MB, last made 3 days ago', '0.0 MB')
    """
    made = "" if days is None else f", last made {counted(int(days), 'day')} ago"
    return f"{number / 1e6:.1f} MB{made}"
