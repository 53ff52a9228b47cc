"""Tables that move in several axes, against statics, flight in the world's frame, and symmetry."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from vsr_core import GRAVITY, engines
from vsr_core.engines.bullet import BulletWorld
from vsr_core.engines.interface import Solver, TurningWorld
from vsr_core.errors import InvalidInput
from vsr_core.judge.proofs import Barrier, barrier
from vsr_core.motions.pulses import CosinePulse
from vsr_core.motions.sampled import SampledMotion, sampled
from vsr_core.motions.six_axes import (
    AXES,
    AxisPulse,
    AxisPulses,
    TableMotion,
    angular_velocity,
    rotation,
)
from vsr_core.outcome import Outcome, Response
from vsr_core.rock import solid
from vsr_core.rock.body import Rock
from vsr_core.run import loop
from vsr_core.run.cases import Settings, prepare
from vsr_core.run.input_checks import check
from vsr_core.run.overturning import simulate
from vsr_core.scene import Contact, Scene, State
from vsr_core.table.servo import PUBLISHED

Array = NDArray[np.float64]
STEP = 1e-3
TURNING = pytest.mark.parametrize("engine", ["bullet", "nonsmooth"])


@cache
def box(size: tuple[float, float, float] = (1.0, 1.0, 2.0)) -> tuple[Rock, Barrier]:
    rock = solid.box(size, 2110.0).rock
    return rock, barrier(rock)


def world_of(scene: Scene, engine: str = "bullet", step: float = STEP) -> TurningWorld:
    # At the limit of friction a block creeps by what the search for impulses leaves over.
    solver = Solver(iterations=8, residual=1e-6) if engine == "nonsmooth" else None
    return cast(TurningWorld, engines.load(engine).build(scene, step, 1, solver))


def middles(duration: float, step: float = STEP) -> Array:
    return (np.arange(round(duration / step)) + 0.5) * step


def respond(
    motion: TableMotion | CosinePulse, scene: Scene, engine: str = "bullet", *, reduce: bool = True
) -> Response:
    limits = barrier(scene.rock)
    settings = Settings(8e-4, reduce, engine=engine)
    case = prepare(scene, limits, reduce=reduce)
    check(case, settings, motion)
    return simulate(case, motion, settings)


def on_axis(axis: str, peak: float, ratio: float) -> AxisPulses:
    return AxisPulses((AxisPulse(axis, peak, ratio),))  # type: ignore[arg-type]


def ramp(axis: str, angle: float, rise: float = 2.0, stay: float = 2.0) -> SampledMotion:
    """To an angle without a jerk, and there."""
    time = np.linspace(0.0, rise + stay, 401)
    s = np.clip(time / rise, 0.0, 1.0)
    samples = np.zeros((401, 6))
    samples[:, AXES.index(axis)] = angle * s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
    return sampled(time, samples)


def test_a_table_does_not_tilt_beyond_the_vertical() -> None:
    """Degrees without their unit do, and would be taken for radians."""
    assert ramp("pitch", 1.5).duration == 4.0
    for axis in ("roll", "pitch"):
        with pytest.raises(InvalidInput, match="beyond the vertical"):
            ramp(axis, 5.0)


class Tumbling(TableMotion):
    """Cosines on all six axes, at rest and level at t = 0."""

    duration = 1.5
    shortest_time = 0.3
    turns = True
    fine_times = np.linspace(0.0, 1.5, 301)

    def derivative(self, t: Array, order: int) -> Array:
        rate = np.array([2.0, 1.3, 0.7, 1.1, 1.7, 2.3])
        size = np.array([0.3, 0.2, 0.4, 0.5, 0.6, 1.5])
        phase = t[:, None] * rate
        values = (1.0 - np.cos(phase), rate * np.sin(phase), rate**2 * np.cos(phase))
        return cast(Array, size * values[order])


# Kinematics


def test_rotation_is_roll_then_pitch_then_yaw_about_the_worlds_axes() -> None:
    angles = np.random.default_rng(1).uniform(-3.0, 3.0, (20, 3))
    expected = Rotation.from_euler("xyz", angles).as_matrix()
    np.testing.assert_allclose(rotation(angles), expected, atol=1e-14)


def test_angular_velocity_is_what_turns_the_matrix() -> None:
    """R^T R' by differences of R, and the rate by differences of that."""
    motion, t, h = Tumbling(), np.linspace(0.1, 1.4, 27), 1e-4

    def body_rate(at: Array) -> Array:
        before, now, after = (rotation(motion.derivative(at + d, 0)[:, 3:]) for d in (-h, 0.0, h))
        skew = np.einsum("nji,njk->nik", now, (after - before) / (2.0 * h))
        return np.column_stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]])

    courses = [motion.derivative(t, order)[:, 3:] for order in range(3)]
    velocity, rate = angular_velocity(*courses)
    np.testing.assert_allclose(velocity, body_rate(t), atol=1e-6)
    slope = (body_rate(t + 1e-3) - body_rate(t - 1e-3)) / 2e-3
    np.testing.assert_allclose(rate, slope, atol=1e-4)


