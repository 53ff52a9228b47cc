"""Rock and ground told apart in one scan: by a user's cut, and what a seam is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.errors import InvalidInput
from vsr_core.scan.cleaning import areas
from vsr_core.scan.concave import Turns, cheapest_cut, turns
from vsr_core.scan.cuts import Cut, split
from vsr_core.scan.topology import at_border, chains, edges, ends, pieces


@dataclass(frozen=True, eq=False)
class Seam:
    """A closed loop between rock and ground.

    Attributes
    ----------
    loop : ndarray of int, shape (n,), vertices in order, the rock to their left
    points : ndarray, shape (n, 3) [m], where they are in the scan
    length : float [m]
    concave : float, share of its length along a clear hollow
    """

    loop: Indices
    points: Array
    length: float
    concave: float


@dataclass(frozen=True, eq=False)
class Separation:
    """A scan whose faces are rock or ground.

    Attributes
    ----------
    vertices : ndarray, shape (n, 3) [m]
    faces : ndarray of int, shape (m, 3)
    rock : ndarray of bool, shape (m,)
    seams : tuple of Seam, the longest first
    confidence : float, 0 to 1: 1 for a cut that was given; for a proposed seam see ``propose``
    notes : tuple of str
    settled : bool, whether the seams lie where rock and ground would meet (see ``rim``)
    """

    vertices: Array
    faces: Indices
    rock: Mask
    seams: tuple[Seam, ...]
    confidence: float
    notes: tuple[str, ...]
    settled: bool = False


def by_cut(mesh: trimesh.Trimesh, cut: Cut, reach: float = 0.0) -> Separation:
    """Rock and ground by a user's cut through a clean scan.

    Parameters
    ----------
    mesh : trimesh.Trimesh [m]
    cut : Plane, Box, Polygon or Colour, in the mesh's coordinates
    reach : float [m]
        0 takes the cut as it is; else the seam moves to the hollow nearby, by at most this.

    Raises
    ------
    InvalidInput
        If the cut leaves no rock or no ground, or touches the border of the scan.
    """
    if reach > 0.0:
        vertices, faces = np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int64)
        rock = cut.inside(mesh)[faces].sum(axis=1) > 0.0
    else:
        vertices, faces, rock = split(mesh, cut)
    rock, notes = whole(vertices, faces, rock)
    found = turns(vertices, faces)
    if reach > 0.0:
        rock = _to_the_hollow(vertices, faces, rock, found, reach)
        rock, more = whole(vertices, faces, rock)
        notes += more
    return Separation(vertices, faces, rock, seams(vertices, faces, rock, found), 1.0, notes)


def whole(vertices: Array, faces: Indices, rock: Mask) -> tuple[Mask, tuple[str, ...]]:
    """Rock in one piece without islands of ground: the largest piece of what is given.

    Raises
    ------
    InvalidInput
        If there is no rock, no ground, or the rock reaches the border of the scan.
    """
    area = areas(vertices, faces)
    outer = at_border(faces, len(vertices))
    if not outer.any():
        raise InvalidInput(
            "a scan without a rim",
            "rock and ground form one open surface",
            "use a closed rock as it is",
        )
    if not rock.any():
        raise InvalidInput("a cut that leaves no rock", "part of the scan is rock", "move the cut")
    side = edges(faces).pairs
    before, given = rock, None
    while given is None or (rock != given).any():
        given = rock
        rock = _largest(faces, side, area, rock)
        if (rock & outer).any():
            raise InvalidInput(
                "a cut that touches the border of the scan",
                "the ground surrounds the rock",
                "move the cut, or scan more of the ground",
            )
        one, other = side.T // 3
        piece = pieces((side // 3)[rock[one] == rock[other]], len(faces))
        rock = ~np.isin(piece, piece[outer])
    lost, won = area[before & ~rock].sum(), area[rock & ~before].sum()
    notes = [f"{lost:.2g} m2 cut off beside the rock left to the ground"] if lost > 0.0 else []
    if won > 0.0:
        notes.append(f"{won:.2g} m2 of ground within the rock made rock")
    return rock, tuple(notes)


def _largest(faces: Indices, side: Indices, area: Array, rock: Mask) -> Mask:
    """The largest part of the rock that hangs together by more than an edge across it.

    An edge from seam to seam would be an edge of the surface that closes the rock as well.
    """
    one, other = side.T // 3
    links = ends(faces, side[:, 0])
    at_seam = np.zeros(int(faces.max()) + 1, dtype=bool)
    at_seam[links[rock[one] != rock[other]]] = True
    held = rock[one] & rock[other] & ~at_seam[links].all(axis=1)
    piece = pieces((side // 3)[held], len(area))
    return rock & (piece == int(np.argmax(np.bincount(piece[rock], weights=area[rock]))))


def seams(vertices: Array, faces: Indices, rock: Mask, found: Turns) -> tuple[Seam, ...]:
    """Loops between rock and ground, the longest first."""
    one, other = found.faces.T
    between = np.flatnonzero(rock[one] != rock[other])
    side = np.where(rock[one[between]], found.side[between, 0], found.side[between, 1])
    links = ends(faces, side)
    hollow = found.hollow[between]
    made = []
    for loop in chains(links):
        own = np.isin(links[:, 0], loop)
        length = float(found.length[between][own].sum())
        concave = float(found.length[between][own & hollow].sum()) / length
        made.append(Seam(loop, vertices[loop], length, concave))
    return tuple(sorted(made, key=lambda seam: -seam.length))


def _to_the_hollow(vertices: Array, faces: Indices, rock: Mask, found: Turns, reach: float) -> Mask:
    """The cheapest seam within ``reach`` of a cut."""
    one, other = found.faces.T
    between = rock[one] != rock[other]
    start, end = ends(faces, found.side[between, 0]).T
    middle = 0.5 * (vertices[start] + vertices[end])
    away = cKDTree(middle).query(vertices[faces].mean(axis=1), distance_upper_bound=reach)[0]
    near = np.isfinite(away)
    ground = ~rock & (~near | at_border(faces, len(vertices)))
    if not (rock & ~near).any() or not ground.any():
        raise InvalidInput(
            f"a seam sought within {reach} m of the cut",
            "part of the rock and of the ground lie further away",
            "seek it within less",
        )
    return cheapest_cut(found, len(faces), rock & ~near, ground)
