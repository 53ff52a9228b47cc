"""Error of the overturning boundary against the time step, measured on the scene itself.

A row is one direction and one PGV/PGA. The reference is Housner's equation where a box rocks on an
edge of a flat pedestal, else the same scene at the reference step of the engine's ladder. Every
step of the ladder is compared with it. A pulse on which the reference itself changes its mind with
its step has no right answer, and does not count.

Where too few rows topple, longer pulses and directions between are tried, and then the boundary
from which on the rock is displaced. Where too few have that, too, nothing is said of the error.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cache, partial
from itertools import product
from typing import NamedTuple

import numpy as np

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.engines import load
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import Response
from vsr_core.rock.body import Rock
from vsr_core.run.agreement import (
    BAND,
    HALVINGS,
    WINDOW,
    Answer,
    agrees_from,
    answer,
    by_references,
)
from vsr_core.run.boundary_search import Topples, first_boundary, halved, left_its_place, verdict
from vsr_core.run.cases import Case, Settings, TerrainCase
from vsr_core.run.displacement import respond
from vsr_core.run.input_checks import longest_step
from vsr_core.run.overturning import simulate
from vsr_core.scene import Contact, Scene

BOX_PERIODS, HULL_PERIODS = (0.9, 1.35, 1.9), (0.45, 0.9)
"""PGV/PGA of the rows in units of sqrt(radius / g). Of shorter pulses one swing decides, by those
of a box it topples after some impacts, and steps tell most."""

LONGER_PERIODS = (1.2, 1.8)
"""PGV/PGA of more rows where those topple nothing, in the same units."""

ENOUGH = 3
"""Rows with a reference that an error is stated from: fewer say little of the others."""

KEPT_BY = 0.8
"""Share of the rows that keep the error stated. The others are those where many impacts decide:
there the outcome changes with the last digit, at any step."""


class Boundary(IntEnum):
    """What a rock does from the boundary of a row on."""

    TOPPLED = 0
    DISPLACED = 1
    """Its base slides further than a balanced rock's may, or it topples."""


class Place(NamedTuple):
    """A row before it is measured.

    Attributes
    ----------
    yaw : float [rad]
    pgv_pga : float [s]
    """

    yaw: float
    pgv_pga: float
    boundary: Boundary


@dataclass(frozen=True)
class Row:
    """What was measured on one direction and one PGV/PGA.

    Attributes
    ----------
    pgv_pga : float [s]
    reference : float [m/s^2], the boundary at the reference; infinite if no pulse gets there
    exact : bool, whether the reference is Housner's equation
    error : ndarray, shape (k,), relative: where, from the boundary outwards, a run first agrees; of
        an exact reference no less than the shift
    shift : ndarray, shape (k,), relative: how far away a boundary is found by halving, as that of a
        study is, of an exact reference the lowest. Where outcomes alternate with PGA a run agrees
        by chance, and this is larger.
    steps : ndarray, shape (k,), mean time steps of a run
    """

    pgv_pga: float
    reference: float
    exact: bool
    error: Array
    shift: Array
    steps: Array


@dataclass(frozen=True)
class Front:
    """Error against time step of a scene.

    Attributes
    ----------
    shares : ndarray, shape (k,), time steps in units of sqrt(radius / g), falling
    agreement : ndarray, shape (k,), ``Row.error`` that ``KEPT_BY`` of the rows keep, see ``front``
    error : ndarray, shape (k,), as ``agreement``, of each row's error or shift, the larger
    worst : ndarray, shape (k,), the largest of these; nan, as all but ``shares``, where fewer than
        ``ENOUGH`` rows have a reference
    steps : ndarray, shape (k,), mean time steps of a run near the boundary
    """

    shares: Array
    agreement: Array
    error: Array
    worst: Array
    steps: Array


@dataclass(frozen=True)
class Choice:
    """A time step and what is known of its error.

    Attributes
    ----------
    time_step : float [s]
    error : float, relative error of the overturning boundary at that step, kept by ``KEPT_BY`` of
        the rows; nan where it was not measured
    agreement : float, from how far off the boundary outcomes agree at that step, as ``error``
    worst : float, the largest error among the rows measured
    displaced : float, as ``error`` of the boundary from which on the rock is displaced
    within : bool, whether agreement was measured, and what was is within the tolerance asked for
    """

    time_step: float
    error: float
    agreement: float
    worst: float
    displaced: float
    within: bool


def directions(rock: Rock) -> tuple[float, ...]:
    """Yaws of the rows of a rock [rad]: the faces of a box, four quarters of any other.

    Returns
    -------
    tuple of float [rad], of a box the narrow face first
    """
    if rock.shape != "box":
        return (0.0, 0.5 * math.pi, math.pi, 1.5 * math.pi)
    half_x, half_y, _ = np.abs(rock.vertices).max(axis=0)
    faces = (0.0, 0.5 * math.pi) if half_x <= half_y else (0.5 * math.pi, 0.0)
    return faces[:1] if half_x == half_y else faces


