"""Contact with a terrain in the compiled engine: exact answers, and what must not matter."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from vsr_core import GRAVITY
from vsr_core.engines.nonsmooth import build, features, rock_features
from vsr_core.engines.nonsmooth.tree import forget, ground
from vsr_core.rock.body import convex_hull
from vsr_core.scene import Contact, Scene, State
from vsr_core.surrogates.ground import rough
from vsr_core.terrain.surface import Terrain
from vsr_core.verification.reference import dissipation, rimless_wheel, runout
from vsr_core.verification.reference._run import axes, sheet, slope
from vsr_core.verification.reference.rimless_wheel import WHEELS
from vsr_core.verification.rocks import box, hull, sphere, upright

Array = NDArray[np.float64]

STEP = 1e-3


def profile(*points: tuple[float, float], half: float = 3.0, cells: int = 1) -> Terrain:
    """Ground of a profile in x and z, drawn out along y."""
    x, z = np.array(points).T
    return Terrain(*sheet(x, z, np.linspace(-half, half, cells + 1)))


def mirrored(terrain: Terrain) -> Terrain:
    return Terrain(terrain.vertices * [1.0, -1.0, 1.0], terrain.faces[:, ::-1])


def hilly(seed: int) -> Terrain:
    vertices, faces = sheet(np.linspace(-3.0, 3.0, 25), np.zeros(25), np.linspace(-2.0, 2.0, 17))
    vertices[:, 2] += 0.1 * rough(vertices[:, :2], 1.5, 3, seed)
    return Terrain(vertices, faces)


def tumbler(seed: int) -> Array:
    corners = np.random.default_rng(seed).normal(size=(16, 3))
    return np.asarray(0.4 * corners / np.linalg.norm(corners, axis=1, keepdims=True))


def last(scene: Scene, duration: float, step: float = STEP) -> State:
    world = build(scene, step)
    world.advance([0.0] * round(duration / step))
    return world.state()


def on(terrain: Terrain, rock, contact: Contact, start: State) -> Scene:  # type: ignore[no-untyped-def]
    return Scene(rock, contact, pedestal="terrain", start=start, terrain=terrain)


@pytest.mark.parametrize("cell", [3.0, 1.0, 0.3])
def test_an_even_slope_is_even_however_it_is_cut(cell: float) -> None:
    angle = math.radians(20.0)
    turn = axes(angle)
    start = upright((0.0, 0.3, 0.5), (1.0, 0.4, -0.5), (0.5, 1.0, 0.2))
    states = []
    for width in (12.0, cell):
        terrain = slope(angle, (-3.0, 9.0), 3.0, width, False)
        placed = State(turn @ start.position, turn, turn @ start.velocity, start.angular_velocity)
        states.append(last(on(terrain, box(0.5, 0.4, 0.3), Contact(0.4, 0.38), placed), 0.8))
    np.testing.assert_allclose(states[1].position, states[0].position, atol=1e-9)
    np.testing.assert_allclose(states[1].rotation, states[0].rotation, atol=1e-9)


def test_mirrored_ground_gives_the_mirrored_path() -> None:
    terrain, corners, flip = hilly(3), tumbler(1), np.array([1.0, -1.0, 1.0])
    start = State(np.array([-1.0, 0.1, 0.8]), np.eye(3), np.array([2.0, 0.3, 0.0]), np.zeros(3))
    contact = Contact(0.6, 0.38)
    path = last(on(terrain, hull(corners, as_scanned=True), contact, start), 0.5)
    other = replace(start, position=start.position * flip, velocity=start.velocity * flip)
    rock = hull(corners * flip, as_scanned=True)
    seen = last(on(mirrored(terrain), rock, contact, other), 0.5)
    np.testing.assert_allclose(seen.position * flip, path.position, atol=1e-6)
    np.testing.assert_allclose(seen.velocity * flip, path.velocity, atol=1e-4)


def test_the_same_run_has_the_same_bits() -> None:
    rock = hull(tumbler(2), as_scanned=True)
    start = State(np.array([-1.0, 0.0, 0.7]), np.eye(3), np.array([2.0, 0.0, 0.0]), np.ones(3))
    world = build(on(hilly(5), rock, Contact(0.6, 0.38), start), STEP)
    paths = []
    for _ in range(2):
        world.put(start)
        for _ in range(20):
            world.advance([0.0] * 40)
        paths.append(world.state())
    np.testing.assert_array_equal(paths[0].position, paths[1].position)
    np.testing.assert_array_equal(paths[0].angular_velocity, paths[1].angular_velocity)


@pytest.mark.parametrize("seed", range(4))
def test_what_was_near_before_does_not_matter(seed: int) -> None:
    """A search kept up to date finds what one begun anew in each step does."""
    rock = hull(tumbler(seed), as_scanned=True)
    start = upright((0.0, 0.0, 0.8), (1.5, 0.4, 0.0), (2.0, -3.0, 1.0))
    scene = on(hilly(seed), rock, Contact(0.5, 0.3), start)
    kept, anew = build(scene, 4e-3), build(scene, 4e-3)
    for _ in range(600):
        kept.advance([0.0])
        forget(anew._ground)
        anew.advance([0.0])
        assert kept.state().position.tobytes() == anew.state().position.tobytes()


def test_a_box_dropped_flat_across_borders_bounces_straight() -> None:
    terrain = profile((-2.0, 0.0), (0.05, 0.0), (2.0, 0.0), cells=4)
    start = upright((0.0, 0.0, 0.3), (0.0, 0.0, -1.0))
    fell = math.sqrt(1.0 + 2.0 * GRAVITY * 0.15)
    world = build(on(terrain, box(0.4, 0.4, 0.3), Contact(0.6, 0.5), start), STEP)
    world.advance([0.0] * 120)
    state = world.state()
    touched = (fell - 1.0) / GRAVITY
    assert state.velocity[2] == pytest.approx(0.5 * fell - GRAVITY * (0.12 - touched), abs=1e-3)
    np.testing.assert_allclose(state.velocity[:2], 0.0, atol=1e-9)
    np.testing.assert_allclose(state.angular_velocity, 0.0, atol=1e-9)


def test_an_edge_lands_on_a_ridge_across_it() -> None:
    terrain = profile((-3.0, -3.0), (0.0, 0.0), (3.0, -3.0))
    turn = Rotation.from_euler("y", 45.0, degrees=True).as_matrix()
    turn = Rotation.from_euler("z", 90.0, degrees=True).as_matrix() @ turn
    half = 0.4 * math.sqrt(0.5)
    start = State(np.array([0.0, 0.0, half + 0.1]), turn, np.array([0.0, 0.0, -2.0]), np.zeros(3))
    world = build(on(terrain, box(0.4, 0.6, 0.4), Contact(0.6), start), STEP)
    world.advance([0.0] * 60)
    number, depth = world.contacts()
    places, normals = world.footing()
    assert number == 1
    assert depth < 1e-5
    np.testing.assert_allclose(places, [[0.0, 0.0, 0.0]], atol=1e-6)
    np.testing.assert_allclose(normals, [[0.0, 0.0, 1.0]], atol=1e-6)
    np.testing.assert_allclose(world.state().velocity, 0.0, atol=1e-6)


def test_a_peak_carries_the_face_of_a_block() -> None:
    side = np.linspace(-1.0, 1.0, 5)
    vertices, faces = sheet(side, np.zeros(5), side)
    vertices[np.abs(vertices[:, :2]).max(axis=1) < 0.1, 2] = 0.3
    start = upright((0.0, 0.0, 0.4501))
    world = build(on(Terrain(vertices, faces), box(0.8, 0.8, 0.3), Contact(0.6), start), STEP)
    world.advance([0.0] * 50)
    assert world.contacts()[0] == 1
    np.testing.assert_allclose(world.footing()[0], [[0.0, 0.0, 0.3]], atol=1e-6)
    assert world.state().position[2] == pytest.approx(0.45, abs=1e-5)


@pytest.mark.parametrize("bend", [0.3, -0.3])
def test_a_corner_does_not_fall_through_a_bend(bend: float) -> None:
    terrain = profile((-3.0, -3.0 * bend), (0.0, 0.0), (3.0, -3.0 * bend))
    rock = hull(tumbler(4), as_scanned=True)
    for x in np.linspace(-0.02, 0.02, 9).tolist():
        start = State(
            np.array([x - 0.5, 0.0, 1.0]), np.eye(3), np.array([2.0, 0.0, -3.0]), np.ones(3)
        )
        world = build(on(terrain, rock, Contact(0.5, 0.3), start), 2.0 * STEP)
        for _ in range(20):
            world.advance([0.0] * 10)
            state = world.state()
            corners = state.position + rock.vertices @ state.rotation.T
            below = [terrain.depth(corner) or 0.0 for corner in corners]
            assert max(below) < 2e-3


def test_a_sphere_rolls_over_an_edge_and_keeps_its_energy() -> None:
    terrain = profile((-3.0, 0.0), (0.0, 0.0), (3.0, -0.3))
    start = upright((-0.5, 0.0, 0.3), (0.5, 0.0, 0.0), (0.0, 0.5 / 0.3, 0.0))
    state = last(on(terrain, sphere(0.3), Contact(0.9), start), 2.5)
    speed, fell = float(np.linalg.norm(state.velocity)), 0.3 - state.position[2]
    assert state.position[0] > 0.5
    # It leaves the edge and lands again, which takes a little.
    assert 0.7 * speed**2 == pytest.approx(0.7 * 0.25 + GRAVITY * fell, rel=0.02)


@pytest.mark.parametrize("restitution", [0.0, 0.38])
def test_a_block_slides_over_borders(restitution: float) -> None:
    contact = Contact(0.6, restitution)
    assert runout.sliding(math.radians(10.0), contact, 0.5, False, "nonsmooth", STEP) < 1e-3


@pytest.mark.parametrize("wheel", WHEELS)
def test_wheels_roll_at_their_terminal_speed(wheel: rimless_wheel.Wheel) -> None:
    assert rimless_wheel.distance(wheel, 0.5, False, "nonsmooth", STEP) < 1e-3
    assert rimless_wheel.straightness(wheel, 0.5, False, "nonsmooth", STEP) < 1e-6


def test_a_block_slides_through_a_bend() -> None:
    bend = runout.Bend()
    found = runout.bending(bend, Contact(0.3), 40, False, "nonsmooth", STEP)
    assert found == pytest.approx(bend.run_out(0.3), rel=0.025)


def test_energy_never_grows_without_restitution() -> None:
    assert dissipation.worst(6, Contact(0.6), False, "nonsmooth", STEP) < 1e-3


def test_a_yawed_table_shakes_a_terrain_in_its_own_direction() -> None:
    yaw = 0.7
    terrain = slope(0.0, (-3.0, 3.0), 3.0, 1.0, False)
    scene = replace(
        on(terrain, box(0.4, 0.4, 0.2), Contact(0.0), upright((0.0, 0.0, 0.1))), yaw=yaw
    )
    world = build(scene, STEP)
    world.advance([1.0] * 500)
    along = np.array([math.cos(yaw), -math.sin(yaw), 0.0])
    np.testing.assert_allclose(world.state().velocity, -0.5 * along, atol=1e-9)


def test_only_what_stands_out_is_a_feature() -> None:
    flat = features.of_terrain(slope(0.3, (-3.0, 3.0), 3.0, 0.5, False))
    assert len(flat.edges) == len(flat.vertices) == 0
    assert set(flat.faces["flat"].tolist()) == {0}
    ridge = features.of_terrain(profile((-1.0, -1.0), (0.0, 0.0), (1.0, -1.0), cells=3))
    assert len(ridge.edges) == 3
    assert len(set(ridge.edges["line"].tolist())) == 1
    assert len(ridge.vertices) == 0
    assert len(features.of_terrain(profile((-1.0, 1.0), (0.0, 0.0), (1.0, 1.0))).edges) == 0
    cube = convex_hull(np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T)
    assert len(rock_features.of_rock(cube, (), 1e-6).edges) == 12


def test_boxes_of_the_tree_hold_their_triangles() -> None:
    made = ground(box(0.4, 0.4, 0.2), hilly(1))
    boxes, links = made.tree.boxes, made.tree.links
    leaves = np.flatnonzero(links[:, 1])
    held = np.concatenate([np.arange(first, end) for first, end in links[leaves, 2:4]])
    np.testing.assert_array_equal(held, np.arange(made.own_face))
    for at in range(len(boxes)):
        inside = (links[:, 0] <= links[at, 0]) & (np.arange(len(boxes)) >= at)
        low, high = boxes[at, :3] - boxes[at, 3:], boxes[at, :3] + boxes[at, 3:]
        assert (boxes[inside, :3] - boxes[inside, 3:] >= low - 1e-12).all()
        assert (boxes[inside, :3] + boxes[inside, 3:] <= high + 1e-12).all()
