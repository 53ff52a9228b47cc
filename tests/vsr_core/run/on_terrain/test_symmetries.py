"""Runs on a terrain under mirrors, turns and scales, in any order, on ground that was reduced."""

from __future__ import annotations

import hashlib
import math
import pickle
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from support import grounds
from support.suites import slow_but

from pipeline import ROOT
from tests.support.rocks_on_ground import (
    SOME,
    Array,
    cells,
    early,
    ground_of,
    known,
    place,
    rock_of,
    run,
    site_of,
    usual,
)
from vsr_core import engines
from vsr_core.motions.pulses import CosinePulse
from vsr_core.rock import reduction
from vsr_core.run import displacement, loop
from vsr_core.run.cases import Settings, TerrainCase
from vsr_core.run.displacement import DisplacementRun


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
sys.path[:0] = ["tests", "tests/vsr_core/run/on_terrain"]
import test_symmetries as tests
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
