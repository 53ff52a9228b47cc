"""The driven table against its own algebra, Newton's laws, and the table's own frame."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from support.jobs import job

from pipeline.config import in_si
from pipeline.config.layers import load_site
from pipeline.stages.mesh.products import Standing
from pipeline.stages.motions.motion_grid import MotionData
from pipeline.stages.runs.scenes import Scenes, reach
from pipeline.stages.runs.scenes import code as run_code
from pipeline.stages.runs.step_choice import stored_steps
from pipeline.stages.runs.study import Study
from pipeline.workflow import graph
from pipeline.workflow.datasets import read
from pipeline.workflow.engine_input import find as find_engine
from pipeline.workflow.graph import identities
from pipeline.workflow.store import Store
from vsr_core import GRAVITY, engines
from vsr_core.engines.bullet.driven import BulletDrivenWorld
from vsr_core.errors import InvalidInput
from vsr_core.judge.proofs import Barrier, barrier, reachable_energy
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import DecidedBy, Outcome, Response
from vsr_core.rock import solid
from vsr_core.rock.body import Rock
from vsr_core.run import reductions
from vsr_core.run.cases import Settings, prepare
from vsr_core.run.input_checks import PERIOD_SHARE, check_drive
from vsr_core.run.overturning import simulate
from vsr_core.run.sampling import samples, sampling
from vsr_core.run.time_step import step_unit
from vsr_core.scene import Contact, Scene, State, resting
from vsr_core.source import tracing
from vsr_core.table.servo import (
    PUBLISHED,
    Servo,
    check,
    largest_stable_period,
    loop,
    spectral_radius,
)

Array = NDArray[np.float64]
PULSE = CosinePulse.from_g(0.2, 0.8)  # the paper's Fig. 7a
HELD = replace(PUBLISHED, period=0.005)  # for as long as the published commands


@cache
def box(size: tuple[float, float, float] = (1.0, 1.0, 2.0)) -> tuple[Rock, Barrier]:
    rock = solid.box(size, 2110.0).rock
    return rock, barrier(rock)


def quick(mass: float, share: float = 1.0, period: float = 1e-3) -> Servo:
    """A proportional servo that takes ``share`` of an error away in a period."""
    return Servo(mass, share * mass / period, 0.0, 0.0, period)


def pid(servo: Servo, wanted: Array, start: float = 0.0) -> Array:
    """Velocities [m/s] of a free mass at the end of each period, in the words of the module."""
    speed, total, before, speeds = start, 0.0, 0.0, []
    for target in wanted.tolist():
        error = target - speed
        total += servo.period * error
        force = servo.kp * error + servo.ki * total + servo.kd * (error - before) / servo.period
        speed += force * servo.period / servo.mass
        before = error
        speeds.append(speed)
    return np.array(speeds)


def world_of(described: Scene, substeps: int = 1) -> BulletDrivenWorld:
    assert described.drive is not None
    step = described.drive.period / substeps
    world = engines.load("bullet").build(described, step, substeps)
    assert isinstance(world, BulletDrivenWorld)
    return world


def driven(world: BulletDrivenWorld, wanted: Array) -> Array:
    """The table's velocity [m/s] at the end of each period."""
    speeds = []
    for speed in wanted.tolist():
        world.advance([speed])
        speeds.append(world.table()[1])
    return np.array(speeds)


def outcome(drive: Servo | None, pga_g: float, ratio: float, friction: float = 0.6) -> Response:
    rock, limits = box()
    case = prepare(Scene(rock, Contact(friction), drive=drive), limits, reduce=True)
    settings = Settings(0.002 * step_unit(rock))
    return simulate(case, CosinePulse.from_g(pga_g, ratio), settings)


# The sampled loop


def random_servos(count: int) -> list[Servo]:
    """Gains from far below to above the limit; a third each without ki, without kd."""
    rng = np.random.default_rng(1)
    found = []
    for number in range(count):
        p, i, d = rng.uniform(0.02, 3.0), rng.uniform(0.01, 3.0), rng.uniform(0.01, 1.3)
        i, d = (0.0 if number % 3 == 0 else i), (0.0 if number % 3 == 1 else d)
        mass, h = 10.0 ** rng.uniform(-1.0, 5.0), 10.0 ** rng.uniform(-4.0, -1.0)
        found.append(Servo(mass, p * mass / h, i * mass / h**2, d * mass, h))
    return found


