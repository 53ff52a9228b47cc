"""What a rock on a terrain touches, and when it has toppled."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from support import grounds
from support.suites import slow_but

from tests.support.rocks_on_ground import (
    SOME,
    TOPPLING,
    Array,
    early,
    ground_of,
    known,
    rock_of,
    run,
    site_of,
    usual,
)
from vsr_core import GRAVITY, engines
from vsr_core.engines.bullet import ground as bullet_ground
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import Outcome, StopReason
from vsr_core.rock import solid
from vsr_core.run import displacement
from vsr_core.run.cases import TerrainCase
from vsr_core.run.sampling import MOST_SUBSTEPS, sampling
from vsr_core.scene import State


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
