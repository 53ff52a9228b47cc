"""Stability: the stiff and extreme cases, each with its verdict."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import groupby
from typing import Annotated, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from pipeline.config.sections import Key
from pipeline.drawing.style import INK, SERIES, cell_edges, pictures, styled, svg_uri
from pipeline.workflow import pages, writers
from pipeline.workflow.grammar import counted
from pipeline.workflow.progress import telling
from pipeline.workflow.stage import Product, Work
from pipeline.workflow.workers import Batch
from vsr_core.arrays import Array
from vsr_core.verification import stability
from vsr_core.verification.stability import ExtremeCase, Finding, Verdict
from vsr_core.verification.stability.stiffness_map import POINTS, Limits, limits

TABLE, PAGE, PICTURE = "stability.csv", "stability.html", "stability_map"

_BATCH = 2
"""Cases handed to a worker at once, of those that share nothing."""

_HEAVY = ("long_rest", "raw_scans", "stiffness_map")
"""Families that take longest, and so come first."""

_ON_REQUEST = "raw_scans"
"""The family that is only run where it is asked for."""

_DIED = Finding(
    Verdict.WRONG, math.nan, math.nan, math.nan, "the process died in it; see the log of workers"
)


def make(work: Work, raw_scans: Annotated[bool, Key("stability.raw_scans")]) -> Product:
    """Run all cases and say what became of them.

    Parameters
    ----------
    raw_scans : bool, whether those of raw scans are among them

    Returns
    -------
    Product
        Table, page and map of verdicts; a case that is silently wrong counts as unresolved.
    """
    every = stability.cases()
    cases = {name: one for name, one in every.items() if raw_scans or one.family != _ON_REQUEST}
    table = _table(cases, _findings(work, cases))
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


def _findings(work: Work, cases: dict[str, ExtremeCase]) -> dict[str, Finding]:
    order = sorted(cases, key=lambda name: cases[name].family not in _HEAVY)
    batches = _batches(order, cases)
    with telling(work.stage, counted(len(cases), "case"), work.log):
        done = work.cluster.each(run_cases, batches, lambda nothing: nothing)
        return {name: finding or _DIED for _, name, finding in done}


def _batches(order: list[str], cases: dict[str, ExtremeCase]) -> Iterator[Batch]:
    for together, names in groupby(order, lambda name: cases[name].together):
        alike = tuple(names)
        size = len(alike) if together else _BATCH
        for start in range(0, len(alike), size):
            yield Batch(None, alike[start : start + size])


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
        if len(own)
    ]
    facts = {
        "counts": _counts(table),
        "total": len(table),
        "groups": groups,
        "wrong": list(table[table["verdict"] == Verdict.WRONG.value].itertuples()),
        "picture": picture,
        "files": {"table": TABLE, "picture": PICTURE},
        "raw_scans": _ON_REQUEST in set(table["family"]),
    }
    return pages.filled(PAGE, facts)


_TILES: dict[Verdict, Any] = {
    Verdict.RIGHT: {"facecolor": SERIES[4], "hatch": ""},
    Verdict.FLAGGED: {"facecolor": "#f3e3b3", "hatch": "////"},
    Verdict.WRONG: {"facecolor": "#c7362f", "hatch": "xxxx"},
}
"""Each verdict by colour and by hatch: they differ in grey and for a reader who sees no red."""

_LABELS = {
    Verdict.RIGHT: "right",
    Verdict.FLAGGED: "flagged: refused or ended without an outcome",
    Verdict.WRONG: "silently wrong",
}

_GAP = 0.35
"""Between the stiffest spring and the rigid contact, in decades."""


@styled
def stability_map(points: pd.DataFrame, limits: Limits) -> Figure:
    """Verdict at each time step and stiffness, with the limits that the program knows.

    Parameters
    ----------
    points : DataFrame, with ``time_step`` [s], ``stiffness`` [N/m] and ``verdict``
    """
    figure = Figure(figsize=(7.2, 4.9), layout="constrained")
    axes = figure.add_subplot()
    steps = np.log10(np.unique(points["time_step"]))
    finite = np.log10(np.unique(points["stiffness"][np.isfinite(points["stiffness"])]))
    rigid = float(finite[-1]) + 1.0 + _GAP
    edges = cell_edges(steps)
    for step, stiffness, name in points[["time_step", "stiffness", "verdict"]].itertuples(False):
        row = np.searchsorted(steps, math.log10(step))
        left = (math.log10(stiffness) if math.isfinite(stiffness) else rigid) - 0.5
        size = (1.0, edges[row + 1] - edges[row])
        look: Any = {"edgecolor": "white", "linewidth": 1.2, **_TILES[Verdict(name)]}
        axes.add_patch(Rectangle((left, edges[row]), *size, **look))
    _draw_limits(axes, finite, limits, rigid + 0.5)
    axes.set(xlim=(finite[0] - 0.5, rigid + 0.5), ylim=(edges[0], edges[-1]))
    names = [*(f"$10^{{{round(decade)}}}$" for decade in finite), "rigid"]
    axes.set_xticks([*finite, rigid], names)
    axes.set_yticks(steps, [f"{1e3 * 10.0**step:.3g}" for step in steps])
    axes.tick_params(length=0)
    axes.set(xlabel="stiffness of each point of contact [N/m]", ylabel="time step [ms]")
    counts = points["verdict"].value_counts()
    tiles = [
        Patch(edgecolor="white", label=f"{_LABELS[v]} ({counts.get(v.value, 0)})", **look)
        for v, look in _TILES.items()
    ]
    lines, _ = axes.get_legend_handles_labels()
    figure.legend(handles=[*tiles, *lines], loc="outside lower center", ncols=2, handleheight=1.3)
    return figure


def _draw_limits(axes: Axes, finite: Array, limits: Limits, right: float) -> None:
    """What the program checks before a run, over decades of stiffness up to ``right``."""
    ends = finite[0] - 0.5, finite[-1] + 0.5
    longest = math.log10(limits.step)
    axes.plot([ends[0], right], [longest] * 2, color=INK, label="longest step for the rock")
    softest: Any = {"color": INK, "ls": (0, (4, 2)), "label": "softest contact that bears it"}
    axes.axvline(math.log10(limits.stiffness), **softest)
    slope = np.polyfit(finite, np.log10(limits.spring_steps), 1)
    springs: Any = {
        "color": INK,
        "ls": (0, (1, 1.2)),
        "lw": 2.0,
        "label": "longest step for the springs",
    }
    axes.plot(ends, np.polyval(slope, ends), **springs)
