"""What the accuracy stage hands to its workers, and the records made of what comes back."""

from __future__ import annotations

import random
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from itertools import combinations, product
from typing import Any, NamedTuple

import numpy as np

from pipeline.config import in_si
from pipeline.config.motion_schema import PulseConfig
from pipeline.config.schema import COMPILED
from pipeline.stages.runs.scenes import Group, flat_case, terrain_case
from pipeline.stages.runs.study import Study
from pipeline.stages.studies.accuracy import worker_tasks
from pipeline.stages.studies.accuracy.worker_tasks import Way
from pipeline.workflow.grammar import counted
from pipeline.workflow.progress import telling
from pipeline.workflow.stage import Work
from pipeline.workflow.workers import Batch
from vsr_core import engines
from vsr_core.errors import InvalidInput
from vsr_core.outcome import Outcome
from vsr_core.rock.body import Rock
from vsr_core.run import time_step as ladder
from vsr_core.run.cases import Case, Settings, TerrainCase
from vsr_core.verification import other_engines, reference, sensitivity
from vsr_core.verification.work_precision import Score, Target

MOST_ROWS = 4
"""Rows on which ways of running are compared; some take seconds a run."""

CELLS, TERRAIN_CELLS = 160, 16
"""Cells of the grid that are run in every engine and at a sixteenth of the step."""

STEPS = tuple(1.0 / n for n in (240, 480, 1000, 2000, 4000, 8000, 16000, 32000))
"""Time steps of the reference suite [s]."""

COLUMNS = ("part", "method", "setting", "error", "worst", "rows", "cpu_s", "lost", "note")

Record = dict[str, Any]
"""A line of the table by ``COLUMNS``; and ``own``, whether it is of this project, ``step`` of its
setting, in the unit of its method, and of the reference suite ``case`` and ``engine``."""

Place = tuple[float, float]
"""Yaw [degree] and PGV/PGA [s] of a row."""


class SampledCell(NamedTuple):
    """A cell of the grid, and its outcomes by how it was run: an engine, or ``FINE``.

    Attributes
    ----------
    yaw, pgv_pga, pga : float [degree], [s], [g]
    """

    yaw: float
    pgv_pga: float
    pga: float
    outcomes: dict[str, int]


FINE = "fine"
"""Name of the runs at a sixteenth of the step."""


def installed(*, on_terrain: bool = False) -> tuple[str, ...]:
    """List the engines whose library is there, on a terrain those that hold one."""
    found = []
    for name in (COMPILED, "bullet") if on_terrain else engines.names():
        try:
            engines.load(name)
        except InvalidInput:
            continue
        found.append(name)
    return tuple(found)


def _places(rock: Rock) -> list[Place]:
    """At most ``MOST_ROWS`` usual rows: each direction once, short and long pulses in turn."""
    usual, periods = ladder.lots(rock)[0], ladder.periods(rock)
    yaws = [in_si.in_degrees(yaw) for yaw in dict.fromkeys(place.yaw for place in usual)]
    if len(yaws) * len(periods) <= MOST_ROWS:
        return list(product(yaws, periods))
    return [(yaw, periods[at % len(periods)]) for at, yaw in enumerate(yaws)][:MOST_ROWS]


def find_targets(work: Work, study: Study) -> dict[Place, Target]:
    """Find what is right on the rows of the site that something topples."""
    names = (COMPILED,) if study.settings.on_terrain else installed()
    batches = (Batch(yaw, ((ratio, names),)) for yaw, ratio in _places(study.scenes.rock))
    with telling(work.stage, "references of the boundaries", work.log):
        done = work.cluster.each(worker_tasks.find_target, batches, partial(_case, study))
        found = {(yaw, ratio): target for yaw, (ratio, _), target in done if target is not None}
    return {place: target for place, target in sorted(found.items()) if target.passing}


def score_ways(work: Work, study: Study, targets: dict[Place, Target]) -> list[Record]:
    """Score every way of running on every row, summed up over the rows."""
    case = _case(study, 0.0)
    engine = study.settings.engine
    ways = [("project", name) for name in installed(on_terrain=study.settings.on_terrain)]
    if isinstance(case, Case):
        ways += [("peer", n) for n in other_engines.names() if not other_engines.missing(n)]
        ways += [
            ("sweep", str(number))
            for number, variation in enumerate(sensitivity.variations())
            if engine in variation.engines and case.full.rock.shape in variation.shapes
        ]

    def shared(place: Place) -> tuple[Case | TerrainCase, Target, Settings]:
        return _case(study, place[0]), targets[place], study.how(_group(study, place[0]))

    boundaries = counted(len(targets), "boundary", "boundaries")
    batches = (Batch(place, (way,)) for way in ways for place in targets)
    scored: dict[Way, list[Score]] = defaultdict(list)
    with telling(work.stage, f"{counted(len(ways), 'way')} of running on {boundaries}", work.log):
        for _, _, results in work.cluster.each(worker_tasks.score, batches, shared):
            for way, found in results or ():
                scored[way].append(found)
    return [
        record(
            way.part,
            way.method,
            way.setting,
            own=way.own,
            step=way.step,
            error=kept([score.error for score in scores]),
            worst=max(score.error for score in scores),
            rows=len(scores),
            cpu_s=sum(score.seconds for score in scores) / len(scores),
            lost=sum(score.lost for score in scores),
        )
        for way, scores in sorted(scored.items())
    ]


