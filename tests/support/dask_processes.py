"""A Dask scheduler and its workers as processes, to be joined, left and killed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from pipeline import ROOT

PATIENCE = 60.0
"""Time [s] that a process has to start."""


class Farm:
    """A scheduler, and workers that come and go.

    Parameters
    ----------
    folder : Path, for their files
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir(exist_ok=True)
        self.workers: list[subprocess.Popen[bytes]] = []
        file = folder / "scheduler.json"
        self.scheduler = self._start("scheduler", "--port", "0", "--scheduler-file", str(file))
        deadline = time.monotonic() + PATIENCE
        while not file.exists() or not file.read_text():
            assert time.monotonic() < deadline
            time.sleep(0.05)
        self.address = json.loads(file.read_text())["address"]

    def __enter__(self) -> Farm:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.end()

    def end(self) -> None:
        """Kill them all."""
        for process in (*self.workers, self.scheduler):
            _kill(process)

    def worker(self, *options: str, code: Path = ROOT) -> subprocess.Popen[bytes]:
        """Start a worker, of the code in a folder.

        Parameters
        ----------
        options : of ``dask worker``, besides one thread and no nanny
        code : Path

        Returns
        -------
        Popen
        """
        given = ("--nthreads", "1", "--no-nanny", "--death-timeout", "60", *options)
        started = self._start(
            "worker", self.address, *given, "--local-directory", str(self.folder), code=code
        )
        self.workers.append(started)
        return started

    def _start(self, what: str, *options: str, code: Path = ROOT) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "distributed.cli.dask_" + what, *options]
        with (self.folder / f"{what}.log").open("ab") as log:
            return subprocess.Popen(
                [*command, "--host", "127.0.0.1", "--no-dashboard"],
                stdout=log,
                stderr=log,
                cwd=code,
                env={**os.environ, "PYTHONPATH": str(code)},
                start_new_session=True,
            )


def _kill(process: subprocess.Popen[bytes]) -> None:
    """A process with all that it has started."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
