"""What the accuracy stage has its workers do: small functions of what travels to them."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

from vsr_core import engines
from vsr_core.arrays import Array
from vsr_core.motions.pulses import CosinePulse
from vsr_core.run import quantities
from vsr_core.run import time_step as ladder
from vsr_core.run.cases import Case, Settings, TerrainCase
from vsr_core.run.displacement import displace
from vsr_core.run.overturning import simulate_all
from vsr_core.verification import other_engines, reference, sensitivity, work_precision
from vsr_core.verification.work_precision import Score, Target, response

BUDGET, TERRAIN_BUDGET = 25.0, 5.0
"""CPU time [s] that a peer may take for one setting on one row, and an engine of the project on a
terrain; finer ones are left out."""

SUITE_BUDGET = 4.0
"""CPU time [s] that one case of the reference suite may take at one step."""

RUNS_A_ROW = 10
"""Runs that one setting takes on a row, about."""


class Way(NamedTuple):
    """A way of running, with one of its settings.

    Attributes
    ----------
    step : float, time step, in units of sqrt(radius / g) of this project's, else [s]
    """

    part: str
    method: str
    setting: str
    own: bool
    step: float


Scored = tuple[Way, Score]


class Suite(NamedTuple):
    """A case of the reference suite in one engine at one time step."""

    name: str
    engine: str
    time_step: float
    error: float
    seconds: float


def find_target(
    case: Case | TerrainCase, items: tuple[tuple[float, tuple[str, ...]], ...]
) -> list[Target]:
    """Find the references of rows.

    Parameters
    ----------
    items : tuple of (PGV/PGA [s], names of the engines to ask)
    """
    return [work_precision.target(case, pgv_pga, names) for pgv_pga, names in items]


def score(
    shared: tuple[Case | TerrainCase, Target, Settings], items: tuple[tuple[str, str], ...]
) -> list[list[Scored]]:
    """Score ways of running.

    Parameters
    ----------
    items : tuple of (kind, name)

    Returns
    -------
    list of list of (Way, Score), one for each setting of a way
    """
    ways: dict[str, Callable[..., list[Scored]]]
    ways = {"project": _project, "peer": _peer, "sweep": _variation}
    return [ways[kind](*shared, name) for kind, name in items]


def _project(
    case: Case | TerrainCase, wanted: Target, settings: Settings, engine: str
) -> list[Scored]:
    unit = ladder.unit_of(case)
    found: list[Scored] = []
    for share in engines.load(engine).LADDER.shares:
        if isinstance(case, TerrainCase) and found and _dear(found[-1], TERRAIN_BUDGET):
            break
        own = Settings(share * unit, settings.reduce, engine)
        result = work_precision.score(work_precision.project(case, own), wanted)
        way = Way("method", f"project, {engine}", f"{share:g}", own=True, step=share)
        found.append((way, result))
    return found


def _peer(case: Case, wanted: Target, settings: Settings, name: str) -> list[Scored]:
    method = other_engines.load(name)
    found: list[Scored] = []
    for setting in method.SWEEP:
        if found and _dear(found[-1], BUDGET):
            break
        tilt, step = method.build(case.full, setting), setting["time_step"]
        test = work_precision.by_tilt(tilt, case.limits.toppled_tilt)
        result = work_precision.score(test, wanted)
        way = Way("method", method.LABEL, f"{1e3 * step:g} ms", own=False, step=step)
        found.append((way, result))
    return found


def _dear(scored: Scored, budget: float) -> bool:
    """Whether the next finer setting takes more than its time."""
    return 2.0 * RUNS_A_ROW * scored[1].seconds > budget


def _variation(case: Case, wanted: Target, settings: Settings, number: str) -> list[Scored]:
    variation = sensitivity.variations()[int(number)]
    own, changed = variation.change(case, settings)
    result = work_precision.score(work_precision.project(own, changed), wanted)
    way = Way("sweep", variation.what, variation.value, own=True, step=changed.time_step)
    return [(way, result)]


def run_cells(
    shared: tuple[Case | TerrainCase, tuple[Settings, ...]], items: tuple[tuple[float, float], ...]
) -> list[tuple[int, ...]]:
    """Run cells with each of some settings.

    Parameters
    ----------
    items : tuple of (PGV/PGA [s], PGA [m/s^2])
    """
    case, every = shared
    return [
        tuple(int(response(case, CosinePulse(pga, pgv_pga), one).outcome) for one in every)
        for pgv_pga, pga in items
    ]


def measure_quantities(
    shared: tuple[Case | TerrainCase, Settings], items: tuple[int, ...]
) -> list[tuple[Array, float]]:
    """Errors of tilts, slips and travels over samples of so many pulses, and CPU time a run [s]."""
    case, settings = shared
    found = []
    for number in items:
        sample = quantities.pulses(case, number)
        errors = quantities.measure(case, settings, number)
        start = time.process_time()
        if isinstance(case, Case):
            simulate_all(case, sample, settings)
        else:
            for pulse in sample:
                displace(case, pulse, settings)
        found.append((errors, (time.process_time() - start) / number))
    return found


def run_reference(steps: tuple[float, ...], items: tuple[tuple[str, str], ...]) -> list[Any]:
    """Run cases of the reference suite.

    Parameters
    ----------
    steps : tuple of float, time steps [s]
    items : tuple of (name, engine)

    Returns
    -------
    list of list of Suite, one for every time step that fits the budget
    """
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
