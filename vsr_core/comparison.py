"""Error of the overturning boundary against CPU time, for any way of running a shaking test.

All ways are given the same rows (a direction and a PGV/PGA) and the same runs. The reference of a
row is Housner's equation where it applies. Else it is two engines that share no code, each at a
sixteenth of the usual step: where these two differ, nobody can say who is right, and any outcome
passes.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from vsr_core import GRAVITY
from vsr_core.motion import CosinePulse
from vsr_core.outcome import Outcome
from vsr_core.precision import (
    OFFSETS,
    REFERENCE_SHARE,
    STRONGEST,
    WORST,
    bisect,
    rocking_block,
    step_unit,
)
from vsr_core.rocking import first_overturning_pga, rocking_response
from vsr_core.simulate import Case, Settings, simulate

Test = Callable[[CosinePulse], int]
"""Runs one pulse from rest: 1 the rock toppled, 0 it stands, -1 no verdict."""

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
    spread : float, how far the two references are apart, relative; 0 if exact
    right : dict, from PGA [m/s^2] to 1 topples, 0 stands, -1 the references differ
    """

    pgv_pga: float
    boundary: float
    exact: bool
    spread: float
    right: Mapping[float, int]


@dataclass(frozen=True)
class Score:
    """How one way of running did on one row.

    Attributes
    ----------
    error : float, relative: outcomes further from the boundary are right
    seconds : float, CPU time of a run
    lost : int, runs without a verdict
    """

    error: float
    seconds: float
    lost: int


def target(case: Case, pgv_pga: float, engines: tuple[str, ...]) -> Target:
    """Reference of a row; ``engines`` are those that give it where no equation does."""
    block = rocking_block(case)
    if block is not None:
        boundary = first_overturning_pga(block, pgv_pga, STRONGEST, 0.005 * GRAVITY)
        right = {
            pga: int(rocking_response(block, pga, pgv_pga).overturned) for pga in _levels(boundary)
        }
        return Target(pgv_pga, boundary, True, 0.0, right)
    step = REFERENCE_SHARE * step_unit(case.full.rock)
    tests = [project(case, Settings(step, engine=engine)) for engine in engines]
    coarse = project(case, Settings(16.0 * step, engine=engines[0]))
    low = 0.9 * min(-case.still[0], case.still[1])
    near = bisect(_topples(coarse, pgv_pga), low, STRONGEST, 9)
    found = [bisect(_topples(test, pgv_pga), 0.9 * near, 1.1 * near, 6) for test in tests]
    boundary = float(np.mean(found))
    if boundary > 0.9 * STRONGEST:
        return Target(pgv_pga, float("nan"), False, 0.0, {})
    right = {}
    for pga in _levels(boundary):
        outcomes = {test(CosinePulse(pga, pgv_pga)) for test in tests}
        right[pga] = outcomes.pop() if len(outcomes) == 1 else -1
    return Target(pgv_pga, boundary, False, float(np.ptp(found)) / boundary, right)


def score(test: Test, wanted: Target) -> Score:
    """Error and cost of one way of running on one row."""
    lost = 0

    def outcome(level: float) -> int:
        nonlocal lost
        found = test(CosinePulse(level, wanted.pgv_pga))
        lost += found < 0
        return found

    outcome(COST_AT[0] * wanted.boundary)  # what is built and imported once is no cost of a run
    start = time.process_time()
    for share in COST_AT:
        outcome(share * wanted.boundary)
    seconds = (time.process_time() - start) / len(COST_AT)
    error = max(_agrees_from(outcome, wanted, side) for side in (-1.0, 1.0))
    return Score(error, seconds, lost)


def project(case: Case, settings: Settings) -> Test:
    """The own way of running a test, outcomes proved where they can be."""

    def test(pulse: CosinePulse) -> int:
        outcome = simulate(case, pulse, settings).outcome
        return 1 if outcome is Outcome.OVERTURNED else 0 if outcome.overturned == 0 else -1

    return test


def by_tilt(largest_tilt: Callable[[CosinePulse], float], toppled: float) -> Test:
    """A test that reads the largest tilt [rad], nan where it diverged."""

    def test(pulse: CosinePulse) -> int:
        tilt = largest_tilt(pulse)
        return -1 if tilt != tilt else int(tilt > toppled)

    return test


def _levels(boundary: float) -> list[float]:
    return [boundary * (1.0 + side * offset) for offset in OFFSETS for side in (-1.0, 1.0)]


def _agrees_from(outcome: Callable[[float], int], wanted: Target, side: float) -> float:
    """Least offset on one side of the boundary at which an outcome is right."""
    for offset in OFFSETS:
        pga = wanted.boundary * (1.0 + side * offset)
        if wanted.right[pga] in (-1, outcome(pga)):
            return offset
    return WORST


def _topples(test: Test, pgv_pga: float) -> Callable[[float], bool]:
    return lambda pga: test(CosinePulse(pga, pgv_pga)) != 0
