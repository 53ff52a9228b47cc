"""Runs on a terrain: against the flat pedestal, the symmetries of mechanics, and free flight."""

from __future__ import annotations

import hashlib
import math
import pickle
import subprocess
import sys
import types
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from support import grounds
from support.suites import slow_but

from pipeline import ROOT
from pipeline.stages.runs.displacement_runs import pack, unpack
from vsr_core import GRAVITY, engines
from vsr_core.engines.bullet import ground as bullet_ground
from vsr_core.engines.interface import Solver
from vsr_core.errors import InvalidInput
from vsr_core.judge import on_terrain, proofs, track
from vsr_core.judge.proofs import Barrier, barrier
from vsr_core.motions.pulses import CosinePulse
from vsr_core.motions.records.trace import RecordedMotion, Trace
from vsr_core.outcome import DISPLACED_SHARE, DecidedBy, Outcome, StopReason
from vsr_core.rock import reduction, solid
from vsr_core.rock.body import Rock
from vsr_core.run import displacement, loop
from vsr_core.run.cases import Settings, TerrainCase, prepare
from vsr_core.run.displacement import DisplacementRun
from vsr_core.run.loop import HALVINGS
from vsr_core.run.movement import Trajectory
from vsr_core.run.overturning import simulate
from vsr_core.run.sampling import MOST_SUBSTEPS, sampling
from vsr_core.run.static_limits import SAFE_SHARE
from vsr_core.run.time_step import step_unit
from vsr_core.scene import Contact, Scene, State
from vsr_core.surrogates.double_rock import double_rock
from vsr_core.terrain.surface import Terrain

Array = NDArray[np.float64]


@cache
def rock_of(name: str) -> tuple[Rock, Barrier]:
    if name == "box":
        rock = solid.box((0.5, 0.4, 1.0), 2110.0).rock
    elif name == "double rock":
        rock = solid.from_mesh(trimesh.Trimesh(*double_rock(), process=False), 2110.0).rock
    else:
        rock = grounds.lump(0)
    return rock, barrier(rock)


@cache
def ground_of(name: str) -> Terrain:
    """By name; ``... parts`` is the same as convex parts."""
    if name.endswith(" parts"):
        return grounds.in_parts(ground_of(name.removesuffix(" parts")), 0.004, 0.04)
    made: dict[str, Callable[[], Terrain]] = {
        "level": grounds.level,
        "perch": grounds.perch,
        "cliff": lambda: grounds.cliff(3.0, 0.3),
        "niche": lambda: grounds.niche(0.75, 0.4, lines=9),
    }
    return made[name]()


@cache
def site_of(rock: str, ground: str, yaw: float = 0.0, restitution: float = 0.0) -> TerrainCase:
    """A rock that has settled on a ground."""
    body, limits = rock_of(rock)
    made = grounds.site(body, ground_of(ground), yaw=yaw, restitution=restitution)
    rest = displacement.settled(made.seat, 0.006 * step_unit(body))
    scene = replace(made.seat, start=rest)
    return TerrainCase(scene, scene, limits.toppled_tilt)


def usual(
    rock: Rock, share: float = 0.002, *, reduce: bool = True, engine: str = "bullet"
) -> Settings:
    return Settings(share * step_unit(rock), reduce, engine)


def run(site: TerrainCase, pga_g: float, ratio: float, engine: str = "bullet") -> DisplacementRun:
    settings = usual(site.seat.rock, engine=engine)
    return displacement.displace(site, CosinePulse.from_g(pga_g, ratio), settings)


def cells(seed: int, count: int, low: float, high: float, longest: float = 0.5) -> Array:
    """Random PGA [g], PGV/PGA [s] and yaw [rad], shape (count, 3)."""
    rng = np.random.default_rng(seed)
    ratio = np.exp(rng.uniform(math.log(0.08), math.log(longest), count))
    pga, yaw = rng.uniform(low, high, count), rng.uniform(0.0, 2.0 * math.pi, count)
    return np.column_stack([pga, ratio, yaw])


def squarely(chosen: Array) -> Array:
    """The same cells, shaken along x or y: on one corner a box has no boundary, but a fringe."""
    quarter = 0.5 * math.pi
    return np.column_stack([chosen[:, :2], np.round(chosen[:, 2] / quarter) * quarter])


# Level ground is a flat pedestal


def like_the_plane(rock: str, ground: str, chosen: Array, shift: float = 0.03) -> None:
    """Same side as on the plane, but for cells whose own neighbours are on both sides of it."""
    body, limits = rock_of(rock)
    settings = usual(body)
    sides = []
    beside = 0
    for pga, ratio, yaw in chosen.tolist():
        case = prepare(Scene(body, Contact(0.6), yaw), limits, reduce=True)

        def flat(share: float, case=case, pga=pga, ratio=ratio) -> int:  # type: ignore[no-untyped-def]
            return simulate(
                case, CosinePulse.from_g(share * pga, ratio), settings
            ).outcome.overturned

        site = site_of(rock, ground)
        site = replace(site, seat=replace(site.seat, yaw=yaw))
        found = displacement.respond(site, CosinePulse.from_g(pga, ratio), settings)
        if found.outcome.overturned != flat(1.0):
            around = [flat(1.0 + way * shift * part) for way in (-1, 1) for part in (0.3, 0.6, 1.0)]
            assert len({*around, flat(1.0)}) == 2, (pga, ratio, yaw, found)
            beside += 1
        sides.append(found.outcome.overturned)
    assert set(sides) == {0, 1}
    assert beside <= 0.1 * len(chosen)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rock", "ground", "count"),
    [("box", "level", 5), ("box", "level parts", 5), ("double rock", "level parts", 6)],
)
def test_level_ground_is_a_flat_pedestal(rock: str, ground: str, count: int) -> None:
    """After the first impacts: many of them magnify any difference."""
    if rock == "box":
        like_the_plane(rock, ground, squarely(cells(1, count, 0.4, 1.2, 0.2)))
    else:
        like_the_plane(rock, ground, cells(1, count, 0.08, 0.5, 0.15))


@pytest.mark.slow
@pytest.mark.parametrize("ground", ["level", "level parts"])
@pytest.mark.parametrize("rock", ["box", "double rock"])
def test_level_ground_is_a_flat_pedestal_on_a_grid(rock: str, ground: str) -> None:
    if rock == "box":
        like_the_plane(rock, ground, squarely(cells(2, 60, 0.3, 1.2, 0.3)))
    else:
        like_the_plane(rock, ground, cells(2, 60, 0.08, 0.5, 0.3))


def boundary(over: Callable[[float], bool], low: float, high: float) -> float:
    """The least PGA [g] that topples, to 0.2 %."""
    assert over(high)
    assert not over(low)
    while high - low > 0.002 * high:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if over(middle) else (middle, high)
    return high


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rock", "ground", "shift"),
    [
        ("box", "level", 0.02),
        ("box", "level parts", 0.02),
        ("double rock", "level", 0.03),  # it settles with a lean of 0.02 deg
        ("double rock", "level parts", 0.02),
    ],
)
def test_boundary_on_level_ground(rock: str, ground: str, shift: float) -> None:
    """Of few impacts, against that on the plane."""
    body, limits = rock_of(rock)
    case = prepare(Scene(body, Contact(0.6)), limits, reduce=True)
    settings, site = usual(body), site_of(rock, ground)
    low, high = (0.5, 1.0) if rock == "box" else (0.1, 0.4)

    def flat(pga: float) -> bool:
        return simulate(case, CosinePulse.from_g(pga, 0.15), settings).outcome.overturned == 1

    def terrain(pga: float) -> bool:
        return (
            displacement.respond(site, CosinePulse.from_g(pga, 0.15), settings).outcome.overturned
            == 1
        )

    assert boundary(terrain, low, high) == pytest.approx(boundary(flat, low, high), rel=shift)


