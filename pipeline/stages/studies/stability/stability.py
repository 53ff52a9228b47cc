"""Stability: the stiff and extreme cases, each with its verdict."""

from __future__ import annotations

import importlib
import math
from collections.abc import Iterator, Sequence
from typing import Any

from pipeline.drawing.style import pictures, svg_uri
from pipeline.stages.studies.stability.stability_figure import stability_map
from pipeline.workflow import pages, writers
from pipeline.workflow.cluster import Batch
from pipeline.workflow.stage import Job, Product
from vsr_core.verification import stability
from vsr_core.verification.stability import Case, Finding, Verdict
from vsr_core.verification.stability.stiffness_map import POINTS, limits

TABLE, PAGE, PICTURE = "stability.csv", "stability.html", "stability_map"

BATCH = 2
"""Cases handed to a worker at once."""

HEAVY = ("rest", "map")
"""Families that take longest, and so come first."""

COLUMNS = ("case", "family", "parameter", "value", "unit", "verdict", "measured", "expected",
           "error", "tolerance", "note")  # fmt: skip

DIED = Finding(
    Verdict.WRONG, math.nan, math.nan, math.nan, "the process died in it; see the log of workers"
)

Record = dict[str, Any]


def make(job: Job) -> Product:
    """Run all cases and say what became of them."""
    cases = stability.cases()
    job.log(f"stability: {len(cases)} cases")
    findings = _findings(job, cases)
    records = [_record(case, findings[name]) for name, case in cases.items()]
    figure = stability_map(_points(cases, findings), limits())
    text = _page(records, cases, svg_uri(figure))
    counts = _counts(records)
    files = {
        TABLE: writers.table(COLUMNS, records),
        PAGE: writers.text(text),
        **pictures(PICTURE, figure),
    }
    wrong = [record["case"] for record in _wrong(records)]
    summary = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
    if wrong:
        summary += f": {'; '.join(wrong[:5])}{' ...' if len(wrong) > 5 else ''}"
    return Product(files, summary, unresolved=len(wrong))


def run_cases(shared: None, names: tuple[str, ...]) -> list[Finding]:
    """Findings of the cases of those names, on a worker."""
    cases = stability.cases()
    return [cases[name].run() for name in names]


def _findings(job: Job, cases: dict[str, Case]) -> dict[str, Finding]:
    order = sorted(cases, key=lambda name: cases[name].family not in HEAVY)

    def batches() -> Iterator[Batch]:
        for start in range(0, len(order), BATCH):
            names = tuple(order[start : start + BATCH])
            yield Batch(names, "cases", names)

    found: dict[str, Finding] = {}
    for batch, results in job.cluster.run(run_cases, batches(), lambda name: None):
        found |= zip(batch.items, results or [DIED] * len(batch.items), strict=True)
    return found


def _record(case: Case, finding: Finding) -> Record:
    return {
        "case": case.name,
        "family": case.family,
        "parameter": case.parameter,
        "value": case.value,
        "unit": case.unit,
        "verdict": finding.verdict.value,
        "measured": finding.measured,
        "expected": finding.expected,
        "error": finding.error,
        "tolerance": case.tolerance,
        "note": finding.note,
    }


def _counts(records: Sequence[Record]) -> dict[str, int]:
    return {v.value: sum(record["verdict"] == v.value for record in records) for v in Verdict}


def _wrong(records: Sequence[Record]) -> list[Record]:
    return [record for record in records if record["verdict"] == Verdict.WRONG.value]


def _points(cases: dict[str, Case], findings: dict[str, Finding]) -> list[Record]:
    """The map's cases, by time step [s] and stiffness [N/m]."""
    return [
        {"time_step": step, "stiffness": stiffness, "verdict": findings[name].verdict.value}
        for name, (step, stiffness) in POINTS.items()
        if name in findings
    ]


def _page(records: list[Record], cases: dict[str, Case], picture: str) -> str:
    groups = []
    for family in stability.families():
        own = [record for record in records if record["family"] == family]
        kinds: dict[str, list[Record]] = {}
        for record in own:
            kinds.setdefault(cases[record["case"]].reference, []).append(record)
        groups.append(
            {"name": family, "about": _about(family), "kinds": kinds, "counts": _counts(own)}
        )
    facts = {
        "counts": _counts(records),
        "total": len(records),
        "groups": groups,
        "wrong": _wrong(records),
        "picture": picture,
        "files": {"table": TABLE, "picture": PICTURE},
    }
    return pages.filled(PAGE, facts)


def _about(family: str) -> str:
    """First line of a family's docstring."""
    text = importlib.import_module(f"{stability.__name__}.{family}").__doc__ or ""
    return text.partition("\n")[0].rstrip(".")
