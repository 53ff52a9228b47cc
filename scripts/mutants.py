"""Single faults put into the code one by one: which of them the tests notice.

    python -m scripts.mutants               all of scripts/mutants.yaml; an hour on two cores
    python -m scripts.mutants fits keys     those whose area or description holds one of the words

Each is put into a copy of the checkout in a temporary folder. The tests that concern it run first,
then those of whole products, then all; the first failure ends them. The exit code is 1 if fewer
than 95 of 100 are noticed, 2 if a fault does not fit the code or the tests fail without any.
"""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from queue import SimpleQueue
from threading import Lock

import yaml

from pipeline import ROOT

TABLE = ROOT / "scripts" / "mutants.yaml"

SHARE = 0.95
"""Of the faults, that the tests have to notice."""

LONGEST = 1800.0
"""Time for the tests of a fault [s]: one that never ends is noticed, too."""

PYTEST = ("-m", "pytest", "-x", "-q", "--no-header", "--tb=no", "-p", "no:cacheprovider")


ALL = ("-n", "auto", "--dist", "loadfile", "--ignore=tests/scripts")
"""All tests but those of this module, which any fault fails."""


@dataclass(frozen=True)
class Fault:
    """A single fault.

    Attributes
    ----------
    area, what : str, what it is about, and what is wrong
    file : str, that it is in
    before, after : str, text of the code, which stands in the file once, and of the fault
    stages : tuple of tuples of str, tests that run one after the other
    """

    area: str
    what: str
    file: str
    before: str
    after: str
    stages: tuple[tuple[str, ...], ...]

    def __str__(self) -> str:
        return f"{self.area}: {self.what}"

    def misfit(self, root: Path) -> str:
        """Why it cannot be put into the code of a folder, or an empty text.

        Parameters
        ----------
        root : Path

        Returns
        -------
        str
        """
        path = root / self.file
        if not path.is_file():
            return f"{self.file} is not there"
        text = path.read_text(encoding="utf-8")
        if (found := text.count(self.before)) != 1:
            return f"{self.file} has its text {found} times, not once"
        try:
            ast.parse(text.replace(self.before, self.after))
        except SyntaxError as error:
            return f"{self.file} is no Python with it: {error}"
        gone = [test for stage in self.stages for test in stage if not (root / test).exists()]
        return f"{gone[0]}, which tests it, is not there" if gone else ""


def faults(words: Sequence[str] = ()) -> tuple[Fault, ...]:
    """The faults of the table.

    Parameters
    ----------
    words : sequence of str, of which an area or a description holds one; all faults if empty

    Returns
    -------
    tuple of Fault
    """
    table = yaml.safe_load(TABLE.read_text(encoding="utf-8"))
    found = [
        Fault(area, what, stages=(tuple(room["near"]), tuple(room["wide"])), **text)
        for area, room in table.items()
        for what, text in room["faults"].items()
    ]
    return tuple(one for one in found if not words or any(word in str(one) for word in words))


class Copy:
    """A copy of the checkout, into which one fault at a time is put.

    Its machine code is known by its folder, so it is kept for one fault after the other.

    Parameters
    ----------
    folder : Path, that does not exist yet
    """

    _ticks = count(1)

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        listed = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
        names = subprocess.run(listed, cwd=ROOT, capture_output=True, check=True).stdout.decode()
        for name in filter(None, names.split("\0")):
            if (ROOT / name).is_file():
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, folder / name)
        if (ROOT / ".venv").is_dir():  # by which commands of the documentation are looked at
            (folder / ".venv").symlink_to(ROOT / ".venv")
        self._run("-m", "vsr_core.run")
        self._compiled = set(self._machine_code())

    def notices(self, fault: Fault) -> str:
        """Which test, that does not fail without it, notices a fault, or an empty text.

        Parameters
        ----------
        fault : Fault

        Returns
        -------
        str
        """
        path = self._folder / fault.file
        text = path.read_text(encoding="utf-8")
        self._write(path, text.replace(fault.before, fault.after))
        try:
            stages = (*fault.stages, ALL)
            found = next(filter(None, map(self.failing, stages)), "")
        finally:
            self._write(path, text)
            for folder in set(self._machine_code()) - self._compiled:
                shutil.rmtree(folder)
        _, _, test = found.partition(" ")
        return "" if "::" in test and self.failing([test.partition(" - ")[0]]) else found

    def failing(self, tests: Sequence[str]) -> str:
        """What fails first of some tests, or an empty text.

        Parameters
        ----------
        tests : sequence of str, paths and options of pytest

        Returns
        -------
        str
        """
        try:
            done = self._run(*PYTEST, *tests)
        except subprocess.TimeoutExpired:
            return "no end of the tests"
        lines = done.stdout.splitlines()
        failed = [line for line in lines if line.startswith(("FAILED", "ERROR"))]
        return "" if done.returncode == 0 else (failed or lines[-1:] or ["no test"])[0]

    def _write(self, path: Path, text: str) -> None:
        """Write a module, at a time that no bytecode of it can be from."""
        path.write_text(text, encoding="utf-8")
        moment = time.time() + next(self._ticks)
        os.utime(path, (moment, moment))

    def _machine_code(self) -> Iterator[Path]:
        return (self._folder / "vsr_core" / "__pycache__").glob("compiled-*")

    def _run(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run Python in the copy, and nothing of the checkout that it is installed from."""
        environment = {**os.environ, "PYTHONPATH": str(self._folder)}
        return subprocess.run(
            [sys.executable, *arguments],
            cwd=self._folder,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
            timeout=LONGEST,
        )


def measure(wanted: Sequence[Fault], folder: Path) -> int:
    """Put faults into copies of the code, one in each at a time, and tell which are noticed.

    Parameters
    ----------
    wanted : sequence of Fault
    folder : Path, of the copies

    Returns
    -------
    int, how many are noticed; less than 0 if the tests fail without a fault
    """
    jobs = min(os.cpu_count() or 1, len(wanted))
    with ThreadPoolExecutor(jobs) as pool:
        copies: SimpleQueue[Copy] = SimpleQueue()
        for copy in pool.map(Copy, (folder / str(job) for job in range(jobs))):
            copies.put(copy)
        tests = sorted({test for fault in wanted for stage in fault.stages for test in stage})
        copy = copies.get()
        if failing := copy.failing(tests):
            print(f"without a fault: {failing}", file=sys.stderr)
            return -1
        copies.put(copy)
        told = Lock()

        def try_one(fault: Fault) -> bool:
            copy, begun = copies.get(), time.monotonic()
            noticed = copy.notices(fault)
            copies.put(copy)
            with told:
                spent = f"{time.monotonic() - begun:4.0f} s"
                print(f"{spent}  {fault}: {noticed or 'NOT NOTICED'}", flush=True)
            return bool(noticed)

        return sum(pool.map(try_one, wanted))


def main(words: Sequence[str]) -> int:
    """Measure the tests.

    Parameters
    ----------
    words : sequence of str, as ``faults`` takes them

    Returns
    -------
    int, the exit code
    """
    wanted = faults(words)
    misfits = [f"{fault}: {why}" for fault in wanted if (why := fault.misfit(ROOT))]
    if misfits or not wanted:
        print("\n".join(misfits) or "no such fault", file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory() as folder:
        noticed = measure(wanted, Path(folder))
    if noticed < 0:
        return 2
    print(f"{noticed} of {len(wanted)} faults noticed ({noticed / len(wanted):.0%})")
    return 0 if noticed >= SHARE * len(wanted) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