def test_slip_on_level_ground_is_that_on_the_plane() -> None:
    """A squat block that slides and does not rock."""
    squat = solid.box((0.8, 0.8, 0.3), 2000.0).rock
    limits = barrier(squat)
    for pga, ratio, yaw in [(0.8, 0.2, 0.0), (0.6, 0.3, 1.0)]:
        case = prepare(Scene(squat, Contact(0.3), yaw), limits, reduce=False)
        flat = simulate(case, CosinePulse.from_g(pga, ratio), usual(squat, reduce=False))
        for ground in ("level", "level parts"):
            site = grounds.site(
                squat, ground_of(ground), limits.toppled_tilt, yaw=yaw, friction=0.3
            )
            found = displacement.displace(site, CosinePulse.from_g(pga, ratio), usual(squat))
            assert found.response.outcome is flat.outcome is Outcome.DISPLACED
            assert found.response.slip == pytest.approx(flat.slip, rel=0.02)
            assert found.stop is StopReason.REST
            # A positive pulse pushes first away from where the table starts to, whatever the yaw.
            early = found.trajectory.position[found.trajectory.time < 0.2][-1, :2]
            way = np.array([math.cos(yaw), -math.sin(yaw)])
            assert early @ way < -0.9 * np.linalg.norm(early) < -1e-3


def test_outcomes_that_stand() -> None:
    squat = solid.box((0.8, 0.8, 0.3), 2000.0).rock
    site = grounds.site(squat, ground_of("level parts"), 1.0, friction=0.3)
    for pga, outcome in [(0.4, Outcome.BALANCED), (0.5, Outcome.DISPLACED)]:
        response = run(site, pga, 0.2).response
        assert response.outcome is outcome
        assert 0.4 < response.slip / (DISPLACED_SHARE * squat.radius) < 2.0


# Symmetries


def place(found: DisplacementRun, times: Array) -> Array:
    """Centre of mass at times [s], shape (n, 3) [m]."""
    path = found.trajectory
    return np.stack([np.interp(times, path.time, part) for part in path.position.T], axis=1)


def early(found: DisplacementRun, other: DisplacementRun, back: Array, radius: float) -> None:
    """Same side; the same way, but for a hundredth of the radius, until the impacts differ."""
    assert found.response.outcome.overturned == other.response.outcome.overturned
    times = np.linspace(0.0, 0.5, 40)
    apart = place(found, times) - place(other, times) @ back.T
    assert np.abs(apart).max() < 0.01 * radius


def seen_from(site: TerrainCase, matrix: Array, yaw: float) -> TerrainCase:
    """A site turned, mirrored or scaled by ``matrix``, shaken along ``yaw`` [rad]."""
    scene = site.seat
    rock, start, ground = scene.rock, scene.start, scene.terrain
    assert start is not None
    assert ground is not None
    scale = abs(np.linalg.det(matrix)) ** (1.0 / 3.0)
    turn = matrix / scale
    axes = turn @ rock.axes
    axes[:, 2] *= np.linalg.det(axes)
    other = replace(
        scene,
        rock=replace(
            rock,
            vertices=rock.vertices @ matrix.T,
            mass=rock.mass * scale**3,
            inertia=rock.inertia * scale**5,
            axes=axes,
        ),
        start=replace(
            start, position=matrix @ start.position, rotation=turn @ start.rotation @ turn.T
        ),
        terrain=grounds.moved(ground, matrix),
        yaw=yaw,
    )
    return TerrainCase(other, other, site.toppled_tilt)


SOME = [(0.5, 0.2, 0.0), (0.9, 0.15, 1.0), (0.4, 0.3, 3.0), (0.18, 0.3, 0.5), (0.25, 0.08, 4.0)]
"""PGA [g], PGV/PGA [s] and yaw [rad] that topple the lump on its perch, but for the last."""


@cache
def known(pga: float, ratio: float, yaw: float) -> DisplacementRun:
    """A run of the lump on its perch."""
    return run(site_of("lump", "perch parts", yaw), pga, ratio)


@pytest.mark.slow
def test_some_topple_and_some_do_not() -> None:
    assert {known(*cell).response.outcome.overturned for cell in SOME} == {0, 1}


@pytest.mark.parametrize(("pga", "ratio", "yaw"), slow_but(SOME[:1], SOME))
def test_mirrored_site_and_shaking(pga: float, ratio: float, yaw: float) -> None:
    site = site_of("lump", "perch parts", yaw)
    mirror = np.diag([1.0, -1.0, 1.0])
    other = seen_from(site, mirror, -yaw)
    early(known(pga, ratio, yaw), run(other, pga, ratio), mirror, site.seat.rock.radius)


@pytest.mark.parametrize(("pga", "ratio", "yaw"), slow_but(SOME[4:5], SOME))
def test_turned_site_and_shaking(pga: float, ratio: float, yaw: float) -> None:
    """The shaking is along -yaw in the site's frame: it turns with the site if yaw goes back."""
    site = site_of("lump", "perch parts", yaw)
    turn = grounds.turn_z(0.8)
    other = seen_from(site, turn, yaw - 0.8)
    early(known(pga, ratio, yaw), run(other, pga, ratio), turn.T, site.seat.rock.radius)


@pytest.mark.parametrize("yaw", [0.7, 2.0, 4.4])
def test_a_compiled_run_turns_with_its_site(yaw: float) -> None:
    """The rock turned by +yaw with all that surrounds it, and then shaken along +x."""
    site = site_of("lump", "perch parts", yaw)
    turn = grounds.turn_z(yaw)
    turned = seen_from(site, turn, 0.0)
    one, other = (run(scene, 0.5, 0.2, "nonsmooth") for scene in (site, turned))
    early(one, other, turn.T, site.seat.rock.radius)
    first = place(one, np.linspace(0.0, 0.15, 2))
    push = (turn @ (first[1] - first[0]))[:2]
    assert push[0] < -0.9 * np.linalg.norm(push) < -1e-3  # first towards -x, once it is turned


@pytest.mark.slow
def test_reversed_motion_is_a_site_turned_round() -> None:
    site = site_of("lump", "perch parts", 0.4)
    turned = site_of("lump", "perch parts", 0.4 + math.pi)
    for pga, ratio, _ in SOME[::2]:
        one, other = run(site, -pga, ratio), run(turned, pga, ratio)
        early(one, other, np.eye(3), site.seat.rock.radius)


@pytest.mark.parametrize(
    ("pga", "ratio", "yaw", "scale"),
    [
        pytest.param(*cell, scale, marks=[pytest.mark.slow] * (number % 2 == other))
        for number, cell in enumerate(SOME)
        for other, scale in enumerate((0.4, 2.25))
    ],
)
def test_similar_sites_move_alike(pga: float, ratio: float, yaw: float, scale: float) -> None:
    """Lengths times s, times times sqrt(s), at any density of the rock."""
    site = site_of("lump", "perch parts", yaw)
    other = seen_from(site, scale * np.eye(3), yaw)
    pace = math.sqrt(scale)
    found = run(other, pga, ratio * pace)
    path = replace(found.trajectory, time=found.trajectory.time / pace)
    again = replace(found, trajectory=path)
    early(known(pga, ratio, yaw), again, np.eye(3) / scale, site.seat.rock.radius)


