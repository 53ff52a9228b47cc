"""Where a rock comes to rest, stands before it is shaken, and how far it may be pushed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation
from support import grounds

from tests.support.rocks_on_ground import (
    ground_of,
    late,
    place,
    rock_of,
    shaken_late,
    site_of,
    staying,
    usual,
)
from vsr_core import GRAVITY
from vsr_core.errors import InvalidInput
from vsr_core.judge import proofs
from vsr_core.motions.pulses import CosinePulse
from vsr_core.motions.records.trace import RecordedMotion, Trace
from vsr_core.outcome import DecidedBy, Outcome, StopReason
from vsr_core.rock import solid
from vsr_core.run import displacement
from vsr_core.run.cases import Settings
from vsr_core.run.static_limits import SAFE_SHARE
from vsr_core.run.time_step import step_unit
from vsr_core.scene import Contact, State
from vsr_core.surrogates.double_rock import double_rock


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
