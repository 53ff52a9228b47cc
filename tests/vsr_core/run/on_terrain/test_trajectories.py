"""What a trajectory on a terrain tells: samples, poses, flight and contact."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from support import grounds
from support.suites import slow_but

from pipeline.stages.runs.displacement_runs import pack, unpack
from tests.support.rocks_on_ground import TOPPLING, Array, ground_of, rock_of, run, site_of, usual
from vsr_core import GRAVITY, engines
from vsr_core.judge import on_terrain, track
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import StopReason
from vsr_core.rock import solid
from vsr_core.run import displacement
from vsr_core.run.cases import TerrainCase
from vsr_core.run.displacement import DisplacementRun
from vsr_core.run.movement import Trajectory
from vsr_core.run.time_step import step_unit
from vsr_core.scene import State


@cache
def fallen() -> tuple[TerrainCase, DisplacementRun, CosinePulse]:
    """A box that is pushed off a cliff of 3 m."""
    box, limits = rock_of("box")
    site = grounds.site(box, ground_of("cliff"), limits.toppled_tilt, friction=0.2)
    motion = CosinePulse.from_g(-1.2, 0.3)
    return site, displacement.displace(site, motion, usual(box)), motion


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
