"""Rocks of made raw scans, from the scan to a scene to run."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from itertools import pairwise

import numpy as np
import trimesh
from scipy.spatial import ConvexHull

from vsr_core import GRAVITY
from vsr_core.arrays import Array, Mask
from vsr_core.engines import nonsmooth
from vsr_core.rock import reduction, solid
from vsr_core.rock.body import Rock
from vsr_core.run import displacement
from vsr_core.run.time_step import step_unit
from vsr_core.scan import seat
from vsr_core.scan.preparation import Prepared, prepare_scan
from vsr_core.scene import Contact, Scene, State
from vsr_core.surrogates.field_scans import FieldScan, Scanned, scan
from vsr_core.terrain.coarsening import coarser
from vsr_core.terrain.surface import Terrain
from vsr_core.verification.rocks import box, upright

FRICTION, RESTITUTION = 0.6, 0.3
DENSITY = 2700.0  # kg/m^3

_BENEATH = 0.5  # radii, from the lowest of the points that bear to a floor that is not reached


@dataclass(frozen=True, eq=False)
class Settled:
    """A rock that came to rest on its seat.

    Attributes
    ----------
    scene : Scene, its start at rest
    seconds : float, of CPU that settling took
    """

    rock: Rock
    seat: seat.Seat
    scene: Scene
    seconds: float


def _untold(what: str) -> None:
    """Progress that nobody waits for."""


@lru_cache(maxsize=2)
def prepared(field: FieldScan) -> tuple[Scanned, Prepared]:
    """A scan, and what is made of it; among the walls of a niche a point on the rock is given."""
    raw = scan(field)
    mesh = trimesh.Trimesh(raw.vertices, raw.faces, process=False)
    near = tuple(raw.on_rock) if field.walls else None
    return raw, prepare_scan(
        lambda: mesh, None, near=near, closing="caps", density=DENSITY, tell=_untold
    )


@lru_cache(maxsize=2)
def lightened(field: FieldScan) -> tuple[Rock, Rock, Terrain]:
    """The rock, the same with fewer vertices, and light ground."""
    made = prepared(field)[1]
    rock = solid.from_mesh(made.rock, DENSITY, as_scanned=True).rock
    light = coarser(made.terrain, lambda at: np.full(len(at), 0.01 * rock.radius))
    return rock, reduction.on_its_seat(rock), light


def seated(field: FieldScan, bearing: seat.Bearing = "rim") -> tuple[Rock, seat.Seat]:
    """The rock, and its seat in light ground."""
    made, (rock, own, light) = prepared(field)[1], lightened(field)
    up = np.array([0.0, 0.0, rock.height])
    loops = seat.seams(made.terrain, made.seat)
    return rock, seat.seat(light, loops, own.vertices + up, rock.vertices + up, bearing)


@lru_cache(maxsize=2)
def settled(field: FieldScan) -> Settled:
    """The rock at rest on its seat."""
    rock, laid = seated(field)
    scene = resting(rock, laid.terrain)
    _load_the_engine()
    begun = time.thread_time()
    start = displacement.settled(scene, longest_step(rock), "nonsmooth")
    return Settled(rock, laid, replace(scene, start=start), time.thread_time() - begun)


@cache
def _load_the_engine() -> None:
    """Settle a block, as what settles first waits for machine code, half a minute where none is."""
    square = np.array([[-2.0, -2.0, 0.0], [2.0, -2.0, 0.0], [2.0, 2.0, 0.0], [-2.0, 2.0, 0.0]])
    rock = box(1.0, 1.0, 1.0)
    scene = resting(rock, Terrain(square, np.array([[0, 1, 2], [0, 2, 3]])))
    displacement.settled(scene, longest_step(rock), "nonsmooth")


def resting(rock: Rock, terrain: Terrain) -> Scene:
    """A rock as it was scanned."""
    own, contact = reduction.on_its_seat(rock), Contact(FRICTION, RESTITUTION)
    start = upright((0.0, 0.0, rock.height))
    return Scene(own, contact, 0.0, "terrain", start=start, terrain=terrain)


def on_its_points(made: Settled, bears: Mask | None = None) -> Scene:
    """The rock as it was scanned, on points that bear it and nothing else, without restitution.

    Parameters
    ----------
    bears : ndarray of bool, shape (k,), which of the points; None for all
    """
    tips, pyramids = made.seat.points, made.seat.pyramids
    low = float(tips[:, 2].min()) - _BENEATH * made.rock.radius
    wide = 20.0 * made.rock.radius * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
    floor = np.column_stack([wide, np.full(4, low)])
    ground = Terrain(floor, np.array([[0, 1, 2], [0, 2, 3]]))
    if bears is not None:
        pyramids = tuple(pyramids[k] for k in np.flatnonzero(bears))
    terrain = replace(made.seat, ground=ground, pyramids=pyramids).terrain
    as_scanned = upright((0.0, 0.0, made.rock.height))
    return replace(made.scene, contact=Contact(FRICTION), start=as_scanned, terrain=terrain)


def pushes(laid: seat.Seat) -> Array:
    """Directions in which the points that bear a rock push it, shape (k, 3)."""
    along = np.array([tip_and_foot[0] - tip_and_foot[1:].mean(0) for tip_and_foot in laid.pyramids])
    return np.asarray(along / np.linalg.norm(along, axis=1, keepdims=True))


def longest_step(rock: Rock) -> float:
    """The longest time step of the engine [s]."""
    return nonsmooth.LADDER.longest * step_unit(rock)


def turned(state: State, since: State) -> float:
    """Angle between two poses [rad]."""
    cosine = 0.5 * (float(np.trace(state.rotation @ since.rotation.T)) - 1.0)
    return math.acos(max(-1.0, min(1.0, cosine)))


def tipping_limit(points: Array, centre: Array, toward: Array) -> float:
    """Horizontal acceleration of a rock [m/s^2] that takes its weight over an edge.

    Parameters
    ----------
    points : ndarray, shape (k, 3) [m], that bear it
    toward : ndarray, shape (3,), unit vector
    """
    loop = points[ConvexHull(points[:, :2]).vertices]
    limits = []
    for one, other in pairwise([*loop, loop[0]]):
        axis = other - one
        weight = float(np.dot(axis, np.cross(centre - one, [0.0, 0.0, -GRAVITY])))
        push = float(np.dot(axis, np.cross(centre - one, toward)))
        if push * weight < 0.0:
            limits.append(-weight / push)
    return min(limits)
