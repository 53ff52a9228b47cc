"""Settings of libraries, from the shell and from files of theirs, seen before work begins."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from pipeline.config.problems import InputError, Problem

_HOME = os.path.expanduser("~")  # noqa: PTH111 (never fails)

_OF_DASK = "/etc/dask", f"{sys.prefix}/etc/dask", f"{_HOME}/.config/dask"
"""Folders of settings that Dask reads, too."""


def check_settings() -> None:
    """Refuse an environment in which nothing runs: Numba without compilation, unreadable YAML.

    Numba and Dask read theirs on import, which takes a while, and most commands never do.
    """
    own = Path(".numba_config.yaml")
    if own.exists() or any(name.startswith("NUMBA_") for name in os.environ):
        try:
            from numba.core import config
        except Exception as error:  # noqa: BLE001 (whatever YAML or a setting brings up)
            remedy = f"correct {own}, or what NUMBA_* of the shell say"
            raise unread("Numba", error, remedy) from None
        if config.DISABLE_JIT:  # type: ignore[attr-defined]
            given, remedy = "disable_jit", f"leave it out of {own}, or unset NUMBA_DISABLE_JIT"
            raise InputError(Problem("settings of Numba", "", given, "runs are compiled", remedy))
    if dask_is_set():
        try:
            import distributed  # noqa: F401
        except Exception as error:  # noqa: BLE001
            raise unread("Dask", error, MEND_DASK) from None


def dask_is_set() -> bool:
    """Whether anything but Dask itself says how it is set."""
    in_shell = any(name.startswith("DASK_") for name in os.environ)
    return in_shell or any(map(_says_something, _OF_DASK))


MEND_DASK = "correct its YAML, or what DASK_* of the shell say"


def unread(library: str, error: BaseException, remedy: str) -> InputError:
    """What is wrong with settings of a library that it refuses, whatever it does then."""
    given = f"what it cannot read ({error!r})"
    rule = f"{library} reads its own before it is used"
    return InputError(Problem(f"settings of {library}", "", given, rule, remedy))


def _says_something(folder: str) -> bool:
    """Whether files of settings in a folder hold more than the comments that Dask puts there."""
    files = (path for path in Path(folder).glob("*.*") if path.suffix in (".yaml", ".yml", ".json"))
    lines = (line for path in files for line in path.open("rb"))
    try:
        return any(line.strip() and not line.lstrip().startswith(b"#") for line in lines)
    except OSError:
        return True