def periods(rock: Rock) -> tuple[float, ...]:
    """PGV/PGA of the rows of a rock [s]."""
    unit = step_unit(rock)
    return tuple(unit * x for x in (BOX_PERIODS if rock.shape == "box" else HULL_PERIODS))


def lots(rock: Rock) -> tuple[tuple[Place, ...], ...]:
    """List the rows of a rock; a lot is measured where those before it have too few references.

    A box topples over its narrow face: a study may shake that alone, and errors are so much smaller
    on the broad one (0.12 to 0.25 % for 0.7 to 1.9 %) that they would hide those on the other.

    Returns
    -------
    tuple of tuple of Place
        The usual rows; those of longer pulses, between the directions unless the rock is a box; the
        usual ones again, of displacement.
    """
    ways, unit = directions(rock), step_unit(rock)
    tipped, between = ways, tuple(way + 0.25 * math.pi for way in ways)
    if rock.shape == "box":
        tipped = between = ways[:1]
    longer = tuple(unit * x for x in LONGER_PERIODS)
    toppled, displaced = (Boundary.TOPPLED,), (Boundary.DISPLACED,)
    rows = (
        (tipped, periods(rock), toppled),
        (between, longer, toppled),
        (ways, periods(rock), displaced),
    )
    return tuple(tuple(Place(*row) for row in product(*lot)) for lot in rows)


def enough(rows: Sequence[Row]) -> bool:
    """Whether so many rows have a reference that an error can be stated."""
    return sum(math.isfinite(row.reference) for row in rows) >= ENOUGH


def step_unit(rock: Rock) -> float:
    """Unit of the time steps, sqrt(radius / g) [s]."""
    return math.sqrt(rock.radius / GRAVITY)


def unit_of(case: Case | TerrainCase) -> float:
    """Unit of the time steps of a case's ladder [s], ``step_unit`` of its rock.

    Returns
    -------
    float [s]
    """
    return step_unit(case.full.rock if isinstance(case, Case) else case.seat.rock)


def measure(
    case: Case, pgv_pga: float, settings: Settings, boundary: Boundary = Boundary.TOPPLED
) -> Row:
    """Error of one row at every step of the ladder; of ``settings`` all but the time step counts.

    Parameters
    ----------
    pgv_pga : float [s]
    """
    trial = partial(_Trial, partial(simulate, case), unit_of(case), pgv_pga, settings, boundary)
    if boundary is Boundary.TOPPLED:
        return _row(trial, settings, partial(answer, case, pgv_pga))
    return _row(trial, settings, partial(by_references, case))


def measure_on_seat(
    case: TerrainCase, pgv_pga: float, settings: Settings, boundary: Boundary = Boundary.TOPPLED
) -> Row:
    """As ``measure``, of a rock on its seat in a terrain, with references alone.

    Parameters
    ----------
    pgv_pga : float [s]
    """
    trial = partial(_Trial, partial(respond, case), unit_of(case), pgv_pga, settings, boundary)
    return _row(trial, settings, partial(by_references, case))


def _row(
    trial: Callable[[float], _Trial],
    settings: Settings,
    known_by: Callable[[Topples, Sequence[Topples], Sequence[Topples]], Answer],
) -> Row:
    """Every step of the ladder against what is right.

    Parameters
    ----------
    trial : callable, from a share of the ladder's unit to what is tried
    """
    ladder = load(settings.engine).LADDER
    fine, second, coarse = map(trial, (ladder.reference, ladder.second, ladder.coarse))
    known, pgv_pga = known_by(coarse, (fine,), (fine, second)), fine.pgv_pga
    if math.isnan(known.boundary):
        nothing = np.full(len(ladder.shares), math.nan)
        return Row(pgv_pga, math.inf, known.exact, nothing, nothing, nothing)
    passing = cache(known.passing)
    error, shift, steps = [], [], []
    # not about the boundary, at which the first trial would agree by luck
    ends = (1.0 - WINDOW) * known.boundary, (1.0 + 1.5 * WINDOW) * known.boundary
    right = (lambda pga: passing(pga) == {True}) if known.exact else fine
    lowest = [partial(_lowest, ends, offset) for offset in (0.0, 0.5)]
    looks = lowest if known.exact else [partial(_halved, ends)]
    expected = cache(lambda look: look(right))
    for share in ladder.shares:
        tried = trial(share)
        error.append(agrees_from(tried, passing, known.boundary))
        steps.append(tried.steps / tried.runs)
        shift.append(_shift(tried, looks, expected))
    errors, shifts = np.array(error), np.array(shift)
    errors = np.fmax(errors, shifts) if known.exact else errors
    return Row(pgv_pga, known.boundary, known.exact, errors, shifts, np.array(steps))


