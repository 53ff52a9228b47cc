"""Errors of tilts, slips and travels against the time step, and what a run costs at it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from pipeline.config import in_si
from pipeline.drawing.style import FAINT, INK, SERIES, styled
from pipeline.stages.runs.quantity_errors import IN_WORDS
from pipeline.stages.runs.scenes import Group, flat_case, terrain_case
from pipeline.stages.runs.study import Study
from pipeline.stages.studies.accuracy import worker_tasks
from pipeline.stages.studies.accuracy.comparison import Record, record
from pipeline.workflow.progress import telling
from pipeline.workflow.stage import Work
from pipeline.workflow.workers import Batch
from vsr_core import engines
from vsr_core.outcome import QUANTITIES
from vsr_core.run import time_step as ladder
from vsr_core.run.cases import Case, Settings, TerrainCase
from vsr_core.run.quantities import exact, summed_up

PULSES, TERRAIN_PULSES = 128, 16
"""Pulses of the sample, over all directions."""

EXACT = {"peak_tilt": "Housner's equation", "slip": "Newmark's sliding block"}
"""Names of exact answers."""

LEAST = 1e-5
"""Errors below it are drawn there."""


def fronts(work: Work, study: Study) -> list[Record]:
    """Errors of every quantity at the steps of the engine's ladder, in the median and 95 %."""
    settings, rock = study.settings, study.scenes.level_rock
    yaws = [in_si.in_degrees(yaw) for yaw in ladder.directions(rock)]
    shares = engines.load(settings.engine).LADDER.shares
    number = (TERRAIN_PULSES if settings.on_terrain else PULSES) // len(yaws)
    unit = ladder.step_unit(rock)

    def batches() -> Iterator[Batch]:
        return (Batch((yaw, share), (number,)) for share in shares for yaw in yaws)

    def shared(place: tuple[float, float]) -> tuple[Case | TerrainCase, Settings]:
        yaw, share = place
        return _case(study, yaw), Settings(
            share * unit, settings.simulation.reduce, settings.engine, whole=True
        )

    told = "tilts, slips and ways at each time step and a sixteenth of it"
    with telling(work.stage, told, work.log):
        found = work.cluster.each(worker_tasks.measure_quantities, batches(), shared)
        done = {place: result for place, _, result in found if result is not None}
    known = exact(_case(study, yaws[0]))
    return [
        line
        for share in shares
        for line in _lines(
            [done[yaw, share] for yaw in yaws if (yaw, share) in done], share, unit, known
        )
    ]


def _case(study: Study, yaw: float) -> Case | TerrainCase:
    place = terrain_case if study.settings.on_terrain else flat_case
    return place(study.scenes, Group(yaw, study.settings.contact.friction[0]))


def _lines(
    done: list[tuple[Any, float]], share: float, unit: float, known: tuple[str, ...]
) -> Iterator[Record]:
    """A line of each quantity that enough runs have, at one step."""
    if not done:
        return
    errors = np.concatenate([found for found, _ in done], axis=1)
    for name, own in zip(QUANTITIES, errors, strict=True):
        error = summed_up(own)
        if np.isnan(error.median):
            continue
        answer = EXACT[name] if name in known else "a sixteenth of the step"
        yield record(
            "quantity",
            IN_WORDS[name],
            f"{1e3 * share * unit:.4g} ms",
            own=True,
            step=share * unit,
            error=error.median,
            worst=error.most,
            rows=error.runs,
            cpu_s=float(np.mean([seconds for _, seconds in done])),
            note=f"error is the median, worst that of 95 %; compared with {answer}",
        )


@styled
def diagram(table: pd.DataFrame, chosen: float) -> Figure:
    """Median and 95 % of the errors of each quantity against the time step.

    Parameters
    ----------
    table : DataFrame, with the records of ``fronts`` as rows
    chosen : float [s]
    """
    groups = table.astype({"error": float, "worst": float, "step": float}).groupby(
        "method", sort=False
    )
    figure = Figure(figsize=(3.1 * max(2, groups.ngroups), 3.4), layout="constrained")
    panels = figure.subplots(1, groups.ngroups, sharey=True, squeeze=False)[0]
    for panel, (name, own) in zip(panels, groups, strict=True):
        steps = 1e3 * own["step"]
        for end, colour, label in (("worst", SERIES[0], "95 %"), ("error", INK, "median")):
            error = 100.0 * own[end].clip(lower=LEAST)
            panel.plot(steps, error, color=colour, marker="o", markersize=4, label=label)
        panel.axvline(1e3 * chosen, color=FAINT, linewidth=0.8)
        panel.set(xscale="log", yscale="log", xlabel="time step [ms]")
        panel.set_title(name, loc="left")
        panel.set_xticks(steps, [f"{step:.2g}" for step in steps])
        panel.xaxis.set_minor_formatter(NullFormatter())
        panel.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        panel.grid(visible=True)
    panels[0].set_ylabel("relative error [%]")
    panels[0].legend(loc="best")
    return figure
