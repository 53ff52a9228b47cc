"""The terrain and the rock, as scanned and where it came to lie, as viewers of glTF read them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation

from pipeline.stages.datasets.displaced_runs import left_seat
from pipeline.stages.datasets.displacement_dataset import Displacement
from pipeline.stages.mesh.products import RockData, TerrainData
from pipeline.workflow.stage import Product, Work
from pipeline.workflow.writers import binary
from vsr_core.arrays import Array

if TYPE_CHECKING:
    import trimesh

FILE = "model.glb"

ROCK, GROUND = (201, 170, 120, 255), (150, 150, 145, 255)
"""Colours, red, green, blue and opacity of 255."""

Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
"""Turns z up into y up, as glTF has it (Khronos glTF 2.0, section 3.4)."""


def make(work: Work, runs: Displacement, ground: TerrainData, shape: RockData) -> Product:
    """Write one node for the terrain, one for the rock, and one for each run that left the seat."""
    import trimesh

    rock, terrain = shape.data, ground.data
    places = {"rock": pose(start(rock), np.array([0.0, 0.0, 0.0, 1.0]))} | ends(runs.data)
    scene = trimesh.Scene()
    scene.add_geometry(
        _mesh(terrain["terrain_vertex"], terrain["terrain_face"], GROUND), "terrain", "terrain"
    )
    scene.add_geometry(_mesh(rock["surface_vertex"], rock["surface_face"], ROCK), "rock", "rock")
    for name, matrix in {"terrain": np.eye(4), **places}.items():
        geometry = "terrain" if name == "terrain" else "rock"
        scene.graph.update(name, matrix=Y_UP @ matrix, geometry=geometry)
    told = f"terrain, rock and {len(places) - 1} end positions"
    return Product({FILE: binary(scene.export(file_type="glb"))}, told)


def start(rock: xr.Dataset) -> Array:
    """Centre of mass of the rock as it stands, shape (3,) [m], in the site's frame."""
    return np.array([0.0, 0.0, -float(rock["vertex"].values[:, 2].min())])


def ends(displacement: xr.Dataset) -> dict[str, Array]:
    """The last pose of each run that left the seat, by what the run was.

    Returns
    -------
    dict of ndarray, shape (4, 4)
        See :func:`pose`.
    """
    found = {}
    last = np.cumsum(displacement["row_size"].values) - 1
    for run in np.flatnonzero(left_seat(displacement) & (displacement["row_size"].values > 0)):
        one, sample = displacement.isel(run=run), last[run]
        place = np.array([displacement[axis].values[sample] for axis in "xyz"], float)
        name = (
            f"run {run}: yaw {one['yaw'].item():g} deg, PGA {one['pga'].item():g} g, "
            f"PGV/PGA {one['pgv_pga'].item():g} s, friction {one['friction'].item():g}"
        )
        name += f", record {one['record'].item()}" if "record" in one else ""
        found[name] = pose(place, displacement["quaternion"].values[sample].astype(float))
    return found


def pose(place: Array, quaternion: Array) -> Array:
    """Matrix that takes the rock from its own frame to the site's, shape (4, 4).

    Parameters
    ----------
    place : ndarray, shape (3,) [m], of the centre of mass
    quaternion : ndarray, shape (4,), x, y, z, w
    """
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_quat(quaternion).as_matrix()
    matrix[:3, 3] = place
    return matrix


def _mesh(vertex: xr.DataArray, face: xr.DataArray, colour: tuple[int, ...]) -> trimesh.Trimesh:
    import trimesh

    mesh = trimesh.Trimesh(vertex.values, face.values, process=False)
    mesh.visual = trimesh.visual.TextureVisuals(
        material=trimesh.visual.material.PBRMaterial(baseColorFactor=colour, roughnessFactor=1.0)
    )
    return mesh
