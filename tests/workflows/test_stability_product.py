"""`vsr run stability` on a few quick cases, and what a silently wrong one does."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from conftest import Ran
from matplotlib.figure import Figure

from vsr_core.errors import InvalidInput
from vsr_core.verification import stability
from vsr_core.verification.stability import ExtremeCase, Measured

COMMAND = ("run", "stability", "--site", "cuboid_1x1x2", "--workers", "0")


QUICK = ("fall at 0.008 in bullet", "sliding at 0.3 in bullet")


def refuses() -> Measured:
    raise InvalidInput("a step of a year", "it is shorter", "shorten it")


@pytest.fixture
def cases(monkeypatch: pytest.MonkeyPatch) -> dict[str, ExtremeCase]:
    """Real cases, and two made of the first of them: one that is refused, one that is wrong."""
    some = {name: case for name, case in stability.cases().items() if name in QUICK}
    assert set(some) == set(QUICK)
    first = some[QUICK[0]]
    some["refused"] = replace(first, name="refused", measure=refuses)
    off = replace(
        first, name="off by a tenth", tolerance=0.09, measure=lambda: Measured(1.1, 1, 0.1)
    )
    some["off by a tenth"] = off
    monkeypatch.setattr(stability, "cases", lambda: some)
    map_of = "pipeline.stages.studies.stability.stability_map"
    monkeypatch.setattr(map_of, lambda *given: Figure(figsize=(0.1, 0.1)))  # of the whole map only
    return some


def test_verdicts_table_page_and_exit_code(
    cases: dict[str, ExtremeCase], vsr: Callable[..., Ran], derived: Path
) -> None:
    ran = vsr(*COMMAND)
    assert ran.code == 1
    assert "1 case is silently wrong; stability.html says which" in ran.err
    folder = derived / "cuboid_1x1x2"
    with (folder / "stability.csv").open(newline="") as file:
        rows = {row["case"]: row for row in csv.DictReader(file)}
    assert list(rows) == list(cases)
    verdicts = {name: row["verdict"] for name, row in rows.items()}
    expected = dict.fromkeys(QUICK, "right") | {"refused": "flagged"}
    assert verdicts == expected | {"off by a tenth": "silently wrong"}
    for name in QUICK:
        row = rows[name]
        assert 0.0 <= float(row["error"]) <= float(row["tolerance"])
    assert "shorten it" in rows["refused"]["note"]
    assert float(rows["off by a tenth"]["measured"]) == 1.1
    page = (folder / "stability.html").read_text(encoding="utf-8")
    assert page.index("off by a tenth") < page.index(QUICK[0])  # what is wrong comes first
    assert (folder / "stability_map.png").is_file()

    del cases["off by a tenth"]
    assert vsr(*COMMAND, into=folder.parent / "again").code == 0
