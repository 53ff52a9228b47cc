"""Work in a process of its own, beside what follows it."""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import signal
import sys
import traceback
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Generic, TypeVar, cast

from pipeline.config.problems import Unfinished

T = TypeVar("T")

_PR_SET_PDEATHSIG = 1

KILLED = "a process was killed (is there memory enough?); the same command goes on from there"


def possible() -> bool:
    """Whether a copy of this process may go on with the libraries it has loaded.

    A process without them would take longer to load them than what is done aside takes; one of a
    pool has no others of its own.
    """
    return sys.platform == "linux" and not multiprocessing.current_process().daemon


class Begun(Generic[T]):
    """Work that was begun in a copy of this process."""

    def __init__(self, work: Callable[[], T]) -> None:
        context = multiprocessing.get_context("fork")
        self._end, told = context.Pipe(duplex=False)
        given = work, told, os.getpid()
        self._process = context.Process(target=_do, args=given, daemon=True)  # ends with this one
        self._process.start()
        told.close()

    def __call__(self) -> T:
        """Wait for the end of the work, return its result or raise its error.

        Raises
        ------
        Unfinished
            Where its process was killed.
        """
        try:
            result, error = self._end.recv()
        except EOFError:
            error = Unfinished(KILLED)
        self._process.join()
        if error is not None:
            raise error
        return cast(T, result)

    def stop(self) -> None:
        """End it where it is, if it goes on still."""
        self._process.kill()
        self._process.join()


def _do(work: Callable[[], object], told: Connection, parent: int) -> None:
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it was killed meanwhile
        os._exit(1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that waits
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # with which that one ends this one
    try:
        told.send((work(), None))
    except Exception as error:  # noqa: BLE001 (raised again by who waits)
        error.add_note("".join(traceback.format_exception(error)))
        error.__cause__ = error.__context__ = None  # a library's, which may not travel
        told.send((None, error))