def test_density_does_not_matter() -> None:
    for pga, ratio, yaw in SOME[:3]:
        site = site_of("lump", "perch parts", yaw)
        rock = site.seat.rock
        scene = replace(
            site.seat, rock=replace(rock, mass=7.0 * rock.mass, inertia=7.0 * rock.inertia)
        )
        other = run(TerrainCase(scene, scene, site.toppled_tilt), pga, ratio)
        early(known(pga, ratio, yaw), other, np.eye(3), rock.radius)


# The same run twice


def digest(found: DisplacementRun) -> str:
    path = found.trajectory
    arrays = (
        path.time,
        path.position,
        path.quaternion,
        path.velocity,
        path.angular_velocity,
        path.contact,
    )
    made = hashlib.blake2b(repr((found.response, found.stop)).encode())
    for array in arrays:
        made.update(np.ascontiguousarray(array).tobytes())
    return made.hexdigest()


def various() -> list[tuple[TerrainCase, float, float]]:
    """Runs over triangles, parts, with rebounds and with a lighter rock after toppling."""
    lump, limits = rock_of("lump")
    sites = [
        site_of("box", "perch", 0.3),
        site_of("box", "perch parts", 0.3),
        grounds.site(lump, ground_of("perch parts"), yaw=2.0, restitution=0.3),
    ]
    seat = site_of("lump", "perch parts").seat
    flight = replace(seat, rock=reduction.in_flight(lump))
    sites.append(TerrainCase(seat, flight, limits.toppled_tilt))
    motions = [(0.7, 0.2), (-1.2, 0.12)] * 2
    return [(site, *motion) for site, motion in zip(sites, motions, strict=True)]


FRESH = """
import pickle, sys
sys.path[:0] = ["tests", "tests/vsr_core/run"]
import test_displacement_run as tests
for cell in reversed(pickle.load(sys.stdin.buffer)):
    print(tests.digest(tests.run(*cell)))
"""


@pytest.mark.slow
def test_a_world_is_as_new_at_every_step() -> None:
    """Steps that do not fill a sample in binary numbers too."""
    site = site_of("box", "level parts")
    rng = np.random.default_rng(0)
    for share in rng.uniform(0.002, 0.006, 10):
        scene = replace(site.seat)
        new = TerrainCase(scene, scene, site.toppled_tilt)
        motion = CosinePulse.from_g(1.0, float(rng.uniform(0.05, 0.1)))
        settings = usual(scene.rock, float(share))
        first, again = (
            displacement.displace(new, motion, settings, follow=False) for _ in range(2)
        )
        assert digest(first) == digest(again)


@pytest.mark.slow
def test_a_run_knows_nothing_of_the_runs_before() -> None:
    """Bit for bit the same: again, in any order, after others, and in another process."""
    chosen = various()
    inorder = [digest(run(*cell)) for cell in chosen]
    assert len(set(inorder)) == len(chosen)
    order = np.random.default_rng(4).permutation(len(chosen))
    shuffled = {int(i): digest(run(*chosen[i])) for i in order}
    assert [shuffled[i] for i in range(len(chosen))] == inorder
    displacement.respond(chosen[0][0], CosinePulse.from_g(1.0, 0.3), Settings(0.002))
    assert digest(run(*chosen[0])) == inorder[0]
    command = [sys.executable, "-c", FRESH]
    done = subprocess.run(
        command, input=pickle.dumps(chosen), capture_output=True, check=True, cwd=ROOT
    )
    assert done.stdout.decode().split() == inorder[::-1]


# Reduced scenes


def reduced(site: TerrainCase, parts: str) -> TerrainCase:
    """As a pipeline makes it, with few corners, and fewer in flight; on parts, not triangles."""
    seat = replace(
        site.seat, rock=reduction.on_its_seat(site.seat.rock), terrain=ground_of(parts), start=None
    )
    start = grounds.at_rest(site.seat.rock.height)
    seat = replace(seat, start=displacement.settled(replace(seat, start=start), 1e-3))
    return TerrainCase(
        seat, replace(seat, rock=reduction.in_flight(site.seat.rock)), site.toppled_tilt
    )


