"""How the database of runs keeps its journal: by what the file system of its folder can do."""

from __future__ import annotations

import errno
import os
from pathlib import Path

MOUNTS = Path("/proc/self/mountinfo")

LOCAL = {
    "apfs", "bcachefs", "btrfs", "ext2", "ext3", "ext4", "f2fs", "jfs", "overlay", "ramfs", "tmpfs",
    "ufs", "xfs", "zfs",
}  # fmt: skip
"""File systems of one machine: processes that use them share memory and locks."""


def file_system(folder: Path, mounts: Path = MOUNTS) -> str:
    """Type of the file system that a folder is on."""
    try:
        lines = mounts.read_text(encoding="utf-8", errors="surrogateescape").splitlines()
    except OSError:
        return ""
    whole = os.path.realpath(folder)
    deepest, found = -1, ""
    for line in lines:
        place, _, source = line.partition(" - ")
        point = _unescaped(place.split()[4])
        inside = point == "/" or whole == point or whole.startswith(f"{point}/")
        if inside and len(point) >= deepest:  # what is mounted later lies on top
            deepest, found = len(point), source.split()[0]
    return found


def _unescaped(text: str) -> str:
    """A path as the kernel lists it, with blanks and the like as octal numbers."""
    for sign in " \t\n\\":
        text = text.replace(f"\\{ord(sign):03o}", sign)
    return text


def is_local(folder: Path) -> bool:
    """Whether a folder is known to be on a file system of this machine alone."""
    return file_system(folder) in LOCAL


def mode(folder: Path) -> str:
    """Choose SQLite's journal: a write-ahead log needs memory that all its users share."""
    return "WAL" if is_local(folder) else "TRUNCATE"


def settle(folder: Path) -> None:
    """See to it that files renamed or removed in a folder stay so after a power cut."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):  # which does so by itself
            raise
    finally:
        os.close(handle)