@given(st.sampled_from(AXES), st.floats(-5.0, 5.0), st.floats(0.05, 2.0))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_a_pulse_is_the_cosine_pulse_on_its_axis(axis: str, peak: float, ratio: float) -> None:
    pulse, plain = on_axis(axis, peak, ratio), CosinePulse(peak, ratio)
    t = np.linspace(-0.1, 1.1, 50) * plain.duration
    own = AXES.index(axis)
    for order, quantity in enumerate((plain.displacement, plain.velocity, plain.acceleration)):
        course = pulse.derivative(t, order)
        np.testing.assert_array_equal(course[:, own], quantity(t))
        assert not np.delete(course, own, axis=1).any()
    if not pulse.turns:
        assert pulse.peak_acceleration == pytest.approx(abs(peak))


def cosine_samples(rate: float, motion: TableMotion) -> tuple[Array, Array]:
    time = np.arange(math.ceil(motion.duration * rate) + 1) / rate
    time = time * motion.duration / time[-1]
    return time, motion.derivative(time, 0)


@pytest.mark.parametrize("axis", ["x", "pitch"])
def test_samples_of_a_pulse_give_it_back_with_its_jump(axis: str) -> None:
    """The acceleration jumps to its peak at t = 0; errors fall at least as the fourth power."""
    pulse = on_axis(axis, 3.0, 0.3)
    errors = []
    for rate in (25.0, 50.0, 100.0):
        motion = sampled(*cosine_samples(rate, pulse))
        t = np.linspace(0.0, motion.duration, 1001)
        orders = [np.abs(motion.derivative(t, k) - pulse.derivative(t, k)).max() for k in range(3)]
        errors.append(orders[2])
        assert motion.shortest_time == pytest.approx(pulse.shortest_time, rel=0.05)
    assert errors[1] < 3.0 * 1e-4
    assert errors[0] / errors[1] > 12.0
    assert errors[1] / errors[2] > 12.0


def test_a_sampled_motion_rests_outside_and_keeps_its_last_place() -> None:
    motion = ramp("yaw", 0.7)
    outside = np.array([-1.0, motion.duration + 1.0])
    np.testing.assert_allclose(motion.derivative(outside, 0)[:, 5], [0.0, 0.7], atol=1e-12)
    assert not motion.derivative(outside, 1).any()
    assert not motion.derivative(outside, 2).any()


def test_the_shortest_steps_are_taken_however_they_are_rounded() -> None:
    samples = np.zeros((101, 6))
    samples[:, 0] = 1.0 - np.cos(np.linspace(0.0, 2.0 * np.pi, 101))
    time = 1e-6 * np.arange(101)
    assert np.diff(time).min() < 1e-6
    np.testing.assert_allclose(sampled(time, samples).time, time, rtol=1e-9)
    with pytest.raises(InvalidInput, match="from 1e-06"):
        sampled(0.9 * time, samples)


