"""Terrain: the ground around the rock as runs need it, and where the rock rests on it."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation

from pipeline.config import in_si
from pipeline.config.problems import InputError
from pipeline.config.scene_schema import ContactConfig
from pipeline.config.sections import Key
from pipeline.stages.mesh.products import ScanData, Standing, TerrainData
from pipeline.workflow.datasets import described, netcdf
from pipeline.workflow.engine_input import Engine
from pipeline.workflow.stage import Product, Work
from vsr_core.arrays import Array
from vsr_core.engines import load
from vsr_core.errors import InvalidInput
from vsr_core.rock import reduction
from vsr_core.rock.body import Rock
from vsr_core.run.displacement import settled
from vsr_core.run.time_step import step_unit
from vsr_core.scene import Contact, Scene, State
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


def make(
    work: Work,
    contact: ContactConfig,
    reduce: Annotated[bool, Key("simulation.reduce")],
    engine: Engine,
    scan: ScanData,
    standing: Standing,
) -> Product:
    """Make the ground light enough to run on, and set the rock down."""
    data, rock = scan.data, standing.rock
    whole = Terrain(data["terrain_vertex"].values, data["terrain_face"].values.astype(np.int64))
    try:
        terrain = _light(whole, rock, in_parts=engine.name == "bullet") if reduce else whole
        seated = reduction.on_its_seat(rock) if reduce else rock
        height = rock.height
        starts = [
            _rest(terrain, seated, height, in_si.contact(contact, friction), engine.name)
            for friction in contact.friction
        ]
    except InvalidInput as error:
        file = work.origin.file_of("pedestal")
        raise InputError.from_invalid(file, "pedestal", error) from None
    dataset = _dataset(whole, terrain, starts).assign_coords(friction=list(contact.friction))
    dataset.attrs["origin_in_scan"] = data.attrs["origin_in_scan"]
    fewer = f"{len(terrain.light.faces)} of which stand for it, " if terrain.light else ""
    parts = f"{len(terrain.parts)} convex parts" if terrain.parts else "as triangles"
    note = f"{len(whole.faces)} faces, {fewer}{parts}"
    return Product({TerrainData.FILE: netcdf(described(dataset, work, "Terrain"))}, note)


def _light(whole: Terrain, rock: Rock, *, in_parts: bool) -> Terrain:
    def tolerance(points: Array) -> Array:
        near = np.hypot(points[:, 0], points[:, 1]) < NEAR_RADII * rock.radius
        return np.where(near, SEAT_SHARE, SLOPE_SHARE) * rock.radius

    light = coarser(whole, tolerance)
    parts = convex_parts(light, tolerance, THICKNESS_SHARE * rock.radius) if in_parts else ()
    return replace(whole, parts=parts, light=light)


def _rest(terrain: Terrain, rock: Rock, height: float, contact: Contact, engine: str) -> State:
    """Where a rock comes to rest, let go as it was scanned.

    Parameters
    ----------
    height : float [m], of its centre of mass as scanned
    """
    scanned = State(np.array([0.0, 0.0, height]), np.eye(3), np.zeros(3), np.zeros(3))
    scene = Scene(rock, contact, 0.0, "terrain", start=scanned, terrain=terrain)
    return settled(scene, load(engine).LADDER.longest * step_unit(rock), engine)


def _dataset(whole: Terrain, terrain: Terrain, starts: list[State]) -> xr.Dataset:
    parts, light = terrain.parts, terrain.light or Terrain(np.empty((0, 3)), _NO_FACES)
    turns = np.array([state.rotation for state in starts])
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
            "start_position": (("friction", "xyz"), np.array([state.position for state in starts])),
            "start_quaternion": (("friction", "xyzw"), Rotation.from_matrix(turns).as_quat()),
        }
    )