def test_two_periods_of_the_loop_by_hand() -> None:
    """Errors 1 and 0.58: the integral has the present one in it, the derivative looks back."""
    servo = Servo(mass=2.0, kp=3.0, ki=4.0, kd=0.5, period=0.1)
    first = (3.0 + 4.0 * 0.1 + 0.5 * 1.0 / 0.1) * 0.1 / 2.0
    second = (3.0 * 0.58 + 4.0 * 0.158 + 0.5 * (0.58 - 1.0) / 0.1) * 0.1 / 2.0
    assert loop(servo, np.ones(2)) == pytest.approx([first, first + second])
    weak = replace(servo, force_limit=1.0)
    assert loop(weak, np.array([1.0, -9.0])) == pytest.approx([0.05, 0.0])


def test_spectral_radius_is_the_growth_of_the_loop() -> None:
    """Over 400 periods, after 100; waves make it uncertain by some thousandths."""
    radii = []
    for servo in random_servos(60):
        speeds = np.abs(pid(servo, np.zeros(600), start=1e-150))
        early, late = (speeds[first : first + 100].max() for first in (100, 500))
        if late == 0.0 or not np.isfinite(late):  # shrunk or grown past all numbers
            assert abs(math.log(spectral_radius(servo))) > 0.3
            continue
        radius = (late / early) ** (1.0 / 400.0)
        assert spectral_radius(servo) == pytest.approx(radius, rel=0.01)
        radii.append(radius)
    assert len(radii) > 30
    assert sum(radius > 1.0 for radius in radii) > 5
    assert sum(radius < 1.0 for radius in radii) > 5


@pytest.mark.parametrize("number", range(12))
def test_longest_period_separates_decay_from_growth(number: int) -> None:
    servo = replace(random_servos(12)[number])
    servo = replace(servo, kd=min(servo.kd, 0.8 * servo.mass))
    longest = largest_stable_period(servo)
    below, above = (replace(servo, period=share * longest) for share in (0.98, 1.02))
    assert abs(pid(below, np.zeros(20_000), start=1.0)[-1]) < 1e-3
    assert abs(pid(above, np.zeros(3_000), start=1.0)[-1]) > 1e3
    check(below)
    with pytest.raises(InvalidInput):
        check(above)


def test_longest_period_of_a_proportional_servo() -> None:
    for servo in random_servos(12):
        plain = replace(servo, ki=0.0, kd=0.0)
        assert largest_stable_period(plain) == pytest.approx(2.0 * servo.mass / servo.kp, rel=1e-14)


def test_derivative_gain_above_the_mass_is_unstable_at_any_period() -> None:
    """It feeds back the acceleration of a period ago, amplified."""
    for period in (1e-6, 1e-3, 1.0):
        servo = Servo(10.0, 1.0, 0.0, 11.0, period)
        assert abs(pid(servo, np.zeros(500), start=1.0)[-1]) > 1e3
        with pytest.raises(InvalidInput, match=r"no period is stable.*lower kd"):
            check(servo)


def test_published_gains_run_at_the_physics_rate_and_not_at_the_command_rate() -> None:
    check(PUBLISHED)
    assert PUBLISHED.stiffness == pytest.approx(1.0)
    with pytest.raises(InvalidInput) as refusal:
        check(HELD)
    assert "Kp h / M = 5 " in refusal.value.given
    assert f"spectral radius of {spectral_radius(HELD):.4g}" in refusal.value.given
    assert f"{1e3 * largest_stable_period(HELD):.4g} ms" in refusal.value.rule
    # the integral takes a thousandth of 2 M / kp = 2 ms
    assert largest_stable_period(HELD) == pytest.approx(2e-3, rel=2e-3)
    assert largest_stable_period(HELD) == largest_stable_period(PUBLISHED)
    with pytest.raises(InvalidInput):
        prepare(Scene(box()[0], Contact(0.6), drive=HELD), box()[1], reduce=True)


# The table in Bullet

FULL = Servo(mass=3000.0, kp=1.2e6, ki=4e7, kd=900.0, period=1e-3)
"""Every gain at work: p = 0.4, i = 0.013, d = 0.3."""


@pytest.mark.parametrize("substeps", [1, 3])
@pytest.mark.parametrize("servo", [FULL, PUBLISHED, HELD], ids=["full", "published", "unstable"])
def test_a_table_without_friction_is_the_sampled_loop(servo: Servo, substeps: int) -> None:
    """Stable or not, the rock standing on it, at any number of steps in a period."""
    wanted = np.concatenate([np.full(4, 0.3), np.linspace(0.3, -0.2, 8)])
    speeds = driven(world_of(Scene(box()[0], Contact(0.0), drive=servo), substeps), wanted)
    expected = pid(servo, wanted)
    np.testing.assert_allclose(speeds, expected, atol=1e-9 * np.abs(expected).max())
    assert (np.abs(expected).max() > 1e5) == (servo is HELD)


