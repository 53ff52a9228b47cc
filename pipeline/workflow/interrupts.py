"""Ctrl-C and SIGTERM: when they may come."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker
from types import FrameType


@contextmanager
def held_back() -> Iterator[None]:
    """Let Ctrl-C and SIGTERM wait until something is whole, such as a cluster that starts.

    Processes that start meanwhile never hear Ctrl-C, which a terminal sends to all of them: this
    one ends them.
    """
    came: list[int] = []

    def note(number: int, frame: FrameType | None) -> None:
        came.append(number)

    resource_tracker.ensure_running()  # which unblocks Ctrl-C when it starts
    before = signal.signal(signal.SIGTERM, note)  # where held by the mask, children could not end
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        if came:
            signal.raise_signal(signal.SIGTERM)
