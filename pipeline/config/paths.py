"""Paths that a user gives: found beside the file that names them, and shown as they would write."""

from __future__ import annotations

import os
from pathlib import Path

from pipeline import ROOT
from pipeline.config.problems import InputError, Problem


def located(folder: Path, name: str, file: str, key: str) -> Path:
    """An absolute path, without links, of what a configuration names."""
    path = folder / name
    try:
        if not name or not _is_text(name):
            raise ValueError("an empty name" if not name else "not in UTF-8")
        found = Path(os.path.realpath(path))
        found.stat()
    except FileNotFoundError:
        pass  # who wants the file says so better
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        rule = f"it is not a valid path ({why})"
        raise InputError(Problem(file, key, repr(name), rule, "correct the path")) from None
    return found


def _is_text(name: str) -> bool:
    """Whether a name can stand in a product; bytes that are no UTF-8 cannot."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return True


def shown(path: Path) -> str:
    """A path as a reader would write it: relative to where they stand, if it is below."""
    real = os.path.realpath(path)
    for folder in (Path.cwd(), ROOT):
        if Path(real).is_relative_to(os.path.realpath(folder)):
            return os.path.relpath(real, os.path.realpath(folder))
    return str(path)