def test_force_limit_and_no_other() -> None:
    """Uniform acceleration, past 100 of Bullet's own units of speed."""
    rock, _ = box((0.02, 0.02, 0.02))
    servo = replace(quick(5.0), force_limit=40.0)
    world = world_of(Scene(rock, Contact(0.0), drive=servo))
    speeds = driven(world, np.full(5000, 1e6))
    np.testing.assert_allclose(speeds, 8.0 * 1e-3 * np.arange(1, 5001), rtol=1e-7)
    assert speeds[-1] * math.sqrt(world._scale) > 600.0
    assert world.table()[0] == pytest.approx(0.5 * 8.0 * 5.0**2, rel=1e-3)


@pytest.mark.parametrize("pedestal", ["box", "mesh"])
def test_momentum_is_conserved_when_no_force_acts(pedestal: str) -> None:
    """A sliding block sets a free table in motion, until both move as one."""
    rock, _ = box((2.0, 2.0, 0.5))
    mass, friction, speed, step = 1.7 * rock.mass, 0.4, 2.0, 1e-3
    start = replace(resting(Scene(rock, Contact(0.0))), velocity=np.array([speed, 0.0, 0.0]))
    servo = replace(quick(mass), force_limit=0.0)
    described = Scene(rock, Contact(friction), pedestal=pedestal, start=start, drive=servo)  # type: ignore[arg-type]
    world = world_of(described)
    stops = speed / (friction * GRAVITY * (1.0 + rock.mass / mass))
    relative = []
    for _ in range(round(2.0 * stops / step)):
        world.advance([0.0])
        along, table = float(world.state().velocity[0]), world.table()[1]
        momentum = rock.mass * (along + table) + mass * table
        assert momentum == pytest.approx(rock.mass * speed, rel=1e-6)
        relative.append(along)
    assert world.table()[1] == pytest.approx(speed * rock.mass / (rock.mass + mass), rel=1e-4)
    moving = np.count_nonzero(np.array(relative) > 0.01 * speed) / 0.99
    # On a mesh Bullet's box catches inner edges.
    assert moving * step == pytest.approx(stops, rel=0.02 if pedestal == "box" else 0.1)


def test_state_is_relative_to_the_table() -> None:
    """A rock that keeps standing has not moved, however far the table went."""
    rock, _ = box((2.0, 2.0, 0.5))
    world = world_of(Scene(rock, Contact(0.6), drive=PUBLISHED))
    start = world.state().position
    speeds = driven(world, np.minimum(3.0, 2.0 * 1e-3 * np.arange(4000)))
    assert world.table() == (pytest.approx(3.0 * 4.0 - 0.5 * 3.0 * 1.5, abs=0.02), speeds[-1])
    np.testing.assert_allclose(world.state().position, start, atol=2e-3)
    np.testing.assert_allclose(world.state().velocity, 0.0, atol=1e-3)


# Tracking


def errors(servo: Servo, rock: Rock, friction: float) -> Array:
    """Velocity less the pulse's at the end of each period [m/s]."""
    number = sampling(PULSE, servo, servo.period).pulse_samples
    world = world_of(Scene(rock, Contact(friction), drive=servo))
    speeds = driven(world, samples(PULSE, servo, servo.period, number))
    return speeds - PULSE.velocity(servo.period * np.arange(1, number + 1))


