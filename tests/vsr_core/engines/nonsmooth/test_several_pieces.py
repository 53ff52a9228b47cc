"""Rocks of several convex pieces on a terrain: exact answers, and other engines on the same."""

from __future__ import annotations

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from support import grounds

from vsr_core import GRAVITY, engines
from vsr_core.engines.nonsmooth import build
from vsr_core.rock import solid
from vsr_core.rock.body import Rock
from vsr_core.run import displacement
from vsr_core.scene import Contact, Scene, State
from vsr_core.terrain.surface import Terrain
from vsr_core.verification.rocks import GRIPPING

Array = NDArray[np.float64]

STEP = 1e-3
WIDE = 0.3  # m, half the width along y of all solids here


def prism(low: tuple[float, float], high: tuple[float, float]) -> Array:
    """Corners of a box between two corners in x and z."""
    (a, b), (c, d) = low, high
    return np.array([(x, y, z) for x in (a, c) for y in (-WIDE, WIDE) for z in (b, d)])


def made_of(*boxes: Array) -> tuple[Rock, Array]:
    """Rock of boxes that lie side by side, in their pose, and its centre of mass there."""
    bodies = [solid.box(tuple(np.ptp(one, axis=0)), 2000.0).rock for one in boxes]
    places = np.array([one.mean(axis=0) for one in boxes])
    masses = np.array([body.mass for body in bodies])
    centre = masses @ places / masses.sum()
    off = places - centre
    inertia = sum(
        np.diag(body.inertia) + body.mass * (r @ r * np.eye(3) - np.outer(r, r))
        for body, r in zip(bodies, off, strict=True)
    )
    moments, turn = solid.principal(np.asarray(inertia))
    corners = trimesh.convex.convex_hull(np.concatenate(boxes)).vertices - centre
    pieces = tuple(one - centre for one in boxes)
    return Rock("hull", np.array(corners), float(masses.sum()), moments, turn, pieces), centre


def about_y(angle: float) -> Array:
    """Turn by which x goes to -z."""
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])


def angle_of(state: State) -> float:
    return math.atan2(state.rotation[0, 2], state.rotation[0, 0])


def on(terrain: Terrain, rock: Rock, start: State, friction: float) -> Scene:
    return Scene(rock, Contact(friction), pedestal="terrain", start=start, terrain=terrain)


def about_edge(rock: Rock, lever: Array, duration: float, turned: float) -> float:
    """Angle of a rock that has turned about a fixed edge along y from rest, by the equation of it.

    ``lever`` goes from the edge to the centre of mass at angle 0; ``turned`` is that at the start.
    """
    moments = rock.axes @ np.diag(rock.inertia) @ rock.axes.T
    inertia = moments[1, 1] + rock.mass * (lever @ lever)

    def pace(_: float, y: Array) -> list[float]:
        x = (about_y(y[0]) @ lever)[0]
        return [y[1], rock.mass * GRAVITY * x / inertia]

    found = solve_ivp(pace, (0.0, duration), [turned, 0.0], rtol=1e-10, atol=1e-12)
    return float(found.y[0, -1])


# An L whose notch lies on a ridge; a dumbbell whose neck lies on one, its weights lower

L_SHAPE = prism((0.0, 0.0), (2.0, 0.5)), prism((0.0, 0.5), (0.5, 2.0))
DUMBBELL = (
    prism((-0.8, -0.3), (-0.4, 0.3)),
    prism((-0.4, -0.1), (0.4, 0.1)),
    prism((0.4, -0.3), (0.8, 0.3)),
)
STEEP = math.radians(70.0)


def ridge(half: float, rounding: float = 0.0, height: float = 3.0) -> Terrain:
    """Ridge along y whose top, at z = 0, is flat to ``half`` each way, then round, then steep."""
    turn = np.linspace(0.0, STEEP, 12 if rounding else 1)
    x, z = half + rounding * np.sin(turn), -rounding * (1.0 - np.cos(turn))
    foot = x[-1] + (height + z[-1]) / math.tan(STEEP), -height
    side = np.vstack([np.column_stack([x, z]), foot, [foot[0] + 3.0, -height]])
    if half == 0.0:
        return grounds.extruded(np.vstack([side[::-1] * [-1, 1], side[1:]]), 1.0, cells=3)
    return grounds.extruded(np.vstack([side[::-1] * [-1, 1], side]), 1.0, cells=3)


def hung(lean: float) -> tuple[Rock, Array, State]:
    """The L with its notch down on the origin, its lever from there, and it leaning."""
    rock, centre = made_of(*L_SHAPE)
    down = about_y(math.pi + math.radians(-45.0))
    rock = replace(rock, pieces=tuple(one @ down.T for one in rock.pieces), axes=down @ rock.axes)
    rock = replace(rock, vertices=rock.vertices @ down.T)
    lever = down @ (centre - [0.5, 0.0, 0.5])
    turn = about_y(lean)
    return rock, lever, State(turn @ lever, turn, np.zeros(3), np.zeros(3))


