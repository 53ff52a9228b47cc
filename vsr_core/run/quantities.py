"""Errors of what a run comes to besides its outcome: how far a rock tilts, slides and goes.

They are measured on a sample of cosine pulses, from those that hardly move the rock to those that
topple it, at a time step and again at a sixteenth of it. Where a run has an exact answer that is
taken: Housner's for the largest tilt of a block, Newmark's for the slip of one that only slides.
An error is relative to the answer, or to a small amount where that is larger.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.judge import proofs
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import AT_REST, DISPLACED_SHARE, OF_TRAVEL, QUANTITIES, Outcome, Response
from vsr_core.run.agreement import rocking_block
from vsr_core.run.cases import Case, Settings, TerrainCase
from vsr_core.run.displacement import DisplacementRun, displace
from vsr_core.run.movement import Trajectory
from vsr_core.run.overturning import simulate_all
from vsr_core.run.rocking_block import rocking_response
from vsr_core.run.sliding_block import farthest
from vsr_core.run.time_step import unit_of

FINER = 16.0
"""By how much the step is shorter that a run is compared with."""

PULSES, PULSES_ON_TERRAIN = 256, 48
"""Pulses of a sample, over all directions."""

STRONGEST, STRONGEST_ON_TERRAIN, WEAKEST = 2.0, 6.0, 0.05 * GRAVITY
"""PGA of the strongest, in units of the weakest, which is about to move the rock; and that [m/s^2]
where nothing is known to hold it."""

PERIODS = (0.2, 2.0)
"""PGV/PGA of the shortest and longest, in units of sqrt(radius / g)."""

SPREAD = (0.7548776662466927, 0.5698402909980532)
"""Steps in two dimensions that fill a square evenly: powers of the plastic number."""

SMALL_TILT, SMALL_SLIP, SMALL_WAY = 0.01, 0.1, 0.1
"""What an answer is at least taken for: a share of the tilt at which the rock topples, of the slip
that counts as displaced, and of the radius."""

ENOUGH = 8
"""Runs that an error is stated from."""

MEDIAN_SHARE, MOST_SHARE = 0.3, 2.0
"""A tolerance holds for a quantity if its median error is within the first of it, and 95 % within
the second."""


class Error(NamedTuple):
    """Error of a quantity over a sample.

    Attributes
    ----------
    median, most : float, relative: half and 95 % of the runs are right to it; nan if too few have
        the quantity
    runs : int, that have it
    """

    median: float
    most: float
    runs: int

    def within(self, tolerance: float) -> bool:
        """Whether it was measured and keeps to a tolerance."""
        return self.median <= MEDIAN_SHARE * tolerance and self.most <= MOST_SHARE * tolerance


def summed_up(errors: Array) -> Error:
    """Median and 95 % of the errors of some runs.

    Parameters
    ----------
    errors : ndarray, shape (n,); nan of those that have not the quantity

    Examples
    --------
    >>> summed_up(np.array([0.01, np.nan, *[0.02] * 18, 0.5]))
    Error(median=0.02, most=0.02, runs=20)
    """
    known = errors[np.isfinite(errors)]
    if len(known) < ENOUGH:
        return Error(math.nan, math.nan, len(known))
    return Error(
        float(np.median(known)), float(np.quantile(known, 0.95, method="inverted_cdf")), len(known)
    )


def measure(case: Case | TerrainCase, settings: Settings, number: int) -> Array:
    """Errors of all quantities over the sample of one direction.

    Parameters
    ----------
    number : int, of its pulses
    settings : Settings, at whose time step; over a terrain rocks that topple are followed to rest

    Returns
    -------
    ndarray, shape (5, number), in the order of ``QUANTITIES``; nan where a run lacks one, as the
        rock topples, or stays where it stands
    """
    settings = replace(settings, whole=True)
    finer = replace(settings, time_step=settings.time_step / FINER)
    shaken = pulses(case, number)
    if isinstance(case, Case):
        errors = np.full((len(QUANTITIES), number), math.nan)
        ours = simulate_all(case, shaken, settings)
        upright = [n for n, one in enumerate(ours) if one.outcome.overturned == 0]
        fine = simulate_all(case, [shaken[n] for n in upright], finer)
        for n, right in zip(upright, fine, strict=True):
            answer = _exact(case, shaken[n], right)
            errors[: len(AT_REST), n] = _of_rest(case, ours[n], answer)
        return errors
    both = ([displace(case, pulse, how) for pulse in shaken] for how in (settings, finer))
    return np.array(
        [
            [*_of_rest(case, one.response, right.response), *_of_travel(case, one, right)]
            for one, right in zip(*both, strict=True)
        ]
    ).T


def pulses(case: Case | TerrainCase, number: int) -> list[CosinePulse]:
    """Sample of pulses of a direction, spread evenly in PGV/PGA and the logarithm of PGA."""
    scene = case.full if isinstance(case, Case) else case.seat
    known = case.static_limits, proofs.static_limits(scene.rock, scene.contact, scene.yaw)
    least = next((min(-low, high) for low, high in known if low < 0.0 < high), WEAKEST)
    turns = np.outer(np.arange(1, number + 1), SPREAD) % 1.0
    ratios = unit_of(case) * (PERIODS[0] + (PERIODS[1] - PERIODS[0]) * turns[:, 1])
    peaks = least * (STRONGEST if scene.terrain is None else STRONGEST_ON_TERRAIN) ** turns[:, 0]
    return [CosinePulse(*pulse) for pulse in zip(peaks.tolist(), ratios.tolist(), strict=True)]


def exact(case: Case | TerrainCase) -> tuple[str, ...]:
    """Quantities that have an exact answer."""
    if not isinstance(case, Case):
        return ()
    if rocking_block(case) is not None:
        return ("peak_tilt",)
    return ("slip",) if _slides_alone(case) else ()


def _slides_alone(case: Case) -> bool:
    """Whether a rock is Newmark's block: nothing tips it, and its table follows the motion."""
    return case.slides and case.full.drive is None


