"""Rock: from a box or a scan to a rigid body at rest, its base and how it tips."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import numpy as np
import trimesh
import xarray as xr
from threadpoolctl import threadpool_limits

from pipeline.config import in_si
from pipeline.config.problems import InputError, Problem
from pipeline.config.scene_schema import RockConfig
from pipeline.config.sections import Key
from pipeline.stages.mesh import scan_alone
from pipeline.stages.mesh.products import (
    BARRIER_SCALARS,
    SCAN_PAGE,
    PlacedData,
    RockData,
    ScanData,
    of_contact,
    pieces_in,
)
from pipeline.stages.mesh.sources import Source
from pipeline.workflow.datasets import described, netcdf
from pipeline.workflow.progress import Steps
from pipeline.workflow.stage import Product, Work
from vsr_core.errors import InvalidInput
from vsr_core.judge.proofs import barrier
from vsr_core.rock import solid
from vsr_core.rock.body import Rock
from vsr_core.rock.doubts import doubts
from vsr_core.rock.solid import Solid
from vsr_core.rock.tipping import base_polygon, tipping

Origin = dict[str, str | int]
"""Where a shape is from, as attributes: its source in words, and whether that is a surrogate."""

BASE_TOLERANCE = 0.003
"""Share of the height of the centre of mass that the drawn base polygon may stand off."""


def make(
    work: Work,
    rock: RockConfig,
    rolling_friction: Annotated[float, Key("contact.rolling_friction")],
    source: Source | None,
    scan: ScanData | None,
    placed: PlacedData | None,
) -> Product:
    """Read, check, weigh and set down the rock."""
    found = scan or placed
    made, level, origin, repaired, doubtful = _solid(work, rock, source, found)
    if rolling_friction > 0.05 * made.rock.radius:
        raise InputError(
            Problem(
                work.origin.file_of("contact.rolling_friction"),
                "contact.rolling_friction",
                f"{rolling_friction} m on a rock of radius {made.rock.radius:.3g} m",
                "it is a length, at most a twentieth of the rock's radius",
                "give metres; 0 if you have a coefficient in mind",
            )
        )
    dataset, turned = _dataset(made, level), in_si.in_degrees(made.turned)
    if found is not None:
        told = found.data.attrs
        of_rock = made.rock.pieces, told.get("contact_error_m", np.nan), told["contact_shape"]
        dataset = dataset.merge(of_contact(*of_rock), combine_attrs="no_conflicts")
    dataset.attrs |= {
        **origin,
        "repaired": "; ".join((*repaired, *doubtful)),
        "mass_kg": made.rock.mass,
        "volume_m3": made.volume,
        "turned_to_rest_deg": turned,
    }
    note = f"{origin['shape_source']}; {made.rock.mass:.4g} kg, turned {turned:.2f} deg to rest"
    if repaired:
        note += "; what was found or changed, `vsr prep` shows"
    if doubtful:
        note += f"; doubtful: {'; '.join(doubtful)}"
    return Product({RockData.FILE: netcdf(described(dataset, work, "Rock"))}, note)


def _solid(
    work: Work, rock: RockConfig, source: Source | None, scan: ScanData | PlacedData | None
) -> tuple[Solid, Rock, Origin, tuple[str, ...], tuple[str, ...]]:
    """The rock as it stands, the same on level ground, where from, what was repaired or is odd."""
    if source is None:
        assert rock.size is not None
        made = solid.box(rock.size, rock.density)
        return made, made.rock, {"shape_source": "box", "surrogate": 0}, (), ()
    where = f"{work.origin.file_of('rock.mesh')}: rock.mesh"
    if scan is not None:
        mesh, origin, repaired = _from_scan(work, scan)
        name = str(origin["shape_source"])
    else:
        where, name = where if source.path else work.origin.file, source.name
        with Steps(work.stage, work.log) as steps:
            whole = scan_alone.closed(source, rock.closing, work.origin, steps.tell)
        mesh, origin, repaired = whole.rock, source.attributes, whole.repaired
    try:
        made = solid.from_mesh(mesh, rock.density, as_scanned=scan is not None)
        if scan is not None:
            pieces = tuple(piece - np.array(mesh.center_mass) for piece in pieces_in(scan.data))
            made = replace(made, rock=replace(made.rock, pieces=pieces))
        level = solid.standing(made.rock) if scan is not None else made.rock
    except InvalidInput as error:
        raise InputError.from_invalid(where, name, error) from None
    return made, level, origin, repaired, tuple(doubts(mesh))


def _from_scan(
    work: Work, scan: ScanData | PlacedData
) -> tuple[trimesh.Trimesh, Origin, tuple[str, ...]]:
    """The rock in the pose in which it stands on its terrain, where from, what was repaired."""
    data = scan.data
    if not data.attrs["accepted"]:
        raise InputError(
            Problem(
                work.origin.file_of("pedestal.cut"),
                "pedestal.cut",
                "nothing",
                "it says what of the scan is the rock",
                f"look at {SCAN_PAGE}, which `vsr prep` makes, and set pedestal.cut: proposal, or "
                "give a plane, box, polygon or colour",
            )
        )
    faces = data["rock_face"].values.astype(np.int64)
    mesh = trimesh.Trimesh(data["rock_vertex"].values, faces, process=False)
    origin: Origin = {name: data.attrs[name] for name in ("shape_source", "surrogate")}
    mesh, repaired = solid.checked(mesh)
    before = data.attrs.get("repaired", "").split("; ")  # of a rock in a file of its own
    return mesh, origin, tuple(dict.fromkeys((*filter(None, before), *repaired)))


def _dataset(made: Solid, level: Rock) -> xr.Dataset:
    rock = made.rock
    tips = tipping(level.hull, np.radians(np.arange(360.0)))
    with threadpool_limits(1):  # its products are so thin that threads only wait for each other
        limits = barrier(level)
    attributes = {f"barrier_{name}": getattr(limits, name) for name in BARRIER_SCALARS}
    return xr.Dataset(
        {
            "vertex": (("corner", "xyz"), rock.vertices),
            "surface_vertex": (("surface_corner", "xyz"), made.vertices.astype(np.float32)),
            "surface_face": (("face", "three"), made.faces.astype(np.int32)),
            "principal_moment": ("axis", rock.inertia),
            "principal_axis": (("xyz", "axis"), rock.axes),
            "base_polygon": (
                ("base_corner", "xy"),
                base_polygon(level.vertices, BASE_TOLERANCE * level.height),
            ),
            "uplift_pga": ("direction", tips.uplift),
            "tipping_pga": ("direction", tips.overturning),
            "tipping_angle": ("direction", np.degrees(tips.angle)),
            "barrier_height": ("barrier_tilt", limits.height),
        },
        {"direction": np.arange(360.0), "barrier_tilt": limits.tilt},
        {"rock_shape": rock.shape, **attributes},
    )
