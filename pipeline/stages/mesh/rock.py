"""Rock: from a box or a scan to a rigid body at rest, its base and how it tips."""

from __future__ import annotations

import numpy as np
import trimesh
import xarray as xr
from threadpoolctl import threadpool_limits

from pipeline.config import in_si
from pipeline.config.problems import InputError, Problem
from pipeline.stages.mesh import sources
from pipeline.stages.mesh.products import BARRIER_SCALARS, ROCK, SCAN, SCAN_PAGE
from pipeline.workflow.datasets import described, netcdf, read
from pipeline.workflow.progress import Steps
from pipeline.workflow.stage import Job, Product
from vsr_core.errors import InvalidInput
from vsr_core.judge.proofs import barrier
from vsr_core.rock import solid
from vsr_core.rock.body import Rock
from vsr_core.rock.solid import Solid
from vsr_core.rock.tipping import base_polygon, tipping

BASE_TOLERANCE = 0.003
"""Share of the height of the centre of mass that the drawn base polygon may stand off."""


def make(job: Job) -> Product:
    """Read, check, weigh and set down the rock."""
    made, level, origin, repaired = _solid(job)
    rolling, radius = job.config.contact.rolling_friction, made.rock.radius
    if rolling > 0.05 * radius:
        raise InputError(
            Problem(
                job.site.file_of("contact.rolling_friction"),
                "contact.rolling_friction",
                f"{rolling} m on a rock of radius {radius:.3g} m",
                "it is a length, at most a twentieth of the rock's radius",
                "give metres; 0 if you have a coefficient in mind",
            )
        )
    dataset, turned = _dataset(made, level), in_si.in_degrees(made.turned)
    dataset.attrs |= {
        **origin,
        "repaired": "; ".join(repaired),
        "mass_kg": made.rock.mass,
        "volume_m3": made.volume,
        "turned_to_rest_deg": turned,
    }
    note = f"{origin['shape_source']}; {made.rock.mass:.4g} kg, turned {turned:.2f} deg to rest"
    if repaired:
        note += "; repaired, as `vsr prep` shows"
    return Product({ROCK: netcdf(described(dataset, job, "Rock"))}, note)


Origin = dict[str, str | int]
"""Where a shape is from, as attributes: its source in words, and whether that is a surrogate."""


def _solid(job: Job) -> tuple[Solid, Rock, Origin, tuple[str, ...]]:
    """The rock as it stands, the same on level ground, where it is from, what was repaired."""
    rock, terrain = job.config.rock, job.config.on_terrain
    if rock.shape == "box":
        assert rock.size is not None
        made = solid.box(rock.size, rock.density)
        return made, made.rock, {"shape_source": "box", "surrogate": 0}, ()
    mesh, origin, repaired, where, file = _from_scan(job) if terrain else _from_file(job)
    try:
        made = solid.from_mesh(mesh, rock.density, as_scanned=terrain)
        level = solid.standing(made.rock) if terrain else made.rock
    except InvalidInput as error:
        raise InputError.from_invalid(where, file, error) from None
    return made, level, origin, repaired


_Given = tuple[trimesh.Trimesh, Origin, tuple[str, ...], str, str]
"""A closed mesh, where it is from, what was repaired, and what to name if it is refused."""


def _from_file(job: Job) -> _Given:
    """The rock of a scan of it alone."""
    source = sources.find(job.site)
    where = f"{job.site.file_of('rock.mesh')}: rock.mesh" if source.path else job.site.file
    with Steps(job.stage, job.log) as steps:
        whole = sources.closed(source, job.site, steps.tell)
    return whole.rock, source.attributes, whole.repaired, where, source.name


def _from_scan(job: Job) -> _Given:
    """The rock in the pose in which it stands on its terrain."""
    scan = read(job.path(SCAN))
    if not scan.attrs["accepted"]:
        raise InputError(
            Problem(
                job.site.file_of("pedestal.cut"),
                "pedestal.cut",
                "nothing",
                "it says what of the scan is the rock",
                f"look at {SCAN_PAGE}, which `vsr prep` makes, and set pedestal.cut: proposal, or "
                "give a plane, box, polygon or colour",
            )
        )
    faces = scan["rock_face"].values.astype(np.int64)
    mesh = trimesh.Trimesh(scan["rock_vertex"].values, faces, process=False)
    origin: Origin = {name: scan.attrs[name] for name in ("shape_source", "surrogate")}
    mesh, repaired = solid.checked(mesh)
    where = f"{job.site.file_of('rock.mesh')}: rock.mesh"
    return mesh, origin, repaired, where, str(origin["shape_source"])


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
