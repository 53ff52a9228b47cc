"""A run done once more: the same run, energies by mechanics, and points where the rock stands."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.spatial import ConvexHull, Delaunay
from scipy.spatial.transform import Rotation
from support import grounds

from vsr_core import GRAVITY
from vsr_core.errors import InvalidInput
from vsr_core.judge.on_terrain import DROPPED_SHARE
from vsr_core.judge.proofs import barrier
from vsr_core.motions.pulses import CosinePulse, SinePulse
from vsr_core.motions.six_axes import AxisPulse, AxisPulses
from vsr_core.outcome import DecidedBy, Outcome
from vsr_core.rock import solid
from vsr_core.rock.body import Rock
from vsr_core.rock.reduction import in_flight
from vsr_core.run import replay as replays
from vsr_core.run.cases import Case, Settings, TerrainCase, prepare
from vsr_core.run.displacement import displace, respond
from vsr_core.run.overturning import simulate
from vsr_core.run.replay import Replay, replay
from vsr_core.scene import Contact, Scene
from vsr_core.surrogates.double_rock import double_rock
from vsr_core.table.servo import Servo

Array = NDArray[np.float64]

SIZE, DENSITY = (0.5, 1.0, 2.0), 2110.0
MASS = DENSITY * SIZE[0] * SIZE[1] * SIZE[2]
FINE = Settings(0.004, engine="nonsmooth")
COARSE = Settings(0.003, engine="bullet")
ROCKS, FALLS = CosinePulse.from_g(0.45, 0.12), CosinePulse.from_g(0.6, 0.5)


@cache
def rock() -> Rock:
    return solid.box(SIZE, DENSITY).rock


@cache
def case(yaw: float = 0.0, drive: Servo | None = None) -> Case:
    scene = Scene(rock(), Contact(0.6), yaw, drive=drive)
    return prepare(scene, barrier(rock()), reduce=True)


@cache
def played(pulse: CosinePulse, settings: Settings = FINE, yaw: float = 0.0) -> Replay:
    return replay(case(yaw), pulse, settings)


def angular_velocity(run: Replay) -> Array:
    """By differences of the poses, half-way between two of them."""
    turn = Rotation.from_quat(run.quaternion)
    return (turn[1:] * turn[:-1].inv()).as_rotvec() / np.diff(run.time)[:, None]


def kinetic_by_poses(run: Replay) -> Array:
    """Of a cuboid, m/2 v^2 + w I w / 2, half-way between two poses."""
    a, b, c = SIZE
    inertia = MASS / 12.0 * np.array([b * b + c * c, a * a + c * c, a * a + b * b])
    speed = np.diff(run.position, axis=0) / np.diff(run.time)[:, None]
    half = Rotation.from_quat(run.quaternion)[:-1]
    own = half.inv().apply(angular_velocity(run))
    return 0.5 * MASS * (speed**2).sum(axis=1) + 0.5 * (own**2 * inertia).sum(axis=1)


# ---- The same run


@pytest.mark.parametrize("settings", [FINE, COARSE, replace(FINE, reduce=False)])
@pytest.mark.parametrize("pulse", [ROCKS, FALLS, CosinePulse.from_g(0.1, 0.3)])
def test_it_is_the_run_of_the_study(pulse: CosinePulse, settings: Settings) -> None:
    run, response = played(pulse, settings, 0.4), simulate(case(0.4), pulse, settings)
    assert run.response == response
    decided = int(np.searchsorted(run.time, run.decided - 1e-9))
    frames = run.tilt[: decided + 1]
    if settings.engine == "bullet":  # which is looked at when it is judged
        assert response.peak_tilt <= frames.max() + 1e-6
    else:  # in every step, and between steps
        top = 0.125 * np.abs(np.diff(frames)).max(initial=0.0)
        assert frames.max() - 1e-6 <= response.peak_tilt <= frames.max() + top + 1e-6
    assert run.tilt[decided] == pytest.approx(response.final_tilt, abs=1e-6)
    assert (np.diff(run.time) > 0.0).all()


@pytest.mark.parametrize("settings", [FINE, COARSE])
def test_it_is_the_run_of_the_study_on_a_table_that_turns(settings: Settings) -> None:
    axes = ("x", 0.5 * GRAVITY), ("y", 0.5 * GRAVITY), ("roll", 0.5), ("pitch", 0.5)
    turns = AxisPulses(tuple(AxisPulse(axis, peak, 0.2) for axis, peak in axes))
    assert replay(case(), turns, settings).response == simulate(case(), turns, settings)


def test_what_the_study_passes_over_is_passed_over() -> None:
    """A sine begins gently: until its push can lift the rock, no step is done."""
    gentle = SinePulse(0.6 * GRAVITY, 0.3)
    run = replay(case(), gentle, FINE)
    assert run.response == simulate(case(), gentle, FINE)
    begins = float(np.diff(run.time).max())
    lifts = SIZE[0] / SIZE[2] * GRAVITY  # of a block: the acceleration b/h g
    assert gentle.acceleration(np.array([begins]))[0] == pytest.approx(lifts, rel=0.05)
    assert run.tilt[1] == 0.0


def test_it_goes_on_where_the_study_stops() -> None:
    run = played(FALLS)
    assert run.response.outcome is Outcome.OVERTURNED
    assert run.response.decided_by is DecidedBy.NO_RETURN
    assert run.time[-1] > run.decided + 0.5
    # it lies on a long side: its centre is half the short side high, and it is at rest
    assert run.position[-1, 2] == pytest.approx(0.5 * SIZE[0], abs=1e-3)
    assert run.kinetic[-1] < 1e-3 * MASS
    short = replay(case(), FALLS, FINE, longest=0.2)
    assert short.time[-1] == pytest.approx(run.decided + 0.2, abs=0.05)


def test_a_run_that_never_starts_stands_still() -> None:
    run = played(CosinePulse.from_g(0.1, 0.3))
    assert run.response.decided_by is DecidedBy.NO_UPLIFT_BOUND
    assert run.decided == 0.0
    assert run.time[-1] >= CosinePulse.from_g(0.1, 0.3).duration
    assert run.tilt.max() < 1e-6
    assert run.kinetic.max() < 1e-9 * MASS


@pytest.mark.parametrize("settings", [FINE, COARSE])
def test_a_run_that_never_starts_stands_as_its_engine_seats_it(settings: Settings) -> None:
    """Bullet, of single precision, seats a rock of many faces 1e-4 rad off."""
    mesh = trimesh.Trimesh(*double_rock(), process=False)
    scene = Scene(solid.from_mesh(mesh, DENSITY).rock, Contact(0.6))
    seated, gentle = prepare(scene, barrier(scene.rock), reduce=True), CosinePulse.from_g(0.02, 0.3)
    run = replay(seated, gentle, settings)
    assert run.response.steps == 0
    assert run.tilt.max() < 1e-3


def test_fewer_states_of_the_same_run() -> None:
    whole, part = played(ROCKS), replay(case(), ROCKS, FINE, spacing=0.02)
    assert part.response == whole.response
    assert len(part.time) < 0.3 * len(whole.time)
    same = np.isin(whole.time, part.time)
    np.testing.assert_array_equal(whole.position[same][-5:], part.position[-5:])


def test_another_run_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    otherwise = replace(simulate(case(), ROCKS, FINE), final_tilt=0.3)
    monkeypatch.setattr(replays, "simulate", lambda *_: otherwise)
    with pytest.raises(AssertionError, match="ends otherwise"):
        replay(case(), ROCKS, FINE)


def test_a_run_without_a_solution_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    unsound = replace(simulate(case(), ROCKS, FINE), outcome=Outcome.UNSTABLE)
    monkeypatch.setattr(replays, "simulate", lambda *_: unsound)
    with pytest.raises(InvalidInput, match="unstable at every time step"):
        replay(case(), ROCKS, FINE)


@pytest.mark.parametrize(
    ("engine", "pga"),
    [
        ("nonsmooth", 0.8),
        ("bullet", 0.3),
        pytest.param("nonsmooth", 0.3, marks=pytest.mark.slow),
        pytest.param("bullet", 0.8, marks=pytest.mark.slow),
    ],
)
def test_on_a_terrain_it_is_the_run_of_the_study_and_goes_on(engine: str, pga: float) -> None:
    seat = grounds.site(rock(), grounds.level(), yaw=0.5).seat
    place = TerrainCase(seat, seat, barrier(rock()).toppled_tilt)
    pulse, settings = CosinePulse.from_g(pga, 0.3), Settings(0.003, engine=engine)
    run = replay(place, pulse, settings)
    assert run.response == respond(place, pulse, settings)
    assert (run.response.outcome is Outcome.OVERTURNED) == (pga == 0.8)
    assert run.time[-1] >= run.decided
    # level ground is a flat pedestal: the rock ends on its base, or on a side
    heights = [0.5 * side for side in SIZE]
    lowest = min(abs(run.position[-1, 2] - height) for height in heights)
    assert lowest < 0.02
    assert run.tilt[-1] > 1.0 if pga == 0.8 else run.tilt[-1] < 0.1


@pytest.mark.parametrize("engine", ["nonsmooth", "bullet"])
@pytest.mark.parametrize("tilt", [0.5, 1.2])
def test_after_toppling_it_goes_the_way_of_the_displacement_run(engine: str, tilt: float) -> None:
    """By its tilt, and by how far its centre came down before that; another hull is in flight."""
    seat = grounds.site(grounds.lump(), grounds.perch(), yaw=4.0).seat
    place = TerrainCase(seat, replace(seat, rock=in_flight(seat.rock)), tilt)
    pulse, settings = CosinePulse.from_g(0.4, 0.3), Settings(0.003, engine=engine)
    stored, run = displace(place, pulse, settings).trajectory, replay(place, pulse, settings)
    decided = int(np.searchsorted(run.time, run.decided - 1e-9))
    dropped = run.position[0, 2] - run.position[decided, 2] > DROPPED_SHARE * seat.rock.radius
    assert (run.tilt[decided] > tilt) != dropped
    assert dropped == (tilt == 1.2)
    assert run.time[-1] == stored.time[-1] > run.decided + 1.0
    at = np.searchsorted(run.time, stored.time - 1e-9)
    np.testing.assert_allclose(run.position[at], stored.position, rtol=0.0, atol=1e-9)
    same = np.abs((run.quaternion[at] * stored.quaternion).sum(axis=1))  # with either sign
    np.testing.assert_allclose(same, 1.0, atol=1e-9)


def test_states_are_no_closer_than_asked_for_on_a_terrain_either() -> None:
    seat = grounds.site(rock(), grounds.level(), yaw=0.5).seat
    place, pulse = TerrainCase(seat, seat, 1.0), CosinePulse.from_g(0.8, 0.3)
    run = replay(place, pulse, FINE, spacing=0.02, longest=0.3)
    assert run.time[-1] == pytest.approx(run.decided + 0.3, abs=0.01)
    assert np.diff(run.time).max() < 0.02 + 1e-9
    assert np.median(np.diff(run.time)) > 0.015


# ---- Energies


def test_energies_are_those_of_a_cuboid_by_its_poses() -> None:
    for run in (played(FALLS), played(ROCKS, FINE, 0.4)):
        np.testing.assert_allclose(
            run.potential, MASS * GRAVITY * (run.position[:, 2] - 0.5 * SIZE[2]), atol=1e-6
        )
        middle = 0.5 * (run.kinetic[1:] + run.kinetic[:-1])
        smooth = np.abs(np.diff(run.kinetic)) < 0.05 * run.kinetic.max()  # no impact in between
        off = np.abs(kinetic_by_poses(run) - middle)[smooth]
        assert smooth.mean() > 0.9
        assert off.max() < 0.025 * run.kinetic.max()  # half of what counts as none
        assert np.quantile(off, 0.95) < 5e-4 * run.kinetic.max()


def test_energy_is_kept_in_flight() -> None:
    """Thrown up by a table that drops away, the rock flies and turns over a table at rest."""
    thrown = AxisPulses((AxisPulse("x", 30.0, 0.06), AxisPulse("z", 50.0, 0.04)))
    run = replay(case(0.4), thrown, replace(FINE, time_step=0.001))
    touches = np.array([len(points) > 0 for points in run.bearing])
    free = ~touches & (run.time > thrown.duration + 0.002)
    free[1:] &= ~touches[:-1]
    free = free & (np.cumsum(np.diff(free, prepend=False)) == 1)  # the first flight
    assert free.sum() > 100
    whole = (run.kinetic + run.potential)[free]
    assert np.ptp(run.potential[free]) > 0.05 * whole.mean()
    assert np.linalg.norm(angular_velocity(run), axis=1)[free[1:]].min() > 0.3
    np.testing.assert_allclose(whole, whole[0], rtol=1e-3)


def test_the_shaking_does_the_work() -> None:
    """In the table's frame a body force -m a(t) acts: until the first impact it does all work."""
    run = played(FALLS)
    speed = np.gradient(run.position[:, 0], run.time)
    work = cumulative_trapezoid(-MASS * run.acceleration[:, 0] * speed, run.time, initial=0.0)
    falls = run.tilt < 0.9  # about one edge all the way
    until = int(np.argmin(falls))
    assert until > 50
    gained = (run.kinetic + run.potential)[:until]
    np.testing.assert_allclose(gained, work[:until], atol=0.01 * gained.max())


