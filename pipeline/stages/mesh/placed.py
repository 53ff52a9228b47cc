"""Placed: a rock and a terrain in two files, the rock where the user puts it or where it falls."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
import xarray as xr
from scipy.spatial.transform import Rotation

from pipeline.config.layers import Origin
from pipeline.config.problems import InputError
from pipeline.config.scene_schema import PoseConfig, RockConfig
from pipeline.drawing.style import png_uri
from pipeline.stages.mesh import closed_rock, scan_alone, scan_figures, scan_page, sources
from pipeline.stages.mesh.gap_map import gap_map, gaps
from pipeline.stages.mesh.products import SCAN_PAGE, PlacedData, of_contact
from pipeline.stages.mesh.sources import GroundFile, Source
from pipeline.workflow.datasets import described, netcdf
from pipeline.workflow.progress import Steps
from pipeline.workflow.stage import Product, Work
from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.rock import solid
from vsr_core.run.dropping import dropped
from vsr_core.scan import placing
from vsr_core.scan.cleaning import clean
from vsr_core.scan.contact_shape import ContactShape, contact_shape
from vsr_core.scan.thinning import thinned_out
from vsr_core.scan.weighing import Refused, Seen, measured, refusing
from vsr_core.scan.whole_rock import WholeRock
from vsr_core.terrain.surface import Terrain

AS_IN_ITS_FILE = PoseConfig(position=(0.0, 0.0, 0.0))


@dataclass(frozen=True, eq=False)
class Placed:
    """A rock on its terrain, in the site's frame.

    Attributes
    ----------
    rock : trimesh.Trimesh [m], closed
    origin : ndarray, shape (3,) [m], of the site's frame in the terrain's coordinates
    gap : float [m], by which the rock can be lowered until it meets the ground; an overlap if < 0
    turned : float [rad], by its fall
    contact : ContactShape, what of the rock touches the terrain, in the site's frame
    """

    rock: trimesh.Trimesh
    terrain: Terrain
    origin: Array
    gap: float
    turned: float
    contact: ContactShape
    notes: tuple[str, ...]


def make(work: Work, rock: RockConfig, source: Source, ground: GroundFile) -> Product:
    """Close the rock, put it on the terrain, and say how far the two are apart."""
    with Steps(work.stage, work.log) as steps:
        whole = scan_alone.closed(source, rock.closing, work.origin, steps.tell)
        steps.tell("putting the rock on the terrain")
        placed = _placed(work.origin, rock, whole, ground)
        solid = measured(whole.rock, rock.density)
        about = _about(placed, ground)
        page = closed_rock.drawn(
            work.origin.name, source, rock.closing, whole, solid, steps.tell, about
        )
    dataset = _dataset(placed)
    label = f"{source.label}; terrain: {ground.label}"
    dataset.attrs |= source.attributes | {
        "shape_source": label,
        "accepted": 1,
        "repaired": "; ".join(whole.repaired),
        "gap_m": placed.gap,
        "turned_by_fall_deg": np.degrees(placed.turned),
    }
    files = {PlacedData.FILE: netcdf(described(dataset, work, "Rock and terrain"))}
    of_ground = "; ".join((f"ground of {len(placed.terrain.faces)} faces", *placed.notes))
    note = f"{_told(placed)}; {of_ground}"
    return Product(files | {SCAN_PAGE: page}, note)


def _about(placed: Placed, ground: GroundFile) -> scan_page.Row:
    """What the page says of the terrain."""
    figure = scan_figures.on_its_ground(placed.rock, placed.terrain, ground.label)
    rock = placed.rock
    apart = gaps(np.array(rock.vertices), np.array(rock.faces), placed.terrain)
    return {
        "error": 1e3 * max(abs(placed.gap), apart.overlap),
        "gaps": apart,
        "map": png_uri(gap_map(apart, [], ground.label)),
        "lies": _told(placed),
        "source": ground.label,
        "notes": (*placed.notes, f"contact: {placed.contact.told}"),
        "picture": png_uri(figure),
    }


def _told(placed: Placed) -> str:
    """How a rock lies, in words."""
    apart = "above the ground" if placed.gap >= 0.0 else "in the ground"
    fallen = f", turned {np.degrees(placed.turned):.1f} deg by its fall" if placed.turned else ""
    return f"the rock lies {1e3 * abs(placed.gap):.1f} mm {apart}{fallen}"


def _placed(origin: Origin, rock: RockConfig, whole: WholeRock, file: GroundFile) -> Placed:
    """The rock in its pose, beside which the ground is checked."""
    raw = sources.load_ground(file, origin)
    pose = rock.pose or AS_IN_ITS_FILE
    key = "rock.pose" if rock.pose else "pedestal.mesh"
    try:
        with refusing(lambda: Seen.nothing_of(raw)):
            cleaned = thinned_out(clean(raw))
    except Refused as error:
        where = f"{origin.file_of('pedestal.mesh')}: pedestal.mesh"
        raise InputError.from_invalid(where, file.name, error) from None
    ground = Terrain(np.array(cleaned.mesh.vertices), np.array(cleaned.mesh.faces, np.int64))
    turn = Rotation.from_quat(pose.quaternion)
    points = turn.apply(np.array(whole.rock.vertices) + whole.offset)
    points += np.array(pose.position) - cleaned.offset
    mesh = trimesh.Trimesh(points, whole.rock.faces, process=False)

    def seen() -> Seen:
        return Seen(ground.vertices, ground.faces, cleaned.offset, {})

    try:
        with refusing(seen):
            mesh, turned, gap = _lying(mesh, rock.density, ground, drop=pose.drop)
    except InvalidInput as error:
        raise InputError.from_invalid(origin.file_of(key), key, error) from None
    shift = -np.append(mesh.center_mass[:2], mesh.vertices[:, 2].min())
    mesh.apply_translation(shift)
    terrain = Terrain(ground.vertices + shift, ground.faces)
    try:
        with refusing(seen):
            seen_all = np.zeros(len(terrain.faces), dtype=bool)
            touching = contact_shape(
                mesh, terrain, seen_all, rock.contact_shape, rock.contact_error
            )
    except Refused as error:
        key = "rock.contact_shape"
        raise InputError.from_invalid(origin.file_of(key), key, error) from None
    return Placed(mesh, terrain, cleaned.offset - shift, gap, turned, touching, cleaned.notes)


def _lying(
    mesh: trimesh.Trimesh, density: float, ground: Terrain, *, drop: bool
) -> tuple[trimesh.Trimesh, float, float]:
    """The rock where it lies, by how much its fall turned it [rad], and the gap beneath it [m]."""
    body = solid.from_mesh(mesh, density, as_scanned=True).rock
    centre = np.array(mesh.center_mass)
    placing.require_ground(ground, body.vertices + centre)
    turned = 0.0
    if drop:
        rest = dropped(body, ground, *centre[:2])
        turned = Rotation.from_matrix(rest.rotation).magnitude()
        points = (np.array(mesh.vertices) - centre) @ rest.rotation.T + rest.position
        mesh = trimesh.Trimesh(points, mesh.faces, process=False)
        body, centre = solid.from_mesh(mesh, density, as_scanned=True).rock, rest.position
    corners = body.vertices + centre
    placing.require_ground(ground, corners)
    gap = placing.require_contact(ground, corners, body.radius)
    placing.set_down(ground, corners, corners, body.radius)  # refused before anything is written
    return mesh, float(turned), gap


def _dataset(placed: Placed) -> xr.Dataset:
    made = xr.Dataset(
        {
            "rock_vertex": (("rock_corner", "xyz"), np.array(placed.rock.vertices)),
            "rock_face": (("rock_triangle", "three"), np.array(placed.rock.faces, np.int32)),
            "terrain_vertex": (("terrain_corner", "xyz"), placed.terrain.vertices),
            "terrain_face": (("terrain_triangle", "three"), placed.terrain.faces.astype(np.int32)),
        },
        attrs={"origin_in_scan": placed.origin},
    )
    contact = placed.contact
    stored = of_contact(contact.pieces, contact.error, contact.told)
    return made.merge(stored, combine_attrs="no_conflicts")
