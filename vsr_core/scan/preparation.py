"""From a raw scan to a rock and the ground that it stands on, each step weighed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import get_args

import numpy as np
import trimesh

from vsr_core.arrays import Array, Mask
from vsr_core.rock.reduction import in_flight, on_its_seat
from vsr_core.rock.solid import from_mesh
from vsr_core.scan.cleaning import Cleaned, clean
from vsr_core.scan.closing import Closed, Closing, close
from vsr_core.scan.coarse_first import proposed
from vsr_core.scan.contact_shape import ContactShape, Wanted, contact_shape
from vsr_core.scan.cuts import Cut
from vsr_core.scan.filling import filled
from vsr_core.scan.ground_beneath import ground_beneath
from vsr_core.scan.proposal import Alternative, Undecided, alternatives
from vsr_core.scan.separation import Separation, by_cut, settled
from vsr_core.scan.thinning import thinned_out
from vsr_core.scan.weighing import (
    Measure,
    Refused,
    Seen,
    Step,
    Tell,
    Trial,
    hausdorff,
    measured,
    refusing,
    tipping_angles,
    tried,
)
from vsr_core.terrain.surface import Terrain


class Miscut(Refused):
    """A refusal that another cut may cure."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """A rock on its terrain.

    Attributes
    ----------
    rock : trimesh.Trimesh [m], closed, in the site's frame
    added : ndarray of bool, its faces that the scan did not see
    seat : ndarray of bool, its faces beneath the rock, which the scan did not see
    contact : ContactShape, what of the rock touches it, in the site's frame
    origin : ndarray, shape (3,) [m], of the site's frame in the scan's coordinates
    separation : Separation, in the coordinates of the clean scan
    alternatives : tuple of Alternative, cuts that could take its place, in the scan's coordinates
    shift : ndarray, shape (3,) [m], from the clean scan's coordinates to the site's frame
    """

    rock: trimesh.Trimesh
    added: Mask
    terrain: Terrain
    seat: Mask
    contact: ContactShape
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
    load: Callable[[], trimesh.Trimesh],
    cut: Cut | None,
    *,
    near: tuple[float, float, float] | None = None,
    closing: Closing,
    density: float,
    tell: Tell,
    contact: tuple[Wanted, float] = ("hull", 0.05),
) -> Prepared:
    """Rock and terrain from a raw scan in metres, z up.

    Parameters
    ----------
    load : function that gives the scan; it is kept no longer than needed, as scans are large
    cut : what of it is the rock, in its coordinates; None to propose the hollow around the rock
    near : three floats [m], a point on the rock, where several rocks stand on the ground
    density : float [kg/m^3]
    contact : what of the rock is to touch its terrain, and the error of pieces, as a share of the
        rock's radius; see ``contact_shape``

    Raises
    ------
    Miscut
        If rock and ground cannot be separated so; see ``by_cut`` and ``propose``.
    Refused
        If another step cannot be done; see ``clean``, ``close``, ``ground_beneath``,
        ``contact_shape``.
    """
    tell("cleaning the scan")
    mesh = load()
    raw = measured(mesh, density)
    with refusing(lambda: Seen.nothing_of(load())):
        cleaned = clean(mesh)
        del mesh
        cleaned = filled(thinned_out(cleaned))
    tell("telling rock and ground apart")
    separation = _separated(cleaned, cut, near)
    tell(f"closing the rock with {closing}")
    with refusing(lambda: _two_parts(separation, cleaned.offset)):
        closed = close(separation, closing)
    tell("laying the ground beneath the rock")
    with refusing(lambda: _three_parts(separation, closed, cleaned.offset)):
        terrain, seat, notes = ground_beneath(separation, closed)
    tell("weighing what each step changed")
    shift = -np.append(closed.rock.center_mass[:2], closed.rock.vertices[:, 2].min())
    rock = closed.rock.copy()
    rock.apply_translation(shift)
    steps = tuple(_steps(raw, cleaned, separation, closed, density, closing))
    solid = steps[2].after
    tell("finding what of the rock touches")
    terrain = Terrain(terrain.vertices + shift, terrain.faces)
    with refusing(lambda: _three_parts(separation, closed, cleaned.offset)):
        touching = contact_shape(rock, terrain, seat, *contact)
    tell("trying other cuts")
    point = None if near is None else np.array(near) - cleaned.offset
    others = alternatives(cleaned.mesh, separation, point)
    tell("trying other closings")
    trials = tuple(
        tried(name, partial(_rock, separation, name), solid, density)
        for name in get_args(Closing)
        if name != closing
    )
    return Prepared(
        rock=rock,
        added=closed.added,
        terrain=terrain,
        contact=touching,
        seat=seat,
        origin=cleaned.offset - shift,
        separation=separation,
        proposed=cut is None,
        alternatives=tuple(replace(other, cut=other.cut.moved(cleaned.offset)) for other in others),
        closing=closing,
        shift=shift,
        steps=steps,
        trials=trials,
        notes=(*cleaned.notes, *closed.notes, *notes),
    )


def _separated(
    cleaned: Cleaned, cut: Cut | None, near: tuple[float, float, float] | None
) -> Separation:
    """Rock and ground, their seam settled."""
    mesh, offset = cleaned.mesh, cleaned.offset

    def seen() -> Seen:
        return Seen(np.array(mesh.vertices), np.array(mesh.faces, np.int64), offset, {})

    with refusing(seen, Miscut):
        try:
            if cut is None:
                found = proposed(mesh, near, offset)
            else:
                point = None if near is None else np.array(near) - offset
                found = by_cut(mesh, cut.moved(-offset), point)
        except Undecided as error:
            raise Miscut(error, replace(seen(), parts=error.rocks)) from error
        return settled(found)


def _two_parts(separation: Separation, offset: Array) -> Seen:
    parts = {"rock": separation.rock, "ground": ~separation.rock}
    return Seen(separation.vertices, separation.faces, offset, parts)


def _three_parts(separation: Separation, closed: Closed, offset: Array) -> Seen:
    """What of a closed rock and the ground beside it is seen, and what was added."""
    caps = np.concatenate([cap.faces for cap in closed.caps])
    rock, none = separation.rock, np.zeros(len(caps), dtype=bool)
    parts = {
        "rock": np.append(rock, none),
        "ground": np.append(~rock, none),
        "added": np.append(np.zeros(len(rock), dtype=bool), ~none),
    }
    return Seen(closed.vertices, np.concatenate([separation.faces, caps]), offset, parts)


def _rock(separation: Separation, closing: Closing) -> trimesh.Trimesh:
    return close(separation, closing).rock


def _steps(
    raw: Measure,
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
    yield Step("clean", raw, whole, np.nan, cleaned.notes)
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
        (
            "hull on the seat",
            on_its_seat(body),
            "all corners of the base stay, and all of the rock where the seat is whole",
        ),
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
