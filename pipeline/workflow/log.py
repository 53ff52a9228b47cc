"""What a command tells beside what it prints: on the screen, and in a file that is asked for."""

from __future__ import annotations

import errno
import logging
import os
import re
import sys
import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import Any, TextIO

from pipeline.config.problems import InputError, Problem, printable
from vsr_core.errors import reason


class _Screen(logging.Handler):
    """The standard error, as it is at the time of a line."""

    def emit(self, record: logging.LogRecord) -> None:
        try:
            sys.stderr.write(f"{record.getMessage()}\n")
            sys.stderr.flush()
        except (
            OSError
        ):  # or nobody reads it: the exit code tells all the same how the command ended
            _give_up(sys.stderr)


def _give_up(stream: TextIO) -> None:
    """See to it that what a stream did not take is not tried again at the end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


class _File(logging.FileHandler):
    """A file to which lines are added; one that can no longer be written is told, and left."""

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802 (its name there)
        _LOG.removeHandler(self)
        _LOG.warning(f"vsr: warning: {self.baseFilename} takes no more lines: {sys.exception()}")


_LOG, _SCREEN = logging.getLogger("vsr"), _Screen()
_LOG.setLevel(logging.INFO)
_LOG.propagate = False
_LOG.addHandler(_SCREEN)


def begin(*, quiet: bool, file: Path | None) -> None:
    """Tell the lines of one command: of a quiet one only what is wrong on the screen.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    for handler in set(_LOG.handlers) - {_SCREEN}:
        _LOG.removeHandler(handler)
        handler.close()
    _SCREEN.setLevel(logging.WARNING if quiet else logging.INFO)
    if file is not None:
        kept = _File(file, encoding="utf-8", errors="backslashreplace")
        kept.setFormatter(logging.Formatter("%(asctime)s %(message)s"))
        _LOG.addHandler(kept)


def is_log(file: Path) -> bool:
    """Whether lines can be added to a file: it is new, is named as a log, or begins as one."""
    if not file.exists() or file.suffix.lower() == ".log":
        return True
    with file.open("rb") as there:
        start = there.read(len("2000-01-01 00:00:00,000 "))
    return not start or re.fullmatch(rb"[\d-]{10} [\d:]{8},\d{3} ", start) is not None


def log(line: str) -> None:
    """Tell how a command goes on."""
    _LOG.info(printable(line))


def complain(line: str) -> None:
    """Tell what is wrong, also of a quiet command."""
    _LOG.warning(printable(line))


def show(lines: Iterable[str]) -> int:
    """Print what a command answers; returns the exit code of one that has no more to do."""
    try:
        if sys.stdout is None:
            raise OSError(errno.EBADF, os.strerror(errno.EBADF))
        print("\n".join(lines), flush=True)
    except BrokenPipeError:
        raise
    except OSError as error:
        if sys.stdout is not None:
            _give_up(sys.stdout)
        given, rule = f"what is printed, not taken ({reason(error)})", "it can be written"
        raise InputError(Problem("output", "", given, rule, "free space")) from None
    return 0


def in_notebook() -> bool:
    """Whether lines stand below the cell of a notebook."""
    return type(sys.stderr).__module__.startswith("ipykernel.")


def on_screen() -> bool:
    """Whether lines are shown where they can be written over."""
    return (in_notebook() or sys.stderr.isatty()) and _SCREEN.level <= logging.INFO


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
            complain(f"vsr: warning{whose}: {text}")

    warnings.showwarning = tell  # type: ignore[assignment]
