"""Terrain: the ground around the rock as runs need it, and where the rock rests on it."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
import trimesh
import xarray as xr
from scipy.spatial.transform import Rotation

from pipeline.config import in_si
from pipeline.config.layers import Origin
from pipeline.config.problems import InputError, Problem
from pipeline.config.scene_schema import ContactConfig, SeatPoints
from pipeline.config.sections import Key
from pipeline.stages.mesh import seating
from pipeline.stages.mesh.products import PlacedData, ScanData, Standing, TerrainData
from pipeline.workflow.datasets import described, netcdf
from pipeline.workflow.engine_input import Engine
from pipeline.workflow.stage import Product, Work
from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.rock.doubts import spikes
from vsr_core.run.displacement import held_toward
from vsr_core.scan import seat
from vsr_core.scan.missing_ground import holes
from vsr_core.scene import State
from vsr_core.terrain.surface import Terrain


def make(
    work: Work,
    contact: ContactConfig,
    bearing: Annotated[Literal["rim", "whole"] | SeatPoints, Key("pedestal.seat")],
    reduce: Annotated[bool, Key("simulation.reduce")],
    engine: Engine,
    scan: ScanData | None,
    placed: PlacedData | None,
    standing: Standing,
) -> Product:
    """Make the ground light enough to run on, lay the seat, and set the rock down."""
    found = scan or placed
    assert found is not None
    data, rock = found.data, standing.rock
    how = bearing.points if isinstance(bearing, SeatPoints) else bearing
    try:
        whole = how == "whole"
        bed = seating.bed(data, rock, reduce=reduce, whole_seam=whole)
        seated = seating.seated(rock, reduce=reduce, whole_seam=whole)
        laid, height = seating.laid(bed, rock, seated, how)
        terrain = laid.terrain
        scenes = [
            seating.rest(terrain, seated, height, in_si.contact(contact, friction), engine.name)
            for friction in contact.friction
        ]
        held = held_toward(scenes[0], seating.longest_step(rock, engine.name), engine.name)
    except InvalidInput as error:
        raise _refusal(work.origin, error, own_file=scan is None) from None
    scanned = seating.whole_ground(data)
    ground = trimesh.Trimesh(scanned.vertices, scanned.faces)
    for told in (*spikes(ground), *holes(ground)):
        work.log(f"{work.stage}: doubtful: {told}")
    starts = [scene.start for scene in scenes if scene.start is not None]
    dataset = _dataset(scanned, laid, terrain, starts)
    dataset = dataset.assign_coords(friction=list(contact.friction))
    seat_note, held_note = _bears(laid, height - rock.height), _holds(held)
    dataset.attrs["origin_in_scan"] = data.attrs["origin_in_scan"]
    dataset.attrs |= {"seat": seat_note, "held": held_note, "whole_seam": int(whole)}
    if held_note:
        work.log(f"{work.stage}: {held_note}")
    note = f"{len(scanned.faces)} faces, for which {len(terrain.faces)} stand in runs"
    return Product(
        {TerrainData.FILE: netcdf(described(dataset, work, "Terrain"))}, f"{note}; {seat_note}"
    )


def _refusal(origin: Origin, error: InvalidInput, *, own_file: bool) -> InputError:
    if not own_file:
        return InputError.from_invalid(origin.file_of("pedestal"), "pedestal", error)
    key, remedy = "rock.pose", "correct rock.pose, or let the rock fall: drop: true"
    return InputError(Problem(origin.file_of(key), key, error.given, error.rule, remedy))


def _bears(laid: seat.Seat, raised: float) -> str:
    if raised > 0.0:
        by = f"{1e3 * raised:.1f} mm"
        return f"the rock was raised by {by}, out of the ground, and settled from there"
    bears = f"{len(laid.points)} points of the seam bear the rock" if len(laid.points) else ""
    moved = f"scanned ground was moved out of the rock by at most {1e3 * laid.moved:.1f} mm"
    return f"{bears or 'all of the seam bears the rock'}; {moved}"


def _holds(toward: Array) -> str:
    """What holds a rock that no steady shaking moves, in words; empty where none does."""
    if not len(toward):
        return ""
    ways = ", ".join(f"{round(way)}" for way in np.degrees(toward))
    return (
        "walls beside the seat hold the rock: no steady acceleration moves it toward "
        f"{ways} deg (counter-clockwise from +x)"
    )


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