def in_the_niche(count: int) -> None:
    full = site_of("lump", "niche")
    light = reduced(full, "niche parts")
    assert len(light.flight.rock.vertices) < len(full.seat.rock.vertices)
    same, ended = 0, set()
    for pga, ratio, yaw in cells(5, count, 0.15, 0.7, 0.3).tolist():
        motion = CosinePulse.from_g(pga, ratio)
        one = displacement.displace(
            TerrainCase(replace(full.seat, yaw=yaw), full.flight, full.toppled_tilt),
            motion,
            usual(full.seat.rock, reduce=False),
        )
        other = displacement.displace(
            TerrainCase(
                replace(light.seat, yaw=yaw), replace(light.flight, yaw=yaw), light.toppled_tilt
            ),
            motion,
            usual(full.seat.rock),
        )
        same += one.response.outcome is other.response.outcome
        ended.add(one.response.outcome.overturned)
        times = np.linspace(0.0, 0.25, 20)
        apart = np.linalg.norm(place(one, times) - place(other, times), axis=1)
        assert apart.max() < 0.02 * full.seat.rock.radius
    assert ended == {0, 1}
    assert same >= count - max(1, count // 10)


@pytest.mark.slow
def test_a_reduced_scene_does_as_the_complete_one() -> None:
    in_the_niche(3)


@pytest.mark.slow
def test_a_reduced_scene_does_as_the_complete_one_on_a_grid() -> None:
    in_the_niche(40)


def test_a_state_is_raised_out_of_the_ground() -> None:
    site = site_of("box", "level parts")
    assert site.seat.start is not None
    world = engines.load("bullet").build(site.seat, 5e-4, 1)
    for depth in (0.0, 0.003, 0.03):
        pressed = replace(
            site.seat.start,
            position=site.seat.start.position - [0.0, 0.0, depth],
            angular_velocity=np.ones(3),
        )
        world.put(pressed)
        raised = loop.clear(world, pressed)
        lift = raised.position - pressed.position
        np.testing.assert_allclose(lift[:2], 0.0)
        assert depth - 1e-4 <= lift[2] <= 1.25 * depth + 1e-3
        np.testing.assert_array_equal(raised.rotation, pressed.rotation)
        np.testing.assert_array_equal(raised.angular_velocity, pressed.angular_velocity)
        np.testing.assert_allclose(world.state().position, raised.position, atol=1e-9)
        world.put(replace(raised, angular_velocity=np.zeros(3)))
        world.advance([0.0])
        assert world.contacts()[1] < 1e-3
    aloft = replace(site.seat.start, position=np.array([0.0, 0.0, 2.0]))
    world.put(aloft)
    np.testing.assert_array_equal(loop.clear(world, aloft).position, aloft.position)


# Trajectories


@cache
def fallen() -> tuple[TerrainCase, DisplacementRun, CosinePulse]:
    """A box that is pushed off a cliff of 3 m."""
    box, limits = rock_of("box")
    site = grounds.site(box, ground_of("cliff"), limits.toppled_tilt, friction=0.2)
    motion = CosinePulse.from_g(-1.2, 0.3)
    return site, displacement.displace(site, motion, usual(box)), motion


TOPPLING = [("box", "cliff"), ("lump", "perch parts"), ("lump", "niche parts")]


@cache
def pushed(rock: str, ground: str) -> DisplacementRun:
    return run(site_of(rock, ground), -0.9, 0.15)


@pytest.mark.parametrize(("rock", "ground"), slow_but(TOPPLING[1:2], TOPPLING))
def test_samples_of_a_trajectory(rock: str, ground: str) -> None:
    site = site_of(rock, ground)
    path = pushed(rock, ground).trajectory
    start = site.seat.start
    assert start is not None
    assert path.time[0] == 0.0
    np.testing.assert_array_equal(path.position[0], start.position)
    np.testing.assert_allclose(Rotation.from_quat(path.quaternion[0]).as_matrix(), start.rotation)
    assert not path.velocity[0].any()
    gaps = np.diff(path.time)
    assert gaps.min() > 0.0
    # 50 Hz, a look late at the most; impacts add the looks before and after them.
    assert gaps.max() <= 0.02 + on_terrain.MONITORING_TIME + 1e-9
    assert len(path.time) >= path.time[-1] / (0.02 + on_terrain.MONITORING_TIME)
    assert (gaps < 1.1 * on_terrain.MONITORING_TIME).any()
    np.testing.assert_allclose(np.linalg.norm(path.quaternion, axis=1), 1.0, atol=1e-12)
    arrays = (path.position, path.quaternion, path.velocity, path.angular_velocity, path.contact)
    assert {len(array) for array in arrays} == {len(path.time)}


@pytest.mark.parametrize(("rock", "ground"), TOPPLING)
def test_positions_and_poses_follow_from_velocities(rock: str, ground: str) -> None:
    site = site_of(rock, ground)
    path = pushed(rock, ground).trajectory
    gaps = np.diff(path.time)[:, None]
    moved = np.diff(path.position, axis=0)
    middle = 0.5 * (path.velocity[1:] + path.velocity[:-1]) * gaps
    # What is no impact may still push between two samples, and when it did is not known.
    unseen = track.IMPACT_SHARE * math.sqrt(GRAVITY * site.seat.rock.radius)
    jumps = np.linalg.norm(np.diff(path.velocity, axis=0), axis=1)[:, None]
    assert (np.abs(moved - middle) <= (0.5 * jumps + unseen) * gaps).all()
    assert np.abs(moved - middle).sum() < 0.03 * path.length
    turn = Rotation.from_quat(path.quaternion)
    turned = (turn[1:] * turn[:-1].inv()).as_rotvec()
    twice = 0.5 * (path.angular_velocity[1:] + path.angular_velocity[:-1]) * gaps
    bends = np.linalg.norm(np.diff(path.angular_velocity, axis=0), axis=1)[:, None]
    assert (np.abs(turned - twice) <= (0.5 * bends + unseen / site.seat.rock.radius) * gaps).all()
    assert np.abs(turned - twice).sum() < 0.03 * np.linalg.norm(turned, axis=1).sum()


def surface_of(site: TerrainCase, found: DisplacementRun) -> Array:
    """Points all over the rock at each sample, shape (samples, points, 3) [m]."""
    surface = trimesh.convex.convex_hull(site.seat.rock.vertices)
    while len(surface.vertices) < 200:
        surface = surface.subdivide()
    path = found.trajectory
    turns = Rotation.from_quat(path.quaternion).as_matrix()
    return np.einsum("tij,pj->tpi", turns, surface.vertices) + path.position[:, None]


def clearance() -> tuple[Array, NDArray[np.bool_]]:
    """Height of the fallen box above the lower level [m], and if it is beyond the cliff's wall."""
    site, found, _ = fallen()
    points = surface_of(site, found)
    return points[:, :, 2].min(axis=1) + 3.0, points[:, :, 0].min(axis=1) > 0.34


def test_free_flight_is_ballistic() -> None:
    """Against the pulse in closed form: off the ground the rock is free in the frame at rest."""
    site, found, motion = fallen()
    path = found.trajectory
    clear, beyond = clearance()
    aloft = (clear > 0.01) & beyond
    first = int(np.argmax(aloft))
    flight = slice(first, first + int(np.argmin(aloft[first:])))
    assert flight.stop - flight.start > 15
    assert path.time[flight][0] < motion.duration
    time = path.time[flight] - path.time[flight][0]
    along = np.array([1.0, 0.0, 0.0])
    table = motion.velocity(path.time[flight])
    fixed = path.velocity[flight] + table[:, None] * along
    speed = np.linalg.norm(fixed, axis=1).max()
    falling = fixed[0] - np.outer(GRAVITY * time, [0.0, 0.0, 1.0])
    assert np.abs(fixed - falling).max() < 1e-3 * speed
    place_fixed = path.position[flight] + motion.displacement(path.time[flight])[:, None] * along
    expected = place_fixed[0] + np.outer(time, fixed[0])
    expected[:, 2] -= 0.5 * GRAVITY * time**2
    assert np.abs(place_fixed - expected).max() < 1e-3 * path.length
    # Nothing turns it: its angular momentum stays.
    rock = site.seat.rock
    inertia = rock.axes * rock.inertia @ rock.axes.T
    turn = Rotation.from_quat(path.quaternion[flight]).as_matrix()
    momentum = np.einsum("tij,jk,tlk,tl->ti", turn, inertia, turn, path.angular_velocity[flight])
    size = np.linalg.norm(momentum, axis=1).max()
    assert np.abs(momentum - momentum[0]).max() < 0.01 * size
    assert not path.contact[flight][1:].any()


def test_contact_is_told_by_the_distance_from_the_ground() -> None:
    _, found, _ = fallen()
    path = found.trajectory
    clear, beyond = clearance()
    assert found.stop is StopReason.REST
    assert path.contact[-1]
    assert path.contact[0]
    touching = np.maximum(clear[1:], clear[:-1]) < 1e-4
    assert path.contact[1:][touching].all()
    assert touching.sum() > 10
    # At 1 cm it could not have come down and gone up again between two samples.
    apart = (np.minimum(clear[1:], clear[:-1]) > 0.01) & beyond[:-1]
    assert not path.contact[1:][apart].any()
    assert apart.sum() > 15


def test_contact_before_an_impact_is_told_too() -> None:
    """A block that slides into a wall has touched the ground all the way."""
    floor = grounds.extruded(np.array([[-4, 0], [-1.5, 0], [0.8, 0], [0.82, 1], [4, 1]]), 3.0)
    block = solid.box((0.6, 0.6, 0.3), 2000.0).rock
    early_samples = 0
    for pga in (-0.65, -0.7, -0.8):
        path = run(grounds.site(block, floor, friction=0.1), pga, 0.25).trajectory
        struck = int(np.argmax(np.diff(path.velocity[:, 0]) < -0.5))
        assert path.position[struck, 0] == pytest.approx(0.5, abs=0.05)
        assert path.contact[: struck + 2].all()
        early_samples += path.time[struck] - path.time[struck - 1] < 0.015
    assert early_samples >= 1


def test_numbers_of_a_trajectory() -> None:
    """A made-up path of a 3-4-5 triangle's two short sides."""
    path = Trajectory(
        np.array([0.0, 1.0, 2.0]),
        np.array([[1.0, 1.0, 1.0], [4.0, 1.0, 1.0], [4.0, 1.0, -3.0]]),
        np.tile([0.0, 0.0, 0.0, 1.0], (3, 1)),
        np.array([[3.0, 0.0, 0.0], [2.0, -3.0, 6.0], [0.0, 0.0, -4.0]]),
        np.zeros((3, 3)),
        np.ones(3, dtype=bool),
    )
    assert (path.length, path.distance, path.largest_speed) == (7.0, 5.0, 7.0)


def test_largest_speed_is_that_before_the_impact() -> None:
    """A fall of h ends at sqrt(v0^2 + 2 g h): sampled at 50 Hz alone it would be missed."""
    path = fallen()[1].trajectory
    (clear, _), speed = clearance(), np.linalg.norm(path.velocity, axis=1)
    landing = int(np.argmax(speed))
    assert clear[:landing].max() > 0.5
    # A look's way, at the most, over the ground.
    assert clear[landing] < 1.5 * speed[landing] * on_terrain.MONITORING_TIME


@pytest.mark.parametrize(("rock", "ground"), TOPPLING)
def test_a_rock_at_rest_stays(rock: str, ground: str) -> None:
    site = site_of(rock, ground)
    found = run(site, 0.9, 0.15)
    if found.stop is not StopReason.REST:
        found = run(site, 0.05, 0.15)
    assert found.stop is StopReason.REST
    path = found.trajectory
    end = State(
        path.position[-1],
        Rotation.from_quat(path.quaternion[-1]).as_matrix(),
        path.velocity[-1],
        path.angular_velocity[-1],
    )
    body = site.seat.rock
    world = engines.load("bullet").build(replace(site.seat, start=end), 0.002 * step_unit(body), 1)
    for _ in range(100):
        world.advance([0.0] * math.ceil(0.05 / (0.002 * step_unit(body))))
    state = world.state()
    assert np.linalg.norm(state.position - end.position) < 0.01 * body.radius
    assert np.abs(state.rotation - end.rotation).max() < 0.01


def test_packed_trajectories_come_back() -> None:
    path = fallen()[1].trajectory
    samples = unpack(pack(path))
    np.testing.assert_array_equal(samples["time"], path.time)
    np.testing.assert_array_equal(samples["contact"], path.contact)
    for name, array in (
        ("position", path.position),
        ("quaternion", path.quaternion),
        ("velocity", path.velocity),
        ("angular_velocity", path.angular_velocity),
    ):
        np.testing.assert_allclose(samples[name], array, rtol=1e-6, atol=1e-12)
    assert len(pack(path)) < 60 * len(path.time)


# How runs stop


@pytest.mark.parametrize(("engine", "pga"), [("bullet", 0.6), ("nonsmooth", 1.8)])
def test_leaves_a_small_terrain(engine: str, pga: float) -> None:
    """Sliding off a table top is no toppling, and falling off its end is no rest.

    In compiled runs a border holds nothing: the block has to be fast not to sink meanwhile.
    """
    block = solid.box((0.6, 0.6, 0.3), 2000.0).rock
    small = grounds.level(0.8, 4)
    for yaw in (0.0, 1.2):
        found = run(grounds.site(block, small, friction=0.02, yaw=yaw), pga, 0.5, engine)
        path = found.trajectory
        assert found.stop is StopReason.LEFT_TERRAIN
        assert found.response.outcome is Outcome.UNSETTLED
        over = np.abs(path.position[-1, :2]).max() - 0.8
        late = (on_terrain.BORDER_INTERVALS + 1) * on_terrain.MONITORING_TIME
        assert 0.0 < over < path.largest_speed * late


def test_slides_on_until_time_is_up() -> None:
    block = solid.box((0.6, 0.6, 0.3), 2000.0).rock
    start = replace(grounds.at_rest(block.height), velocity=np.array([0.2, 0.0, 0.0]))
    site = grounds.site(block, ground_of("level parts"), friction=0.0, start=start)
    found = displacement.displace(site, CosinePulse.from_g(1e-6, 0.05), Settings(0.002))
    assert (found.stop, found.response.outcome) == (StopReason.TIME, Outcome.UNSETTLED)
    path = found.trajectory
    assert path.time[-1] == pytest.approx(on_terrain.LONGEST_TIME + 0.1 * math.pi, abs=0.05)
    assert path.velocity[-1] == pytest.approx([0.2, 0.0, 0.0], abs=0.01)


class Fake:
    """A ground world told where its rock is at each look."""

    VERSION = "0"

    def __init__(self, story: Callable[[Fake], dict[str, Array | float]]) -> None:
        self.story = story
        self.time_steps: list[float] = []

    def build(
        self, scene: Scene, time_step: float, substeps: int, solver: Solver | None = None
    ) -> Fake:
        self.time_steps.append(time_step)
        self.interval, self.time = time_step * substeps, 0.0
        assert scene.start is not None
        self.start = scene.start
        return self

    def advance(self, acceleration: Iterable[float]) -> None:
        self.time += len(list(acceleration)) * self.interval

    def now(self) -> dict[str, Array | float]:
        return self.story(self) if self.time > 0.5 else {}

    def state(self) -> State:
        return replace(self.start, **{k: v for k, v in self.now().items() if k != "deep"})

    def put(self, state: State) -> None:
        raise AssertionError

    def contacts(self) -> tuple[int, float]:
        return 4, float(self.now().get("deep", 0.0))


STORIES: dict[str, Callable[[Fake], dict[str, Array | float]]] = {
    "x is no number": lambda world: {"position": np.array([math.nan, 0.0, 0.5])},
    "z is no number": lambda world: {"position": np.array([0.0, 0.0, math.nan])},
    "no rotation": lambda world: {"rotation": np.full((3, 3), math.nan)},
    "infinite angular velocity": lambda world: {"angular_velocity": np.array([math.inf, 0.0, 0.0])},
    "gained speed": lambda world: {"velocity": np.array([0.0, 0.0, 50.0])},
    "gained height": lambda world: {"position": np.array([0.0, 0.0, 9.0])},
    "through the ground": lambda world: {"position": np.array([0.0, 0.0, -0.1])},
    "deep in the ground": lambda world: {"deep": 0.1},
}


def faked(
    monkeypatch: pytest.MonkeyPatch, story: str | Callable[..., object]
) -> tuple[Fake, DisplacementRun]:
    fake = Fake(STORIES[story] if isinstance(story, str) else story)  # type: ignore[arg-type]
    site = site_of("box", "level")
    monkeypatch.setattr(engines, "load", lambda name: types.SimpleNamespace(build=fake.build))
    return fake, displacement.displace(site, CosinePulse.from_g(0.5, 0.3), usual(site.seat.rock))


@pytest.mark.parametrize("story", STORIES)
def test_a_world_that_breaks_the_guards_is_unstable(
    monkeypatch: pytest.MonkeyPatch, story: str
) -> None:
    """Tried at half the step five times, then said so; what was sound before stays to be seen."""
    fake, found = faked(monkeypatch, story)
    assert (found.response.outcome, found.stop) == (Outcome.UNSTABLE, StopReason.UNDONE)
    assert len(fake.time_steps) == HALVINGS + 1
    ratios = np.array(fake.time_steps[:-1]) / np.array(fake.time_steps[1:])
    np.testing.assert_allclose(ratios, 2.0, rtol=0.02)
    path = found.trajectory
    for array in (path.time, path.position, path.quaternion, path.velocity, path.angular_velocity):
        assert np.isfinite(array).all()


@pytest.mark.parametrize("look", range(4))
def test_what_sinks_into_the_ground_has_not_toppled(
    monkeypatch: pytest.MonkeyPatch, look: int
) -> None:
    """At whatever look: only every eighth is a close one."""

    def sunk(world: Fake) -> dict[str, Array]:
        down = world.time > 0.6 + look * on_terrain.MONITORING_TIME
        return {"position": np.array([0.0, 0.0, -0.1])} if down else {}

    _, found = faked(monkeypatch, sunk)
    assert (found.response.outcome, found.stop) == (Outcome.UNSTABLE, StopReason.UNDONE)
    site = site_of("box", "level")
    alone = displacement.respond(site, CosinePulse.from_g(0.5, 0.3), usual(site.seat.rock))
    assert alone.outcome is Outcome.UNSTABLE


def test_creeping_is_no_rest(monkeypatch: pytest.MonkeyPatch) -> None:
    """Slow enough for the kinetic energy of a rest, and yet under way."""
    site = site_of("box", "level")
    start = site.seat.start
    assert start is not None

    def creeps(world: Fake) -> dict[str, Array]:
        velocity = np.array([0.01, 0.0, 0.0])
        return {"position": start.position + velocity * world.time, "velocity": velocity}

    _, found = faked(monkeypatch, creeps)
    assert (found.response.outcome, found.stop) == (Outcome.UNSETTLED, StopReason.TIME)


def test_a_guard_that_holds_at_a_finer_step_is_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    def until_fine(world: Fake) -> dict[str, Array]:
        coarse = len(world.time_steps) < 3
        return {"velocity": np.array([0.0, 0.0, 99.0 if coarse else 0.0])}

    fake, found = faked(monkeypatch, until_fine)
    assert len(fake.time_steps) == 3
    assert (found.response.outcome, found.stop) == (Outcome.BALANCED, StopReason.REST)


def test_what_a_shake_can_give_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """As fast as the table may have made it: PGV forth and back, twice."""
    most = 4.0 * 0.5 * GRAVITY * 0.3

    def fast(world: Fake) -> dict[str, Array]:
        over = world.time > 0.98 * 2.0 * math.pi * 0.3
        return {"velocity": np.array([0.97 * most if over else 0.0, 0.0, 0.0])}

    _, found = faked(monkeypatch, fast)
    assert (found.response.outcome, found.stop) == (Outcome.UNSETTLED, StopReason.TIME)


# Setting down


def test_settles_where_it_stands() -> None:
    for name, ground in [("box", "level"), ("lump", "level parts"), ("double rock", "niche")]:
        rock, _ = rock_of(name)
        for above in (0.0, 0.01):
            start = grounds.at_rest(rock.height + above * rock.radius)
            scene = grounds.site(rock, ground_of(ground), start=start).seat
            rest = displacement.settled(scene, 0.006 * step_unit(rock))
            expected = [0.0, 0.0, rock.height]
            np.testing.assert_allclose(rest.position, expected, atol=0.004 * rock.radius)
            np.testing.assert_allclose(rest.rotation, np.eye(3), atol=0.01)
            assert not rest.velocity.any()
            assert not rest.angular_velocity.any()


def test_finds_the_pose_of_a_rock_on_a_slope() -> None:
    """A box that was scanned upright, on ground that leans by 5 deg: it leans too."""
    box, _ = rock_of("box")
    lean = math.radians(5.0)
    gap = 0.5 * 0.5 * math.tan(lean)
    start = grounds.at_rest(box.height + gap)
    rest = displacement.settled(grounds.site(box, grounds.incline(lean), start=start).seat, 1e-3)
    assert math.acos(rest.rotation[2, 2]) == pytest.approx(lean, abs=2e-3)
    normal = np.array([math.sin(lean), 0.0, math.cos(lean)])
    np.testing.assert_allclose(rest.rotation[:, 2], normal, atol=2e-3)
    assert rest.position @ normal == pytest.approx(box.height, abs=2e-3)


@pytest.mark.parametrize(
    ("start", "said"),
    [
        (grounds.at_rest(0.8), "moves by 0.3"),
        (
            grounds.at_rest(0.55, Rotation.from_euler("y", 35.0, degrees=True).as_matrix()),
            "turns by",
        ),
        (replace(grounds.at_rest(3.0), position=np.array([9.0, 0.0, 3.0])), "still moves"),
    ],
    ids=["in the air", "leaning", "beyond the border"],
)
def test_a_rock_that_does_not_stand_is_refused(start: State, said: str) -> None:
    box, _ = rock_of("box")
    with pytest.raises(InvalidInput, match=said):
        displacement.settled(grounds.site(box, ground_of("level"), start=start).seat, 1e-3)


def test_a_rock_over_a_cliff_is_refused() -> None:
    """Its centre is beyond the edge: it tips over it and comes to rest below."""
    box, _ = rock_of("box")
    start = replace(grounds.at_rest(box.height), position=np.array([0.4, 0.0, box.height]))
    with pytest.raises(InvalidInput, match="unshaken"):
        displacement.settled(grounds.site(box, ground_of("cliff"), start=start).seat, 1e-3)


# Runs that need not start


def staying(rock: str, ground: str, yaw: float) -> TerrainCase:
    """A rock that settled, with the range of accelerations in which it stays."""
    site = site_of(rock, ground, yaw)
    return replace(
        site,
        static_limits=displacement.limits_on_seat(site.seat, 0.006 * step_unit(site.seat.rock)),
    )


@pytest.mark.parametrize("yaw", [0.0, 0.9, 4.2])
def test_nothing_moves_in_the_range_of_rest(yaw: float) -> None:
    """The run that is left out, done all the same."""
    site = staying("lump", "perch parts", yaw)
    least = min(-site.static_limits[0], site.static_limits[1])
    assert least > 0.02 * GRAVITY
    rock = site.seat.rock
    motion = CosinePulse(0.99 * least, 0.15)
    left_out = displacement.displace(site, motion, usual(rock))
    done = displacement.displace(site, motion, usual(rock, reduce=False))
    assert left_out.response.decided_by is DecidedBy.NO_UPLIFT_BOUND
    assert done.response.decided_by is DecidedBy.SIMULATION
    assert left_out.response.outcome is done.response.outcome is Outcome.BALANCED
    assert left_out.stop is done.stop is StopReason.REST
    assert done.response.slip < 0.005 * rock.radius
    assert done.response.peak_tilt < 0.005
    path = left_out.trajectory
    assert (len(path.time), path.length, path.distance, path.largest_speed) == (1, 0, 0, 0)
    beyond = displacement.displace(site, CosinePulse(1.01 * least, 0.15), usual(rock))
    assert beyond.response.decided_by is DecidedBy.SIMULATION


def test_a_rock_that_topples_on_a_terrain_is_decided_then() -> None:
    """Not at rest, which a run that is followed reaches later; the words say so."""
    site, motion = site_of("box", "level"), CosinePulse.from_g(1.0, 0.15)
    settings = usual(site.seat.rock)
    alone, followed = (
        displacement.displace(site, motion, settings, follow=follow) for follow in (False, True)
    )
    assert alone.response.outcome is followed.response.outcome is Outcome.OVERTURNED
    assert (alone.stop, followed.stop) == (StopReason.UNDONE, StopReason.REST)
    assert alone.response.steps < followed.response.steps
    for run in (alone, followed):
        assert run.response.decided_by is DecidedBy.SIMULATION
        assert "at rest, on a terrain toppled" in run.response.decided_by.how


def shaken_late(site: TerrainCase, pga_g: float, quiet: float) -> RecordedMotion:
    """A pulse of 0.3 s after a tremble well within the range of rest."""
    lowest, highest = site.static_limits
    before = np.where(np.arange(round(quiet / 0.01)) % 7 < 3, 0.8 * lowest, 0.8 * highest)
    pulse = CosinePulse.from_g(pga_g, 0.3)
    after = pulse.acceleration(0.01 * np.arange(200))
    return RecordedMotion(Trace(np.concatenate([before, after, [0.0]]), 0.01))


@cache
def late(pga_g: float) -> tuple[TerrainCase, DisplacementRun, DisplacementRun]:
    """With and without the time before the first push."""
    site = staying("lump", "perch parts", 0.0)
    motion = shaken_late(site, pga_g, 1.5)
    settings = Settings(1e-3)
    skipped = displacement.displace(site, motion, settings)
    return (
        site,
        skipped,
        displacement.displace(replace(site, static_limits=(0.0, 0.0)), motion, settings),
    )


@pytest.mark.slow
@pytest.mark.parametrize("pga_g", [0.15, 0.25, 0.45, 0.9])
def test_a_run_begins_at_the_first_push(pga_g: float) -> None:
    """Not in the tremble of 1.5 s before; the verdict is no other."""
    site, found, whole = late(pga_g)
    assert found.response.outcome is whole.response.outcome
    path, other = found.trajectory, whole.trajectory
    assert path.time[0] == other.time[0] == 0.0
    assert 1.44 < path.time[1] < 1.5
    assert other.time[1] < 0.03
    for part in ("position", "quaternion"):
        np.testing.assert_array_equal(getattr(path, part)[1], getattr(path, part)[0])
    assert not path.velocity[:2].any()
    assert (np.diff(path.time[1:]) < 0.03).all()
    times = np.linspace(0.0, 1.9, 60)
    apart = np.abs(place(found, times) - place(whole, times)).max()
    assert apart < 0.01 * site.seat.rock.radius


def test_late_shaking_topples_some_and_some_not() -> None:
    assert len({late(pga)[1].response.outcome for pga in (0.15, 0.9)}) > 1


def test_a_later_push_is_the_same_run_later() -> None:
    """Times included, until the bits by which they are rounded are an impact's."""
    site = staying("lump", "perch parts", 0.0)
    settings = Settings(1e-3)
    early, then = (
        displacement.displace(site, shaken_late(site, 0.9, t), settings) for t in (0.5, 4.0)
    )
    assert early.response.outcome is then.response.outcome
    one, other = early.trajectory, then.trajectory
    np.testing.assert_allclose(other.time[1:30] - one.time[1:30], 3.5, atol=1e-9)
    np.testing.assert_allclose(other.position[:30], one.position[:30], atol=1e-6)
    assert np.linalg.norm(one.position[29] - one.position[0]) > 0.01


def test_a_run_begins_at_once_where_its_rest_is_not_known() -> None:
    """Even unshaken: what is not at rest moves by itself."""
    site = site_of("box", "cliff")
    assert site.static_limits == (0.0, 0.0)
    motion = RecordedMotion(Trace(np.append(np.zeros(100), 0.1), 0.01))
    assert displacement.displace(site, motion, Settings(1e-3)).trajectory.time[1] < 0.03


def test_the_rock_moves_well_beyond_its_range_of_rest() -> None:
    site = staying("lump", "perch parts", 0.9)
    for sign, part in ((-1.0, -site.static_limits[0]), (1.0, site.static_limits[1])):
        motion = CosinePulse(sign * 1.6 / SAFE_SHARE * part, 0.2)
        found = displacement.displace(site, motion, usual(site.seat.rock))
        assert found.response.peak_tilt > 0.01 or found.response.slip > 0.01


@pytest.mark.parametrize("yaw", [0.0, 0.5 * math.pi])
def test_range_of_rest_on_level_ground_is_within_that_of_statics(yaw: float) -> None:
    """By how much depends on which of its corners the engine has it stand on."""
    for name in ("box", "double rock"):
        site = staying(name, "level parts", yaw)
        lowest, highest = proofs.static_limits(site.seat.rock, Contact(0.6), yaw)
        assert SAFE_SHARE * lowest * 1.02 <= site.static_limits[0] <= 0.0
        assert SAFE_SHARE * highest * 1.02 >= site.static_limits[1] >= 0.0


def test_footing_is_under_the_rock() -> None:
    site = site_of("box", "level parts")
    world = engines.load("bullet").build(site.seat, 1e-3, 1)
    world.advance([0.0] * 20)
    points, normals = world.footing()
    assert len(points) >= 3
    np.testing.assert_allclose(normals, np.tile([0.0, 0.0, 1.0], (len(points), 1)), atol=1e-3)
    corners = np.tile([0.25, 0.2, 0.0], (len(points), 1))
    np.testing.assert_allclose(np.abs(points), corners, atol=2e-3)
    aloft = replace(site.seat, start=grounds.at_rest(3.0))
    assert [len(part) for part in engines.load("bullet").build(aloft, 1e-3, 1).footing()] == [0, 0]


# Toppling alone


@pytest.mark.slow
def test_toppling_is_known_without_following() -> None:
    ended = set()
    for pga, ratio, yaw in [*SOME, (0.2, 0.2, 2.0)]:
        site = site_of("lump", "perch parts", yaw)
        motion = CosinePulse.from_g(pga, ratio)
        settings = usual(site.seat.rock)
        whole = known(pga, ratio, yaw).response
        alone = displacement.respond(site, motion, settings)
        assert alone.outcome is whole.outcome
        assert alone.slip == whole.slip
        assert alone.steps <= whole.steps
        assert alone.peak_tilt <= whole.peak_tilt
        if alone.outcome is Outcome.OVERTURNED:
            assert alone.steps < whole.steps
        ended.add(alone.outcome.overturned)
    assert ended == {0, 1}


@pytest.mark.parametrize(("friction", "ratio"), slow_but([(0.05, 0.4)], [(0.05, 0.4), (0.6, 0.1)]))
def test_what_goes_through_the_border_has_not_toppled(friction: float, ratio: float) -> None:
    """A rock of which a foot comes over it; on ground that goes on it stands."""
    block, motion = solid.box((0.6, 0.44, 1.1), 2000.0).rock, CosinePulse.from_g(0.9, ratio)

    def on_ground_from(start: float) -> displacement.DisplacementRun:
        line = np.array([[start, 0.0], [-0.2, 0.0], [0.5, 0.0], [6.0, 0.0]])
        site = grounds.site(block, grounds.extruded(line, 3.0), friction=friction)
        return displacement.displace(site, motion, usual(block))

    wide = on_ground_from(-6.0)
    assert not wide.response.outcome.overturned
    foot = float(wide.trajectory.position[:, 0].min()) - 0.3
    for over in (0.02, 0.1, 0.28):
        found = on_ground_from(foot + over).response.outcome
        assert found in (wide.response.outcome, Outcome.UNSETTLED)


@pytest.mark.slow
@pytest.mark.parametrize("drop", [0.11, 0.12])
def test_a_rock_that_sinks_has_toppled(drop: float) -> None:
    """It slides, upright, down a ramp to a lower level: toppled from 0.116 radii down."""
    block = solid.box((0.3, 0.3, 0.2), 2000.0).rock
    depth = drop * block.radius
    steps = np.array([[-3.0, 0.0], [0.2, 0.0], [0.5, -depth], [3.0, -depth]])
    start = replace(grounds.at_rest(block.height), velocity=np.array([0.25, 0.0, 0.0]))
    site = grounds.site(block, grounds.extruded(steps, 2.0), friction=0.0, start=start)
    found = displacement.displace(site, CosinePulse.from_g(1e-6, 0.05), usual(block))
    assert found.stop is StopReason.LEFT_TERRAIN
    assert found.trajectory.position[-1, 0] > 3.0
    assert found.response.peak_tilt < 0.3
    assert found.response.outcome is (Outcome.OVERTURNED if drop > 0.116 else Outcome.UNSETTLED)


# The world


def test_a_world_takes_and_tells_states() -> None:
    for rock, ground in TOPPLING:
        scene = site_of(rock, ground, 0.7).seat
        world = engines.load("bullet").build(scene, 1e-3, 1)
        turn = Rotation.from_rotvec([0.4, -1.0, 2.0]).as_matrix()
        given = State(np.array([0.3, -0.2, 5.0]), turn, np.array([1.0, -2.0, 0.5]), np.ones(3))
        world.put(given)
        told = world.state()
        for name in ("position", "rotation", "velocity", "angular_velocity"):
            np.testing.assert_allclose(getattr(told, name), getattr(given, name), atol=1e-9)
        assert world.contacts() == (0, 0.0)
        world.advance([2.0] * 100)
        assert world.contacts() == (0, 0.0)
        push = -0.1 * 2.0 * np.array([math.cos(0.7), -math.sin(0.7), 0.0])
        expected = given.velocity + push - [0.0, 0.0, 0.1 * GRAVITY]
        np.testing.assert_allclose(world.state().velocity, expected, atol=1e-6)


def test_contacts_of_a_box_at_rest_and_pressed_in() -> None:
    box, _ = rock_of("box")
    scene = site_of("box", "level parts").seat
    world = engines.load("bullet").build(scene, 1e-3, 1)
    world.advance([0.0] * 50)
    count, deepest = world.contacts()
    assert 3 <= count <= 4
    assert deepest < 1e-3 * box.radius
    assert scene.start is not None
    world.put(replace(scene.start, position=scene.start.position - [0.0, 0.0, 0.01]))
    world.advance([0.0])
    assert world.contacts()[1] == pytest.approx(0.01, abs=0.002)


@pytest.mark.slow
@pytest.mark.parametrize("ground", ["perch", "perch parts"])
def test_all_ground_that_a_rock_touches_is_there(ground: str) -> None:
    """Thrown and spinning at high speed: no face in its reach is missing at any look."""
    rock, _ = rock_of("lump")
    terrain = ground_of(ground)
    rng = np.random.default_rng(0)
    mesh = trimesh.convex.convex_hull(rock.vertices)
    over = np.vstack([rock.vertices, trimesh.sample.sample_surface(mesh, 300, seed=1)[0]])
    scene = grounds.site(rock, terrain).seat
    triangles = terrain.vertices[terrain.faces]
    checked = 0
    for _ in range(3):
        world = engines.load("bullet").build(scene, 5e-4, 1)
        start = State(
            np.array([*rng.uniform(-1.0, 1.0, 2), 1.5]),
            Rotation.random(random_state=rng).as_matrix(),
            np.array([*rng.uniform(-6.0, 6.0, 2), -6.0]),
            rng.uniform(-15.0, 15.0, 3),
        )
        world.put(start)
        for _ in range(100):
            world.advance([0.0] * 10)
            state = world.state()
            points = over @ state.rotation.T + state.position
            centre = triangles.mean(axis=1)
            near = np.linalg.norm(centre - state.position, axis=1) < rock.radius + 0.6
            if terrain.depth(state.position) is None:
                break
            if not near.any():
                continue
            small = trimesh.Trimesh(triangles[near].reshape(-1, 3), process=False, faces=None)
            small.faces = np.arange(3 * near.sum()).reshape(-1, 3)
            close, distance, _ = trimesh.proximity.closest_point(small, points)
            touched = close[distance < 0.004 * rock.radius]
            assert blocks_at(world, touched).all()
            checked += len(touched)
    assert checked > 30


def blocks_at(world: object, points: Array) -> NDArray[np.bool_]:
    """Whether points [m] of the ground are in blocks that Bullet has."""
    ground: bullet_ground.GroundBlocks = world._ground  # type: ignore[attr-defined]
    scaled = points * ground._scale
    found = np.zeros(len(points), dtype=bool)
    for block in ground._bodies if len(points) else ():
        corners = ground._blocks[block]
        if ground._tiles is None:
            hull = trimesh.convex.convex_hull(corners)
            apart = trimesh.proximity.ProximityQuery(hull).signed_distance(scaled) * -1.0
            found |= apart < 0.1
        else:
            sheet = trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False)
            found |= trimesh.proximity.closest_point(sheet, scaled)[1] < 1e-6
    return found


