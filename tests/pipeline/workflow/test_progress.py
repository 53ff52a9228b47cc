"""What long work says while it lasts."""

from __future__ import annotations

import time

import pytest

from pipeline.workflow import progress
from pipeline.workflow.progress import Steps


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
