"""What long work says while it lasts."""

from __future__ import annotations

import subprocess
import sys
import time

import nbclient
import nbformat
import pytest

from pipeline import ROOT
from pipeline.workflow import progress
from pipeline.workflow.progress import Progress, Steps


def test_a_step_that_lasts_is_told_and_one_that_does_not_is_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(progress, "_SILENT_SECONDS", 0.3)
    lines: list[str] = []
    with Steps("scan", lines.append) as steps:
        steps.tell("reading")
        steps.tell("closing")
        end = time.monotonic() + 60.0
        while not lines and time.monotonic() < end:
            time.sleep(0.01)
    assert [line.rpartition(", ")[0] for line in lines] == ["scan: closing"]
    assert lines[0].endswith(" s so far")


def test_short_rounds_that_follow_each_other_are_told_of(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "_QUIET_SECONDS", 0.5)
    lines: list[str] = []
    end = time.monotonic() + 60.0
    while not lines and time.monotonic() < end:
        with Progress(2, lines.append) as runs:
            time.sleep(0.1)
            runs.add([0])
    assert lines[0].startswith("runs 1/2  ")


def test_a_long_run_is_told_of_before_it_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "_PATIENT_SECONDS", 0.3)
    lines: list[str] = []
    with Progress(4, lines.append):
        end = time.monotonic() + 60.0
        while not lines and time.monotonic() < end:
            time.sleep(0.01)
    assert lines[0].startswith("runs 0/4  ")
    assert lines[0].endswith(" s so far")


@pytest.mark.slow
def test_a_notebook_keeps_one_line_of_all_that_was_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    runs = (
        "import time\n"
        "from pipeline.workflow.progress import Progress\n"
        "for total in (3, 6):\n"
        "    with Progress(total, print) as progress:\n"
        "        for outcome in (0, 0, 0, 1, 1, 1)[:total]:\n"
        "            time.sleep(0.25)\n"
        "            progress.add([outcome])\n"
    )
    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(runs)])
    nbclient.NotebookClient(book, timeout=120).execute()
    (shown,) = book.cells[0]["outputs"]
    assert shown["output_type"] == "display_data"
    assert shown["data"]["text/plain"].startswith("runs 6/6 ")
    assert shown["data"]["text/plain"].endswith("3 balanced, 3 overturned")


def test_a_warning_of_a_library_is_told_in_one_line_once() -> None:
    """Also one that the library has shown always, and none that Python leaves out."""
    program = (
        "import warnings\n"
        "from pipeline.workflow.log import tell_warnings_once\n"
        "tell_warnings_once()\n"
        "where = 'lib/site-packages/sklearn/x.py', 7\n"
        "warnings.simplefilter('always', UserWarning, append=True)\n"
        "for text in ('one\\ncause', 'one\\ncause', 'another'):\n"
        "    warnings.warn_explicit(text, UserWarning, *where)\n"
        "warnings.warn_explicit('old', DeprecationWarning, *where)\n"
        "warnings.warn_explicit('of no file', RuntimeWarning, 'sys', 1)\n"
        "warnings.warn_explicit('of none', RuntimeWarning, '', 1)\n"
    )
    ran = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert ran.stderr.splitlines() == [
        "vsr: warning of sklearn: UserWarning: one cause",
        "vsr: warning of sklearn: UserWarning: another",
        "vsr: warning of sys: RuntimeWarning: of no file",
        "vsr: warning of Python: RuntimeWarning: of none",
    ]