@pytest.mark.slow
def test_blocks_far_away_are_no_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    """With all of the ground there at once the rock goes the same way."""
    site = site_of("lump", "perch parts", 1.0)
    here = run(site, 0.5, 0.2)
    monkeypatch.setattr(bullet_ground, "NEAREST", 1e6)
    scene = replace(site.seat)
    everywhere = run(TerrainCase(scene, scene, site.toppled_tilt), 0.5, 0.2)
    early(here, everywhere, np.eye(3), site.seat.rock.radius)


# Rocks as scanned


def test_a_scanned_rock_keeps_its_pose_and_stands_when_asked_to() -> None:
    mesh = trimesh.Trimesh(*double_rock(), process=False)
    level = solid.from_mesh(mesh, 2110.0).rock
    tilted = mesh.copy()
    turn = Rotation.from_rotvec([0.03, -0.05, 0.0]).as_matrix()
    tilted.vertices = mesh.vertices @ turn.T + [4.0, 5.0, 6.0]
    scanned = solid.from_mesh(tilted, 2110.0, as_scanned=True)
    assert scanned.turned == 0.0
    np.testing.assert_allclose(scanned.vertices, tilted.vertices - tilted.center_mass, atol=1e-9)
    stood = solid.standing(scanned.rock)
    assert stood.height == pytest.approx(level.height, abs=1e-6)
    assert (stood.mass, stood.inertia.tolist()) == (
        scanned.rock.mass,
        scanned.rock.inertia.tolist(),
    )
    # The turn between the two is the same for corners and axes, and small.
    r = np.linalg.lstsq(scanned.rock.vertices, stood.vertices, rcond=None)[0].T
    np.testing.assert_allclose(r @ r.T, np.eye(3), atol=1e-9)
    np.testing.assert_allclose(r @ scanned.rock.axes, stood.axes, atol=1e-9)
    np.testing.assert_allclose((r @ turn)[2], [0.0, 0.0, 1.0], atol=1e-5)


