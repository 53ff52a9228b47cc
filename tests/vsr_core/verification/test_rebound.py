"""Bouncing, rolling and sliding on terrain: the answers themselves, and engines against them.

The compiled engine passes all of them. Cases that Bullet is known to fail are told as its faults.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from support.suites import slow_but

from benchmarks import rebound as page
from benchmarks import tumbling
from benchmarks.rebound_figure import _stronge
from vsr_core import GRAVITY
from vsr_core.scene import Contact
from vsr_core.verification.reference import dissipation, impact, incline, rimless_wheel, runout
from vsr_core.verification.reference._run import Path, axes, slope
from vsr_core.verification.reference.impact import UP, Motion
from vsr_core.verification.reference.rimless_wheel import RADIUS, WHEELS, Wheel
from vsr_core.verification.rocks import sphere

Array = NDArray[np.float64]

ENGINES, STEP = ("bullet", "nonsmooth"), 1e-3

each_engine = pytest.mark.parametrize("engine", ENGINES)

SEEDS = st.integers(0, 10**6)
SHARES = st.floats(0.0, 1.0)


def random_impact(seed: int) -> tuple[Motion, Array, Array]:
    """Motion, arm and inertia of a body of any shape whose point comes down."""
    rng = np.random.default_rng(seed)
    arm = rng.normal(size=3)
    arm[2] = -abs(arm[2])
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    inertia = turn @ np.diag(rng.uniform(0.1, 0.9, 3)) @ turn.T
    before = Motion(3.0 * rng.normal(size=3), 3.0 * rng.normal(size=3))
    return before, arm, inertia


# ------------------------------------------------------------------- the answers


@settings(deadline=None, max_examples=60)
@given(seed=SEEDS, restitution=SHARES, friction=st.floats(0.02, 1.2))
def test_an_impact_keeps_its_laws(seed: int, restitution: float, friction: float) -> None:
    before, arm, inertia = random_impact(seed)
    assume(before.at(arm)[2] < -0.05)
    after = impact.rebound(before, arm, inertia, restitution, friction)
    impulse = after.velocity - before.velocity
    # Angular momentum about the point that touches is kept.
    turned = inertia @ (after.angular_velocity - before.angular_velocity) - np.cross(arm, impulse)
    np.testing.assert_allclose(turned, 0.0, atol=1e-9 * np.linalg.norm(impulse))
    left = after.at(arm)
    assert left[2] == pytest.approx(-restitution * before.at(arm)[2])
    across = float(np.hypot(*impulse[:2]))
    assert across <= friction * impulse[2] * (1.0 + 1e-9)
    slip = float(np.hypot(*left[:2]))
    if slip > 1e-6:
        assert across == pytest.approx(friction * impulse[2])
        assert impulse[:2] @ left[:2] == pytest.approx(-across * slip)
    if restitution == 0.0:
        assert after.energy(inertia) <= before.energy(inertia)


@settings(deadline=None, max_examples=60)
@given(
    down=st.floats(0.1, 9.0),
    along=st.floats(-9.0, 9.0),
    angular_velocity=st.floats(-9.0, 9.0),
    restitution=SHARES,
    friction=st.floats(0.01, 1.0),
)
def test_impact_of_a_sphere_in_closed_form(
    down: float, along: float, angular_velocity: float, restitution: float, friction: float
) -> None:
    radius, inertia = 0.5, 0.4 * 0.5**2
    slip = along - radius * angular_velocity
    assume(abs(slip) > 1e-6)
    before = Motion(np.array([along, 0.0, -down]), np.array([0.0, angular_velocity, 0.0]))
    after = impact.rebound(before, -radius * UP, inertia * np.eye(3), restitution, friction)
    most = friction * (1.0 + restitution) * down
    braked = math.copysign(min(abs(slip) / 3.5, most), slip)
    assert after.velocity[0] == pytest.approx(along - braked, abs=1e-9)
    assert after.angular_velocity[1] == pytest.approx(
        angular_velocity + radius * braked / inertia, abs=1e-9
    )
    assert after.energy(inertia * np.eye(3)) <= before.energy(inertia * np.eye(3)) + 1e-9


def test_newtons_restitution_gains_energy_where_stronges_does_not() -> None:
    rng, gained, contact = np.random.default_rng(1), 0, Contact(0.6, 0.9)
    for _ in range(25):
        lean, inertia = rng.uniform(-1.4, 1.4), rng.uniform(0.2, 0.5) * np.eye(3)
        arm = np.array([math.sin(lean), 0.0, -math.cos(lean)])
        before = Motion(np.array([rng.normal(), 0.0, -1.0]), np.zeros(3))
        held = before.energy(inertia)
        law = impact.rebound(before, arm, inertia, contact.restitution, contact.friction)
        gained += law.energy(inertia) > 1.001 * held
        assert _stronge(before, arm, inertia, contact) <= held * (1.0 + 1e-3)
    assert gained > 0


def test_stronge_and_newton_agree_where_the_slip_never_turns() -> None:
    inertia, contact = 0.1 * np.eye(3), Contact(0.3, 0.5)
    arm = np.array([0.0, 0.0, -0.5])
    before = Motion(np.array([5.0, 0.0, -1.0]), np.zeros(3))
    law = impact.rebound(before, arm, inertia, contact.restitution, contact.friction)
    energetic = _stronge(before, arm, inertia, contact)
    assert energetic == pytest.approx(law.energy(inertia), rel=1e-3)


@pytest.mark.parametrize("wheel", WHEELS)
def test_terminal_rate_of_a_wheel_by_marching(wheel: Wheel) -> None:
    rock = rimless_wheel.prism(wheel.sides)
    axis = float((rock.axes * rock.inertia @ rock.axes.T)[1, 1]) / rock.mass
    inertia, half = axis + RADIUS**2, math.pi / wheel.sides

    def swing(_: float, state: Array) -> list[float]:
        return [state[1], GRAVITY * RADIUS * math.sin(state[0]) / inertia]

    def lands(_: float, state: Array) -> float:
        return float(state[0]) - (wheel.angle + half)

    lands.terminal = True  # type: ignore[attr-defined]
    rate, time = wheel.terminal, 0.0
    for _ in range(120):
        start = [wheel.angle - half, rate]
        swung = solve_ivp(swing, (0.0, 9.0), start, events=lands, rtol=1e-10, atol=1e-12)
        before, time = float(swung.y_events[0][0][1]), float(swung.t_events[0][0])
        # About the new edge: its own spin, and the velocity of the axis about the old edge.
        kept = (axis + RADIUS**2 * math.cos(2.0 * half)) / inertia
        rate = kept * before
    assert before == pytest.approx(wheel.terminal, rel=1e-7)
    assert time == pytest.approx(wheel.period, rel=1e-7)
    assert RADIUS * before**2 < GRAVITY * math.cos(wheel.angle + half)  # it stays on the ground


@pytest.mark.parametrize("friction", [0.1, 0.3, 0.45])
def test_run_out_through_a_bend_is_that_of_many_chords(friction: float) -> None:
    bend, chords = runout.Bend(), 4000
    speed = 2.0 * GRAVITY * bend.length * (math.sin(bend.angle) - friction * math.cos(bend.angle))
    turn = bend.angle / chords
    for k in range(chords):
        # Turned by a chord it loses what its impulse on the ground and the friction of that take.
        speed *= (math.cos(turn) - friction * math.sin(turn)) ** 2
        lean = bend.angle - (k + 1) * turn
        push = GRAVITY * (math.sin(lean) - friction * math.cos(lean))
        speed += 2.0 * push * bend.radius * turn
    exact = bend.run_out(friction)
    assert exact == pytest.approx(max(speed, 0.0) / (2.0 * friction * GRAVITY), abs=0.02)
    drop, level = bend.top[1], exact - bend.top[0]
    assert drop / level > friction  # the line falls faster than friction alone has it


# ------------------------------------------------------------------- the engines


@pytest.mark.slow
@each_engine
@settings(deadline=None, max_examples=8, derandomize=True)
@given(degrees=st.floats(12.0, 60.0), friction=st.floats(0.05, 1.0), cut=st.booleans())
def test_spheres_roll_and_slip(engine: str, degrees: float, friction: float, cut: bool) -> None:
    angle = math.radians(degrees)
    least = 2.0 / 7.0 * math.tan(angle)
    assume(abs(friction / least - 1.0) > 0.1)
    contact = Contact(friction, 0.38)
    ground = incline.ground(angle, 1.0, cut)
    found, turning = incline.descend(ground, angle, contact, engine, STEP)
    exact, spun = incline.acceleration(angle, friction)
    assert found == pytest.approx(exact, rel=0.01)
    assert turning == pytest.approx(spun, rel=0.02)


@each_engine
@pytest.mark.parametrize("cut", [False, True])
@pytest.mark.parametrize("cell", slow_but([1.0], [3.0, 1.0, 0.5]))
def test_a_sphere_feels_no_border(cell: float, cut: bool, engine: str) -> None:
    assert incline.rolling(math.radians(20.0), 0.6, cell, cut, engine, STEP) < 5e-3


@each_engine
@pytest.mark.parametrize("cut", [False, True])
@pytest.mark.parametrize("restitution", [0.38, 0.8])
@pytest.mark.parametrize("name", impact.THROWS)
def test_impacts(name: str, restitution: float, cut: bool, engine: str) -> None:
    cell = 1.5 if cut else 0.5
    for friction in (0.3, 0.6, 0.9):
        contact = Contact(friction, restitution)
        error = impact.error(impact.THROWS[name], contact, cell, cut, engine, STEP)
        if engine == "nonsmooth":
            assert error < 5e-3
        else:
            assert error < (0.04 if name == "corner" and friction == 0.3 else 0.015)


@each_engine
@pytest.mark.parametrize("restitution", [0.0, 0.38])
def test_run_out_knows_no_mass(restitution: float, engine: str) -> None:
    angle = math.radians(10.0)
    ground = slope(angle, (-1.0, 11.0), 3.0, 12.0, True)
    lines = [
        runout.energy_line(
            runout.block(density), angle, Contact(0.6, restitution), ground, engine, STEP
        )
        for density in (500.0, 5000.0)
    ]
    assert lines[0] == pytest.approx(lines[1], rel=1e-6)


@pytest.mark.parametrize(
    ("restitution", "cut", "engine"),
    [
        *itertools.product((0.0, 0.38), (False, True), ("nonsmooth",)),
        (0.38, False, "bullet"),
        (0.0, True, "bullet"),
        pytest.param(0.0, False, "bullet", marks=pytest.mark.slow),
        pytest.param(0.38, True, "bullet", marks=pytest.mark.slow),
    ],
)
def test_energy_never_grows(restitution: float, cut: bool, engine: str) -> None:
    contact = Contact(0.6, restitution)
    assert dissipation.worst(8, contact, cut, engine, STEP) < 0.01


@each_engine
@pytest.mark.parametrize("cut", [False, True])
def test_energy_never_grows_without_friction(cut: bool, engine: str) -> None:
    assert dissipation.worst(6, Contact(0.0, 0.8), cut, engine, STEP) < 0.01


def test_a_rise_of_the_energy_is_seen() -> None:
    rock = sphere(0.5)
    speed = np.array([3.0, 1.0, 2.0])
    velocity = np.column_stack([speed, np.zeros((3, 2))])
    turns = np.broadcast_to(np.eye(3), (3, 3, 3))
    path = Path(np.arange(3.0), np.zeros((3, 3)), turns, velocity, np.zeros((3, 3)))
    np.testing.assert_allclose(dissipation.energy(rock, path), 0.5 * speed**2)
    spinning = replace(path, velocity=np.zeros((3, 3)), angular_velocity=velocity)
    np.testing.assert_allclose(dissipation.energy(rock, spinning), 0.05 * speed**2)


def test_ground_is_an_even_slope_whatever_it_is_made_of() -> None:
    angle = math.radians(30.0)
    for cut in (False, True):
        ground = slope(angle, (-1.0, 3.0), 1.0, 1.0, cut)
        heights = (ground.vertices @ axes(angle))[:, 2]
        np.testing.assert_allclose(heights, 0.0, atol=1e-12)
        assert len(ground.parts) == (8 if cut else 0)
        for part in ground.parts:
            inside = part @ axes(angle)
            assert inside[:, 2].max() == pytest.approx(0.0, abs=1e-12)
            assert inside[:, 2].min() < -0.01


@pytest.mark.slow
@each_engine
def test_pushes_are_the_same_again_and_start_above_the_ground(engine: str) -> None:
    contact = Contact(0.6, 0.38)
    first, again = (tumbling.tumble(engine, contact, False, 3) for _ in range(2))
    np.testing.assert_array_equal(first[0].position, again[0].position)
    assert first[1] > 2.0
    terrain = tumbling.ground(False)
    for number in range(5):
        start = tumbling.push(number)
        corners = start.position + tumbling.rock().vertices @ start.rotation.T
        clear = [z - terrain.surfaces(x, y)[0][-1] for x, y, z in corners.tolist()]
        assert min(clear) == pytest.approx(tumbling.ABOVE)


def test_page_has_every_case() -> None:
    text = page.PAGE.read_text(encoding="utf-8")
    for row in page.ROWS:
        assert f"| {row.what} |" in text
    assert page.FIGURE.stat().st_size > 50_000
    assert text.count("±") == 21


@each_engine
def test_a_block_slides_over_the_border_of_two_pieces(engine: str) -> None:
    error = runout.sliding(math.radians(10.0), Contact(0.6), 1.0, True, engine, STEP)
    assert error < (1e-3 if engine == "nonsmooth" else 0.1)


def slow_sphere(cut: bool, engine: str) -> float:
    """Error of the acceleration of a sphere that rolls down 2 deg."""
    angle = math.radians(2.0)
    found, _ = incline.descend(incline.ground(angle, 1.0, cut), angle, Contact(0.6), engine, STEP)
    return abs(found / incline.acceleration(angle, 0.6)[0] - 1.0)


@each_engine
def test_a_slow_sphere_stays_on_the_ground_of_parts(engine: str) -> None:
    assert slow_sphere(True, engine) < 0.02


@pytest.mark.parametrize("facets", [20, 40, 80])
def test_a_block_slides_through_a_bend_the_better_the_finer_it_is(facets: int) -> None:
    """The block is not a point: 5 cm of 8 m, and its ends bridge the arc."""
    bend = runout.Bend()
    found = runout.bending(bend, Contact(0.3), facets, False, "nonsmooth", STEP)
    assert found == pytest.approx(bend.run_out(0.3), rel=0.01 + 0.3 / facets)


# ------------------------------------------------------------------- known faults of Bullet


def bent(cut: bool, engine: str) -> float:
    """Error of the run-out through a bend of 20 facets."""
    bend = runout.Bend()
    exact = bend.run_out(0.3)
    return abs(runout.bending(bend, Contact(0.3), 20, cut, engine, STEP) / exact - 1.0)


def in_the_cone(cut: bool, engine: str) -> float:
    """Error of the impact of a corner that slides on, without restitution."""
    return impact.error(impact.THROWS["corner"], Contact(0.3), 1.5, cut, engine, STEP)


def wheel(number: int, cut: bool, engine: str) -> float:
    """Error of the distance that a wheel rolls at its terminal speed."""
    return rimless_wheel.distance(WHEELS[number], 1.0, cut, engine, STEP)


FAULTS = {
    "borders of triangles brake a slow sphere": (partial(slow_sphere, False), 0.02),
    "hulls catch where a slope of triangles bends": (partial(bent, False), 0.025),
    "hulls catch where a slope of parts bends": (partial(bent, True), 0.025),
    "one end of 8 edges is found first, on triangles": (partial(wheel, 0, False), 2e-3),
    "one end of 8 edges is found first, on parts": (partial(wheel, 0, True), 2e-3),
    "one end of 12 edges is found first": (partial(wheel, 1, True), 2e-3),
    "friction without restitution is a pyramid, on triangles": (partial(in_the_cone, False), 2e-3),
    "friction without restitution is a pyramid, on parts": (partial(in_the_cone, True), 2e-3),
}  # fmt: skip
"""What is wrong in Bullet, the error of a case that shows it, and the largest one of the compiled
engine."""


@pytest.mark.parametrize("fault", FAULTS)
def test_the_compiled_engine_has_no_fault_of_bullets(fault: str) -> None:
    error, most = FAULTS[fault]
    assert 0.0 <= error("nonsmooth") < most


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_of_bullet_are_there(fault: str) -> None:
    """docs/rebound.md tells them: one that is gone is to go there too."""
    error, most = FAULTS[fault]
    assert error("bullet") > most
