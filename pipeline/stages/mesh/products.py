"""Products of this room by name, and the rock and its ground as later stages take them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.workflow.datasets import read
from pipeline.workflow.store import Store
from vsr_core.judge.proofs import Barrier
from vsr_core.rock.body import Rock
from vsr_core.scene import State
from vsr_core.terrain.surface import Terrain

SCAN, SCAN_PAGE, ROCK, TERRAIN = "scan.nc", "prep.html", "rock.nc", "terrain.nc"

BARRIER_SCALARS = ("toppled_tilt", "edge_tilt", "edge_height", "upright_floor", "floor")
"""Attributes of the rock's dataset that tell its energy barrier."""


@dataclass(frozen=True)
class Ground:
    """A terrain, and the rock's state of rest on it for each friction."""

    terrain: Terrain
    starts: dict[float, State]


def load_rock(store: Store) -> tuple[Rock, Barrier]:
    """The rock and its energy barrier, from the product."""
    path = store.folder / ROCK
    return _rock(path, path.stat().st_mtime_ns)


@lru_cache(maxsize=4)
def _rock(path: Path, changed: int) -> tuple[Rock, Barrier]:
    data = read(path)
    limits = Barrier(
        data["barrier_tilt"].values,
        data["barrier_height"].values,
        *(float(data.attrs[f"barrier_{name}"]) for name in BARRIER_SCALARS),
    )
    rock = Rock(
        data.attrs["rock_shape"],
        data["vertex"].values,
        float(data.attrs["mass_kg"]),
        data["principal_moment"].values,
        data["principal_axis"].values,
    )
    return rock, limits


def load_terrain(store: Store) -> Ground:
    """The ground and the rock's rest on it, from the product."""
    path = store.folder / TERRAIN
    return _terrain(path, path.stat().st_mtime_ns)


@lru_cache(maxsize=2)
def _terrain(path: Path, changed: int) -> Ground:
    data = read(path)
    ends = np.cumsum(data["part_size"].values)[:-1]
    parts = np.split(data["part_corner"].values, ends) if data.sizes["part"] else []
    light = Terrain(data["light_vertex"].values, data["light_face"].values.astype(np.int64))
    terrain = Terrain(
        data["terrain_vertex"].values,
        data["terrain_face"].values.astype(np.int64),
        tuple(parts),
        light if len(light.faces) else None,
    )
    starts = {}
    for i, friction in enumerate(data["friction"].values):
        turn = Rotation.from_quat(data["start_quaternion"].values[i]).as_matrix()
        still = np.zeros(3)
        starts[float(friction)] = State(data["start_position"].values[i], turn, still, still)
    return Ground(terrain, starts)
