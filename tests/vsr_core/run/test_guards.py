"""Guards of runs and the recognition of rest, on made-up states with known answers."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from vsr_core import GRAVITY
from vsr_core.run.guards import (
    HALVINGS,
    Rest,
    at_halved_steps,
    finite,
    gained_too_much,
    kinetic_energy,
)
from vsr_core.scene import State

STANDING = State(np.array([0.0, 0.0, 1.0]), np.eye(3), np.zeros(3), np.zeros(3))


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


@pytest.mark.parametrize("name", ["position", "rotation", "velocity", "angular_velocity"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_one_number_that_is_not_finite_is_seen(name: str, value: float) -> None:
    assert finite(STANDING)
    array = getattr(STANDING, name).copy()
    array.flat[-1] = value
    assert not finite(replace(STANDING, **{name: array}))


@given(st.floats(0.0, 50.0), st.floats(0.0, 3.0), st.floats(0.1, 10.0))
def test_energy_may_grow_by_what_the_table_gives_and_a_little(
    height: float, impulse: float, radius: float
) -> None:
    """Above the floor sqrt(2 e) grows by the impulse at most; 2 % of g R is left to an engine."""
    start = GRAVITY * height
    most = 0.5 * (math.sqrt(2.0 * start) + impulse) ** 2
    slack = 0.02 * GRAVITY * radius
    assert not gained_too_much(most + 0.99 * slack, height, 0.0, impulse, radius)
    assert gained_too_much(most + 1.01 * slack + 1e-9 * most, height, 0.0, impulse, radius)


def test_an_energy_that_is_no_number_is_too_much() -> None:
    assert gained_too_much(math.nan, 1.0, 0.0, 0.0, 1.0)


def test_kinetic_energy_is_that_of_the_principal_axes_in_any_pose() -> None:
    """A body turning about its own x axis, however it is held."""
    inertia = np.diag([0.2, 0.5, 0.9])
    for rotation in Rotation.random(5, random_state=1).as_matrix():
        state = State(np.zeros(3), rotation, np.array([3.0, 0.0, 4.0]), rotation[:, 0] * 2.0)
        assert kinetic_energy(inertia, state) == pytest.approx(0.5 * 25.0 + 0.5 * 0.2 * 4.0)


def rest() -> Rest:
    return Rest(energy=1.0, duration=2.0, creep=0.01, radius=1.0)


def test_a_rock_rests_once_it_has_stood_still_for_long_enough() -> None:
    watched = rest()
    for time, reached in ((0.0, False), (1.9, False), (2.0, True)):
        watched.note(time, STANDING, 0.5)
        assert watched.reached(time, STANDING) is reached


@pytest.mark.parametrize("kinetic", [1.0, 5.0, math.nan])
def test_a_rock_that_moves_meanwhile_begins_to_rest_anew(kinetic: float) -> None:
    watched = rest()
    for time, energy in ((0.0, 0.0), (1.5, kinetic), (1.6, 0.0)):
        watched.note(time, STANDING, energy)
    assert not watched.reached(3.5, STANDING)
    assert watched.reached(3.7, STANDING)


@pytest.mark.parametrize(("path", "reached"), [(0.009, True), (0.011, False)])
def test_a_rock_that_creeps_does_not_rest(path: float, reached: bool) -> None:
    watched = rest()
    watched.note(0.0, STANDING, 0.0)
    watched.note(2.5, shifted(path), 0.0)
    assert watched.reached(2.5, shifted(path)) is reached


def test_turning_counts_as_creeping() -> None:
    """A turn by 0.02 rad moves the end of a radius of 1 m by 0.02 m."""
    watched = rest()
    turned = replace(STANDING, rotation=Rotation.from_euler("z", 0.02).as_matrix())
    watched.note(0.0, STANDING, 0.0)
    watched.note(2.5, turned, 0.0)
    assert not watched.reached(2.5, turned)
