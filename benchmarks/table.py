"""What the benchmarks print: rows as they are measured, and on standard error what is under way."""

from __future__ import annotations

import sys
import time

Row = tuple[str, str, str]
"""What was measured, the value, and the target or an empty text."""

_START = time.monotonic()


def say(what: str) -> None:
    """Tell what is being measured from now on."""
    minutes, seconds = divmod(int(time.monotonic() - _START), 60)
    print(f"bench: {minutes:d}:{seconds:02d} measuring {what}", file=sys.stderr, flush=True)


def show(row: Row) -> None:
    """Print a row."""
    what, measured, target = row
    print(f"{what:<62} {measured:>18}   {target}".rstrip(), flush=True)
