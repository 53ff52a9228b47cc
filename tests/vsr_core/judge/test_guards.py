"""Guards of runs and the recognition of rest, on made-up states with known answers."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from vsr_core import GRAVITY
from vsr_core.compiled import records
from vsr_core.judge import record as judge
from vsr_core.judge.proofs import Barrier
from vsr_core.judge.record import Criteria, RunRecord
from vsr_core.rock import solid
from vsr_core.run import loop
from vsr_core.run.loop import HALVINGS, at_halved_steps
from vsr_core.scene import State

STANDING = State(np.array([0.0, 0.0, 1.0]), np.eye(3), np.zeros(3), np.zeros(3))
BLOCK = solid.box((1.0, 1.0, 2.0), 1000.0).rock
UP = np.array([0.0, 0.0, 1.0])


def criteria(radius: float = 1.0) -> Criteria:
    """A rest has less than 1 m^2/s^2 for 2 s, and no longer path than 0.01 m."""
    limits = Barrier(np.zeros(1), np.zeros(1), 1.0, 0.0, 0.0, 0.0, 0.0)
    shares = 1.0, 2.0, 0.01, 0.01, 0.01, math.inf
    ends = {"proves": True, "whole": False, "follow": False}
    return Criteria(limits, UP, 0.6, 0.0, radius, 1.0, *shares, **ends)


def record(state: State = STANDING) -> RunRecord:
    made = records.room(RunRecord)
    loop.writer(made, BLOCK)(state)
    judge.begin(made, criteria())
    return made


def shifted(metres: float) -> State:
    return replace(STANDING, position=np.array([metres, 0.0, 1.0]))


def test_steps_are_halved_until_the_guards_hold_and_no_further() -> None:
    tried: list[float] = []

    def attempt(step: float) -> float:
        tried.append(step)
        return step

    assert at_halved_steps(8.0, attempt, lambda step: step > 2.0) == 2.0
    assert tried == [8.0, 4.0, 2.0]
    tried.clear()
    assert at_halved_steps(1.0, attempt, lambda step: True) == 0.5**HALVINGS
    assert len(tried) == HALVINGS + 1


@pytest.mark.filterwarnings("ignore:invalid value encountered")
@pytest.mark.parametrize("name", ["position", "rotation", "velocity", "angular_velocity"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_one_number_that_is_not_finite_is_seen(name: str, value: float) -> None:
    assert judge.is_finite(record())
    for place in range(getattr(STANDING, name).size):
        array = getattr(STANDING, name).copy()
        array.flat[place] = value
        assert not judge.is_finite(record(replace(STANDING, **{name: array})))


@settings(deadline=None)  # the first one may compile
@given(st.floats(0.0, 50.0), st.floats(0.0, 3.0), st.floats(0.1, 10.0))
def test_energy_may_grow_by_what_the_table_gives_and_a_little(
    height: float, impulse: float, radius: float
) -> None:
    """Above the floor sqrt(2 e) grows by the impulse at most; 2 % of g R is left to an engine."""
    made = record()
    made.start[2], start = height, GRAVITY * height
    most = 0.5 * (math.sqrt(2.0 * start) + impulse) ** 2
    slack = 0.02 * GRAVITY * radius
    made.energy = most + 0.99 * slack
    assert not judge.gained_too_much(made, criteria(radius), impulse)
    made.energy = most + 1.01 * slack + 1e-9 * most
    assert judge.gained_too_much(made, criteria(radius), impulse)


def test_an_energy_that_is_no_number_is_too_much() -> None:
    made = record()
    made.energy = math.nan
    assert judge.gained_too_much(made, criteria(), 0.0)


def test_kinetic_energy_is_that_of_the_principal_axes_in_any_pose() -> None:
    """A body turning about its own x axis, however it is held."""
    for rotation in Rotation.random(5, random_state=1).as_matrix():
        state = State(np.zeros(3), rotation, np.array([3.0, 0.0, 4.0]), rotation[:, 0] * 2.0)
        made = record(state)
        judge.note(made, criteria())
        about_x = BLOCK.inertia[int(np.argmax(np.abs(BLOCK.axes[0])))] / BLOCK.mass
        assert made.kinetic == pytest.approx(0.5 * 25.0 + 0.5 * about_x * 4.0)


def test_tilt_and_slip_are_those_of_the_base() -> None:
    """Tilted by 0.1 rad about the foot of its axis, the base's centre stays where it is."""
    made = record()
    turn = Rotation.from_euler("y", 0.1).as_matrix()
    loop.writer(made, BLOCK)(replace(STANDING, position=turn[:, 2], rotation=turn))
    judge.note(made, criteria())
    assert (made.tilt, made.peak_tilt) == pytest.approx((0.1, 0.1))
    assert made.slip == pytest.approx(0.0, abs=1e-12)
    loop.writer(made, BLOCK)(shifted(0.3))
    judge.note(made, criteria())
    assert (made.tilt, made.peak_tilt, made.slip) == pytest.approx((0.0, 0.1, 0.3))


def at(made: RunRecord, time: float, state: State, kinetic: float = 0.5) -> bool:
    """Whether a rock rests that is in a state with a kinetic energy."""
    loop.writer(made, BLOCK)(state)
    made.kinetic = kinetic
    judge.note_rest(made, criteria(), time)
    return judge.rests(made, criteria(), time)


def test_a_rock_rests_once_it_has_stood_still_for_long_enough() -> None:
    made = record()
    assert [at(made, time, STANDING) for time in (0.0, 1.9, 2.0)] == [False, False, True]


@pytest.mark.parametrize("kinetic", [1.0, 5.0, math.nan])
def test_a_rock_that_moves_meanwhile_begins_to_rest_anew(kinetic: float) -> None:
    made = record()
    told = ((0.0, 0.0), (1.5, kinetic), (1.6, 0.0), (3.5, 0.0), (3.7, 0.0))
    assert [at(made, time, STANDING, energy) for time, energy in told] == [False] * 4 + [True]


def test_a_rock_on_a_table_that_moves_does_not_rest() -> None:
    made = record()
    made.table_speed = 1.1
    assert [at(made, time, STANDING) for time in (0.0, 2.1)] == [False, False]


@pytest.mark.parametrize(("path", "reached"), [(0.009, True), (0.011, False)])
def test_a_rock_that_creeps_does_not_rest(path: float, reached: bool) -> None:
    made = record()
    at(made, 0.0, STANDING)
    assert at(made, 2.5, shifted(path)) is reached


def test_turning_counts_as_creeping() -> None:
    """A turn by 0.02 rad moves the end of a radius of 1 m by 0.02 m."""
    made = record()
    at(made, 0.0, STANDING)
    turned = replace(STANDING, rotation=Rotation.from_euler("z", 0.02).as_matrix())
    assert not at(made, 2.5, turned)