Look = Callable[[Topples], float]
"""Finds a boundary [m/s^2]."""


def _shift(tried: Topples, looks: Sequence[Look], expected: Callable[[Look], float]) -> float:
    """How far a boundary is from the one expected, by the look that finds them nearest.

    A narrow band that one look meets and another steps over is there or not by luck.
    """
    least = math.inf
    for look in looks:
        least = float(np.fmin(least, abs(look(tried) / expected(look) - 1.0)))
        if least <= BAND:
            break
    return least if math.isfinite(least) else math.nan


def _halved(ends: tuple[float, float], topples: Topples) -> float:
    return halved(topples, *ends, HALVINGS).middle


def _lowest(ends: tuple[float, float], offset: float, topples: Topples) -> float:
    """The lowest boundary between two PGAs [m/s^2] in steps of a band; nan if there is none."""
    levels = np.arange(*ends, BAND * ends[0]) + offset * BAND * ends[0]
    return first_boundary(topples, levels, 3).middle


class _Trial:
    """Whether a pulse is beyond the boundary at one time step, counting runs and steps."""

    def __init__(
        self,
        run: Callable[[CosinePulse, Settings], Response],
        unit: float,
        pgv_pga: float,
        settings: Settings,
        boundary: Boundary,
        share: float,
    ) -> None:
        self.run, self.pgv_pga = run, pgv_pga
        self.is_beyond = verdict if boundary is Boundary.TOPPLED else left_its_place
        self.settings = replace(settings, time_step=share * unit)
        self.runs = self.steps = 0

    def __call__(self, pga: float) -> bool | None:
        response = self.run(CosinePulse(pga, self.pgv_pga), self.settings)
        self.runs += 1
        self.steps += response.steps
        return self.is_beyond(response.outcome)


def front(shares: Sequence[float], error: Array, shift: Array, steps: Array) -> Front:
    """Error against time step over the rows that have a reference.

    It is no smaller than a law of the first order, as that of impacts in steps is, through what
    coarser steps showed: what a few rows keep below it is luck.

    Parameters
    ----------
    shares : sequence of float, time steps in units of sqrt(radius / g), falling
    error, shift, steps : ndarray, shape (rows, k), as in ``Row``; nan where there is no reference
    """
    known = np.isfinite(error).all(axis=1)
    tried = np.array(shares, dtype=np.float64)
    if known.sum() < ENOUGH:
        nothing = np.full(len(tried), math.nan)
        return Front(tried, nothing, nothing, nothing, nothing)
    larger = np.fmax(error, shift)[known]
    agreement, told = (_kept(rows, tried) for rows in (error[known], larger))
    worst = np.fmax(larger.max(axis=0), told)
    return Front(tried, agreement, told, worst, steps[known].mean(axis=0))


def _kept(error: Array, shares: Array) -> Array:
    """Error that the rows keep, or the median of the laws through it and all coarser steps'."""
    kept = np.quantile(error, KEPT_BY, axis=0, method="inverted_cdf")
    slopes = [np.median((kept / shares)[: at + 1]) for at in range(len(shares))]
    return np.fmax(kept, slopes * shares)


def longest(rock: Rock, engine: str) -> float:
    """Longest time step [s] for a tolerance of 1 %, whatever the boundaries say.

    The error of a swing grows with the step: a boundary may be right by luck where many impacts
    would not be.

    Returns
    -------
    float [s]
    """
    return min(longest_step(Scene(rock, Contact(1.0), yaw), engine) for yaw in directions(rock))


def choose(toppled: Front, displaced: Front, tolerance: float, unit: float, most: float) -> Choice:
    """Coarsest step from which on, to all finer ones, outcomes agree within ``tolerance``.

    If there is none, or nothing was measured, it is the finest, and the choice says so. Shifts do
    not count but of Housner's block: where outcomes alternate, they are small or large by chance.

    Parameters
    ----------
    unit : float [s], ``step_unit``
    most : float [s], the ``longest`` step for a tolerance of 1 %
    """
    steps = toppled.shares * unit
    short = steps <= most * tolerance / 0.01 * (1.0 + 1e-9)
    error = np.fmax(toppled.agreement, displaced.agreement)
    largest = np.maximum.accumulate(error[::-1])[::-1]
    good = np.flatnonzero(short & (largest <= tolerance))
    at = int(good[0]) if good.size else len(steps) - 1
    return Choice(
        time_step=float(steps[at]),
        error=float(toppled.error[at]),
        agreement=float(toppled.agreement[at]),
        worst=float(toppled.worst[at]),
        displaced=float(displaced.error[at]),
        within=bool(good.size),
    )