def test_scaling_scales_every_axis() -> None:
    time, samples = cosine_samples(100.0, on_axis("y", 2.0, 0.2))
    motion = sampled(time, samples)
    t = np.linspace(0.0, motion.duration, 57)
    twice = motion.scaled(2.0)
    for order in range(3):
        np.testing.assert_allclose(twice.derivative(t, order), 2.0 * motion.derivative(t, order))
    assert twice.peak_acceleration == pytest.approx(2.0 * motion.peak_acceleration)


# In the turning frame


def flown(start: State, rock: Rock, duration: float) -> tuple[Array, Array]:
    """Position and rotation of a free rock in the world's frame."""
    place = start.position + duration * start.velocity
    place[2] -= 0.5 * GRAVITY * duration**2
    inertia = rock.axes * rock.inertia @ rock.axes.T

    def slope(_: float, y: Array) -> Array:
        turn, own = y[:9].reshape(3, 3), y[9:]
        rate = np.linalg.solve(inertia, np.cross(inertia @ own, own))
        return np.concatenate([np.cross(turn, own).ravel(), rate])

    first = np.concatenate([start.rotation.ravel(), start.rotation.T @ start.angular_velocity])
    end = solve_ivp(slope, (0.0, duration), first, rtol=1e-10, atol=1e-12).y[:9, -1]
    return place, end.reshape(3, 3)


@pytest.mark.parametrize(
    ("engine", "restitution", "order"),
    [
        ("bullet", 0.0, 1),
        ("bullet", 0.3, 1),
        ("nonsmooth", 0.3, 2),
    ],  # Bullet has two kinds of bodies
)
def test_a_thrown_box_flies_as_in_the_worlds_frame(
    engine: str, restitution: float, order: int
) -> None:
    """Whatever the table does: Coriolis, centrifugal and Euler terms, and the moment."""
    rock, _ = box((0.4, 0.7, 1.1))
    motion, duration = Tumbling(), 1.0
    turn = Rotation.from_euler("xyz", [0.3, -0.5, 0.8]).as_matrix()
    start = State(
        np.array([0.5, 0.2, 3.0]), turn, np.array([0.3, -0.2, 4.0]), np.array([1.0, 2.0, 0.5])
    )
    place, turned = flown(start, rock, duration)
    end = motion.derivative(np.array([duration]), 0)
    origin, frame = end[0, :3], rotation(end[:, 3:])[0]
    scene = Scene(rock, Contact(0.6, restitution), pedestal="none", start=start)
    errors = []
    for step in (2e-3, 1e-3, 5e-4):
        world = world_of(scene, engine, step)
        world.turn(motion.acceleration(middles(duration, step)).tolist())
        state = world.state()
        away = np.linalg.norm(state.position - frame.T @ (place - origin))
        angle = Rotation.from_matrix(state.rotation.T @ frame.T @ turned).magnitude()
        errors.append((away, angle))
    for coarse, fine in itertools.pairwise(errors):
        assert fine[0] == pytest.approx(0.5**order * coarse[0], rel=0.1)
        assert fine[1] == pytest.approx(0.5**order * coarse[1], rel=0.25)
    # Half a step of free fall is g h T / 2 = 0.0025 m.
    assert errors[-1][0] < 0.006
    assert errors[-1][1] < 0.002


