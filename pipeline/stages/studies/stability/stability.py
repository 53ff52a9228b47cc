"""Stability: the stiff and extreme cases, each with its verdict."""

from __future__ import annotations

import math

import pandas as pd

from pipeline.drawing.style import pictures, svg_uri
from pipeline.stages.studies.stability.stability_figure import stability_map
from pipeline.workflow import pages, writers
from pipeline.workflow.batches import Batch
from pipeline.workflow.stage import Job, Product
from vsr_core.verification import stability
from vsr_core.verification.stability import ExtremeCase, Finding, Verdict
from vsr_core.verification.stability.stiffness_map import POINTS, limits

TABLE, PAGE, PICTURE = "stability.csv", "stability.html", "stability_map"

_BATCH = 2
"""Cases handed to a worker at once."""

_HEAVY = ("long_rest", "stiffness_map")
"""Families that take longest, and so come first."""

_DIED = Finding(
    Verdict.WRONG, math.nan, math.nan, math.nan, "the process died in it; see the log of workers"
)


def make(job: Job) -> Product:
    """Run all cases and say what became of them.

    Returns
    -------
    Product
        Table, page and map of verdicts; a case that is silently wrong counts as unresolved.
    """
    cases = stability.cases()
    job.log(f"stability: {len(cases)} cases")
    table = _table(cases, _findings(job, cases))
    points = pd.DataFrame.from_dict(POINTS, "index", columns=["time_step", "stiffness"])
    points = points.join(table.set_index("case")["verdict"], how="inner")
    figure = stability_map(points, limits())
    files = {
        TABLE: writers.table(table.drop(columns="reference")),
        PAGE: writers.text(_page(table, svg_uri(figure))),
        **pictures(PICTURE, figure),
    }
    wrong = table["case"][table["verdict"] == Verdict.WRONG.value].tolist()
    summary = ", ".join(f"{count} {verdict}" for verdict, count in _counts(table).items())
    if wrong:
        summary += f": {'; '.join(wrong[:5])}{' ...' if len(wrong) > 5 else ''}"
    return Product(files, summary, unresolved=len(wrong))


def run_cases(shared: None, names: tuple[str, ...]) -> list[Finding]:
    """Run cases on a worker."""
    cases = stability.cases()
    return [cases[name].run() for name in names]


def _findings(job: Job, cases: dict[str, ExtremeCase]) -> dict[str, Finding]:
    order = sorted(cases, key=lambda name: cases[name].family not in _HEAVY)

    starts = range(0, len(order), _BATCH)
    batches = (Batch(None, tuple(order[start : start + _BATCH])) for start in starts)
    done = job.cluster.each(run_cases, batches, lambda nothing: nothing)
    return {name: finding or _DIED for _, name, finding in done}


def _table(cases: dict[str, ExtremeCase], findings: dict[str, Finding]) -> pd.DataFrame:
    """A row a case: the columns of the CSV, and what it is measured against."""
    return pd.DataFrame(
        {
            "case": name,
            "family": case.family,
            "parameter": case.parameter,
            "value": case.value,
            "unit": case.unit,
            "verdict": findings[name].verdict.value,
            "measured": findings[name].measured,
            "expected": findings[name].expected,
            "error": findings[name].error,
            "tolerance": case.tolerance,
            "note": findings[name].note,
            "reference": case.reference,
        }
        for name, case in cases.items()
    )


def _counts(table: pd.DataFrame) -> dict[str, int]:
    """Number of cases by verdict."""
    return {one.value: int((table["verdict"] == one.value).sum()) for one in Verdict}


def _page(table: pd.DataFrame, picture: str) -> str:
    groups = [
        {
            "name": family,
            "about": about,
            "kinds": {
                reference: list(rows.itertuples())
                for reference, rows in own.groupby("reference", sort=False)
            },
            "counts": _counts(own),
        }
        for family, about in stability.families().items()
        for own in [table[table["family"] == family]]
    ]
    facts = {
        "counts": _counts(table),
        "total": len(table),
        "groups": groups,
        "wrong": list(table[table["verdict"] == Verdict.WRONG.value].itertuples()),
        "picture": picture,
        "files": {"table": TABLE, "picture": PICTURE},
    }
    return pages.filled(PAGE, facts)