def test_contact_takes_energy_once_the_shaking_is_over() -> None:
    run = played(ROCKS)
    after = run.time > ROCKS.duration + 0.01
    whole = (run.kinetic + run.potential)[after]
    assert whole[0] > 0.1 * run.kinetic.max()
    assert np.diff(whole).max() < 5e-3 * run.kinetic.max()


# ---- What bears the rock, and the table


@pytest.mark.parametrize("settings", [FINE, COARSE])
def test_points_lie_on_the_ground_and_on_the_rock(settings: Settings) -> None:
    run = played(ROCKS, settings)
    seen = 0
    for points, centre, turn in zip(
        run.bearing, run.position, Rotation.from_quat(run.quaternion), strict=True
    ):
        if len(points):
            seen += 1
            assert np.abs(points[:, 2]).max() < 0.01
            inside = turn.inv().apply(points - centre)
            assert (np.abs(inside) < 0.5 * np.array(SIZE) + 0.015).all()
    assert seen > 0.9 * len(run.bearing)


@pytest.mark.parametrize("settings", [FINE, COARSE])
def test_a_rock_at_rest_stands_between_its_points(settings: Settings) -> None:
    run = played(ROCKS, settings)
    assert run.response.outcome is Outcome.BALANCED
    points = run.bearing[-1][:, :2]
    corners = points[ConvexHull(points).vertices]
    assert Delaunay(corners).find_simplex(run.position[-1, :2]) >= 0