def test_held_commands_are_stairs_and_on_time_in_the_mean() -> None:
    """A servo that takes an error away in a period climbs each in a ramp and then waits."""
    rock, _ = box((2.0, 2.0, 0.5))
    servo = replace(quick(1e4, 1.0), hold=5)
    number = 5 * math.ceil(PULSE.duration / 0.005)
    speeds = driven(
        world_of(Scene(rock, Contact(0.0), drive=servo)), samples(PULSE, servo, 1e-3, number)
    )
    stairs = speeds.reshape(-1, 5)
    np.testing.assert_allclose(stairs, stairs[:, :1].repeat(5, axis=1), atol=1e-9)
    # Within a command the table covers the distance of the motion, to second order.
    before = np.concatenate([[0.0], speeds[:-1]])
    way = 1e-3 * np.cumsum(0.5 * (before + speeds))[4::5]
    exact = PULSE.displacement(0.005 * np.arange(1, number // 5 + 1))
    np.testing.assert_allclose(way[:-1], exact[:-1], atol=2e-5)
    late = PULSE.displacement(0.005 * np.arange(1, number // 5 + 1) - 5e-4)
    assert np.abs(way - late).max() > 5e-4  # half a period would show


def test_commands_in_every_period_are_the_velocity_at_its_end() -> None:
    wanted = samples(PULSE, PUBLISHED, 1e-3, 100)
    exact = PULSE.velocity(1e-3 * (np.arange(100) + 1.0))
    np.testing.assert_allclose(wanted, exact, rtol=1e-14)


def test_published_servo_follows_the_pulse() -> None:
    """PHYSICS.md: 1e-3 m/s on a PGV of 1.57 m/s, measured in another trial."""
    error = errors(PUBLISHED, box()[0], 0.6)
    assert np.abs(PULSE.velocity(np.array([0.8 * math.pi / 2]))) == pytest.approx(1.57, abs=0.01)
    assert math.sqrt(np.mean(error**2)) < 1e-3
    assert np.abs(error).max() < 2e-3
    # The rock on the table takes its share of the first period's force, and no more.
    share = box()[0].mass / (PUBLISHED.mass + box()[0].mass)
    first = PULSE.velocity(np.array([1e-3]))[0]
    assert first + error[0] == pytest.approx((1.0 - share) * first, rel=0.01)


def test_tracking_error_falls_with_the_gain() -> None:
    """Proportional alone: the mass needs the force a M, so the error is a (M / kp - h)."""
    rock, _ = box((2.0, 2.0, 0.5))
    measured = []
    for share in (0.05, 0.1, 0.2, 0.5):
        error = errors(quick(1e4, share), rock, 0.0)
        expected = PULSE.pga * 1e-3 * (1.0 / share - 1.0) / math.sqrt(2.0)
        measured.append(math.sqrt(np.mean(error**2)))
        assert measured[-1] == pytest.approx(expected, rel=0.05)
    exact = errors(quick(1e4, 1.0), rock, 0.0)
    assert np.abs(exact).max() < 1e-9


# Rock and table together


@pytest.mark.parametrize(("ratio", "first"), [(0.15, 0.93), (0.20, 0.73), (0.25, 0.67)])
def test_a_heavy_table_gives_the_outcomes_of_the_tables_frame(ratio: float, first: float) -> None:
    """On both sides of Housner's boundary for 1x1x2 m, and well below it."""
    heavy = quick(1e6 * box()[0].mass)
    for share in (0.75, 0.93, 1.07):
        servo, frame = (outcome(drive, share * first, ratio) for drive in (heavy, None))
        assert servo.outcome is frame.outcome
        assert servo.outcome is (Outcome.OVERTURNED if share > 1.0 else Outcome.BALANCED)


@pytest.mark.parametrize("pga", [0.1, 0.45, 0.9])
def test_only_the_simulation_decides_a_driven_run(pga: float) -> None:
    response = outcome(quick(50.0 * box()[0].mass), pga, 0.25)
    assert response.outcome is (Outcome.OVERTURNED if pga > 0.5 else Outcome.BALANCED)
    assert response.decided_by is DecidedBy.SIMULATION
    assert response.steps > 0
    assert response.final_tilt == pytest.approx(math.pi / 2 if pga > 0.5 else 0.0, abs=0.01)


def leaning(rock: Rock, tilt: float) -> State:
    """On its edge, at rest, turned about y."""
    turn = Rotation.from_euler("y", tilt).as_matrix()
    height = -(rock.vertices @ turn[2]).min()
    return State(np.array([0.0, 0.0, height]), turn, np.zeros(3), np.zeros(3))


def test_a_toppling_rock_disturbs_a_light_table_and_the_servo_recovers() -> None:
    """As in the paper's Fig. 7b; the disturbance falls as the mass of the table grows."""
    rock, _ = box()
    peaks = []
    for mass_ratio in (1.0, 10.0, 100.0):
        servo = quick(mass_ratio * rock.mass, 0.05)
        world = world_of(Scene(rock, Contact(0.6), start=leaning(rock, 0.6), drive=servo), 2)
        speeds = np.abs(driven(world, np.zeros(4000)))
        assert world.state().rotation[2, 2] == pytest.approx(0.0, abs=1e-3)
        peaks.append(speeds.max())
        assert speeds[-1] < 1e-3 * speeds.max()
        assert abs(world.table()[0]) < 1.0  # it stopped, it did not drift away
    assert peaks[0] > 0.1
    assert peaks[0] > 3.0 * peaks[1] > 9.0 * peaks[2]


def test_the_guard_bounds_what_a_light_table_gives() -> None:
    """Ringing table as heavy as the rock: energy never passes what its acceleration allows."""
    rock, limits = box()
    servo = quick(rock.mass, 1.9)
    world = world_of(Scene(rock, Contact(0.6), drive=servo), 2)
    pulse = CosinePulse.from_g(0.9, 0.25)
    floor, swing, before = GRAVITY * limits.floor, 0.0, 0.0
    spread = rock.inertia / rock.mass
    largest = 0.0
    for wanted in samples(pulse, servo, servo.period, 3000).tolist():
        world.advance([wanted])
        speed, state = world.table()[1], world.state()
        swing, before = swing + abs(speed - before), speed
        turning = state.rotation.T @ state.angular_velocity
        energy = 0.5 * (state.velocity @ state.velocity + spread @ turning**2)
        energy += GRAVITY * state.position[2] - floor
        allowed = reachable_energy(GRAVITY * rock.height - floor, world.impulse())
        assert energy <= allowed + 0.02 * GRAVITY * rock.radius
        largest = max(largest, energy)
    assert world.impulse() >= swing > 4.0 * 0.9 * GRAVITY * 0.25
    assert largest > 1.2 * (GRAVITY * rock.height - floor)


def test_the_guard_reads_the_table(monkeypatch: pytest.MonkeyPatch) -> None:
    """Told that the table never accelerated, it takes the rock's energy for a fault."""
    monkeypatch.setattr(BulletDrivenWorld, "impulse", lambda world: 0.0)
    assert outcome(PUBLISHED, 0.9, 0.25).outcome is Outcome.UNSTABLE


def test_runs_are_bit_for_bit_the_same() -> None:
    """Rewound, rebuilt, and after other scenes."""
    cells = [(PUBLISHED, 0.7, 0.2), (quick(box()[0].mass), 0.8, 0.25), (FULL, 0.6, 0.3)]
    first = [outcome(*cell) for cell in cells]
    outcome(None, 0.7, 0.2)
    assert [outcome(*cell) for cell in reversed(cells)] == first[::-1]
    rock, _ = box()
    described = Scene(rock, Contact(0.6), drive=PUBLISHED)
    wanted = samples(CosinePulse.from_g(0.7, 0.2), PUBLISHED, 1e-3, 1500)
    runs = [driven(world_of(described, 2), wanted) for _ in range(2)]  # the second is rewound
    runs.append(driven(world_of(replace(described), 2), wanted))
    assert runs[0].tobytes() == runs[1].tobytes() == runs[2].tobytes()


# What is left out, and what is refused


def test_a_driven_scene_keeps_its_slab_and_its_servo() -> None:
    rock = solid.from_mesh(trimesh.creation.box((1.0, 1.2, 2.0)), 2110.0).rock
    kept, dropped = reductions.reduce(Scene(rock, Contact(0.6), drive=PUBLISHED))
    assert (kept.pedestal, kept.drive) == ("box", PUBLISHED)
    frame, more = reductions.reduce(Scene(rock, Contact(0.6)))
    assert (frame.pedestal, frame.drive) == ("plane", None)
    gone = {reduction.what for reduction in more} - {reduction.what for reduction in dropped}
    assert gone == {
        "joint, servo and moving pedestal",
        "pedestal slab",
        "runs below the uplift and sliding limits",
        "the motion before its first push",
        "time after the outcome is certain",
    }


@pytest.mark.parametrize("step", [1e-4, 3e-4, 4e-4, 1e-3, 3e-3])
def test_a_whole_number_of_steps_fills_a_control_period(step: float) -> None:
    taken = sampling(PULSE, PUBLISHED, step)
    assert taken.interval == PUBLISHED.period
    assert taken.interval / taken.substeps <= step * (1.0 + 1e-9)
    assert taken.substeps == 1 or taken.interval / (taken.substeps - 1) > step
    assert taken.interval * (taken.pulse_samples - 1) < PULSE.duration
    assert taken.interval * taken.pulse_samples >= PULSE.duration


@pytest.mark.parametrize("pedestal", ["plane", "none"])
def test_bullet_refuses_a_pedestal_that_is_no_body(pedestal: str) -> None:
    described = Scene(box()[0], Contact(0.6), pedestal=pedestal, drive=PUBLISHED)  # type: ignore[arg-type]
    with pytest.raises(InvalidInput, match=pedestal):
        world_of(described)


def test_bullet_refuses_samples_that_are_no_control_periods() -> None:
    with pytest.raises(InvalidInput, match="one control period"):
        engines.load("bullet").build(Scene(box()[0], Contact(0.6), drive=PUBLISHED), 1e-3, 2)


def test_mujoco_refuses_a_servo() -> None:
    pytest.importorskip("mujoco")
    described = Scene(box()[0], Contact(0.6), drive=PUBLISHED)
    with pytest.raises(InvalidInput, match="servo in MuJoCo"):
        engines.load("mujoco").build(described, 1e-3, 1)


# The configuration

SMALL = "motion: {pga: [0.2, 0.9], pgv_pga: 0.25}\n"
COMMANDS = (("run", "responses", "--workers", "0"), ("plan",), ("why",), ("status",))


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command[0])
def test_published_gains_at_the_command_rate_are_refused_in_one_line(
    write_site: Callable[..., str], refused: Callable[..., str], command: tuple[str, ...]
) -> None:
    site = write_site(SMALL + "drive: servo\nservo: {period: 0.005}\n")
    words = (f"{site}: servo", "Kp h / M = 5 ", "spectral radius", "1.998 ms", "shorten the period")
    refused(*command, "--site", site, words=words)


def test_a_servo_in_mujoco_is_refused(
    write_site: Callable[..., str], refused: Callable[..., str]
) -> None:
    site = write_site(SMALL + "drive: servo\nsimulation: {engine: mujoco}\n")
    words = (f"{site}: simulation", "'mujoco'", "needs Bullet", "drive: table_frame")
    refused("run", "responses", "--site", site, words=words)


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("servo.kpp=1", ("servo.kpp", "did you mean kp?")),
        ("servo.mass=0", ("servo.mass", "got 0", "mass of the pedestal [kg]")),
        ("servo.period=5", ("servo.period", "got 5", "0.1", "[s]")),
        ("servo.kd=6e4", ("servo", "no period is stable", "lower kd")),
        ("servo.command_rate=300", ("whole number of control periods", "1000 Hz")),
        ("servo.command_rate=1500", ("whole number of control periods", "1000 Hz")),
    ],
)
def test_wrong_servo(
    write_site: Callable[..., str],
    refused: Callable[..., str],
    setting: str,
    words: tuple[str, ...],
) -> None:
    settings = ("--set", "drive=servo", "--set", setting)
    refused("why", "--site", write_site(SMALL), *settings, words=("--set: ", *words))


def quick_site(write_site: Callable[..., str]) -> str:
    """A block of 5275 kg on a servo's table of 50 t."""
    return write_site(
        "rock: {shape: box, size: [1, 1, 2], density: 2637.5}\nyaw: 0\ndrive: servo\n"
        "simulation: {time_step: 0.001}\nmotion: {pga: [0.01, 0.5], pgv_pga: 0.05}\n"
    )


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        # F / (M + m) = 5.5275e4 N / 5.5275e4 kg, and (M + m) 0.5 g
        (["force_limit=55275"], ("servo.force_limit", "0.102 g at most", "0.5 g", "2.71e+05 N")),
        (["kp=1", "ki=0"], ("servo.kp: ", "kp = 1, ki = 0", "of the PGA", "raise kp")),
        (["kp=1e4", "ki=1e9"], ("servo.kp: ", "of the PGA", "lower ki")),
    ],
    ids=["force", "weak", "ringing"],
)
def test_a_servo_that_cannot_perform_the_motions_is_refused(
    write_site: Callable[..., str],
    vsr: Callable[..., object],
    settings: list[str],
    words: tuple[str, ...],
) -> None:
    given = [part for one in settings for part in ("--set", f"servo.{one}")]
    ran = vsr("run", "responses", "--site", quick_site(write_site), "--workers", "0", *given)
    said = ran.err.splitlines()[-1]  # type: ignore[attr-defined]
    assert (ran.code, said[:11]) == (2, "vsr: --set:")  # type: ignore[attr-defined]
    assert [word for word in words if word not in said] == [], said


