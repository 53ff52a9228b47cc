"""The page of claims: every claim, what was computed, the verdict, and the figures themselves."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

from pipeline.drawing.style import data_uri
from pipeline.stages.figures import paper
from pipeline.stages.figures.paper import Finding
from pipeline.workflow import keys, pages, writers
from pipeline.workflow.store import Store

PAGE = "claims.html"

LONGEST_TEST = 60.0
"""Time of one experiment that the paper gives [s], "a few seconds up to a minute"."""


def publish(store: Store, derived: Path) -> None:
    """Fill in the page from the figures that are there, unless it is so already.

    Parameters
    ----------
    derived : Path, of all products, whose logs say how long runs took
    """
    sections = [_section(store, name) for name in paper.names()]
    speed = speed_findings(derived)
    rows = [finding for section in sections for finding in section["findings"]] + speed
    facts = {
        "sections": sections,
        "speed": speed,
        "counts": Counter(finding.verdict for finding in rows),
        "verdicts": (paper.FOUND, paper.NOT_FOUND, paper.NOT_TESTABLE),
        "total": len(rows),
    }
    text = pages.filled(PAGE, facts)
    key = keys.digest_bytes(text.encode())
    if (store.manifest("claims") or {}).get("key") == key and not store.damage("claims"):
        return
    store.open()
    manifest = {"key": key, "facts": {}, "unresolved": 0, "retry": 0}
    store.publish("claims", manifest, {PAGE: writers.text(text)})


def _section(store: Store, name: str) -> dict[str, Any]:
    """Title, picture and findings of a figure; without the latter two if it was never made."""
    label, option = _label(name), name.removeprefix("fig_").lstrip("0")
    section: dict[str, Any] = {"name": name, "label": label, "option": option, "findings": []}
    section |= {"title": paper.load(name).TITLE, "image": ""}
    if store.manifest(name) is None or store.damage(name):
        return section
    stored = json.loads((store.folder / f"{name}.json").read_text(encoding="utf-8"))
    section["findings"] = [Finding(**finding) for finding in stored["findings"]]
    section["image"] = data_uri((store.folder / f"{name}.png").read_bytes(), "png")
    return section


def _label(name: str) -> str:
    """Name of a figure in words.

    >>> _label("fig_08"), _label("table_1"), _label("fig_friction")
    ('Fig. 8', 'Table 1', 'Friction')
    """
    kind, _, number = name.partition("_")
    if not number[:1].isdigit():
        return number.capitalize()
    return f"{'Fig.' if kind == 'fig' else 'Table'} {number.lstrip('0')}"


def speed_findings(derived: Path) -> list[Finding]:
    """Findings on the paper's claims on speed, from the logs of the runs."""
    measured, slowest = [], 0.0
    for site, stage, what in (
        ("double_rock", "runs", "Double Rock on a flat pedestal"),
        ("double_rock_terrain", "displacement_runs", "with its whole trajectory over the terrain"),
    ):
        notes = [note for note in Store(derived / site).notes(stage) if note["runs"]]
        if notes:
            number = sum(note["runs"] for note in notes)
            each = sum(note["cpu_seconds"] for note in notes) / number
            slowest = max(slowest, each)
            measured.append(f"{1e3 * each:.2g} ms of CPU a run, {what} ({number:,} runs)")
    known = "; ".join(measured) or "no run was logged yet"
    return [
        Finding(
            "section 6.1",
            "One overturning experiment takes a few seconds up to a minute.",
            f"the CPU time of a run is at most {LONGEST_TEST:g} s",
            known,
            slowest <= LONGEST_TEST if measured else None,
        ),
        Finding(
            "sections 2.2 and 6.1",
            "A physics engine is 10 to 250 times as fast as a discrete-element code.",
            "ratio of the run times on one scene",
            "no discrete-element code is part of this project",
            None,
        ),
    ]
