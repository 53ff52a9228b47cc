"""One owner of a folder at a time: a lock file that says on which machine, and as which process."""

from __future__ import annotations

import errno
import fcntl
import json
import os
import socket
import threading
import time
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from types import TracebackType

from pipeline.config.problems import InputError, Problem

LOCK = ".owner"

BEAT = 15.0
"""Time [s] between signs of life of an owner, for machines that cannot see its process."""

SILENCE = 120.0
"""Time [s] without one after which an owner on another machine is taken for dead."""

SETTLED = 0.5
"""Time [s] after which what a process has written is seen by others."""


@dataclass(frozen=True)
class Owner:
    """Who has a folder."""

    host: str
    process: int
    since: str

    @classmethod
    def this(cls) -> Owner:
        """The process that asks."""
        return cls(socket.gethostname(), os.getpid(), time.strftime("%Y-%m-%dT%H:%M:%S"))


class Ownership:
    """Owns a folder from its making until ``end``, or until the process dies.

    The kernel's lock on the file ends with the process. Where other machines may not see such
    locks, the owner gives signs of life by the file's time.
    """

    def __init__(self, folder: Path) -> None:
        self._path, self._me = folder / LOCK, Owner.this()
        self._over = threading.Event()
        self._file = self._taken()
        if not is_local(folder):
            threading.Thread(target=self._live, daemon=True).start()

    def end(self) -> None:
        """Give the folder back."""
        self._over.set()
        if _read(self._file) == self._me:
            self._path.unlink(missing_ok=True)
        os.close(self._file)

    def __enter__(self) -> Ownership:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.end()

    def _taken(self) -> int:
        """The lock file, opened, locked, and with our name in it."""
        while True:
            file = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)
            try:
                locked = _lock(file)
                owner = _read(file)
                if locked is False:
                    raise InputError(self._held(owner))
                if _is_at(file, self._path):  # not one that its owner has just removed
                    if owner and self._lives(owner, file, bool(locked)):
                        raise InputError(self._held(owner))
                    try:
                        _write(file, self._me)
                    except OSError:
                        self._path.unlink(missing_ok=True)
                        raise
                    if locked is None:  # two may have come this far; the last one has it
                        time.sleep(SETTLED)
                        if (owner := _read(file)) != self._me:
                            raise InputError(self._held(owner))
                    return file
            except BaseException:
                os.close(file)
                raise
            os.close(file)

    def _lives(self, owner: Owner, file: int, locked: bool) -> bool:
        """Whether an owner whose lock is not in our way is at work nevertheless."""
        if is_local(self._path.parent) or (locked and owner.host == self._me.host):
            return False
        if owner.host == self._me.host:
            return _is_running(owner.process)
        probe = self._path.with_name(f"{LOCK}-{os.getpid()}")
        probe.touch()  # the time of the machine that keeps the files
        now = probe.stat().st_mtime
        probe.unlink()
        silent = now - os.fstat(file).st_mtime
        if silent < 0.0:  # that clock was set back: from now on it has to give a sign again
            os.utime(file)
        return silent < SILENCE

    def _held(self, owner: Owner | None) -> Problem:
        who = (
            f"process {owner.process} on {owner.host}, since {owner.since}" if owner else "another"
        )
        return Problem(
            str(self._path.parent),
            "",
            f"a folder that another command is at work in ({who})",
            "one command at a time changes a folder",
            "wait until it ends or stop it, or give another folder with DERIVED=",
        )

    def _live(self) -> None:
        while not self._over.wait(BEAT):
            with suppress(OSError):
                os.utime(self._file)


def _lock(file: int) -> bool | None:
    """Lock an opened file; None where the file system has no locks."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError as error:
        if error.errno not in (errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP, errno.EINVAL):
            raise
        return None
    return True


def _read(file: int) -> Owner | None:
    with suppress(ValueError, TypeError):
        return Owner(**json.loads(os.pread(file, 4096, 0)))
    return None


def _write(file: int, owner: Owner) -> None:
    text = json.dumps(asdict(owner)).encode()
    os.ftruncate(file, 0)
    os.pwrite(file, text, 0)
    os.fsync(file)


def _is_at(file: int, path: Path) -> bool:
    with suppress(FileNotFoundError):
        return os.path.samestat(os.fstat(file), path.stat())
    return False


def _is_running(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:  # another user's
        return True
    return True


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


def journal_mode(folder: Path) -> str:
    """Choose SQLite's journal: a write-ahead log needs memory that all its users share."""
    return "WAL" if is_local(folder) else "TRUNCATE"


def make_folder(folder: Path) -> None:
    """Make a folder, and those above it, to be there after a power cut."""
    new = [one for one in (folder, *folder.parents) if not one.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    for one in reversed(new):
        settle(one.parent)


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
