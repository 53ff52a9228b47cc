"""A scan of a rock alone made a closed solid: cleaned, its holes closed, each of them told."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import get_args

import numpy as np
import trimesh

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.errors import InvalidPlace
from vsr_core.rock.solid import NoSolidYet, checked
from vsr_core.scan.cleaning import clean, with_area
from vsr_core.scan.closing import Closing, at, close
from vsr_core.scan.fill import area_vector, frame
from vsr_core.scan.holes import (
    LARGEST_HOLE,
    Hole,
    bulge,
    holes_of,
    triangles_across,
    without_chords,
    without_slits,
)
from vsr_core.scan.refusal import Seen, refusing
from vsr_core.scan.separation import Separation
from vsr_core.scan.weighing import Measure, Tell, Trial, tipping_angles, tried


@dataclass(frozen=True, eq=False)
class WholeRock:
    """A rock as a closed solid.

    Attributes
    ----------
    rock : trimesh.Trimesh [m], closed and outward
    added : ndarray of bool, its faces that the scan did not see
    vertices : ndarray, shape (n, 3) [m], of the clean scan
    faces : ndarray of int, shape (m, 3), of the clean scan, with its holes open
    offset : ndarray, shape (3,) [m], the scan's coordinates are those here plus these
    """

    rock: trimesh.Trimesh
    added: Mask
    repaired: tuple[str, ...]
    vertices: Array
    faces: Indices
    holes: tuple[Hole, ...]
    offset: Array


def whole_rock(mesh: trimesh.Trimesh, closing: Closing, tell: Tell) -> WholeRock:
    """Closed solid of a scan of a rock alone.

    A mesh that is one already is taken as it is. Else it is cleaned (see ``clean``); holes up to
    ``LARGEST_HOLE`` of its size are filled between the vertices of their rims; the opening on
    which it stood, of whatever size, is closed as that of a rock on a terrain is (see ``close``).

    Parameters
    ----------
    mesh : trimesh.Trimesh [m], z up
    closing : "caps", "hull" or "poisson", of the opening beneath

    Raises
    ------
    Refused
        If it cannot be cleaned or closed, has a larger hole, or is no solid then.
    """
    tell("checking the surface")
    with refusing(Seen.nothing_of(mesh)):
        try:
            rock, repaired = checked(mesh)
            faces, none = np.array(rock.faces, dtype=np.int64), np.zeros(len(rock.faces), bool)
            return WholeRock(rock, none, repaired, np.array(rock.vertices), faces, (), np.zeros(3))
        except NoSolidYet:
            cleaned = clean(mesh, alone=True)
    vertices, faces = np.array(cleaned.mesh.vertices), np.array(cleaned.mesh.faces, dtype=np.int64)
    vertices, faces = without_chords(vertices, without_slits(vertices, faces))
    all_rock = {"rock": np.ones(len(faces), dtype=bool)}
    with refusing(Seen(vertices, faces, cleaned.offset, all_rock)):
        holes = _closable(vertices, faces)
        tell(f"closing the rock, holes: {len(holes)}")
        solid, added, notes = _closed(vertices, faces, holes, closing)
    notes = (*cleaned.notes, *notes)
    return WholeRock(solid, added, notes, vertices, faces, holes, cleaned.offset)


def _rough(rim: Array) -> float:
    """Area of a rim times the scatter of its points about their mean plane [m^3]."""
    inward = area_vector(rim)
    height = frame(rim, inward).into(rim)[:, 2]
    return float(np.linalg.norm(inward) * height.std())


def _closable(vertices: Array, faces: Indices) -> tuple[Hole, ...]:
    """Holes, none of them too wide."""
    size = float(np.ptp(vertices, axis=0).max())
    holes = holes_of(vertices, faces)
    wide = [h for h in holes if not h.beneath and h.width > LARGEST_HOLE * size]
    if wide:
        others = f" and {len(wide) - 1} more" if len(wide) > 1 else ""
        raise InvalidPlace(
            f"a hole {max(h.width for h in wide):.2g} m wide{others}",
            f"holes up to {LARGEST_HOLE:.0%} of the rock's size, {LARGEST_HOLE * size:.2g} m, are "
            "closed, and the opening on which it stood",
            "scan that side too, or fill the hole in the scan",
            np.array([h.place for h in sorted(wide, key=lambda hole: -hole.width)]),
        )
    return holes


def _closed(
    vertices: Array, faces: Indices, holes: tuple[Hole, ...], closing: Closing
) -> tuple[trimesh.Trimesh, Mask, tuple[str, ...]]:
    """The surface with its holes closed, which of its faces are new, and what was done."""
    filled = [triangles_across(vertices, hole.rim) for hole in holes if not hole.beneath]
    notes = []
    if filled:
        notes.append(f"holes filled between the vertices of their rims: {len(filled)}")
    triangles = vertices[np.concatenate([np.empty((0, 3), np.int64), *filled])]
    whole = with_area(vertices, np.concatenate([faces, *filled]), notes)
    if any(hole.beneath for hole in holes):
        closed = close(alone(vertices, whole), closing)
        added = closed.added | at(closed.rock, triangles)
        return closed.rock, added, (*notes, *closed.notes)
    rock, repaired = checked(trimesh.Trimesh(vertices, whole, process=False))
    return rock, at(rock, triangles), (*notes, *repaired)


def alone(vertices: Array, faces: Indices) -> Separation:
    """A surface all of which is rock.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3) [m]
    faces : ndarray of int, shape (m, 3)
    """
    return Separation(vertices, faces, np.ones(len(faces), dtype=bool), (), 1.0, ())


@dataclass(frozen=True, eq=False)
class Unseen:
    """What closing a hole leaves uncertain.

    Attributes
    ----------
    volume : float [m^3], that may be wrong: of a hole, that of a surface that goes on across it as
        it is beside it (see ``bulge``); of the opening beneath, its area times the scatter of its
        rim about a plane
    tipping : float [rad], largest change of a static tipping angle by that surface; nan of the
        opening beneath, which other closings tell (see ``other_closings``)
    """

    hole: Hole
    volume: float
    tipping: float


def unseen(whole: WholeRock, chosen: Measure) -> Iterator[Unseen]:
    """What each hole leaves uncertain."""
    points = np.array(whole.rock.vertices)
    for hole in whole.holes:
        if hole.beneath:
            yield Unseen(hole, _rough(whole.vertices[hole.rim]), np.nan)
            continue
        more = bulge(whole.vertices, whole.faces, hole)
        share = more.volume / (chosen.volume + more.volume)
        centre = (1.0 - share) * chosen.centre_of_mass + 0.5 * share * (hole.place + more.top)
        angles = tipping_angles(np.concatenate([points, more.top[None]]) - centre)
        yield Unseen(hole, more.volume, float(np.abs(angles - chosen.tipping).max()))


def other_closings(
    whole: WholeRock, closing: Closing, chosen: Measure, density: float
) -> tuple[Trial, ...]:
    """The opening beneath closed in other ways; none where the scan has no such opening.

    Parameters
    ----------
    density : float [kg/m^3]
    """
    if not any(hole.beneath for hole in whole.holes):
        return ()

    def rock(name: Closing) -> trimesh.Trimesh:
        return _closed(whole.vertices, whole.faces, whole.holes, name)[0]

    names = [name for name in get_args(Closing) if name != closing]
    return tuple(tried(name, partial(rock, name), chosen, density) for name in names)
