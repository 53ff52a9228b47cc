"""A made-up slope, a boxy rock and falls down that slope, as the datasets hold them."""

from __future__ import annotations

import numpy as np
import trimesh
import xarray as xr
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

SIZE = (0.8, 0.6, 1.2)
"""Sides of the rock [m]."""


def height(x: Array, y: Array) -> Array:
    """Level around the rock, then a bumpy slope towards +x [m]."""
    bumps = 0.3 * np.sin(1.1 * x) * np.cos(0.9 * y)
    return -0.45 * np.maximum(x - 1.0, 0.0) + bumps * np.clip(np.hypot(x, y) - 1.0, 0.0, 1.0)


def terrain(cells: int = 60, side: float = 30.0) -> xr.Dataset:
    """Terrain on a square grid, faces counter-clockwise seen from above."""
    x = np.linspace(-8.0, side - 8.0, cells + 1)
    y = np.linspace(-0.5 * side, 0.5 * side, cells + 1)
    places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    number = np.arange(len(places)).reshape(cells + 1, cells + 1)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3)
    vertices = np.column_stack([places, height(*places.T)])
    return xr.Dataset(
        {
            "terrain_vertex": (("terrain_corner", "xyz"), vertices),
            "terrain_face": (("terrain_face_number", "three"), faces.astype(np.int32)),
        }
    )


def rock(vertices: Array | None = None, faces: Array | None = None) -> xr.Dataset:
    """A box, or the given surface."""
    if vertices is None or faces is None:
        mesh = trimesh.creation.box(SIZE)
        vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
    return xr.Dataset(
        {
            "vertex": (("corner", "xyz"), vertices),
            "surface_vertex": (("surface_corner", "xyz"), vertices.astype(np.float32)),
            "surface_face": (("face", "three"), faces.astype(np.int32)),
        },
        attrs={"mass_kg": 1000.0},
    )


def displacement(
    runs: int = 4,
    samples: int = 120,
    lowest: float = -0.5 * SIZE[2],
    radius: float = 0.5 * float(np.hypot(*SIZE[1:])),
) -> xr.Dataset:
    """``runs`` falls in different directions after one run that stays; made up, not simulated.

    Parameters
    ----------
    runs, samples : int, falls and samples of each
    lowest : float [m], lowest point of the rock under its centre of mass
    radius : float [m], height over the ground at which the rolling rock's centre keeps
    """
    tracks = [_rest(lowest), *(_fall(number, samples, lowest, radius) for number in range(runs))]
    per_run = {name: [track[1][name] for track in tracks] for name in tracks[0][1]}
    data = xr.concat([track[0] for track in tracks], "sample")
    units = {"pga": "g", "pgv_pga": "s", "yaw": "degree"}
    data = data.assign({name: ("run", np.array(v)) for name, v in per_run.items()})
    data["run"] = ("run", np.arange(len(tracks)), {"cf_role": "trajectory_id"})
    for name, unit in units.items():
        data[name].attrs["units"] = unit
    data["row_size"].attrs["sample_dimension"] = "sample"
    return data


def _rest(lowest: float) -> tuple[xr.Dataset, dict[str, float]]:
    time = np.array([0.0, 1.0])
    where = np.tile([0.0, 0.0, -lowest], (2, 1))
    return _run(time, where, Rotation.identity(2), 0.1, 0.0, outcome=0)


def _fall(
    number: int, samples: int, lowest: float, radius: float
) -> tuple[xr.Dataset, dict[str, float]]:
    """Leans, then rolls and bounces down, and slows to rest."""
    time = np.linspace(0.0, 4.0 + 0.3 * number, samples)
    share = np.clip((time - 0.6) / (time[-1] - 1.0), 0.0, 1.0)
    reach = (4.0 + 3.0 * number) * share**2 * (3.0 - 2.0 * share)
    way = 0.35 * np.sin(2.4 * number)
    x, y = reach * np.cos(way), reach * np.sin(way)
    lift = np.abs(np.sin(reach)) * np.minimum(0.25 * reach, 0.6) * (1.0 - share)
    away = np.minimum(reach, 1.0)
    z = height(x, y) + (1.0 - away) * -lowest + away * radius + lift
    axis = np.array([-np.sin(way), np.cos(way), 0.1 * number])
    turn = Rotation.from_rotvec(np.outer(reach / radius, axis / np.linalg.norm(axis)))
    where = np.column_stack([x, y, z])
    return _run(time, where, turn, 0.4 + 0.1 * number, 30.0 * number, outcome=1)


def _run(
    time: Array, where: Array, turn: Rotation, pga: float, yaw: float, outcome: int
) -> tuple[xr.Dataset, dict[str, float]]:
    velocity = np.gradient(where, time, axis=0)
    speed = np.linalg.norm(velocity, axis=1)
    angular_velocity = np.gradient(turn.as_rotvec(), time, axis=0)
    quaternion = turn.as_quat()
    quaternion[::7] *= -1.0  # the same rotation
    samples = xr.Dataset(
        {
            "time": ("sample", time),
            **{name: ("sample", where[:, k]) for k, name in enumerate("xyz")},
            "quaternion": (("sample", "xyzw"), quaternion),
            "velocity": (("sample", "xyz"), velocity),
            "angular_velocity": (("sample", "xyz"), angular_velocity),
            "speed": ("sample", speed),
            "contact": ("sample", np.ones(len(time), dtype=np.int8)),
        }
    )
    per_run = {
        "pga": pga,
        "pgv_pga": 0.25,
        "yaw": yaw,
        "friction": 0.6,
        "row_size": len(time),
        "outcome": np.int8(outcome),
        "movement": np.int8(outcome),  # rolled over, or stayed
        "trajectory_length": float(np.linalg.norm(np.diff(where, axis=0), axis=1).sum()),
        "largest_speed": float(speed.max()),
        "terminal_distance": float(np.linalg.norm(where[-1] - where[0])),
        "stop_reason": np.int8(0),
        "steps": 1000,
    }
    return samples, per_run
