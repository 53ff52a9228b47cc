"""Work in a process of its own, beside what follows it."""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import signal
import sys
import traceback
from collections.abc import Callable
from contextlib import ExitStack
from multiprocessing.connection import Connection
from multiprocessing.context import ForkProcess
from types import FrameType
from typing import TypeVar

T = TypeVar("T")

POSSIBLE = sys.platform == "linux"
"""Whether a copy of this process may go on with the libraries it has loaded. A process without
them would take longer to load them than what is done aside takes."""


ENDING = 5.0
"""Time [s] that its workers have to end."""

_DEATH_OF_PARENT = 1  # as prctl names it


def begin(work: Callable[[], T], end: ExitStack) -> Callable[[], T]:
    """Begin work in a copy of this process, which may start workers of its own.

    Parameters
    ----------
    work : callable, from nothing to what is to be handed over
    end : ExitStack, at whose end the copy is ended, too

    Returns
    -------
    callable
        It waits for the end of the work, returns its result or raises its error.
    """
    context = multiprocessing.get_context("fork")
    heard, told = context.Pipe(duplex=False)
    process = context.Process(target=_do, args=(work, told, os.getpid()))
    process.start()
    end.callback(_end, process)
    told.close()

    def wait() -> T:
        try:
            result, error = heard.recv()
        except EOFError:
            error = RuntimeError("a process that worked aside died")
        process.join()
        if error is not None:
            raise error
        return result

    return wait


def _end(process: ForkProcess) -> None:
    """End it as Ctrl-C ends the process that waits: its workers first."""
    process.terminate()
    process.join(ENDING)
    process.kill()
    process.join()


def _stop(number: int, frame: FrameType | None) -> None:
    raise SystemExit


def _do(work: Callable[[], object], told: Connection, parent: int) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that waits
    signal.signal(signal.SIGTERM, _stop)  # with which that one ends this one
    ctypes.CDLL(None).prctl(_DEATH_OF_PARENT, signal.SIGTERM)  # and its death by force
    if os.getppid() != parent:
        return
    try:
        told.send((work(), None))
    except Exception as error:  # noqa: BLE001 (raised again by who waits)
        error.add_note("".join(traceback.format_exception(error)))
        error.__cause__ = error.__context__ = None  # a library's, which may not travel
        told.send((None, error))
