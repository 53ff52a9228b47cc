"""What each draw of a rock would do in every test, and how likely it makes what was observed."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.config import in_si
from pipeline.config.observation_schema import (
    Earthquake,
    Observation,
    PushTest,
    RockingTest,
    ShakeTest,
    TiltTest,
)
from pipeline.config.problems import InputError, Problem
from pipeline.stages.observations import shaking
from pipeline.stages.observations.shaking import ShakenBy
from pipeline.stages.uncertainty.draws import Draw
from pipeline.workflow.grammar import counted
from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.observations import field_tests, weighing
from vsr_core.run.cases import Settings

Told = Callable[[str], None]

NEGLIGIBLE = 1e-4
"""Weight of a draw, relative to the largest, below which its shaking is not simulated."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """What an observation says of draws.

    Attributes
    ----------
    log_likelihood : ndarray, shape (draws,), 0 for a draw that agrees wholly
    expected : ndarray, shape (draws,)
        What it would be for each draw: the angle [degree], force [N] or frequency [Hz], or the
        probability to stand; NaN where that was not simulated.
    unit : str, of that
    """

    log_likelihood: Array
    expected: Array
    unit: str


def of_observations(
    draws: Sequence[Draw],
    observations: Sequence[Observation],
    shaken: ShakenBy | None,
    settings: Settings,
    tell: Told,
) -> list[Evidence]:
    """The evidence of each observation; shaking last, of draws that the other tests leave over."""
    found: dict[int, Evidence] = {}
    still = [n for n, one in enumerate(observations) if not isinstance(one, ShakeTest | Earthquake)]
    for number in still:
        tell(f"observation {number + 1} of {len(draws)} draws")
        found[number] = _of_test(draws, observations[number])
    left = np.full(len(draws), True)
    if still:
        likely = np.array([one.log_likelihood for one in found.values()])
        if weighing.unexplained(likely):  # which is refused, or more are drawn
            nothing = Evidence(np.zeros(len(draws)), np.full(len(draws), np.nan), "")
            return [found.get(number, nothing) for number in range(len(observations))]
        weight = weighing.weights(likely)
        left = weight > NEGLIGIBLE * weight.max()
    places = np.flatnonzero(left).tolist()
    for number, one in enumerate(observations):
        if number not in found:
            tell(f"observation {number + 1} in {len(places)} draws")
            kept = [draws[place] for place in places]
            found[number] = _spread(_of_shaking(kept, number, one, shaken, settings), left)
    return [found[number] for number in range(len(observations))]


def _of_test(draws: Sequence[Draw], one: Observation) -> Evidence:
    match one:
        case TiltTest():
            angles = np.array([_tilt(draw, one) for draw in draws])
            return _of_threshold(one.angle, one.sd, angles, "°", moved=one.outcome == "tipped")
        case PushTest():
            forces = np.array([_push(draw, one) for draw in draws])
            return _of_threshold(one.force, one.sd, forces, "N", moved=one.outcome == "lifted")
        case RockingTest():
            frequency = np.array([_rocking(draw, one) for draw in draws])
            likely = -0.5 * ((one.frequency - frequency) / one.sd) ** 2
            return Evidence(likely, frequency, "Hz")
    raise AssertionError(one.kind)


def _of_threshold(value: float, sd: float, found: Array, unit: str, *, moved: bool) -> Evidence:
    """What tips and what slides each draw, shape (draws, 2): it stands up to the lesser."""
    likely = weighing.of_threshold(value, sd, *found.T, moved=moved)
    return Evidence(likely, found[:, 0] if moved else found.min(axis=1), unit)


def _tilt(draw: Draw, test: TiltTest) -> Array:
    (slope,) = draw.slopes(np.array([in_si.angle(test.direction)]))
    return np.degrees(field_tests.tilt_angle(float(slope), draw.member.friction))


def _push(draw: Draw, test: PushTest) -> Array:
    (slope,) = draw.slopes(np.array([in_si.angle(test.direction)]))
    weight, friction = draw.rock.mass * GRAVITY, draw.member.friction
    centre = draw.centre_height
    return np.array(field_tests.push_force(weight, float(slope), friction, centre, test.height))


def _rocking(draw: Draw, test: RockingTest) -> float:
    direction = in_si.angle(test.direction)
    one, other = draw.slopes(np.array([direction, direction + math.pi])).tolist()
    amplitude = in_si.angle(test.amplitude)
    return field_tests.rocking_frequency(
        draw.rock, draw.centre_height, direction, (one, other), amplitude
    )


def _of_shaking(
    draws: Sequence[Draw],
    number: int,
    one: Observation,
    shaken: ShakenBy | None,
    settings: Settings,
) -> Evidence:
    if isinstance(one, Earthquake):
        return Evidence(*shaking.of_earthquake(draws, one, settings), "")
    assert isinstance(one, ShakeTest)
    assert shaken is not None
    return Evidence(*shaking.of_shake(draws, one, shaken.motion(number), settings), "")


def _spread(kept: Evidence, left: Array) -> Evidence:
    """The same of all draws, those that were not simulated with no likelihood."""
    likely, expected = np.full(len(left), -np.inf), np.full(len(left), np.nan)
    likely[left], expected[left] = kept.log_likelihood, kept.expected
    return Evidence(likely, expected, kept.unit)


def refuse(
    observations: Sequence[Observation], found: Sequence[Evidence], file: str, least: float
) -> None:
    """Refuse observations that no draw explains, one by one or together.

    Parameters
    ----------
    least : float, logarithm of the likelihood below which a draw does not explain one

    Raises
    ------
    InputError
        By the number of the observation.
    """
    likely = np.array([one.log_likelihood for one in found])
    problems = []
    for number in weighing.unexplained(likely, least):
        own = found[number].expected[np.isfinite(found[number].expected)]
        rule = f"{_range(own, found[number].unit)} in the {len(own)} draws of the rock"
        remedy = "correct it or its sd, or widen the priors of uncertainty"
        key = f"observations.{number}"
        problems.append(Problem(file, key, observations[number].words, rule, remedy))
    if problems:
        raise InputError(*problems)
    if least == weighing.LEAST and (some := weighing.contradiction(likely)):
        *first, last = some
        draws = counted(likely.shape[1], "draw")
        given = f"{observations[first[0]].words}, and {observations[last].words}"
        rule = f"it contradicts observations.{first[0]}: none of {draws} explains both"
        if len(some) > 2:
            given, rule = f"{len(some)} observations", f"none of {draws} explains all together"
        remedy = "correct one, raise its sd, or give priors of uncertainty that lie about them"
        key = "observations" if len(some) > 2 else f"observations.{last}"
        raise InputError(Problem(file, key, given, rule, remedy))


def _range(expected: Array, unit: str) -> str:
    if not unit:
        return f"{100.0 * float(expected.mean()):.2g} % stand"
    space = "" if unit == "°" else " "
    return f"it is {expected.min():.3g} to {expected.max():.3g}{space}{unit}"
