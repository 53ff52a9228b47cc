"""Terrain: the ground around the rock as runs need it, and where the rock rests on it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation

from pipeline.config import in_si
from pipeline.config.problems import InputError
from pipeline.stages.mesh.products import SCAN, TERRAIN, load_rock
from pipeline.workflow.datasets import described, netcdf, read
from pipeline.workflow.stage import Job, Product
from vsr_core.arrays import Array
from vsr_core.engines import load
from vsr_core.errors import InvalidInput
from vsr_core.rock import reduction
from vsr_core.run.displacement import settled
from vsr_core.run.time_step import step_unit
from vsr_core.scene import Scene, State
from vsr_core.terrain.coarsening import coarser
from vsr_core.terrain.convex_parts import convex_parts
from vsr_core.terrain.surface import Terrain

NEAR_RADII = 2.0
"""Distance from the rock, in its radii, up to which the ground is as detailed as its seat."""

SEAT_SHARE, SLOPE_SHARE = 0.008, 0.04
"""How far convex parts may stand out of the ground, near the rock and beyond, as a share of the
rock's radius."""

_NO_FACES = np.empty((0, 3), dtype=np.int64)

THICKNESS_SHARE = 0.05
"""Thickness of the parts, as a share of the rock's radius: more than a run may sink in."""


def make(job: Job) -> Product:
    """Make the ground light enough to run on, and set the rock down."""
    scan = read(job.path(SCAN))
    whole = Terrain(scan["terrain_vertex"].values, scan["terrain_face"].values.astype(np.int64))
    try:
        terrain = _light(whole, job) if job.config.simulation.reduce else whole
        starts = {
            friction: _rest(terrain, job, friction) for friction in job.config.contact.friction
        }
    except InvalidInput as error:
        raise InputError.from_invalid(job.site.file_of("pedestal"), "pedestal", error) from None
    dataset = _dataset(whole, terrain, starts)
    dataset.attrs["origin_in_scan"] = scan.attrs["origin_in_scan"]
    fewer = f"{len(terrain.light.faces)} of which stand for it, " if terrain.light else ""
    note = f"{len(whole.faces)} faces, {fewer}{len(terrain.parts)} convex parts"
    return Product({TERRAIN: netcdf(described(dataset, job, "Terrain"))}, note)


def _light(whole: Terrain, job: Job) -> Terrain:
    radius = load_rock(job.store)[0].radius

    def tolerance(points: Array) -> Array:
        near = np.hypot(points[:, 0], points[:, 1]) < NEAR_RADII * radius
        return np.where(near, SEAT_SHARE, SLOPE_SHARE) * radius

    light = coarser(whole, tolerance)
    made = convex_parts(light, tolerance, THICKNESS_SHARE * radius)
    return replace(whole, parts=made, light=light)


def _rest(terrain: Terrain, job: Job, friction: float) -> State:
    rock, _ = load_rock(job.store)
    scanned = State(np.array([0.0, 0.0, rock.height]), np.eye(3), np.zeros(3), np.zeros(3))
    if job.config.simulation.reduce:
        rock = reduction.on_its_seat(rock)
    scene = Scene(
        rock,
        in_si.contact(job.config.contact, friction),
        0.0,
        "terrain",
        start=scanned,
        terrain=terrain,
    )
    engine = job.config.engine
    return settled(scene, load(engine).LADDER.longest * step_unit(rock), engine)


def _dataset(whole: Terrain, terrain: Terrain, starts: dict[float, State]) -> xr.Dataset:
    parts, light = terrain.parts, terrain.light or Terrain(np.empty((0, 3)), _NO_FACES)
    turns = np.array([state.rotation for state in starts.values()])
    return xr.Dataset(
        {
            "terrain_vertex": (("terrain_corner", "xyz"), whole.vertices),
            "terrain_face": (("terrain_triangle", "three"), whole.faces.astype(np.int32)),
            "light_vertex": (("light_corner", "xyz"), light.vertices),
            "light_face": (("light_triangle", "three"), light.faces.astype(np.int32)),
            "part_corner": (
                ("corner", "xyz"),
                np.concatenate(parts) if parts else np.empty((0, 3)),
            ),
            "part_size": ("part", np.array([len(p) for p in parts], np.int32)),
            "start_position": (
                ("friction", "xyz"),
                np.array([state.position for state in starts.values()]),
            ),
            "start_quaternion": (("friction", "xyzw"), Rotation.from_matrix(turns).as_quat()),
        },
        {"friction": list(starts)},
    )
