"""Work in a process of its own, beside what follows it."""

from __future__ import annotations

import multiprocessing
import signal
import sys
from collections.abc import Callable
from multiprocessing.connection import Connection

POSSIBLE = sys.platform == "linux"
"""Whether a copy of this process may go on with the libraries it has loaded. A process without
them would take longer to load them than what is done aside takes."""


def begin(work: Callable[[], None]) -> Callable[[], None]:
    """Begin work in a copy of this process.

    Parameters
    ----------
    work : callable, which leaves its results on disk

    Returns
    -------
    callable
        It waits for the end of the work, and raises its error.
    """
    context = multiprocessing.get_context("fork")
    end, told = context.Pipe(duplex=False)
    process = context.Process(target=_do, args=(work, told))
    process.start()
    told.close()

    def wait() -> None:
        try:
            error = end.recv()
        except EOFError:
            error = RuntimeError("a process that worked aside died")
        process.join()
        if error is not None:
            raise error

    return wait


def _do(work: Callable[[], None], told: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that waits
    try:
        work()
    except Exception as error:  # noqa: BLE001 (raised again by who waits)
        told.send(error)
    else:
        told.send(None)