@TURNING
@pytest.mark.parametrize("axis", ["pitch", "roll"])
@pytest.mark.parametrize("friction", [0.2, 0.5])
def test_a_block_on_a_tilted_table_slides_from_mu_on(
    engine: str, axis: str, friction: float
) -> None:
    """With g (sin - mu cos) beyond it, down the slope: toward +x for pitch, -y for roll."""
    rock, _ = box((2.0, 2.0, 0.5))
    angle, scene = math.atan(friction), Scene(rock, Contact(friction))
    ways = {}
    for share in (0.99, 1.01, 1.2):
        motion = ramp(axis, share * angle)
        world = world_of(scene, engine)
        world.turn(motion.acceleration(middles(2.0)).tolist())
        before = world.state()
        world.turn(motion.acceleration(2.0 + middles(1.0)).tolist())
        state = world.state()
        ways[share] = state.position
        down = GRAVITY * (math.sin(share * angle) - friction * math.cos(share * angle))
        gained = state.velocity - before.velocity
        along, across = (0, 1) if axis == "pitch" else (1, 0)
        sign = 1.0 if axis == "pitch" else -1.0
        assert gained[along] == pytest.approx(sign * max(down, 0.0), abs=0.01 * GRAVITY * friction)
        assert abs(state.position[across]) < 1e-3
    assert np.linalg.norm(ways[0.99][:2]) < 1e-3
    assert np.linalg.norm(ways[1.01][:2]) > 0.02


@pytest.mark.slow
@TURNING
@pytest.mark.parametrize(("axis", "size"), [("pitch", (1.0, 1.0, 2.0)), ("roll", (0.1, 0.1, 0.4))])
def test_a_block_on_a_tilted_table_tips_from_alpha_on(
    engine: str, axis: str, size: tuple[float, float, float]
) -> None:
    """The response of complete runs, in which the table turns so slowly that it adds 0.2 %."""
    rock, _ = box(size)
    alpha = math.atan(size[0] / size[2])
    scene = Scene(rock, Contact(5.0))
    stands, falls = (
        respond(ramp(axis, share * alpha, 12.0), scene, engine) for share in (0.99, 1.01)
    )
    assert stands.outcome is Outcome.BALANCED
    assert stands.peak_tilt < 2e-3
    assert falls.outcome is Outcome.OVERTURNED


@TURNING
@pytest.mark.parametrize("bearing", [0.0, 1.1, 2.8])
def test_a_turning_table_throws_at_w2_r_equal_mu_g(engine: str, bearing: float) -> None:
    """Outwards, and then to the right of its way as the table turns to the left."""
    rock, _ = box((0.5, 0.5, 0.25))
    radius, friction = 2.0, 0.5
    out = np.array([math.cos(bearing), math.sin(bearing), 0.0])
    start = State(radius * out + [0.0, 0.0, rock.height], np.eye(3), np.zeros(3), np.zeros(3))
    for share in (0.99, 0.999, 1.001, 1.01):
        samples = np.zeros((2000, 9))
        samples[:, 5] = math.sqrt(share * friction * GRAVITY / radius)
        world = world_of(Scene(rock, Contact(friction), start=start), engine)
        world.turn(samples.tolist())
        way = world.state().position - start.position
        if share < 1.0:
            assert np.linalg.norm(way) < 1e-4
            continue
        assert way @ out > 0.003
        assert np.cross(out, way)[2] < 0.0


@TURNING
def test_a_quarter_turn_of_everything_changes_nothing(engine: str) -> None:
    """Roll of a rock is the pitch of the rock turned by a right angle."""
    rock, _ = box((1.0, 1.3, 2.0))
    one = respond(on_axis("pitch", 2.0, 0.4), Scene(rock, Contact(0.6)), engine)
    # The table's +y comes to be where +x was if all is turned by -90 deg.
    other = respond(on_axis("roll", -2.0, 0.4), Scene(rock, Contact(0.6), math.pi / 2), engine)
    assert one.outcome is other.outcome is Outcome.OVERTURNED
    assert other.peak_tilt == pytest.approx(one.peak_tilt, rel=1e-3)


