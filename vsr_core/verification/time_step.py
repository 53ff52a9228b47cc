"""Error of the overturning boundary against the time step, measured on the scene itself.

A row is one direction and one PGV/PGA. The reference is Housner's equation where a box rocks on an
edge, else the same scene at the reference step of the engine's ladder. Every step of the ladder is
compared with it. A pulse on which the reference itself changes its mind with its step has no right
answer, and either outcome passes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.engines import load
from vsr_core.motions.cosine_pulse import CosinePulse
from vsr_core.rock.body import Rock
from vsr_core.run.cases import Case, Settings
from vsr_core.run.input_checks import longest_step
from vsr_core.run.overturning import simulate
from vsr_core.scene import Contact, Scene
from vsr_core.verification.agreement import agrees_from, answer
from vsr_core.verification.boundary_search import verdict

BOX_PERIODS, HULL_PERIODS = (0.45, 0.6, 0.75), (0.45, 0.9)
"""PGV/PGA of the rows in units of sqrt(radius / g). Housner's block topples there after at most
three impacts; longer pulses rock it until the smallest difference decides."""

KEPT_BY = 0.8
"""Share of the rows that keep the error stated. The others are those where many impacts decide:
there the outcome changes with the last digit, at any step."""


@dataclass(frozen=True)
class Row:
    """What was measured on one direction and one PGV/PGA.

    Attributes
    ----------
    pgv_pga : float [s]
    reference : float [m/s^2], the boundary at the reference; nan if nothing topples the rock
    exact : bool, whether the reference is Housner's equation
    error : ndarray, shape (k,), relative: no run further from the boundary differs
    steps : ndarray, shape (k,), mean time steps of a run
    """

    pgv_pga: float
    reference: float
    exact: bool
    error: Array
    steps: Array


@dataclass(frozen=True)
class Front:
    """Error against time step of a scene.

    Attributes
    ----------
    shares : ndarray, shape (k,), time steps in units of sqrt(radius / g), falling
    error : ndarray, shape (k,), relative error of the boundary that ``KEPT_BY`` of the rows keep
    worst : ndarray, shape (k,), the largest of them
    steps : ndarray, shape (k,), mean time steps of a run near the boundary
    """

    shares: Array
    error: Array
    worst: Array
    steps: Array


@dataclass(frozen=True)
class Choice:
    """A time step and what is known of its error.

    Attributes
    ----------
    time_step : float [s]
    error : float, relative error of the boundary at that step, kept by ``KEPT_BY`` of the rows
    worst : float, the largest among the rows measured
    within : bool, whether ``error`` is within the tolerance asked for
    """

    time_step: float
    error: float
    worst: float
    within: bool


def directions(rock: Rock) -> tuple[float, ...]:
    """Yaws of the rows of a rock [rad]: the faces of a box, four quarters of any other.

    Parameters
    ----------
    rock : Rock

    Returns
    -------
    tuple of float [rad]
    """
    if rock.shape != "box":
        return (0.0, 0.5 * math.pi, math.pi, 1.5 * math.pi)
    half_x, half_y, _ = np.abs(rock.vertices).max(axis=0)
    return (0.0,) if half_x == half_y else (0.0, 0.5 * math.pi)


def periods(rock: Rock) -> tuple[float, ...]:
    """PGV/PGA of the rows of a rock [s].

    Parameters
    ----------
    rock : Rock

    Returns
    -------
    tuple of float [s]
    """
    unit = step_unit(rock)
    return tuple(unit * x for x in (BOX_PERIODS if rock.shape == "box" else HULL_PERIODS))


def step_unit(rock: Rock) -> float:
    """Unit of the time steps, sqrt(radius / g) [s].

    Parameters
    ----------
    rock : Rock

    Returns
    -------
    float [s]
    """
    return math.sqrt(rock.radius / GRAVITY)


def measure(case: Case, pgv_pga: float, settings: Settings) -> Row:
    """Error of one row at every step of the ladder; of ``settings`` all but the time step counts.

    Parameters
    ----------
    case : Case, of the direction to be measured
    pgv_pga : float [s]
    settings : Settings

    Returns
    -------
    Row
    """
    ladder = load(settings.engine).LADDER
    fine, second, coarse = (
        _Trial(case, pgv_pga, settings, share)
        for share in (ladder.reference, ladder.second, ladder.coarse)
    )
    known = answer(case, pgv_pga, coarse, (fine,), (fine, second))
    if math.isnan(known.boundary):
        nothing = np.full(len(ladder.shares), math.nan)
        return Row(pgv_pga, math.nan, known.exact, nothing, nothing)
    passing = cache(known.passing)
    error, steps = [], []
    for share in ladder.shares:
        trial = _Trial(case, pgv_pga, settings, share)
        error.append(agrees_from(trial, passing, known.boundary))
        steps.append(trial.steps / trial.runs)
    return Row(pgv_pga, known.boundary, known.exact, np.array(error), np.array(steps))


class _Trial:
    """Whether a pulse topples the rock at one time step, counting runs and steps."""

    def __init__(self, case: Case, pgv_pga: float, settings: Settings, share: float) -> None:
        self.case, self.pgv_pga = case, pgv_pga
        self.settings = replace(settings, time_step=share * step_unit(case.full.rock))
        self.runs = self.steps = 0

    def __call__(self, pga: float) -> bool | None:
        response = simulate(self.case, CosinePulse(pga, self.pgv_pga), self.settings)
        self.runs += 1
        self.steps += response.steps
        return verdict(response.outcome)


def front(shares: Sequence[float], error: Array, steps: Array) -> Front:
    """Error against time step over the rows that something topples.

    Parameters
    ----------
    shares : sequence of float, time steps in units of sqrt(radius / g), falling
    error, steps : ndarray, shape (rows, k), as in ``Row``; nan where nothing topples it

    Returns
    -------
    Front
    """
    toppled = np.isfinite(error).all(axis=1)
    tried = np.array(shares, dtype=np.float64)
    if not toppled.any():
        nothing = np.full(len(tried), math.nan)
        return Front(tried, nothing, nothing, nothing)
    error, steps = error[toppled], steps[toppled]
    most = np.quantile(error, KEPT_BY, axis=0, method="inverted_cdf")
    return Front(tried, most, error.max(axis=0), steps.mean(axis=0))


def longest(rock: Rock, engine: str, tolerance: float) -> float:
    """Longest time step [s] for a tolerance, whatever the boundaries say.

    ``precheck.longest_step`` holds for a tolerance of 1 %, and the error of a swing grows with the
    step: a boundary may be right by luck where many impacts would not be.

    Parameters
    ----------
    rock : Rock
    engine : str
    tolerance : float, of the boundary

    Returns
    -------
    float [s]
    """
    ways = (Scene(rock, Contact(1.0), yaw) for yaw in directions(rock))
    return min(longest_step(way, engine) for way in ways) * tolerance / 0.01


def choose(measured: Front, tolerance: float, unit: float, most: float) -> Choice:
    """Coarsest step from which on, to all finer ones, the error is within ``tolerance``.

    If there is none it is the finest, and the choice says so. ``unit`` is ``step_unit`` and
    ``most`` the ``longest`` step [s].

    Parameters
    ----------
    measured : Front
    tolerance : float
    unit, most : float [s]

    Returns
    -------
    Choice
    """
    steps = measured.shares * unit
    short = np.nonzero(steps <= most * (1.0 + 1e-9))[0]
    first = int(short[0]) if short.size else len(steps) - 1
    if not np.isfinite(measured.error).any():  # nothing topples it, at any step
        return Choice(float(steps[first]), math.nan, math.nan, within=True)
    largest = np.maximum.accumulate(measured.error[::-1])[::-1]
    good = np.nonzero((largest <= tolerance) & (np.arange(len(steps)) >= first))[0]
    at = int(good[0]) if good.size else len(steps) - 1
    return Choice(
        float(steps[at]), float(measured.error[at]), float(measured.worst[at]), bool(good.size)
    )
