"""What the accuracy stage has its workers do: small functions of what travels to them."""

from __future__ import annotations

import time
from typing import Any, NamedTuple

from vsr_core.motions.cosine_pulse import CosinePulse
from vsr_core.run.cases import Case, Settings
from vsr_core.run.overturning import simulate
from vsr_core.verification import (
    peers,
    reference,
    sensitivity,
    work_precision,
)
from vsr_core.verification import (
    time_step as precision,
)
from vsr_core.verification.work_precision import Score, Target

BUDGET = 25.0
"""CPU time [s] that a peer may take for one setting on one row; finer ones are left out."""

SUITE_BUDGET = 4.0
"""CPU time [s] that one case of the reference suite may take at one step."""

RUNS_A_ROW = 10
"""Runs that one setting takes on a row, about."""


class Scored(NamedTuple):
    """A way of running on one row."""

    part: str
    method: str
    setting: str
    score: Score


class Suite(NamedTuple):
    """A case of the reference suite in one engine at one time step."""

    name: str
    engine: str
    time_step: float
    error: float
    seconds: float


def find_target(case: Case, items: tuple[tuple[float, tuple[str, ...]], ...]) -> list[Target]:
    """References of rows, each given by its PGV/PGA [s] and the engines to ask."""
    return [work_precision.target(case, pgv_pga, names) for pgv_pga, names in items]


def score(shared: tuple[Case, Target, Settings], items: tuple[tuple[str, str], ...]) -> list[Any]:
    """Scores of ways of running, each as a list over its settings."""
    ways = {"project": _project, "peer": _peer, "sweep": _variation}
    return [ways[kind](*shared, name) for kind, name in items]


def _project(case: Case, wanted: Target, settings: Settings, engine: str) -> list[Scored]:
    unit = precision.step_unit(case.full.rock)
    found = []
    for share in precision.SHARES:
        own = Settings(share * unit, settings.reduce, engine)
        result = work_precision.score(work_precision.project(case, own), wanted)
        found.append(Scored("method", f"project, {engine}", f"{share:g}", result))
    return found


def _peer(case: Case, wanted: Target, settings: Settings, name: str) -> list[Scored]:
    method = peers.load(name)
    found: list[Scored] = []
    for setting in method.SWEEP:
        if found and 2.0 * RUNS_A_ROW * found[-1].score.seconds > BUDGET:
            break
        tilt = method.build(case.full, setting)
        test = work_precision.by_tilt(tilt, case.limits.toppled_tilt)
        result = work_precision.score(test, wanted)
        text = f"{1e3 * setting['time_step']:g} ms"
        found.append(Scored("method", method.LABEL, text, result))
    return found


def _variation(case: Case, wanted: Target, settings: Settings, number: str) -> list[Scored]:
    variation = sensitivity.variations()[int(number)]
    own, changed = variation.change(case, settings)
    result = work_precision.score(work_precision.project(own, changed), wanted)
    return [Scored("sweep", variation.what, variation.value, result)]


def run_cells(
    shared: tuple[Case, tuple[Settings, ...]], items: tuple[tuple[float, float], ...]
) -> list[tuple[int, ...]]:
    """Outcomes of cells (PGV/PGA [s], PGA [m/s^2]) with each of the settings."""
    case, every = shared
    return [
        tuple(int(simulate(case, CosinePulse(pga, pgv_pga), one).outcome) for one in every)
        for pgv_pga, pga in items
    ]


def run_reference(steps: tuple[float, ...], items: tuple[tuple[str, str], ...]) -> list[Any]:
    """Cases of the reference suite, each by name and engine, at every time step that fits."""
    cases = {case.name: case for case in reference.cases()}
    found = []
    for name, engine in items:
        measured: list[Suite] = []
        for step in steps:
            if measured and 2.0 * measured[-1].seconds > SUITE_BUDGET:
                break
            start = time.process_time()
            error = cases[name].measure(engine, step)
            seconds = time.process_time() - start
            measured.append(Suite(name, engine, step, float(error), seconds))
        found.append(measured)
    return found