@pytest.mark.parametrize("friction", [0.0, 0.2, GRIPPING])
def test_an_l_swings_about_a_ridge_in_its_notch(friction: float) -> None:
    rock, lever, start = hung(0.25)
    assert abs(lever[0]) < 1e-12
    assert lever[2] < 0.0
    world = build(on(ridge(0.0), rock, start, friction), STEP)
    for _ in range(4):
        world.advance([0.0] * 400)
    wanted = about_edge(rock, lever, 1.6, 0.25)
    assert wanted < -0.1  # on the other side
    assert angle_of(world.state()) == pytest.approx(wanted, abs=1e-6)


def laid(ahead: float) -> tuple[Rock, State]:
    """The dumbbell with the underside of its neck on the ground and its centre at x = ``ahead``."""
    rock, centre = made_of(*DUMBBELL)
    assert np.abs(centre).max() < 1e-12
    return rock, State(np.array([ahead, 0.0, 0.1]), np.eye(3), np.zeros(3), np.zeros(3))


def test_a_dumbbell_rolls_over_an_edge_that_reaches_into_its_waist() -> None:
    half, ahead = 0.05, 0.1
    rock, start = laid(ahead)
    scene, lever = on(ridge(half), rock, start, GRIPPING), np.array([ahead - half, 0.0, 0.1])
    world = build(scene, STEP)
    for steps in (300, 600, 900):
        world.advance([0.0] * 300)
        wanted = about_edge(rock, lever, steps * STEP, 0.0)
        assert angle_of(world.state()) == pytest.approx(wanted, rel=1e-3)
    assert wanted > 0.3
    # its hull is not even near such a pose: it would begin deep in the ground
    assert min(rock.vertices[:, 2]) + 0.1 < -0.15


@pytest.mark.parametrize("share", [0.999, 1.001])
def test_a_dumbbell_tips_on_a_rounded_ridge_where_geometry_has_it(share: float) -> None:
    """It stands while the pull through its centre meets the flat top: a < g b / h.

    Beyond, it rolls onto the rounding, whose radius is less than the height of its centre.
    """
    half, height, rounding = 0.06, 0.1, 0.08
    rock, start = laid(0.0)
    scene = on(ridge(half, rounding), rock, start, GRIPPING)
    lowest, highest = displacement.limits_on_seat(scene, STEP, "nonsmooth")
    exact = GRAVITY * half / height
    assert np.array([-lowest, highest]) == pytest.approx(0.9 * exact, rel=1e-3)
    world = build(scene, STEP)
    world.advance([share * exact] * 1000)
    angle = angle_of(world.state())
    assert angle < -1e-3 if share > 1.0 else abs(angle) < 1e-6


@pytest.mark.parametrize("engine", ["bullet"])
def test_other_engines_roll_the_same_pieces_alike(engine: str) -> None:
    rock, start = laid(0.1)
    scene, lever = on(ridge(0.05), rock, start, 2.0), np.array([0.05, 0.0, 0.1])
    world = engines.load(engine).build(scene, 2e-4, 1)
    world.advance([0.0] * 3500)
    assert angle_of(world.state()) == pytest.approx(about_edge(rock, lever, 0.7, 0.0), rel=0.03)


def test_mujoco_rolls_the_same_pieces_alike() -> None:
    rock, start = laid(0.1)
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.cone = 1e-4, mujoco.mjtCone.mjCONE_ELLIPTIC
    contact = {"friction": [2.0, 0.0, 0.0], "solref": [4e-4, 2.0], "margin": 0.0}
    foot = 3.0 / math.tan(STEEP)
    wedge = prism((-0.05 - foot, -3.0), (0.05 + foot, 0.0))
    wedge[wedge[:, 2] == 0.0, 0] = np.sign(wedge[wedge[:, 2] == 0.0, 0]) * 0.05
    body = spec.worldbody.add_body(
        pos=start.position,
        mass=rock.mass,
        inertia=np.diag(rock.axes @ np.diag(rock.inertia) @ rock.axes.T),
        explicitinertial=True,
        ipos=[0.0] * 3,
    )
    body.add_freejoint()
    for name, corners, owner in [("ground", wedge * [1, 3, 1], spec.worldbody)] + [
        (f"piece {k}", piece, body) for k, piece in enumerate(rock.pieces)
    ]:
        spec.add_mesh(name=name, uservert=corners.ravel().tolist())
        owner.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, **contact)
    model = spec.compile()
    data = mujoco.MjData(model)
    for _ in range(7000):
        mujoco.mj_step(model, data)
    angle = 2.0 * math.atan2(data.qpos[5], data.qpos[3])
    lever = np.array([0.05, 0.0, 0.1])
    assert angle == pytest.approx(about_edge(rock, lever, 0.7, 0.0), rel=0.03)
