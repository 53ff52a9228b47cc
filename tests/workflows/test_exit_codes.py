"""Exit code 1 where any stage, or any member of a sweep, has unresolved runs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import Ran

from pipeline import cli
from pipeline.workflow.store import manifest_text, read_manifest

SITE = """rock: {shape: box, size: [0.5, 1.0, 2.0], density: 2110}
motion: {pga: [0.2, 0.4], pgv_pga: [0.2, 0.5]}
simulation: {engine: nonsmooth, time_step: 0.008}
"""


def lose(folder: Path, stage: str, runs: int) -> None:
    """Note in what was kept of a stage that some of its runs are unresolved."""
    path = folder / ".stages" / f"{stage}.json"
    manifest = read_manifest(path)
    assert manifest is not None
    assert manifest["unresolved"] == 0
    path.write_text(manifest_text(manifest | {"unresolved": runs}), encoding="utf-8")


@pytest.fixture
def line(write_site: Callable[..., str], tmp_path: Path) -> tuple[str, ...]:
    (tmp_path / "study.yaml").write_text("sweep: {bounce: {contact.restitution: [0, 0.2]}}")
    return ("--site", write_site(SITE), "--workers", "0")


def test_an_earlier_stage_counts(
    vsr: Callable[..., Ran], line: tuple[str, ...], derived: Path
) -> None:
    assert vsr("run", "fragility", *line).code == cli.DONE
    lose(derived / "rock", "responses", 3)
    ran = vsr("run", "fragility", *line)
    assert ran.code == cli.UNRESOLVED
    assert "3 runs are unresolved" in ran.err


@pytest.mark.slow
def test_an_earlier_member_of_a_sweep_counts(
    vsr: Callable[..., Ran], line: tuple[str, ...], derived: Path, tmp_path: Path
) -> None:
    asked = ("run", "study", *line, "--study", str(tmp_path / "study.yaml"))
    assert vsr(*asked).code == cli.DONE
    lose(derived / "rock" / "studies" / "study" / "bounce=0", "responses", 2)
    ran = vsr(*asked)
    assert ran.code == cli.UNRESOLVED
    assert "2 runs are unresolved" in ran.err