@pytest.mark.parametrize("hold", [1, 5])
def test_the_published_servo_performs_every_pulse_that_its_commands_leave_it(hold: int) -> None:
    servo, rock = replace(PUBLISHED, hold=hold), box()[0]
    scene = Scene(rock, Contact(0.6), drive=servo)
    for ratio in np.geomspace(servo.command_period / PERIOD_SHARE, 2.0, 20):
        check_drive(scene, CosinePulse.from_g(1.0, float(ratio)))


def test_a_servo_is_judged_by_the_share_of_the_pga_that_it_reaches() -> None:
    """A proportional one lags by T = (M + m) / kp behind a pulse cos(w t): with q = w T it makes

    (cos(w t) + q sin(w t) - exp(-t / T)) / (1 + q^2) of it, 0.57 for q = 1.5 and 0.34 for 3. Its
    velocity is off by q / sqrt(1 + q^2) of the PGV, 0.83 for q = 1.5.
    """
    rock, pulse = box()[0], CosinePulse.from_g(0.3, 0.4)

    def driven(lag: float) -> Scene:
        servo = replace(PUBLISHED, kp=(PUBLISHED.mass + rock.mass) / (lag * 0.4), ki=0.0)
        return Scene(rock, Contact(0.6), drive=servo)

    check_drive(driven(0.4), pulse)
    with pytest.raises(InvalidInput, match=r"reaches 0\.57\d* of the PGA and is off by 0\.8\d PGV"):
        check_drive(driven(1.5), pulse)
    phase, lag = np.linspace(0.0, 2.0 * np.pi, 10_000), 3.0
    made = (np.cos(phase) + lag * np.sin(phase) - np.exp(-phase / lag)) / (1.0 + lag**2)
    with pytest.raises(InvalidInput, match=f"reaches {np.abs(made).max():.2g}"):
        check_drive(driven(lag), pulse)