def test_it_rocks_about_the_edge_that_it_is_pushed_over() -> None:
    run = played(FALLS)
    at = int(np.argmax(run.tilt > 0.1))
    # the table goes to +x first, so the rock topples to -x, about its edge there
    assert run.position[at, 0] < 0.0
    np.testing.assert_allclose(run.bearing[at][:, 0], -0.5 * SIZE[0], atol=0.01)


def test_the_table_moves_as_prescribed() -> None:
    run = played(ROCKS)
    pga, ratio = ROCKS.pga, ROCKS.pgv_pga
    inside = run.time < ROCKS.duration - 1e-9
    np.testing.assert_allclose(
        run.acceleration[inside, 0], pga * np.cos(run.time[inside] / ratio), atol=1e-9
    )
    np.testing.assert_allclose(
        run.velocity[inside, 0], pga * ratio * np.sin(run.time[inside] / ratio), atol=1e-9
    )
    assert not run.acceleration[run.time > ROCKS.duration + 1e-9].any()
    assert not run.acceleration[:, 1:].any()


@pytest.mark.slow
def test_a_table_in_several_axes_and_one_with_a_servo() -> None:
    several = AxisPulses((AxisPulse("x", 5.0, 0.2), AxisPulse("z", 2.0, 0.2)))
    run = replay(case(), several, FINE)
    assert run.response == simulate(case(), several, FINE)
    assert np.abs(run.acceleration[:, 2]).max() == pytest.approx(2.0)
    servo = Servo(5e4, 5e7, 5e7, 0.0, 0.001, math.inf, 5)
    driven = case(0.0, servo)
    settings = replace(COARSE, time_step=0.001)
    run = replay(driven, ROCKS, settings)
    assert run.response == simulate(driven, ROCKS, settings)
    late = (run.time > 0.05) & (run.time < ROCKS.duration)
    off = run.velocity[late, 0] - ROCKS.velocity(run.time[late])
    assert 0.0 < np.abs(off).max() < 0.1 * ROCKS.pga * ROCKS.pgv_pga  # a servo lags a little
    # points are told relative to the table, which is far from where it was
    standing = [points for points in run.bearing if len(points)]
    assert max(np.abs(points[:, 0]).max() for points in standing) < 0.5 * SIZE[0] + 0.02
