"""Error of the boundary of Housner's block at each tolerance, and of the published set-up."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from benchmarks.table import Row, say
from vsr_core.engines import load
from vsr_core.judge import proofs
from vsr_core.rock import solid
from vsr_core.run import time_step
from vsr_core.run.cases import Case, Settings, prepare
from vsr_core.scene import Contact, Scene
from vsr_core.verification import other_engines, work_precision
from vsr_core.verification.work_precision import Target

SIZES = ((1.0, 1.0, 2.0), (0.5, 0.5, 1.0), (1.0, 1.0, 3.0), (0.11, 0.11, 0.55))

ENGINE = "nonsmooth"

TOLERANCES = (0.04, 0.02, 0.01, 0.005)


def blocks() -> Iterator[Row]:
    """Error and CPU of a run at the step chosen for each tolerance; the published set-up's too."""
    say("the boundaries of Housner's blocks")
    cases = [_case(size) for size in SIZES]
    targets = [(case, wanted) for case in cases for wanted in _targets(case)]
    own = float("nan")
    for tolerance in TOLERANCES:
        say(f"the same at a tolerance of {tolerance:.1%}")
        steps = {id(case): _step(case, tolerance) for case in cases}
        scores = [
            work_precision.score(
                work_precision.project(case, Settings(steps[id(case)], engine=ENGINE)), wanted
            )
            for case, wanted in targets
        ]
        cost = float(np.mean([score.seconds for score in scores]))
        own = cost if tolerance == 0.01 else own
        worst = max(score.error for score in scores)
        text = f"{100 * worst:.2f} %, {1e3 * cost:.2f} ms"
        yield f"Housner's blocks, tolerance {tolerance:.1%}: worst error, CPU", text, ""
    say("the published set-up")
    published = other_engines.load("published_setup")
    case, wanted = targets[0]
    found = work_precision.score(
        work_precision.by_tilt(
            published.build(case.full, published.SWEEP[0]), case.limits.toppled_tilt
        ),
        wanted,
    )
    yield "published set-up on 1x1x2 / this at 1 %, CPU", f"{found.seconds / own:.0f}", "10"
    yield "  its error there", f"{100 * found.error:.2f} %", ""


def _case(size: tuple[float, float, float]) -> Case:
    rock = solid.box(size, 2110.0).rock
    return prepare(Scene(rock, Contact(0.6)), proofs.barrier(rock), reduce=True)


def _targets(case: Case) -> list[Target]:
    return [work_precision.target(case, ratio, ()) for ratio in time_step.periods(case.full.rock)]


def _step(case: Case, tolerance: float) -> float:
    rock = case.full.rock
    settings = Settings(1.0, engine=ENGINE)
    rows = [time_step.measure(case, r, settings) for r in time_step.periods(rock)]
    shares = load(ENGINE).LADDER.shares
    columns = [
        np.array([getattr(row, name) for row in rows]) for name in ("error", "shift", "steps")
    ]
    toppled = time_step.front(shares, *columns)
    displaced = time_step.front(shares, *(column[:0] for column in columns))
    unit, most = time_step.step_unit(rock), time_step.longest(rock, ENGINE)
    return time_step.choose(toppled, displaced, tolerance, unit, most).time_step