RIPPLE, RATE = 0.15, 60.0 * math.pi


class Rippled(CosinePulse):
    """A pulse with a ripple on it of 0.15 m/s and 30 Hz, which makes most of the PGA."""

    shortest_time = 1.0 / 30.0

    def velocity(self, t: Array) -> Array:
        return super().velocity(t) + RIPPLE * np.sin(RATE * t)


def test_a_servo_that_follows_the_velocity_but_not_the_pga_is_refused() -> None:
    """Behind the pulse it lags by q = 0.19, and makes 0.98 of it; of the ripple it makes 0.17."""
    rock, lag, t = box()[0], 0.03, np.linspace(0.0, 1.0, 10_000)
    servo = replace(PUBLISHED, kp=(PUBLISHED.mass + rock.mass) / lag, ki=0.0)
    made, wanted = np.zeros(10_000), np.zeros(10_000)
    for speed, rate in ((1.0, 2.0 * math.pi), (RIPPLE, RATE)):
        phase, q = rate * t, rate * lag
        lagged = (np.cos(phase) + q * np.sin(phase) - np.exp(-phase / q)) / (1.0 + q**2)
        made, wanted = made + rate * speed * lagged, wanted + rate * speed * np.cos(phase)
    share = np.abs(made).max() / np.abs(wanted).max()
    with pytest.raises(InvalidInput, match=f"reaches {share:.2g}.* is off by 0.2"):
        check_drive(Scene(rock, Contact(0.6), drive=servo), Rippled(2.0 * math.pi, 0.5 / math.pi))


