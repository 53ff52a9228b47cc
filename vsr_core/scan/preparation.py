"""From a raw scan to a rock and the ground that it stands on, each step weighed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from vsr_core.arrays import Array, Mask
from vsr_core.errors import InvalidInput
from vsr_core.rock.reduction import in_flight, on_its_seat
from vsr_core.rock.solid import from_mesh
from vsr_core.scan.alternatives import Alternative, alternatives
from vsr_core.scan.cleaning import Cleaned, clean
from vsr_core.scan.closing import Closed, Closing, close
from vsr_core.scan.cuts import Cut
from vsr_core.scan.distance import hausdorff
from vsr_core.scan.ground_beneath import depth_in, ground_beneath
from vsr_core.scan.proposal import propose
from vsr_core.scan.rim import settled
from vsr_core.scan.separation import Separation, by_cut
from vsr_core.scan.weighing import Measure, Step, largest_change, measured, tipping_angles
from vsr_core.terrain.surface import Terrain

_START_TOLERANCE = 1e-6  # m: a rock this deep in the ground is rounding and no interpenetration
_SAME_FACE = 1e-6  # m: faces whose middles agree to this are one


class Miscut(InvalidInput):
    """A refusal that another cut may cure."""


@dataclass(frozen=True)
class Trial:
    """Another closing, to see what an unseen underside does to the result.

    Attributes
    ----------
    closing : str
    measure : Measure, or None where it failed
    moved : float [m], of the centre of mass from that of the closing chosen
    tipping_change : float [rad], largest change of a static tipping angle against it
    reason : str, why it failed
    """

    closing: str
    measure: Measure | None
    moved: float
    tipping_change: float
    reason: str


@dataclass(frozen=True, eq=False)
class Prepared:
    """A rock on its terrain.

    Attributes
    ----------
    rock : trimesh.Trimesh [m], closed, in the site's frame
    added : ndarray of bool, its faces that the scan did not see
    terrain : Terrain, in the site's frame
    seat : ndarray of bool, its faces beneath the rock, which the scan did not see
    origin : ndarray, shape (3,) [m], of the site's frame in the scan's coordinates
    separation : Separation, in the coordinates of the clean scan
    proposed : bool, whether the cut was proposed, and not given
    alternatives : tuple of Alternative, cuts that could take its place, in the scan's coordinates
    closing : str, how the rock was closed
    shift : ndarray, shape (3,) [m], from the clean scan's coordinates to the site's frame
    steps : tuple of Step
    trials : tuple of Trial, the other closings
    notes : tuple of str
    """

    rock: trimesh.Trimesh
    added: Mask
    terrain: Terrain
    seat: Mask
    origin: Array
    separation: Separation
    proposed: bool
    alternatives: tuple[Alternative, ...]
    closing: Closing
    shift: Array
    steps: tuple[Step, ...]
    trials: tuple[Trial, ...]
    notes: tuple[str, ...]


def prepare_scan(
    mesh: trimesh.Trimesh,
    cut: Cut | None,
    *,
    near: tuple[float, float, float] | None = None,
    closing: Closing,
    density: float,
    clearance: float,
) -> Prepared:
    """Rock and terrain from a raw scan in metres, z up.

    Parameters
    ----------
    mesh : trimesh.Trimesh [m]
    cut : what of it is the rock, in its coordinates; None to propose the hollow around the rock
    near : three floats [m], a point on the rock, where several rocks stand on the ground
    closing : "caps", "hull" or "poisson"
    density : float [kg/m^3]
    clearance : float [m], between the rock and the ground beneath it

    Returns
    -------
    Prepared

    Raises
    ------
    Miscut
        If rock and ground cannot be separated so; see ``by_cut`` and ``propose``.
    InvalidInput
        If another step cannot be done; see ``clean``, ``close``, ``ground_beneath``.
    """
    cleaned = clean(mesh)
    try:
        separation = settled(_separated(cleaned, cut, near))
    except InvalidInput as error:
        raise Miscut(error.given, error.rule, error.remedy) from error
    closed = close(separation, closing)
    terrain, seat, notes = ground_beneath(separation, closed, clearance)
    depth = depth_in(terrain, closed.rock)
    if depth > _START_TOLERANCE:
        raise InvalidInput(
            f"a rock that starts {1e3 * depth:.3g} mm inside the ground",
            "rock and ground do not overlap",
            "move the cut, or widen pedestal.clearance",
        )
    shift = -np.append(closed.rock.center_mass[:2], closed.rock.vertices[:, 2].min())
    rock = closed.rock.copy()
    rock.apply_translation(shift)
    steps = tuple(_steps(mesh, cleaned, separation, closed, density, closing))
    solid = steps[2].after
    return Prepared(
        rock=rock,
        added=_added(closed),
        terrain=Terrain(terrain.vertices + shift, terrain.faces),
        seat=seat,
        origin=cleaned.offset - shift,
        separation=separation,
        proposed=cut is None,
        alternatives=tuple(
            replace(other, cut=other.cut.moved(cleaned.offset))
            for other in alternatives(cleaned.mesh, separation)
        ),
        closing=closing,
        shift=shift,
        steps=steps,
        trials=tuple(
            _trial(name, separation, solid, density)
            for name in get_args(Closing)
            if name != closing
        ),
        notes=(*cleaned.notes, *closed.notes, *notes),
    )


def _separated(
    cleaned: Cleaned, cut: Cut | None, near: tuple[float, float, float] | None
) -> Separation:
    if cut is None:
        return propose(cleaned.mesh, near, cleaned.offset)
    return by_cut(cleaned.mesh, cut.moved(-cleaned.offset))


def _added(closed: Closed) -> Mask:
    """Which faces of a closed rock are of its caps."""
    caps = np.concatenate([cap.faces for cap in closed.caps])
    middle = closed.vertices[caps].mean(axis=1)
    return np.asarray(cKDTree(middle).query(closed.rock.triangles_center)[0] < _SAME_FACE)


def _steps(
    raw: trimesh.Trimesh,
    cleaned: Cleaned,
    separation: Separation,
    closed: Closed,
    density: float,
    closing: Closing,
) -> Iterator[Step]:
    """What each step from the scan to the hulls that contact sees changed."""
    faces = separation.faces[separation.rock]
    patch = trimesh.Trimesh(separation.vertices, faces, process=False)
    patch.remove_unreferenced_vertices()
    own = closed.notes[len(separation.notes) :]
    whole, part, solid = (measured(m, density) for m in (cleaned.mesh, patch, closed.rock))
    yield Step("clean", measured(raw, density), whole, np.nan, cleaned.notes)
    yield Step("separate", whole, part, np.nan, separation.notes)
    yield Step(f"close ({closing})", part, solid, hausdorff(patch, closed.rock), own)
    yield from _hulls(closed.rock, solid)


def _hulls(rock: trimesh.Trimesh, solid: Measure) -> Iterator[Step]:
    """What contact sees of the rock: its hull, and fewer corners of it; the mass stays the same."""
    centre = np.array(rock.center_mass)
    body = from_mesh(rock, 1.0, as_scanned=True).rock
    excess = float(rock.convex_hull.volume / rock.volume) - 1.0
    before, surface = solid, rock
    for name, other, note in (
        (
            "hull for contact",
            body,
            f"contact takes the rock for its hull, of {excess:.1%} more volume",
        ),
        ("hull on the seat", on_its_seat(body), "all corners of the base stay"),
        ("hull in flight", in_flight(body), "once it has toppled"),
    ):
        hull = trimesh.Trimesh(other.vertices + centre).convex_hull
        after = replace(
            solid,
            faces=len(hull.faces),
            vertices=len(hull.vertices),
            tipping=tipping_angles(np.array(other.vertices)),
        )
        yield Step(name, before, after, hausdorff(surface, hull), (note,))
        before, surface = after, hull


def _trial(name: Closing, separation: Separation, chosen: Measure, density: float) -> Trial:
    try:
        other = measured(close(separation, name).rock, density)
    except InvalidInput as error:
        return Trial(name, None, np.nan, np.nan, error.given)
    moved = float(np.linalg.norm(other.centre_of_mass - chosen.centre_of_mass))
    return Trial(name, other, moved, largest_change(chosen, other), "")