def _case(study: Study, yaw: float) -> Case | TerrainCase:
    place = terrain_case if study.settings.on_terrain else flat_case
    return place(study.scenes, _group(study, yaw))


def _group(study: Study, yaw: float) -> Group:
    return Group(yaw, study.settings.contact.friction[0])


def kept(errors: list[float]) -> float:
    """The error that is not exceeded on most rows."""
    return float(np.quantile(errors, ladder.KEPT_BY, method="inverted_cdf"))


def sample_cells(work: Work, study: Study) -> list[SampledCell]:
    """Run random cells of the grid in every engine, and at a sixteenth of the step."""
    motion = study.motion
    assert isinstance(motion, PulseConfig)
    own, on_terrain = study.how(_group(study, study.yaw[0])), study.settings.on_terrain
    names = installed(on_terrain=on_terrain)
    every = {name: replace(own, engine=name) for name in names}
    every[FINE] = replace(own, time_step=own.time_step / 16.0)
    rng, count = random.Random(1), TERRAIN_CELLS if on_terrain else CELLS
    grid = [(r, a) for r in motion.pgv_pga for a in motion.pga]
    wanted = [(rng.choice(study.yaw), *rng.choice(grid)) for _ in range(count)]

    def batches() -> Iterator[Batch]:
        for yaw in sorted(set(study.yaw)):
            cells = [(r, in_si.acceleration(a)) for at, r, a in wanted if at == yaw]
            for start in range(0, len(cells), 10):
                yield Batch(yaw, tuple(cells[start : start + 10]))

    def shared(yaw: float) -> tuple[Case | TerrainCase, tuple[Settings, ...]]:
        return _case(study, yaw), tuple(every.values())

    told = f"{count} cells in {', '.join(names)}, and at a sixteenth of the step"
    with telling(work.stage, told, work.log):
        done = work.cluster.each(worker_tasks.run_cells, batches(), shared)
        found = [
            SampledCell(yaw, pgv_pga, in_si.in_g(pga), dict(zip(every, outcomes, strict=True)))
            for yaw, (pgv_pga, pga), outcomes in done
            if outcomes is not None
        ]
    return sorted(found, key=lambda cell: (*cell[:3], *cell.outcomes.values()))


def compare_cells(cells: list[SampledCell]) -> list[Record]:
    """Tell the share of cells whose outcome differs between engines, and from the finer step."""
    return [
        record(
            "cells",
            f"{a} and {b}",
            error=sum(_side(c.outcomes[a]) != _side(c.outcomes[b]) for c in cells) / len(cells),
            rows=len(cells),
            note="share of random cells of the grid whose outcome differs",
        )
        for a, b in combinations(cells[0].outcomes if cells else (), 2)
    ]


def _side(outcome: int) -> int:
    return Outcome(outcome).overturned


def run_suite(work: Work) -> list[Record]:
    """Run every case of the reference suite in every engine, at each of ``STEPS``."""
    cases = {case.name: case for case in reference.cases()}
    there = installed()
    items = [
        (name, engine) for name, case in cases.items() for engine in case.engines if engine in there
    ]
    batches = (Batch(STEPS, (item,)) for item in items)
    with telling(work.stage, f"reference suite, {len(items)} cases", work.log):
        done = work.cluster.each(worker_tasks.run_reference, batches, lambda steps: steps)
        found = [result for _, _, results in done for result in results or ()]
    return [
        record(
            "reference",
            f"{result.name} ({result.engine})",
            f"{1e3 * result.time_step:.4g} ms",
            case=result.name,
            engine=result.engine,
            step=result.time_step,
            error=result.error,
            rows=1,
            cpu_s=result.seconds,
            note=f"{cases[result.name].quantity}; {cases[result.name].answer}",
        )
        for result in sorted(found, key=lambda r: (r.name, r.engine, -r.time_step))
    ]


def absent_engines() -> list[Record]:
    """List the other_engines whose libraries are not installed."""
    return [
        record("method", other_engines.load(name).LABEL, note=f"not installed: {', '.join(absent)}")
        for name in other_engines.names()
        if (absent := other_engines.missing(name))
    ]


def record(part: str, method: str, setting: str = "", **values: Any) -> Record:
    """Make a line of the table."""
    empty = dict.fromkeys(COLUMNS, "")
    return empty | {"part": part, "method": method, "setting": setting, "own": False} | values