@pytest.mark.parametrize("limit", [math.inf, 6e5, 4e5])
def test_a_force_limit_does_not_hide_that_a_servo_rings(limit: float) -> None:
    """It is more than the PGA takes, and cuts what the ringing would add to it."""
    servo = replace(PUBLISHED, kp=1e5, ki=5e7, force_limit=limit)
    scene = Scene(box()[0], Contact(0.6), drive=servo)
    with pytest.raises(InvalidInput, match=r"reaches 3\.\d+ of the PGA"):
        check_drive(scene, CosinePulse.from_g(0.6, 0.05))


@pytest.mark.parametrize("limit", [None, 1e5])
def test_the_force_bounds_the_pga(write_site: Callable[..., str], limit: float | None) -> None:
    """F = (M + m) a, and without a limit there is none."""
    given = () if limit is None else (f"servo.force_limit={limit:g}",)
    config = load_site(quick_site(write_site), None, given).config
    rock, limits = box()
    known = reach(Scenes(config.scene, Standing(rock, limits)))
    wanted = math.inf if limit is None else limit / (5e4 + rock.mass) / GRAVITY
    assert known == pytest.approx(wanted, rel=1e-12)


def test_no_boundary_is_looked_for_beyond_the_force(
    write_site: Callable[..., str], vsr: Callable[..., object], derived
) -> None:  # type: ignore[no-untyped-def]
    """Which a table cannot reach: that the rock stands there says nothing."""
    site = quick_site(write_site)
    short = ("--set", "motion.pga=[0.01]", "--set", "servo.force_limit=20000")
    ran = vsr("run", "boundary", "--site", site, "--workers", "0", *short)
    assert ran.code == 0, ran.err  # type: ignore[attr-defined]
    reached = 20000 / 55275 / GRAVITY
    data = read(derived / "rock" / "boundary.nc")
    assert data.attrs["searched_to_g"] == pytest.approx(reached, rel=1e-9)
    lower, upper = (data[f"first_overturning_pga_{end}"].item() for end in ("lower", "upper"))
    assert (lower, upper) == (pytest.approx(reached, rel=1e-9), math.inf)


def test_a_draw_of_which_the_force_cannot_reach_the_grid_is_refused(
    write_site: Callable[..., str], vsr: Callable[..., object]
) -> None:
    """5600 N give this table and rock 0.0103 g, and a draw of a stronger motion wants more."""
    settings = ("motion.pga=[0.01]", "servo.force_limit=5600", "uncertainty.members=4")
    given = [part for one in settings for part in ("--set", one)]
    gain = ("--set", "uncertainty.amplitude={mean: 1, sd: 0.1}")
    site = quick_site(write_site)
    ran = vsr("run", "uncertainty", "--site", site, "--workers", "0", *given, *gain)
    said = ran.err.splitlines()[-1]  # type: ignore[attr-defined]
    assert ran.code == 2, said  # type: ignore[attr-defined]
    assert "servo.force_limit" in said


