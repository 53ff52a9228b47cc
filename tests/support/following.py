"""Which definitions of ``vsr_core`` are entered while something runs."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path

from pipeline import ROOT


@contextmanager
def following() -> Iterator[set[str]]:
    """Definitions of ``vsr_core`` whose code is entered meanwhile."""
    entered: set[str] = set()

    def follow(frame, event: str, _: object) -> None:
        path = Path(frame.f_code.co_filename)
        if event == "call" and path.is_relative_to(ROOT / "vsr_core"):
            module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
            name = frame.f_code.co_qualname.split(".")[0]
            if not name.startswith("<"):
                entered.add(f"{module.removesuffix('.__init__')}:{name}")

    import_module("vsr_core.engines.bullet.driven")  # what only an import enters does not count
    sys.setprofile(follow)
    try:
        yield entered
    finally:
        sys.setprofile(None)