@TURNING
@pytest.mark.parametrize("pga", [0.3, 0.85])
def test_a_table_that_was_turned_before_is_a_rock_that_was(engine: str, pga: float) -> None:
    """The frame of a turning table against the frame of one that only shakes."""
    rock, _ = box((1.0, 1.3, 2.0))
    pulse = CosinePulse.from_g(pga, 0.3)
    time, samples = cosine_samples(400.0, on_axis("x", pulse.pga, 0.3))
    samples[:, 5] = 0.5
    motion = sampled(time, samples)
    assert motion.turns
    turned = respond(motion, Scene(rock, Contact(0.6)), engine, reduce=False)
    plain = respond(pulse, Scene(rock, Contact(0.6), -0.5), engine, reduce=False)
    assert turned.outcome is plain.outcome
    assert turned.slip == pytest.approx(plain.slip, abs=0.02)


def test_the_guard_reads_what_the_table_gives(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, motion = Scene(box()[0], Contact(0.6)), on_axis("pitch", 2.0, 0.4)
    assert respond(motion, scene).outcome is Outcome.OVERTURNED
    monkeypatch.setattr(loop, "HALVINGS", 1)
    monkeypatch.setattr(BulletWorld, "impulse", lambda world: 0.0)
    assert respond(motion, scene).outcome is Outcome.UNSTABLE


# In translation


@pytest.mark.parametrize("pga", [0.2, 0.62, 0.66, 0.9])
def test_a_pulse_along_x_is_that_of_one_axis(pga: float) -> None:
    """To the last bit where nothing is left out, and of the same outcome where it is."""
    scene, pulse = Scene(box()[0], Contact(0.6)), CosinePulse.from_g(pga, 0.3)
    axis = on_axis("x", pulse.pga, 0.3)
    assert respond(axis, scene, reduce=False) == respond(pulse, scene, reduce=False)
    assert respond(axis, scene).outcome is respond(pulse, scene).outcome


@pytest.mark.parametrize("engine", ["bullet", "mujoco"])
@pytest.mark.parametrize("pga", [0.3, 0.72])
def test_a_pulse_along_y_is_one_along_x_of_the_turned_rock(pga: float, engine: str) -> None:
    if engine == "mujoco":
        pytest.importorskip("mujoco")
    rock, limits = box((1.0, 1.3, 2.0))
    settings = Settings(1e-3, engine=engine)
    pulse = CosinePulse.from_g(pga, 0.3)
    along_x = simulate(prepare(Scene(rock, Contact(0.6)), limits, reduce=True), pulse, settings)
    turned = prepare(Scene(rock, Contact(0.6), math.pi / 2), limits, reduce=True)
    along_y = simulate(turned, on_axis("y", pulse.pga, 0.3), settings)
    assert along_y.outcome is along_x.outcome
    assert along_x.outcome is (Outcome.OVERTURNED if pga > 0.5 else Outcome.BALANCED)


def test_a_table_that_falls_faster_than_the_rock_leaves_it() -> None:
    """By (a - g) t^2 / 2; at g it no longer bears it."""
    rock, _ = box()
    world = world_of(Scene(rock, Contact(0.6)))
    start = world.state().position[2]
    world.shake([[0.0, 0.0, -GRAVITY]] * 500)
    assert world.state().position[2] == pytest.approx(start, abs=1e-3)
    assert world.contacts()[0] == 0
    world.shake([[0.0, 0.0, -GRAVITY - 4.0]] * 500)
    assert world.state().position[2] - start == pytest.approx(0.5 * 4.0 * 0.25, rel=0.01)


@pytest.mark.parametrize("vertical", [-0.7, -0.3, 0.5, 2.0])
def test_friction_and_the_weight_on_the_edge_grow_with_the_vertical(vertical: float) -> None:
    """Slides at mu (g + a_z), tips at tan(alpha) (g + a_z), whatever direction."""
    weight = GRAVITY * (1.0 + vertical)
    for rock, friction, limit in (
        (box((2.0, 2.0, 0.5))[0], 0.4, 0.4),
        (box((0.5, 0.5, 2.0))[0], 2.0, 0.25),
    ):
        moved = []
        for share in (0.99, 1.02):
            world = world_of(Scene(rock, Contact(friction)))
            start = world.state()
            push = share * limit * weight
            world.shake([[push, 0.0, GRAVITY * vertical]] * 1000)
            state = world.state()
            tilt = math.acos(min(1.0, float(state.rotation[2, 2])))
            moved.append(abs(float(state.position[0] - start.position[0])) + tilt)
        assert moved[0] < 2e-3 < 5e-3 < moved[1]


def test_vertical_shaking_alone_topples_nothing_and_helps_to() -> None:
    """With a vertical in step, the same horizontal pulse overturns what stood."""
    rock, _ = box((0.5, 0.5, 2.0))
    scene, pulse = Scene(rock, Contact(0.6)), on_axis("z", 0.8 * GRAVITY, 0.2)
    assert respond(pulse, scene).outcome is Outcome.BALANCED
    time, across = cosine_samples(400.0, on_axis("x", 0.26 * GRAVITY, 0.3))
    up = on_axis("z", -0.6 * GRAVITY, 0.3).derivative(time, 0)
    assert respond(sampled(time, across), scene).outcome is Outcome.BALANCED
    assert respond(sampled(time, across + up), scene).outcome is Outcome.OVERTURNED


@pytest.mark.slow
@given(st.floats(0.0, 2.0 * math.pi), st.floats(0.2, 0.9))
@settings(max_examples=5, deadline=None, derandomize=True)
def test_direction_of_shaking_is_the_rocks_direction_turned_back(
    bearing: float, pga: float
) -> None:
    """Of a round column, whose outcome has no direction."""
    import trimesh

    column = trimesh.creation.cylinder(0.5, 2.0, sections=72)
    rock = solid.from_mesh(column, 2110.0).rock
    time, along = cosine_samples(400.0, on_axis("x", GRAVITY * pga, 0.3))
    samples = np.zeros_like(along)
    samples[:, 0], samples[:, 1] = (
        part * along[:, 0] for part in (math.cos(bearing), math.sin(bearing))
    )
    toward = respond(sampled(time, samples), Scene(rock, Contact(0.8)))
    if not 0.58 < pga < 0.72:
        expected = Outcome.OVERTURNED if pga > 0.65 else Outcome.BALANCED
        assert toward.outcome is expected


@pytest.mark.parametrize("seed", range(4))
def test_what_is_left_out_changes_no_outcome_in_three_axes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    time = np.linspace(0.0, 2.0, 401)
    rates, phases = rng.uniform(2.0, 15.0, (2, 3, 6))
    waves = np.sin(rates[..., None] * time + phases[..., None]) / rates[..., None] ** 2
    course = rng.uniform(1.0, 6.0) * np.sin(np.pi * time / 2.0) ** 2 * waves.sum(axis=1)
    samples = np.hstack([course.T, np.zeros((401, 3))])
    scene = Scene(box((0.6, 0.9, 1.8))[0], Contact(0.6), rng.uniform(0.0, 3.0))
    least, whole = (respond(sampled(time, samples), scene, reduce=r) for r in (True, False))
    assert least.outcome is whole.outcome
    assert least.steps <= whole.steps


# What is refused


GOOD = cosine_samples(100.0, on_axis("x", 2.0, 0.2))


def broken(**change: object) -> tuple[Array, Array]:
    time, samples = GOOD[0].copy(), GOOD[1].copy()
    if "time" in change:
        time[10] = change["time"]
    if "value" in change:
        samples[10, 2] = change["value"]
    if "ramp" in change:
        samples[:, 1] = time
    if "degrees" in change:
        samples[:, 4] = 30.0 * np.sin(np.pi * time / time[-1]) ** 2
    return (time[:5], samples[:5]) if "few" in change else (time, samples)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"few": True}, "5 samples"),
        ({"value": math.nan}, "not numbers"),
        ({"time": math.inf}, "not numbers"),
        ({"time": 0.0}, "sample 11; times ascend"),
        ({"ramp": True}, "y moving at 1 a second at the start"),
        ({"degrees": True}, r"rad.*roll \[degree\]"),
    ],
)
def test_samples_that_are_no_motion(change: dict[str, object], words: str) -> None:
    with pytest.raises(InvalidInput, match=words):
        sampled(*broken(**change))