def _exact(case: Case, pulse: CosinePulse, fine: Response) -> Response:
    """What is right: the run at the finer step, with what is known without it."""
    block = rocking_block(case)
    if block is not None:
        right = rocking_response(block, pulse.pga, pulse.pgv_pga)
        outcome = Outcome.OVERTURNED if right.overturned else fine.outcome
        return replace(fine, outcome=outcome, peak_tilt=right.peak_angle)
    if _slides_alone(case):
        return replace(fine, slip=farthest(pulse, case.full.contact.friction * GRAVITY))
    return fine


def _of_rest(case: Case | TerrainCase, one: Response, right: Response) -> list[float]:
    """Errors of ``AT_REST``, where the rock stays upright."""
    if one.outcome.overturned != 0 or right.outcome.overturned != 0:
        return [math.nan] * len(AT_REST)
    if isinstance(case, Case):
        topples, radius = case.limits.edge_tilt, case.full.rock.radius
    else:
        topples, radius = case.toppled_tilt, case.seat.rock.radius
    small = SMALL_TILT * topples, SMALL_TILT * topples, SMALL_SLIP * DISPLACED_SHARE * radius
    return [
        abs(getattr(one, name) - getattr(right, name)) / max(getattr(right, name), least)
        for name, least in zip(AT_REST, small, strict=True)
    ]


def _of_travel(case: TerrainCase, one: DisplacementRun, right: DisplacementRun) -> list[float]:
    """Errors of ``OF_TRAVEL``, where the rock leaves its place: relative to the way it goes."""
    ends = {one.response.outcome, right.response.outcome}
    if Outcome.BALANCED in ends or any(end.overturned < 0 for end in ends):
        return [math.nan] * len(OF_TRAVEL)
    ours, path, least = one.trajectory, right.trajectory, SMALL_WAY * case.seat.rock.radius
    times = np.union1d(ours.time, path.time)
    apart = _places(ours, times) - _places(path, times)
    far = np.linalg.norm(apart, axis=1)
    return [float(far[-1]) / max(path.distance, least), float(far.max()) / max(path.length, least)]


def _places(path: Trajectory, times: Array) -> Array:
    """Where a rock is at some times [m]; at its end after that.

    Returns
    -------
    ndarray, shape (n, 3)
    """
    return np.column_stack([np.interp(times, path.time, axis) for axis in path.position.T])
