"""Terrain: the ground around the rock as runs need it, and where the rock rests on it."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Annotated, Literal

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation

from pipeline.config import in_si
from pipeline.config.problems import InputError
from pipeline.config.scene_schema import ContactConfig, SeatPoints
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
from vsr_core.run.displacement import held_toward, settled
from vsr_core.run.time_step import step_unit
from vsr_core.scan import seat
from vsr_core.scene import Contact, Scene, State
from vsr_core.terrain.coarsening import coarser
from vsr_core.terrain.surface import Terrain

NEAR_RADII = 2.0
"""Distance from the rock, in its radii, up to which the ground is as detailed as its seat."""

SEAT_SHARE, SLOPE_SHARE = 0.008, 0.04
"""How far the ground of runs may be from the one that was scanned, near the rock and beyond, as a
share of the rock's radius."""


def make(
    work: Work,
    contact: ContactConfig,
    bearing: Annotated[Literal["rim", "whole"] | SeatPoints, Key("pedestal.seat")],
    reduce: Annotated[bool, Key("simulation.reduce")],
    engine: Engine,
    scan: ScanData,
    standing: Standing,
) -> Product:
    """Make the ground light enough to run on, lay the seat, and set the rock down."""
    data, rock = scan.data, standing.rock
    whole = Terrain(data["terrain_vertex"].values, data["terrain_face"].values.astype(np.int64))
    how = bearing.points if isinstance(bearing, SeatPoints) else bearing
    seated = reduction.on_its_seat(rock) if reduce else rock
    up = np.array([0.0, 0.0, rock.height])
    try:
        loops = seat.seams(whole, data["terrain_unseen"].values.astype(bool))
        light = coarser(whole, partial(_tolerance, rock)) if reduce else whole
        laid = seat.seat(light, loops, seated.vertices + up, rock.vertices + up, how)
        terrain = laid.terrain
        scenes = [
            _rest(terrain, seated, rock.height, in_si.contact(contact, friction), engine.name)
            for friction in contact.friction
        ]
        held = held_toward(scenes[0], _step(rock, engine.name), engine.name)
    except InvalidInput as error:
        file = work.origin.file_of("pedestal")
        raise InputError.from_invalid(file, "pedestal", error) from None
    starts = [scene.start for scene in scenes if scene.start is not None]
    dataset = _dataset(whole, laid, terrain, starts).assign_coords(friction=list(contact.friction))
    seat_note, held_note = _bears(laid), _holds(held, contact.friction[0])
    dataset.attrs["origin_in_scan"] = data.attrs["origin_in_scan"]
    dataset.attrs |= {"seat": seat_note, "held": held_note}
    if held_note:
        work.log(f"{work.stage}: {held_note}")
    note = f"{len(whole.faces)} faces, {len(terrain.faces)} of which stand for it in runs"
    return Product(
        {TerrainData.FILE: netcdf(described(dataset, work, "Terrain"))}, f"{note}; {seat_note}"
    )


def _bears(laid: seat.Seat) -> str:
    bears = f"{len(laid.points)} points of the seam bear the rock" if len(laid.points) else ""
    moved = f"scanned ground was moved out of the rock's hull by at most {1e3 * laid.moved:.1f} mm"
    return f"{bears or 'all of the seam bears the rock'}; {moved}"


def _holds(toward: Array, friction: float) -> str:
    """What holds a rock that no steady shaking moves, in words; empty where none does."""
    if not len(toward):
        return ""
    ways = ", ".join(f"{round(way)}" for way in np.degrees(toward))
    return (
        f"walls beside the seat hold the rock at friction {friction:g}: no steady acceleration "
        f"moves it toward {ways} deg (counter-clockwise from +x)"
    )


def _tolerance(rock: Rock, points: Array) -> Array:
    near = np.hypot(points[:, 0], points[:, 1]) < NEAR_RADII * rock.radius
    return np.where(near, SEAT_SHARE, SLOPE_SHARE) * rock.radius


def _step(rock: Rock, engine: str) -> float:
    """The longest time step of an engine [s]."""
    return load(engine).LADDER.longest * step_unit(rock)


def _rest(terrain: Terrain, rock: Rock, height: float, contact: Contact, engine: str) -> Scene:
    """A rock that has come to rest, let go as it was scanned.

    Parameters
    ----------
    height : float [m], of its centre of mass as scanned
    """
    scanned = State(np.array([0.0, 0.0, height]), np.eye(3), np.zeros(3), np.zeros(3))
    scene = Scene(rock, contact, 0.0, "terrain", start=scanned, terrain=terrain)
    return replace(scene, start=settled(scene, _step(rock, engine), engine))


def _dataset(whole: Terrain, laid: seat.Seat, terrain: Terrain, starts: list[State]) -> xr.Dataset:
    turns = np.array([state.rotation for state in starts])
    return xr.Dataset(
        {
            "terrain_vertex": (("terrain_corner", "xyz"), whole.vertices),
            "terrain_face": (("terrain_triangle", "three"), whole.faces.astype(np.int32)),
            "contact_vertex": (("contact_corner", "xyz"), terrain.vertices),
            "contact_face": (("contact_triangle", "three"), terrain.faces.astype(np.int32)),
            "bearing_point": (("bearing", "xyz"), laid.points),
            "start_position": (("friction", "xyz"), np.array([state.position for state in starts])),
            "start_quaternion": (("friction", "xyzw"), Rotation.from_matrix(turns).as_quat()),
        }
    )