def test_more_samples_than_memory_holds_splines_of_are_refused() -> None:
    time = 0.001 * np.arange(200_001)
    with pytest.raises(InvalidInput, match=r"200001 samples; .*; cut it to the shaking"):
        sampled(time, np.zeros((len(time), 6)))


def test_angles_that_wrap_are_unwrapped() -> None:
    motion = ramp("yaw", 4.0)
    wrapped = motion.samples.copy()
    wrapped[:, 5] = (wrapped[:, 5] + math.pi) % (2.0 * math.pi) - math.pi
    np.testing.assert_allclose(sampled(motion.time, wrapped).samples, motion.samples, atol=1e-12)


@pytest.mark.parametrize("factor", [1.0, 0.3, 2.0])
def test_the_heading_in_which_a_table_begins_is_not_scaled(factor: float) -> None:
    """An encoder may begin anywhere, and a turn is none."""
    time, samples = np.arange(201) / 100.0, np.zeros((201, 6))
    samples[:, 0] = 0.1 * np.sin(0.5 * np.pi * time) ** 4
    samples[:, 5] = 0.05 * np.sin(np.pi * time) ** 4
    moving = []
    for begun in (-0.01, math.radians(360.0) - 0.01, 0.5):
        headed = sampled(time, samples + begun * np.eye(6)[5]).scaled(factor)
        turned = rotation(np.full((201, 3), [0.0, 0.0, begun]))
        felt = headed.acceleration(time)[:, :3]
        moving.append(np.einsum("nij,nj->ni", turned, felt))
    np.testing.assert_allclose(moving[1], moving[0], atol=1e-9)
    np.testing.assert_allclose(moving[2], moving[0], atol=1e-9)


