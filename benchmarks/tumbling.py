"""How far a rock tumbles down a rough slope, and what restitution and friction have to do with it.

Thirty pushes of the Double Rock surrogate, the same for every pair of coefficients.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.stages.mesh.seating import SLOPE_SHARE
from vsr_core import engines
from vsr_core.rock import reduction, solid
from vsr_core.rock.body import Rock
from vsr_core.run.time_step import step_unit
from vsr_core.scene import Contact, Scene, State
from vsr_core.surrogates.double_rock import double_rock
from vsr_core.surrogates.ground import ramp, rough
from vsr_core.terrain.convex_parts import convex_parts
from vsr_core.terrain.surface import Terrain
from vsr_core.verification.reference._run import sheet
from vsr_core.verification.rocks import DENSITY

Array = NDArray[np.float64]

RESTITUTIONS, FRICTIONS = (0.0, 0.38, 0.8), (0.3, 0.6, 0.9)

PUSHES = 30

ANGLE = math.radians(35.0)

SLOPE, LEVEL, HALF, CELL = 16.0, 44.0, 26.0, 0.8
"""Level length of the slope, of the ground before it, half its width, and its triangles [m]."""

WAVES, HIGH = 3.0, 0.08
"""Longest wave of the ground and its root mean square height [m]."""

BEND = 0.5
"""Width of the bend at the foot of the slope [m]."""

START, ABOVE = -14.0, 0.3
"""Place of the start, the foot of the slope at 0, and height of the rock over the ground [m]."""

LOOK, STILL, LONGEST = 0.05, 20, 40.0
"""Time between two looks [s], looks without a motion that make a rest, and longest run [s]."""

MOVES = 0.01
"""Way between two looks that is a motion, as a share of the radius. Less goes nowhere: on two
facets almost in one plane a rock rocks for a minute."""

THICK = 0.05
"""Thickness of convex parts, as a share of the rock's radius: more than a run may sink in."""


@dataclass(frozen=True)
class Runs:
    """Runs with one pair of coefficients.

    Attributes
    ----------
    way : ndarray, shape (n,) [m], horizontal distance from start to end
    beyond : ndarray, shape (n,) [m], way of the end beyond the foot of the slope
    speed : ndarray, shape (n,) [m/s], largest
    away : int, how many left the ground or were still under way at the end
    """

    way: Array
    beyond: Array
    speed: Array
    away: int


@cache
def rock() -> Rock:
    """The surrogate as a run has it once it has toppled."""
    import trimesh

    mesh = trimesh.Trimesh(*double_rock(), process=False)
    return reduction.in_flight(solid.from_mesh(mesh, DENSITY, as_scanned=True).rock)


@cache
def ground(cut: bool) -> Terrain:
    """Rough slope down +x that runs out on rough level ground."""
    along = np.arange(-SLOPE, LEVEL + 0.5 * CELL, CELL)
    across = np.arange(-HALF, HALF + 0.5 * CELL, CELL)
    vertices, faces = sheet(along, math.tan(ANGLE) * ramp(-along, BEND), across)
    vertices[:, 2] += HIGH * rough(vertices[:, :2], WAVES, 3, 1)
    whole = Terrain(vertices, faces)
    if not cut:
        return whole
    radius = rock().radius
    held = convex_parts(
        whole, lambda points: np.full(len(points), SLOPE_SHARE * radius), THICK * radius
    )
    return Terrain(vertices, faces, held)


def push(number: int) -> State:
    """State at the start: any pose, pushed downhill at 0.5 to 2.5 m/s within 20 deg."""
    rng = np.random.default_rng(number)
    turn = Rotation.random(random_state=number).as_matrix()
    corners = rock().vertices @ turn.T
    below = [ground(False).surfaces(START + x, y)[0][-1] - z for x, y, z in corners.tolist()]
    height = float(max(below)) + ABOVE
    aside, speed = math.radians(rng.uniform(-20.0, 20.0)), rng.uniform(0.5, 2.5)
    velocity = speed * np.array([math.cos(aside), math.sin(aside), 0.0])
    return State(np.array([START, 0.0, height]), turn, velocity, rng.normal(size=3))


def tumble(engine: str, contact: Contact, cut: bool, number: int) -> tuple[State, float, bool]:
    """End of one run, its largest speed [m/s], and whether it came to rest on the ground."""
    terrain, radius = ground(cut), rock().radius
    scene = Scene(rock(), contact, pedestal="terrain", start=push(number), terrain=terrain)
    step = engines.load(engine).LADDER.coarse * step_unit(rock())
    steps = round(LOOK / step)
    world = engines.load(engine).build(scene, step, 1)
    state, fastest, still = world.state(), 0.0, 0
    for _ in range(round(LONGEST / LOOK)):
        before = state
        world.advance([0.0] * steps)
        state = world.state()
        fastest = max(fastest, float(np.linalg.norm(state.velocity)))
        if terrain.depth(state.position) is None:
            return state, fastest, False
        moved = float(np.linalg.norm(state.position - before.position))
        moved += radius * float(np.linalg.norm(state.rotation - before.rotation))
        still = still + 1 if moved < MOVES * radius else 0
        if still == STILL:
            return state, fastest, True
    return state, fastest, False


def runs(engine: str, contact: Contact, cut: bool, number: int = PUSHES) -> Runs:
    """All pushes with one pair of coefficients."""
    ends = [tumble(engine, contact, cut, k) for k in range(number)]
    place = np.array([state.position for state, _, _ in ends])
    return Runs(
        np.hypot(place[:, 0] - START, place[:, 1]),
        place[:, 0],
        np.array([speed for _, speed, _ in ends]),
        sum(not rests for _, _, rests in ends),
    )
