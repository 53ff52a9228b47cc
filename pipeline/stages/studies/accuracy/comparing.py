"""What the accuracy stage hands to its workers, and the records made of what comes back."""

from __future__ import annotations

import random
from collections import defaultdict
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from pipeline.config.motion_schema import PulseConfig
from pipeline.stages.mesh.products import load_rock
from pipeline.stages.runs.scenes import prepared
from pipeline.stages.runs.step_choice import rows_of, time_step
from pipeline.stages.studies.accuracy import measuring
from pipeline.workflow.cluster import Batch
from pipeline.workflow.stage import Job
from vsr_core import GRAVITY, engines
from vsr_core.errors import InvalidInput
from vsr_core.outcome import Outcome
from vsr_core.rock.body import Rock
from vsr_core.run.cases import Settings
from vsr_core.verification import peers, reference, sensitivity
from vsr_core.verification import time_step as precision
from vsr_core.verification.work_precision import Target

MOST_ROWS = 4
"""Rows on which ways of running are compared; some take seconds a run."""

CELLS = 160
"""Cells of the grid that are run in every engine and at a sixteenth of the step."""

STEPS = tuple(1.0 / n for n in (240, 480, 1000, 2000, 4000, 8000, 16000, 32000))
"""Time steps of the reference suite [s]."""

COLUMNS = ("part", "method", "setting", "error", "worst", "rows", "cpu_s", "lost", "note")

Record = dict[str, Any]
Place = tuple[float, float]  # yaw [degree], PGV/PGA [s]


def installed() -> tuple[str, ...]:
    """Engines whose library is there, the default first."""
    found = []
    for name in engines.names():
        try:
            engines.load(name)
        except InvalidInput:
            continue
        found.append(name)
    return tuple(found)


def _places(rock: Rock) -> list[Place]:
    """At most ``MOST_ROWS`` rows: each direction once, short and long pulses in turn."""
    rows = rows_of(rock)
    if len(rows) <= MOST_ROWS:
        return list(rows)
    yaws = sorted({yaw for yaw, _ in rows})
    periods = precision.periods(rock)
    return [(yaw, periods[at % len(periods)]) for at, yaw in enumerate(yaws)][:MOST_ROWS]


def find_targets(job: Job) -> dict[Place, Target]:
    """What is right on the rows of the site that something topples."""
    rock, _ = load_rock(job.store)
    friction = job.config.contact.friction[0]
    names = installed()
    batches = (Batch(place, str(place[0]), ((place[1], names),)) for place in _places(rock))
    job.log("accuracy: references of the boundaries")
    done = job.cluster.run(
        measuring.find_target,
        batches,
        lambda yaw: prepared(job.config, job.store, float(yaw), friction),
    )
    found = {batch.tag: results[0] for batch, results in done if results is not None}
    return {place: wanted for place, wanted in sorted(found.items()) if wanted.right}


def score_ways(job: Job, targets: dict[Place, Target]) -> list[Record]:
    """Every way of running on every row, summed up over the rows."""
    shape = prepared(job.config, job.store, 0.0, job.config.contact.friction[0]).full.rock.shape
    engine = job.config.simulation.engine
    ways = [("project", name) for name in installed()]
    ways += [("peer", name) for name in peers.names() if not peers.missing(name)]
    ways += [
        ("sweep", str(number))
        for number, variation in enumerate(sensitivity.variations())
        if engine in variation.engines and shape in variation.shapes
    ]

    def batches() -> Iterator[Batch]:
        for way in ways:
            for place in targets:
                yield Batch(place, f"{place[0]}/{place[1]}", (way,))

    job.log(f"accuracy: {len(ways)} ways of running on {len(targets)} boundaries")
    scored: dict[tuple[str, str, str], list[Any]] = defaultdict(list)
    shared = partial(_shared, job, targets)
    for _, results in job.cluster.run(measuring.score, batches(), shared):
        for result in (results or [[]])[0]:
            scored[result[:3]].append(result.score)
    return [
        record(
            part,
            method,
            setting,
            error=_kept([score.error for score in scores]),
            worst=max(score.error for score in scores),
            rows=len(scores),
            cpu_s=sum(score.seconds for score in scores) / len(scores),
            lost=sum(score.lost for score in scores),
        )
        for (part, method, setting), scores in sorted(scored.items())
    ]