def test_a_rock_that_lies_far_from_a_level_stand_is_refused() -> None:
    cube = trimesh.creation.box((1.0, 1.0, 1.0))
    for degrees in (40.0, -20.0, 0.0):
        scanned = cube.copy()
        scanned.vertices = Rotation.from_euler("x", degrees, degrees=True).apply(cube.vertices)
        rock = solid.from_mesh(scanned, 2000.0, as_scanned=True).rock
        assert rock.height > 0.6 or degrees == 0.0
        assert solid.standing(rock).height == pytest.approx(0.5)
    # On a corner, a cube is 54.7 deg from each of its faces.
    scanned.vertices = Rotation.align_vectors([[0, 0, 1]], [[1, 1, 1]])[0].apply(cube.vertices)
    with pytest.raises(InvalidInput, match="falls by 55 deg"):
        solid.standing(solid.from_mesh(scanned, 2000.0, as_scanned=True).rock)


# Samples of the motion


@pytest.mark.parametrize("most", [1, 3, 8, 100])
def test_no_more_steps_a_sample_than_asked_for(most: int) -> None:
    motion = CosinePulse.from_g(0.3, 0.2)
    for step in (1e-5, 3e-4, 2e-3, 0.05):
        made = sampling(motion, None, step, most)
        assert 1 <= made.substeps <= most
        assert made.interval / made.substeps <= step * (1.0 + 1e-12)
        assert made.interval * made.pulse_samples == pytest.approx(motion.duration)
        assert made.substeps == 1 or made.interval <= 0.1 * motion.shortest_time * (1.0 + 1e-12)
    assert sampling(motion, None, 1e-5) == sampling(motion, None, 1e-5, MOST_SUBSTEPS)
