"""Lines for long work: runs done, rate, time left, outcomes so far; or what is being done."""

from __future__ import annotations

import math
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Any

from pipeline.workflow.log import in_notebook, on_screen
from vsr_core.outcome import Outcome

_QUIET_SECONDS = 5.0
_SCREEN_SECONDS = 0.2
_SILENT_SECONDS, _PATIENT_SECONDS = 2.0, 10.0  # before what is being done is told, and told again


_LINES: dict[int, Any] = {}  # by the number of the cell of a notebook that they stand below
_ROUND_SECONDS = 1.0  # after which runs are no further round of those before


class Steps:
    """Says what is being done once it takes two seconds, and every ten seconds from then on."""

    def __init__(self, name: str, log: Callable[[str], None]) -> None:
        self._name, self._log, self._end = name, log, threading.Event()
        self._now: tuple[str, float] = ("", time.monotonic())
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> Steps:
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._end.set()
        self._thread.join()

    def tell(self, what: str) -> None:
        """Say what begins."""
        self._now = (what, time.monotonic())

    def _watch(self) -> None:
        told, due = self._now, _SILENT_SECONDS
        while not self._end.wait(0.1):
            now = self._now
            if now is not told:
                told, due = now, _SILENT_SECONDS
            what, since = now
            if (taken := time.monotonic() - since) >= due:
                self._log(f"{self._name}: {what}, {taken:.0f} s so far")
                due += _PATIENT_SECONDS


@contextmanager
def telling(name: str, what: str, log: Callable[[str], None]) -> Iterator[None]:
    """Says at once what is being done, and every ten seconds that it goes on."""
    log(f"{name}: {what}")
    with Steps(name, log) as steps:
        steps.tell(what)
        yield


class Progress:
    """Counts runs and shows them: in place on a screen, now and then in a log.

    Also while none is done, and of short rounds that follow each other.
    """

    _before = (-math.inf, -math.inf)  # when the last ended, and when its last line was shown

    def __init__(self, total: int, log: Callable[[str], None]) -> None:
        self.total, self._log = total, log
        self.outcomes: Counter[int] = Counter()
        self._screen, self._notebook = on_screen(), in_notebook()
        self._told = False  # in a notebook
        self._start = self._shown = time.monotonic()
        ended, shown = Progress._before
        if self._start - ended < _ROUND_SECONDS:
            self._shown = shown
        self._width = 0  # of the widest line so far, over which others are written
        self._end, self._one_line = threading.Event(), threading.Lock()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> Progress:
        if not self._notebook:
            self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._end.set()
        if self._thread.is_alive():
            self._thread.join()
        Progress._before = time.monotonic(), self._shown
        if self._told:
            self._show(self.line(time.monotonic()))  # which is kept with the notebook
        elif self._screen and not self._notebook:
            self._show("")
            sys.stderr.write("\r")

    def add(self, outcomes: list[int]) -> None:
        """Count finished runs by outcome code."""
        with self._one_line:
            self.outcomes.update(outcomes)
            self._tell(after=_SCREEN_SECONDS if self._screen else _QUIET_SECONDS)

    def _watch(self) -> None:
        while not self._end.wait(0.1):
            with self._one_line:
                self._tell(after=_PATIENT_SECONDS)

    def _tell(self, after: float) -> None:
        now = time.monotonic()
        if now - self._shown >= after:
            (self._show if self._screen else self._log)(self.line(now))
            self._shown = now

    def _show(self, line: str) -> None:
        """Write over what stands there."""
        if self._notebook:
            self._below_cell({"text/plain": line})
            return
        self._width = max(self._width, len(line))
        sys.stderr.write(f"\r{line:<{self._width}}")
        sys.stderr.flush()

    def _below_cell(self, line: dict[str, str]) -> None:
        """Change the one line of a cell; of what is written to it, each change would be kept."""
        from IPython import get_ipython  # where there is a kernel, there is this
        from IPython.display import display

        cell, self._told = get_ipython().execution_count, True
        if cell in _LINES:
            _LINES[cell].update(line, raw=True)
        else:
            _LINES[cell] = display(line, raw=True, display_id=True)

    def line(self, now: float) -> str:
        """The line, at time ``now`` of the monotonic clock [s].

        Parameters
        ----------
        now : float [s]
        """
        done, taken = self.outcomes.total(), max(now - self._start, 1e-9)
        if not done:
            return f"runs 0/{self.total}  {taken:.0f} s so far"
        rate = done / taken
        left = (self.total - done) / rate
        counts = ", ".join(
            f"{n} {Outcome(code).name.lower()}" for code, n in self.outcomes.most_common()
        )
        clock = f"{int(left) // 60}:{int(left) % 60:02d}"
        speed = f"{rate:.0f}" if rate >= 10.0 else f"{rate:.2g}"
        return f"runs {done}/{self.total}  {speed}/s  {clock} left  {counts}"