@pytest.mark.slow
def test_draws_are_run_no_further_than_the_force_gives_each(
    write_site: Callable[..., str], vsr: Callable[..., object], derived
) -> None:  # type: ignore[no-untyped-def]
    settings = ("motion.pga=[0.01]", "servo.force_limit=20000", "uncertainty.members=4")
    given = [part for one in settings for part in ("--set", one)]
    gain = ("--set", "uncertainty.amplitude={mean: 1, sd: 0.1}")
    site = quick_site(write_site)
    ran = vsr("run", "uncertainty", "--site", site, "--workers", "0", *given, *gain)
    assert ran.code == 0, ran.err  # type: ignore[attr-defined]
    own, drawn = (read(derived / "rock" / f"{name}.nc") for name in ("boundary", "uncertainty"))
    strongest = drawn["drawn_amplitude"].values.max()
    reached = 20000 / 55275 / GRAVITY / strongest
    assert strongest > 1.0
    assert drawn.attrs["searched_to_g"] == pytest.approx(reached, rel=0.01)  # masses, too, differ
    assert own.attrs["searched_to_g"] > 1.01 * drawn.attrs["searched_to_g"]


def test_the_published_servo_is_the_default(write_site: Callable[..., str]) -> None:
    """With its commands at 200 Hz."""
    held = replace(PUBLISHED, hold=5)
    assert in_si.servo(load_site(write_site("drive: servo\n")).config.servo) == held
    every = load_site(write_site("drive: servo\nservo: {command_rate: null}\n")).config.servo
    assert in_si.servo(every) == PUBLISHED
    limited = load_site(write_site("drive: servo\nservo: {force_limit: 3e4}\n")).config.servo
    assert in_si.servo(limited) == replace(held, force_limit=3e4)


@pytest.mark.slow
def test_a_servo_counts_only_where_it_drives(
    write_site: Callable[..., str], vsr: Callable[..., object]
) -> None:
    """Nothing is made again for an idle servo, and everything for another one that drives."""
    site = write_site(SMALL)
    run = ("run", "responses", "--site", site, "--workers", "0")
    assert vsr(*run).code == 0  # type: ignore[attr-defined]
    idle = vsr("why", "responses", "--site", site, "--set", "servo.kp=3e7").out  # type: ignore[attr-defined]
    assert "changed" not in idle
    assert "2 of 2 are stored" in idle
    assert vsr(*run, "--set", "drive=servo").code == 0  # type: ignore[attr-defined]
    drives = ("--set", "drive=servo", "--set", "servo.kp=3e7")
    other = vsr("why", "responses", "--site", site, *drives).out  # type: ignore[attr-defined]
    assert "servo.kp changed: 50000000.0 is now 30000000.0" in other
    assert "0 of 2 are stored" in other


def test_run_keys_hold_the_servo_that_drives(
    write_site: Callable[..., str], vsr: Callable[..., object], derived
) -> None:  # type: ignore[no-untyped-def]
    site = write_site(SMALL)
    assert vsr("run", "rock", "--site", site).code == 0  # type: ignore[attr-defined]
    store = Store(derived / "rock")

    def run_keys(*settings: str) -> tuple[bytes, ...]:
        asked = job(load_site(site, None, settings), store)
        config = asked.config
        scenes = Scenes(config.scene, graph.built(Standing, asked))
        steps = stored_steps(scenes, store.runs)
        engine = find_engine(config.engine, asked.site)
        motions = MotionData(store.folder)
        study = Study(scenes, engine, config.yaw, config.motion, motions, steps)
        return tuple(run.key for run in study.wanted(study.groups[0]))

    assert run_keys("servo.period=0.0005") == run_keys()
    found = {run_keys()}
    changes = ("mass=6e4", "kp=4e7", "ki=0", "kd=10", "period=0.0005", "force_limit=1e6")
    for change in (*changes, "command_rate=100"):
        found.add(run_keys("drive=servo", f"servo.{change}"))
    assert len(found) == 8
    assert {
        "vsr_core.engines.bullet.driven:BulletDrivenWorld",
        "vsr_core.run.sampling:samples",
        "vsr_core.table.servo:check",
    } <= set(tracing.reached(run_code("bullet", terrain=False)))
    reads = {name: i.facts["config"] for name, i in identities("report", load_site(site)).items()}
    assert {name for name in reads if "drive" in reads[name]} == {
        name for name in reads if "servo" in reads[name]
    }
