"""Impacts in the compiled engine: no energy from nowhere, and the laws where they hold."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from support.suites import slow_but

from vsr_core import GRAVITY, engines
from vsr_core.engines.nonsmooth import build
from vsr_core.errors import InvalidInput
from vsr_core.rock.body import Rock
from vsr_core.scene import Contact, Scene, State
from vsr_core.verification.reference import dissipation
from vsr_core.verification.rocks import box, hull, sphere

Array = NDArray[np.float64]

SEEDS = st.integers(0, 10**6)
SHARES = st.floats(0.0, 1.0)
LAWS = st.booleans()


def energy(rock: Rock, state: State) -> float:
    """Kinetic and potential energy per unit mass [m^2/s^2]."""
    spin = (state.rotation @ rock.axes).T @ state.angular_velocity
    kinetic = state.velocity @ state.velocity + spin @ (rock.inertia / rock.mass * spin)
    return 0.5 * float(kinetic) + GRAVITY * float(state.position[2])


def thrown(rock: Rock, seed: int, step: float, flat: bool = False) -> State:
    """Any pose, or flat, and any motion down, so that the rock lands within the third step."""
    rng = np.random.default_rng(seed)
    turn = np.eye(3) if flat else Rotation.random(random_state=seed).as_matrix()
    velocity, spin = 2.0 * rng.normal(size=3), 3.0 * rng.normal(size=3)
    velocity[2] = -1.0 - abs(velocity[2])
    arms = rock.vertices @ turn.T
    falls = arms[:, 2] + step * rng.uniform(2.0, 3.0) * (np.cross(spin, arms)[:, 2] + velocity[2])
    return State(np.array([0.0, 0.0, -falls.min()]), turn, velocity, spin)


def landed(rock: Rock, contact: Contact, start: State, step: float, steps: int = 6) -> State:
    world = build(Scene(rock, contact, start=start), step)
    world.advance([0.0] * steps)
    return world.state()


def moment_unknown(start: State, after: State, step: float) -> float:
    """Energy by which a rock is too high, of first order in the step [J/kg].

    It lands in one step, and its velocity changes by the next: two steps at the new speed.
    """
    return GRAVITY * 2.0 * step * abs(float(after.velocity[2] - start.velocity[2]))


def hull_of(seed: int) -> Rock:
    corners = np.random.default_rng(seed).normal(size=(12, 3)) * [0.6, 0.45, 0.35]
    return hull(corners, as_scanned=True)


@settings(deadline=None, max_examples=200)
@given(seed=SEEDS, e=SHARES, mu=st.floats(0.0, 1.5), energetic=LAWS, flat=LAWS, long=LAWS)
def test_a_cube_never_gains_energy(
    seed: int, e: float, mu: float, energetic: bool, flat: bool, long: bool
) -> None:
    """Flat, its corners land one after the other, in one step or in several."""
    rock, step = box(1.0, 1.0, 1.0), 1e-3 if long else 1e-5
    start = thrown(rock, seed, step, flat)
    after = landed(rock, Contact(mu, e, energetic=energetic), start, step)
    held = energy(rock, start)
    held += moment_unknown(start, after, step)
    assert energy(rock, after) <= held * (1.0 + (1e-3 if long else 1e-7))


@pytest.mark.slow
@settings(deadline=None, max_examples=200)
@given(seed=SEEDS, e=SHARES, mu=st.floats(0.0, 1.5), energetic=LAWS)
@example(seed=1, e=1.0, mu=0.0, energetic=False)
def test_a_hull_never_gains_energy(seed: int, e: float, mu: float, energetic: bool) -> None:
    """In steps so short that its pose is that of the moment of touching."""
    rock, step = hull_of(seed % 40), 1e-5
    start = thrown(rock, seed, step)
    after = landed(rock, Contact(mu, e, energetic=energetic), start, step)
    held = energy(rock, start) + moment_unknown(start, after, step)
    assert energy(rock, after) <= held * (1.0 + 1e-7)


@settings(deadline=None, max_examples=60)
@given(seed=SEEDS, e=st.floats(0.05, 1.0), energetic=LAWS)
def test_a_corner_without_friction_leaves_as_newton_has_it(
    seed: int, e: float, energetic: bool
) -> None:
    rock, step = hull_of(seed % 40), 1e-6
    start = thrown(rock, seed, step)
    low = rock.vertices[np.argmin(rock.vertices @ start.rotation[2])]
    others = np.sort(rock.vertices @ start.rotation[2])
    assume(others[1] - others[0] > 1e-3)

    def approach(state: State) -> float:
        arm = state.rotation @ low
        return float(state.velocity[2] + np.cross(state.angular_velocity, arm)[2])

    assume(approach(start) < -0.1)
    after = landed(rock, Contact(0.0, e, energetic=energetic), start, step)
    # In the six steps weight, curvature and gyroscopic turning change the corner's speed too.
    turning = max(float(at.angular_velocity @ at.angular_velocity) for at in (start, after))
    beside = 6 * step * (GRAVITY + 2.0 * turning * rock.radius)
    assert approach(after) == pytest.approx(-e * approach(start), abs=beside)


@settings(deadline=None, max_examples=30)
@given(seed=SEEDS, e=SHARES, mu=st.floats(0.0, 1.0))
def test_a_sphere_knows_no_difference_of_laws(seed: int, e: float, mu: float) -> None:
    """Its impulse passes through the centre of mass, or does not change what is normal."""
    rock, step = sphere(0.5), 1e-3
    rng = np.random.default_rng(seed)
    velocity = np.append(rng.normal(size=2), -2.0)
    start = State(np.array([0.0, 0.0, 0.5 + 4e-3]), np.eye(3), velocity, 3.0 * rng.normal(size=3))
    newton, energetic = (
        landed(rock, Contact(mu, e, energetic=law), start, step) for law in (False, True)
    )
    np.testing.assert_array_equal(newton.velocity, energetic.velocity)
    np.testing.assert_array_equal(newton.angular_velocity, energetic.angular_velocity)
    if e > 0.05:
        assert newton.velocity[2] == pytest.approx(2.0 * e, abs=0.06)


@pytest.mark.parametrize("hulls", [4, pytest.param(16, marks=pytest.mark.slow)])
@pytest.mark.parametrize("cut", [False, True])
@pytest.mark.parametrize(
    ("e", "mu"),
    slow_but([(0.8, 0.6), (1.0, 1.0)], [(0.8, 0.6), (0.8, 1.0), (1.0, 0.3), (1.0, 1.0)]),
)
def test_tumbling_hulls_never_gain_energy(e: float, mu: float, cut: bool, hulls: int) -> None:
    assert dissipation.worst(hulls, Contact(mu, e), cut, "nonsmooth", 1e-3) < 1e-3


def test_an_energetic_impact_is_refused_by_an_engine_without_it() -> None:
    scene = Scene(box(1.0, 1.0, 2.0), Contact(0.6, 0.5, energetic=True))
    with pytest.raises(InvalidInput, match="newton"):
        engines.load("bullet").build(scene, 1e-3, 1)


# ------------------------------------------------------------------- a rod whose slip stops


STEP = 1e-5


@dataclass(frozen=True)
class Rod:
    """A rod of 1:20 at 45 deg whose lower end comes down, slips, is stopped, and sticks.

    Its impact in closed form (Stronge 2000, 4.2): velocities of the end are linear in its normal
    impulse p, first with friction against the slip, then with as much as keeps it from slipping.
    """

    friction: float
    lean: float = math.radians(45.0)

    @property
    def rock(self) -> Rock:
        return box(0.05, 0.05, 1.0)

    @property
    def arm(self) -> tuple[float, float]:
        """Place of the end from the middle, along the ground and up [m]."""
        sin, cos = math.sin(self.lean), math.cos(self.lean)
        return -0.5 * sin + 0.025 * cos, -0.5 * cos - 0.025 * sin

    inertia = (0.05**2 + 1.0) / 12.0
    falls, turns = -2.0, -0.5

    @property
    def compliance(self) -> tuple[float, float, float]:
        """Change of the end's velocity by an impulse: along by along, up by up, along by up."""
        x, z = self.arm
        return 1.0 + z * z / self.inertia, 1.0 + x * x / self.inertia, -x * z / self.inertia

    @property
    def comes(self) -> tuple[float, float]:
        """Velocity of the end along the ground and up [m/s]."""
        x, z = self.arm
        return self.turns * z, self.falls - self.turns * x

    def end(self, impulse: float) -> tuple[float, float, float]:
        """Impulse along, and velocities along and up, once the normal impulse is ``impulse``."""
        along, up, both = self.compliance
        slip, v = self.comes
        braking = -math.copysign(self.friction, slip)
        stops = -slip / (both + braking * along)
        assert stops > 0.0
        assert abs(both / along) < self.friction  # then it sticks
        friction = braking * min(impulse, stops) - both / along * max(0.0, impulse - stops)
        return (
            friction,
            slip + along * friction + both * impulse,
            v + both * friction + up * impulse,
        )

    def kept(self, impulse: float) -> float:
        """Share of the energy that is kept."""
        friction, (x, z) = self.end(impulse)[0], self.arm
        turns = self.turns + (z * friction - x * impulse) / self.inertia
        after = friction**2 + (self.falls + impulse) ** 2 + self.inertia * turns**2
        return after / (self.falls**2 + self.inertia * self.turns**2)

    def work(self, impulse: float) -> float:
        """Work of the normal force until then."""
        return float(quad(lambda p: self.end(p)[2], 0.0, impulse, limit=200)[0])

    def laws(self, e: float) -> dict[str, float]:
        """Normal impulse at the end of the impact, by all laws."""
        most = 10.0 * abs(self.falls)
        stopped = brentq(lambda p: self.end(p)[2], 0.0, most)
        returned = -(e**2) * self.work(stopped)
        return {
            "plastic": stopped,
            "newton": brentq(lambda p: self.end(p)[2] + e * self.comes[1], 0.0, most),
            "poisson": (1.0 + e) * stopped,
            "stronge": brentq(
                lambda p: self.work(p) - self.work(stopped) - returned, stopped, most
            ),
        }

    def in_engine(self, e: float, energetic: bool) -> float:
        """Share of the energy that is kept in the engine."""
        turn = Rotation.from_euler("y", self.lean).as_matrix()
        place = np.array([0.0, 0.0, 2.5 * STEP * abs(self.comes[1]) - self.arm[1]])
        start = State(place, turn, np.array([0.0, 0.0, self.falls]), np.array([0, self.turns, 0.0]))
        contact = Contact(self.friction, e, energetic=energetic)
        after = landed(self.rock, contact, start, STEP)
        held = energy(self.rock, start) - GRAVITY * start.position[2]
        return (energy(self.rock, after) - GRAVITY * after.position[2]) / held


@pytest.mark.parametrize("e", [0.0, 0.38, 0.8, 1.0])
def test_a_rod_whose_slip_stops_against_closed_forms(e: float) -> None:
    rod = Rod(0.6)
    kept = {law: rod.kept(impulse) for law, impulse in rod.laws(e).items()}
    own = {law: rod.in_engine(e, energetic=law == "energetic") for law in ("newton", "energetic")}
    if kept["newton"] <= 1.0:
        assert own["newton"] == pytest.approx(kept["newton"], abs=5e-4)
    else:
        assert e == 1.0
        assert kept["newton"] == pytest.approx(1.07, abs=0.01)  # what must not be
        assert 0.99 < own["newton"] <= 1.0
    # It gives back e^2 of the energy taken, of which friction took little before it stuck.
    bound = kept["plastic"] + e**2 * (1.0 - kept["plastic"])
    assert bound - 3e-3 < own["energetic"] <= bound + 5e-4
    assert own["energetic"] == pytest.approx(kept["stronge"], abs=5e-3)
    if e > 0.0:
        assert kept["poisson"] < kept["stronge"] < kept["newton"]
