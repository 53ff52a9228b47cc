"""Warnings of libraries and of machine code, in the log."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from typing import Any


def tell_warnings_once() -> None:
    """Have each warning of a library told in one line, once in this process."""
    known: set[str] = set()

    def tell(message: Warning | str, category: type[Warning], file: str, *_: Any) -> None:
        text = " ".join(str(message).split())
        if text not in known:
            known.add(text)
            parts = Path(file).parts
            at = parts.index("site-packages") + 1 if "site-packages" in parts else -1
            library = parts[at] if parts else "Python"
            own = category.__module__.startswith("vsr_core.")
            whose = "" if own else f" of {library}: {category.__name__}"
            sys.stderr.write(f"vsr: warning{whose}: {text}\n")
            sys.stderr.flush()

    warnings.showwarning = tell  # type: ignore[assignment]
