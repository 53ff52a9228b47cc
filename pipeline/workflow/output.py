"""The file that an option such as ``--to`` names: checked before work begins, and written whole."""

from __future__ import annotations

import os
from pathlib import Path

from pipeline.config.problems import InputError, Problem
from pipeline.workflow.owner import settle
from pipeline.workflow.writers import Writer


def check(option: str, path: Path, suffix: str, *inputs: Path) -> None:
    """Refuse a file that is not to be written.

    Parameters
    ----------
    suffix : str, what its name ends in, so that no file of another kind is written over
    inputs : what the command reads
    """
    try:
        fault, rule = _fault(path, suffix, inputs)
    except OSError as error:
        raise _unwritten(option, path, error) from None
    if fault:
        raise InputError(Problem(option, "", f"{path}, {fault}", rule, "give another path"))


def _fault(path: Path, suffix: str, inputs: tuple[Path, ...]) -> tuple[str, str]:
    """Why a file is not to be written, and the rule; empty where it is."""
    real = _real(path)
    if path.suffix.lower() != suffix:
        return "a name of another kind", f"it ends in {suffix}"
    if real in map(_real, inputs):
        return "which is read by the same command", "it is another file than what is read"
    if folder := next((one for one in real.parents if (one / ".stages").is_dir()), None):
        return f"which is in {folder}", "it is outside of every folder of results"
    if not real.parent.is_dir():
        return "whose folder does not exist", "it is in a folder that exists"
    if real.exists() and not real.is_file():  # a pipe, which may never be read, or a device
        return "which is no regular file", "what is written is a file"
    return "", ""


def put(option: str, path: Path, write: Writer) -> None:
    """Write beside a file, and give what is whole its name."""
    real = _real(path)
    part = real.with_name(f".part-{os.getpid()}")  # short, however long the file's name is
    try:
        try:
            write(part)
            with part.open("rb+") as file:
                os.fsync(file.fileno())
            part.replace(real)
            settle(real.parent)
        finally:
            part.unlink(missing_ok=True)
    except OSError as error:
        raise _unwritten(option, path, error) from error


def _unwritten(option: str, path: Path, error: OSError) -> InputError:
    given = f"{path}, which cannot be written ({error.strerror or error})"
    rule = "it is in a folder with room that you may write to"
    return InputError(Problem(option, "", given, rule, "free space, or give another path"))


def _real(path: Path) -> Path:
    """Where a path leads through links."""
    return Path(os.path.realpath(path))
