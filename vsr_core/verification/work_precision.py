"""Error of the overturning boundary against CPU time, for any way of running a shaking test.

All ways are given the same rows (a direction and a PGV/PGA) and the same runs. The reference of a
row is Housner's equation where it applies. Else it is engines that share no code, each at its
reference step, or one engine at two steps. They may be among the ways compared. Where they differ
nobody can say who is right: such a pulse speaks for no way of running, and no error is told below
what the references know.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from vsr_core.engines import load
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import Response
from vsr_core.run.agreement import agrees_from, answer, by_references, levels
from vsr_core.run.boundary_search import Topples, verdict
from vsr_core.run.cases import Case, Settings, TerrainCase
from vsr_core.run.displacement import respond
from vsr_core.run.overturning import COMPILED, simulate
from vsr_core.run.time_step import unit_of

Test = Callable[[CosinePulse], bool | None]
"""Runs one pulse from rest: whether the rock toppled, None unresolved."""

COST_AT = (0.7, 0.9, 1.1, 1.6)
"""Pulses on which the CPU time of a run is measured, as shares of the boundary."""


@dataclass(frozen=True)
class Target:
    """A row and what is right there.

    Attributes
    ----------
    pgv_pga : float [s]
    boundary : float [m/s^2]; nan if nothing topples the rock
    exact : bool, whether by Housner's equation
    spread : float, how far the references are apart, relative; 0 if exact
    references : tuple of (name of an engine, its time step as in ``Ladder``); empty if exact
    passing : dict, from the PGAs compared [m/s^2] to the outcomes that pass there, as
        ``agreement.Passing``: standing below the boundary and toppling above it, and none where the
        references are not agreed on that
    """

    pgv_pga: float
    boundary: float
    exact: bool
    spread: float
    references: tuple[tuple[str, float], ...]
    passing: Mapping[float, frozenset[bool]]

    @property
    def least(self) -> float:
        """Error of a way that has this very boundary: from this row none is told below it."""
        return agrees_from(lambda pga: pga > self.boundary, self.passing.__getitem__, self.boundary)


@dataclass(frozen=True)
class Score:
    """How one way of running did on one row.

    Attributes
    ----------
    error : float, relative: outcomes further from the boundary are right
    seconds : float, CPU time of a run
    lost : int, unresolved runs
    """

    error: float
    seconds: float
    lost: int


def target(case: Case | TerrainCase, pgv_pga: float, engines: tuple[str, ...]) -> Target:
    """Reference of a row; ``engines`` are those that give it where no equation does.

    Parameters
    ----------
    pgv_pga : float [s]
    """
    unit = unit_of(case)

    def run(name: str, share: float) -> Topples:
        test = project(case, Settings(share * unit, engine=name))
        return lambda pga: test(CosinePulse(pga, pgv_pga))

    steps = [(name, load(name).LADDER.reference) for name in engines]
    if len(engines) == 1:
        steps.append((engines[0], load(engines[0]).LADDER.second))
    references = [run(*step) for step in steps]
    nearest = engines[0] if engines else COMPILED
    coarse = run(nearest, load(nearest).LADDER.coarse)
    if isinstance(case, TerrainCase):
        known = by_references(case, coarse, references, references)
    else:
        known = answer(case, pgv_pga, coarse, references, references)
    nothing = math.isnan(known.boundary)
    compared = () if nothing else (pga for pair in levels(known.boundary) for pga in pair)
    passing = {}
    for pga in compared:
        side = frozenset({pga > known.boundary})
        passing[pga] = side if known.passing(pga) == side else frozenset()
    judges = () if known.exact else tuple(steps)
    return Target(pgv_pga, known.boundary, known.exact, known.spread, judges, passing)


def score(test: Test, wanted: Target) -> Score:
    """Error and cost of one way of running on one row."""
    lost = 0

    def outcome(pga: float) -> bool | None:
        nonlocal lost
        found = test(CosinePulse(pga, wanted.pgv_pga))
        lost += found is None
        return found

    outcome(COST_AT[0] * wanted.boundary)  # what is built and imported once is no cost of a run
    start = time.process_time()
    for share in COST_AT:
        outcome(share * wanted.boundary)
    seconds = (time.process_time() - start) / len(COST_AT)
    return Score(agrees_from(outcome, wanted.passing.__getitem__, wanted.boundary), seconds, lost)


def response(case: Case | TerrainCase, pulse: CosinePulse, settings: Settings) -> Response:
    """The own way of running a test, on what the rock stands on."""
    if isinstance(case, TerrainCase):
        return respond(case, pulse, settings)
    return simulate(case, pulse, settings)


def project(case: Case | TerrainCase, settings: Settings) -> Test:
    """The same as a test, outcomes proved where they can be."""
    return lambda pulse: verdict(response(case, pulse, settings).outcome)


def by_tilt(largest_tilt: Callable[[CosinePulse], float], toppled: float) -> Test:
    """A test that reads the largest tilt [rad], nan where it diverged.

    Parameters
    ----------
    largest_tilt : callable, from a pulse to a tilt [rad]
    toppled : float [rad], tilt beyond which the rock has toppled
    """

    def test(pulse: CosinePulse) -> bool | None:
        tilt = largest_tilt(pulse)
        return None if math.isnan(tilt) else bool(tilt > toppled)

    return test
