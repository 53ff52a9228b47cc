"""Where the shipped files are, where the user is, and the paths that a user gives."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from pipeline import ROOT
from pipeline.config.problems import InputError, Problem

_INSTALLED = ROOT / "pipeline" / "shipped"
SHIPPED = _INSTALLED if _INSTALLED.is_dir() else ROOT
"""The folder that holds the shipped ``configs/`` and ``data/raw/``."""


def working_folder() -> Path:
    """The folder whose ``data/`` is used: the checkout within one, else the current folder."""
    here = Path.cwd()
    return SHIPPED if SHIPPED == ROOT and here.is_relative_to(ROOT) else here


def _own(path: Path) -> Path:
    """In place of a scan that a shipped site names and that is not shipped: the user's own."""
    plain = Path(os.path.normpath(path))
    if plain.is_relative_to(SHIPPED / "data") and not plain.exists():
        return working_folder() / plain.relative_to(SHIPPED)
    return path


def located(folder: Path, name: str, file: str, key: str) -> Path:
    """An absolute path, without links, of what a configuration names."""
    try:
        if not name or not is_text(name):
            raise ValueError("an empty name" if not name else "not in UTF-8")
        found = Path(os.path.realpath(_own(folder / name)))
        found.stat()
    except FileNotFoundError:
        pass  # who wants the file says so better
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        rule = f"it is not a valid path ({why})"
        raise InputError(Problem(file, key, repr(name), rule, "correct the path")) from None
    return found


def is_text(name: str) -> bool:
    """Whether a name can stand in a product; bytes that are no UTF-8 cannot."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return True


def kept(path: Path) -> str:
    """A path as products have it, wherever they are made: a shipped one whole, else its name."""
    real, folder = os.path.realpath(path), os.path.realpath(SHIPPED)
    return os.path.relpath(real, folder) if Path(real).is_relative_to(folder) else path.name


def shown(path: Path) -> str:
    """A path as a reader would write it: relative to where they stand, if it is below."""
    real = os.path.realpath(path)
    here: tuple[Path, ...] = ()
    with suppress(FileNotFoundError):  # it was removed
        here = (Path.cwd(),)
    for folder in (*here, SHIPPED):
        if Path(real).is_relative_to(os.path.realpath(folder)):
            return os.path.relpath(real, os.path.realpath(folder))
    return str(path)
