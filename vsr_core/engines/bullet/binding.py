"""PyBullet, imported without the line that it prints."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from vsr_core.engines import missing
from vsr_core.errors import InvalidInput


@contextmanager
def _silenced() -> Iterator[None]:
    """Keep a library from writing to standard error while it is imported."""
    sys.stderr.flush()
    kept = os.dup(2)
    with open(os.devnull, "wb") as nowhere:  # noqa: PTH123 (a descriptor, not a path)
        os.dup2(nowhere.fileno(), 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)


try:
    with _silenced():
        import pybullet as pybullet
except ModuleNotFoundError:
    raise InvalidInput("the engine 'bullet'", *missing("pybullet")) from None
