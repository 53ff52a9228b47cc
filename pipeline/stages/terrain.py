"""Terrain: the ground around the rock as runs need it, and where the rock rests on it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.datasets import described, netcdf, read
from pipeline.problems import InputError
from pipeline.scenes import contact
from pipeline.stage import Job, Product, Stage
from pipeline.stages.rock import load_rock
from pipeline.stages.scan import FILE as SCAN
from pipeline.store import Store
from vsr_core.errors import Unfit

if TYPE_CHECKING:
    import numpy as np
    import xarray as xr

    from vsr_core.scene import State
    from vsr_core.terrain import Terrain

FILE = "terrain.nc"

NEAR_RADII = 2.0
"""Distance from the rock, in its radii, up to which the ground is as detailed as its seat."""

SEAT_SHARE, SLOPE_SHARE = 0.008, 0.04
"""How far convex pieces may stand out of the ground, near the rock and beyond, as a share of the
rock's radius."""

THICKNESS_SHARE = 0.05
"""Thickness of the pieces, as a share of the rock's radius: more than a run may sink in."""


@dataclass(frozen=True)
class Ground:
    """A terrain, and the rock's state of rest on it for each friction."""

    terrain: Terrain
    starts: dict[float, State]


def make(job: Job) -> Product:
    """Make the ground light enough to run on, and set the rock down."""
    import numpy as np

    from vsr_core.terrain import Terrain

    scan = read(job.path(SCAN))
    whole = Terrain(scan["terrain_vertex"].values, scan["terrain_face"].values.astype(np.int64))
    try:
        terrain = _light(whole, job) if job.config.simulation.reduce else whole
        starts = {
            friction: _rest(terrain, job, friction) for friction in job.config.contact.friction
        }
    except Unfit as error:
        raise InputError.from_unfit(job.site.file, "pedestal", error) from None
    dataset = _dataset(whole, terrain, starts)
    dataset.attrs["origin_in_scan"] = scan.attrs["origin_in_scan"]
    note = f"{len(whole.faces)} faces, {len(terrain.pieces)} convex pieces"
    return Product({FILE: netcdf(described(dataset, job, "Terrain"))}, note)


def load_terrain(store: Store) -> Ground:
    """The ground and the rock's rest on it, from the product."""
    path = store.folder / FILE
    return _load(path, path.stat().st_mtime_ns)


@lru_cache(maxsize=2)
def _load(path: Path, changed: int) -> Ground:
    import numpy as np
    from scipy.spatial.transform import Rotation

    from vsr_core.scene import State
    from vsr_core.terrain import Terrain

    data = read(path)
    ends = np.cumsum(data["piece_size"].values)[:-1]
    pieces = np.split(data["piece_corner"].values, ends) if data.sizes["piece"] else []
    terrain = Terrain(
        data["terrain_vertex"].values,
        data["terrain_face"].values.astype(np.int64),
        tuple(pieces),
    )
    starts = {}
    for i, friction in enumerate(data["friction"].values):
        turn = Rotation.from_quat(data["start_quaternion"].values[i]).as_matrix()
        still = np.zeros(3)
        starts[float(friction)] = State(data["start_position"].values[i], turn, still, still)
    return Ground(terrain, starts)


def _light(whole: Terrain, job: Job) -> Terrain:
    import numpy as np

    from vsr_core.coarse import coarser
    from vsr_core.pieces import pieces

    radius = load_rock(job.store)[0].radius

    def tolerance(points: np.ndarray) -> np.ndarray:
        near = np.hypot(points[:, 0], points[:, 1]) < NEAR_RADII * radius
        return np.where(near, SEAT_SHARE, SLOPE_SHARE) * radius

    light = coarser(whole, tolerance)
    made = pieces(light.terrain, tolerance, THICKNESS_SHARE * radius)
    return replace(whole, pieces=made)


def _rest(terrain: Terrain, job: Job, friction: float) -> State:
    import numpy as np

    from vsr_core import GRAVITY, detail
    from vsr_core.precheck import COARSEST_SHARE
    from vsr_core.scene import Scene, State
    from vsr_core.travel import settled

    rock, _ = load_rock(job.store)
    scanned = State(np.array([0.0, 0.0, rock.height]), np.eye(3), np.zeros(3), np.zeros(3))
    if job.config.simulation.reduce:
        rock = detail.on_its_seat(rock)
    scene = Scene(
        rock, contact(job.config, friction), 0.0, "terrain", start=scanned, terrain=terrain
    )
    return settled(scene, COARSEST_SHARE * math.sqrt(rock.radius / GRAVITY))


def _dataset(whole: Terrain, terrain: Terrain, starts: dict[float, State]) -> xr.Dataset:
    import numpy as np
    import xarray as xr
    from scipy.spatial.transform import Rotation

    pieces = terrain.pieces
    turns = np.array([state.rotation for state in starts.values()])
    return xr.Dataset(
        {
            "terrain_vertex": (("terrain_corner", "xyz"), whole.vertices),
            "terrain_face": (("terrain_triangle", "three"), whole.faces.astype(np.int32)),
            "piece_corner": (
                ("corner", "xyz"),
                np.concatenate(pieces) if pieces else np.empty((0, 3)),
            ),
            "piece_size": ("piece", np.array([len(p) for p in pieces], np.int32)),
            "start_position": (
                ("friction", "xyz"),
                np.array([state.position for state in starts.values()]),
            ),
            "start_quaternion": (("friction", "xyzw"), Rotation.from_matrix(turns).as_quat()),
        },
        {"friction": list(starts)},
    )


STAGE = Stage(
    name="terrain",
    make=make,
    needs=("scan", "rock"),
    reads=("pedestal", "contact", "simulation.reduce"),
    code=("vsr_core.engines.bullet:build",),
    versions=("pybullet",),
    applies=attrgetter("on_terrain"),
)