def _shared(job: Job, targets: dict[Place, Target], name: str) -> Any:
    yaw, pgv_pga = map(float, name.split("/"))
    friction = job.config.contact.friction[0]
    case = prepared(job.config, job.store, yaw, friction)
    simulation = job.config.simulation
    step = time_step(job.config, job.store, friction)
    settings = Settings(step, simulation.reduce, simulation.engine)
    return case, targets[yaw, pgv_pga], settings


def _kept(errors: list[float]) -> float:
    return float(np.quantile(errors, precision.KEPT_BY, method="inverted_cdf"))


def sample_cells(job: Job) -> list[Record]:
    """Random cells of the grid in every engine, and at a sixteenth of the step."""
    config, friction = job.config, job.config.contact.friction[0]
    assert isinstance(config.motion, PulseConfig)
    step = time_step(config, job.store, friction)
    names = installed()
    every = [Settings(step, config.simulation.reduce, name) for name in names]
    every.append(Settings(step / 16.0, config.simulation.reduce, config.simulation.engine))
    rng = random.Random(1)
    grid = [(r, a) for r in config.motion.pgv_pga for a in config.motion.pga]
    wanted = [(rng.choice(config.yaw), *rng.choice(grid)) for _ in range(CELLS)]

    def batches() -> Iterator[Batch]:
        for yaw in sorted(set(config.yaw)):
            cells = [(r, a * GRAVITY) for at, r, a in wanted if at == yaw]
            for start in range(0, len(cells), 10):
                yield Batch(yaw, str(yaw), tuple(cells[start : start + 10]))

    job.log(f"accuracy: {CELLS} cells in {', '.join(names)}, and at a sixteenth of the step")
    found = []
    for batch, results in job.cluster.run(
        measuring.run_cells,
        batches(),
        lambda yaw: (prepared(config, job.store, float(yaw), friction), tuple(every)),
    ):
        for (pgv_pga, pga), outcomes in zip(batch.items, results or [], strict=False):
            cell = {"cell_yaw": batch.tag, "cell_pgv_pga": pgv_pga, "cell_pga": pga / GRAVITY}
            cell |= {f"outcome_{name}": o for name, o in zip(names, outcomes, strict=False)}
            found.append({**cell, "outcome_fine": outcomes[-1]})
    return sorted(found, key=lambda cell: tuple(cell.values()))


def compare_cells(cells: list[Record]) -> list[Record]:
    """Share of the cells whose outcome differs between engines, and from the finer step."""
    names = [name for name in cells[0] if name.startswith("outcome_")] if cells else []
    pairs = [(a, b) for at, a in enumerate(names) for b in names[at + 1 :]]
    return [
        record(
            "cells",
            f"{a.removeprefix('outcome_')} and {b.removeprefix('outcome_')}",
            error=sum(_side(cell[a]) != _side(cell[b]) for cell in cells) / len(cells),
            rows=len(cells),
            note="share of random cells of the grid whose outcome differs",
        )
        for a, b in pairs
    ]


def _side(outcome: int) -> int:
    return Outcome(outcome).overturned


def run_suite(job: Job) -> list[Record]:
    """Every case of the reference suite in every engine, at each of ``STEPS``."""
    cases = {case.name: case for case in reference.cases()}
    there = installed()
    items = [
        (name, engine) for name, case in cases.items() for engine in case.engines if engine in there
    ]
    job.log(f"accuracy: reference suite, {len(items)} cases")
    done = job.cluster.run(
        measuring.run_reference,
        (Batch(item, "steps", (item,)) for item in items),
        lambda name: STEPS,
    )
    found = [result for _, results in done if results is not None for result in results[0]]
    return [
        record(
            "reference",
            f"{result.name} ({result.engine})",
            f"{1e3 * result.time_step:.4g} ms",
            error=result.error,
            rows=1,
            cpu_s=result.seconds,
            note=f"{cases[result.name].quantity}; {cases[result.name].answer}",
        )
        for result in sorted(found, key=lambda r: (r.name, r.engine, -r.time_step))
    ]


def absent_peers() -> list[Record]:
    """A record for each peer whose libraries are not installed."""
    return [
        record("method", peers.load(name).LABEL, note=f"not installed: {', '.join(absent)}")
        for name in peers.names()
        if (absent := peers.missing(name))
    ]


def record(part: str, method: str, setting: str = "", **values: Any) -> Record:
    """A line of the table; what is not given is empty."""
    return {
        **dict.fromkeys(COLUMNS, ""),
        "part": part,
        "method": method,
        "setting": setting,
    } | values