@pytest.mark.parametrize(
    "rounded",
    [lambda t: t.round(3), lambda t: t.round(4), lambda t: t.astype(np.float32).astype(float)],
)
def test_rounded_times_shake_no_table(rounded: Callable[[Array], Array]) -> None:
    """Off its place by half a digit, a sample would be an acceleration."""
    time = 17.0 + np.arange(1025) / 256.0
    samples = np.zeros((1025, 6))
    burst = np.sin(4.0 * np.pi * (time - 17.0)) * np.sin(np.pi * (time - 17.0) / 4.0) ** 4
    samples[:, 0] = 0.05 * burst
    exact, found = sampled(time, samples), sampled(rounded(time), samples)
    assert found.peak_acceleration == pytest.approx(exact.peak_acceleration, rel=1e-4)
    assert found.peak_velocity == pytest.approx(exact.peak_velocity, rel=1e-4)


def test_mujoco_shakes_and_does_not_turn() -> None:
    pytest.importorskip("mujoco")
    case = prepare(Scene(box()[0], Contact(0.6)), box()[1], reduce=True)
    check(case, Settings(1e-3, engine="mujoco"), on_axis("y", 2.0, 0.3))
    with pytest.raises(InvalidInput, match="turns in mujoco"):
        check(case, Settings(1e-3, engine="mujoco"), on_axis("yaw", 2.0, 0.3))


def test_a_servo_takes_one_axis() -> None:
    rock, limits = box()
    case = prepare(Scene(rock, Contact(0.6), drive=PUBLISHED), limits, reduce=True)
    with pytest.raises(InvalidInput, match="slides along x"):
        check(case, Settings(1e-3), on_axis("x", 2.0, 0.3))
    held = replace(PUBLISHED, hold=50)
    case = prepare(Scene(rock, Contact(0.6), drive=held), limits, reduce=True)
    with pytest.raises(InvalidInput, match="command period of 50 ms"):
        check(case, Settings(1e-3), CosinePulse.from_g(0.3, 0.1))
