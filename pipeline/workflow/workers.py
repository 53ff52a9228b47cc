"""What is done on a worker: a batch, by the same code as the client's, one at a time in a process.

Engines keep state that all threads of a process share. A batch whose worker died is done item by
item in a process of its own, so that a run that kills its process takes nothing else along.
"""

from __future__ import annotations

import ctypes
import importlib
import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Hashable, Iterator
from contextlib import nullcontext, suppress
from functools import lru_cache
from typing import IO, Any, NamedTuple

from pipeline.workflow import provenance
from pipeline.workflow.log import tell_warnings_once

BATCHES_IN_FLIGHT = 4
"""Batches handed out per worker: enough to keep it busy, few enough to lose."""

Work = Callable[[Any, tuple[Any, ...]], Any]
"""From what the items of a batch share, and the items, to their results."""


class Batch(NamedTuple):
    """Items that share one object, done together by one worker."""

    shared: Hashable
    items: tuple[Any, ...]


class Done(NamedTuple):
    """Results of a batch; None if its only item killed its process."""

    batch: Batch
    results: Any


TRIES = 3
"""How often an item may kill the process that it has for itself before it is the culprit."""

_ONE = threading.Lock()
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # as mallopt names them
_KEPT, _LARGE = 1 << 28, 1 << 25  # bytes; glibc allows no larger second one


class Task(NamedTuple):
    """A batch as it travels to a worker, without what its items share.

    Attributes
    ----------
    together : bool, whether several batches may be done at once in a process
    apart : bool, whether it is to be done item by item in a process of its own
    """

    function: Work
    items: tuple[Any, ...]
    together: bool
    apart: bool


def door() -> Callable[[bytes, bytes, str], Any]:
    """Function that does a task on a worker, whatever that worker has installed.

    Dask sends it as it is, not by its name: a worker that could not import it would die.

    Returns
    -------
    callable
        It takes a Task and what its items share, both pickled, and the key of the client's
        ``Provenance``; it returns a pair: whether the worker may do the task, and what it made, or
        why not.
    """

    def enter(task: bytes, shared: bytes, client: str) -> tuple[bool, Any]:
        try:
            mine = importlib.import_module("pipeline.workflow.provenance").here()
            if mine.key != client:
                return False, (mine.code, mine.libraries)
        except (ImportError, AttributeError) as error:
            return False, str(error)
        return True, importlib.import_module("pipeline.workflow.workers").do(task, shared)

    return enter


def do(task: bytes, shared: bytes) -> Any:
    """Do a batch."""
    function, items, together, apart = pickle.loads(task)  # noqa: S301 (from our client)
    thing = _unpickled(shared)
    if apart:
        return _apart(function, thing, items)
    with nullcontext() if together else _ONE:
        return function(thing, items)


@lru_cache(maxsize=4)
def _unpickled(shared: bytes) -> Any:
    return pickle.loads(shared)  # noqa: S301 (from our client)


def _apart(function: Work, shared: Any, items: tuple[Any, ...]) -> list[Any]:
    """Results of single items in a process of their own, anew from where that dies."""
    results: list[Any] = []
    deaths = 0
    while len(results) < len(items):
        done = list(_in_child(function, shared, items[len(results) :]))
        results += done
        deaths = 1 if done else deaths + 1
        if deaths == TRIES and len(results) < len(items):
            results.append(None)
            deaths = 0
    return results


def _keep_memory() -> None:
    """Have malloc keep what is freed.

    Dask makes it give memory back at once; with that, rebuilding Bullet's world for each run costs
    more than its physics.
    """
    with suppress(OSError, AttributeError):  # another library of C
        library = ctypes.CDLL(None)
        library.mallopt(_TRIM_THRESHOLD, _KEPT)
        library.mallopt(_MMAP_THRESHOLD, _LARGE)


def dask_setup(worker: Any) -> None:
    """Dask calls this in each worker that we start: Ctrl-C is for the client, which ends them."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _keep_memory()
    tell_warnings_once()
    provenance.here()  # before any of it is edited


# A process for single items


def _in_child(function: Work, shared: Any, items: tuple[Any, ...]) -> Iterator[Any]:
    """Results of items, one after the other, until the process that does them dies."""
    from distributed.protocol.pickle import dumps  # which takes functions of any place

    command = [sys.executable, "-c", "from pipeline.workflow import workers; workers.serve()"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    pipe, nowhere = subprocess.PIPE, subprocess.DEVNULL
    with subprocess.Popen(  # noqa: S603
        command, stdin=pipe, stdout=pipe, stderr=nowhere, env=environment
    ) as child:
        assert child.stdin is not None
        assert child.stdout is not None
        try:
            with suppress(BrokenPipeError, EOFError):
                _send(child.stdin, dumps((function, shared)))
                for item in items:
                    _send(child.stdin, dumps(item))
                    result, error = _received(child.stdout)
                    if error is not None:
                        raise error
                    yield result
        finally:
            child.kill()
            with suppress(BrokenPipeError):
                child.stdin.close()


def serve() -> None:
    """Do the items that come in, one by one, until no more come."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _keep_memory()
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what is printed must not get between the results
    with suppress(EOFError, BrokenPipeError):
        function, shared = _received(sys.stdin.buffer)
        while True:
            item = _received(sys.stdin.buffer)
            answer: tuple[Any, Exception | None]
            try:
                answer = function(shared, (item,)), None
            except Exception as error:  # noqa: BLE001 (it is raised where the batch came from)
                answer = None, error
            _send(out, pickle.dumps(answer))


def _send(stream: IO[bytes], content: bytes) -> None:
    stream.write(len(content).to_bytes(8, "big") + content)
    stream.flush()


def _received(stream: IO[bytes]) -> Any:
    length = int.from_bytes(_exactly(stream, 8), "big")
    return pickle.loads(_exactly(stream, length))  # noqa: S301 (from our own process)


def _exactly(stream: IO[bytes], length: int) -> bytes:
    content = stream.read(length)
    if len(content) < length:
        raise EOFError
    return content
