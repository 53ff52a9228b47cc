"""Rock and ground of one scan, separated along a seam by a user's cut."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from trimesh.graph import connected_component_labels

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.errors import InvalidInput
from vsr_core.rock.triangles import areas
from vsr_core.scan.concave import Turns, turns
from vsr_core.scan.cuts import Cut, split
from vsr_core.scan.topology import border, chains, edges, ends, touching


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
    confidence : float, 0 to 1: 1 for a cut that was given; for a proposed seam see ``propose``
    """

    vertices: Array
    faces: Indices
    rock: Mask
    seams: tuple[Seam, ...]
    confidence: float
    notes: tuple[str, ...]


def by_cut(mesh: trimesh.Trimesh, cut: Cut) -> Separation:
    """Rock and ground by a user's cut through a clean scan.

    Parameters
    ----------
    mesh : trimesh.Trimesh [m]
    cut : Plane, Box, Polygon or Colour, in the mesh's coordinates

    Raises
    ------
    InvalidInput
        If the cut leaves no rock or no ground, or touches the border of the scan.
    """
    vertices, faces, rock = split(mesh, cut)
    rock, notes = whole(vertices, faces, rock)
    found = seams(vertices, faces, rock, turns(vertices, faces))
    return Separation(vertices, faces, rock, found, 1.0, notes)


def whole(vertices: Array, faces: Indices, rock: Mask) -> tuple[Mask, tuple[str, ...]]:
    """Rock in one piece without islands of ground: the largest piece of what is given.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3) [m]
    faces : ndarray of int, shape (m, 3)
    rock : ndarray of bool, shape (m,)

    Returns
    -------
    rock : ndarray of bool, shape (m,)

    Raises
    ------
    InvalidInput
        If there is no rock, no ground, or the rock reaches the border of the scan.
    """
    area = areas(vertices, faces)
    outer = at_border(faces)
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
        piece = connected_component_labels((side // 3)[rock[one] == rock[other]], len(faces))
        rock = ~np.isin(piece, piece[outer])
    lost, won = area[before & ~rock].sum(), area[rock & ~before].sum()
    notes = [f"{lost:.2g} m2 cut off beside the rock left to the ground"] if lost > 0.0 else []
    if won > 0.0:
        notes.append(f"{won:.2g} m2 of ground within the rock made rock")
    return rock, tuple(notes)


def at_border(faces: Indices) -> Mask:
    """Faces at the border of a scan, which are ground.

    Parameters
    ----------
    faces : ndarray of int, shape (m, 3)

    Returns
    -------
    ndarray of bool, shape (m,)

    Raises
    ------
    InvalidInput
        If there are none.

    Examples
    --------
    >>> at_border(np.array([[0, 1, 2]])).tolist()
    [True]
    """
    outer = touching(faces, border(faces))
    if not outer.any():
        raise InvalidInput(
            "a scan without a rim",
            "rock and ground form one open surface",
            "use a closed rock as it is",
        )
    return outer


def _largest(faces: Indices, side: Indices, area: Array, rock: Mask) -> Mask:
    """The largest part of the rock that hangs together by more than an edge across it.

    An edge from seam to seam would be an edge of the surface that closes the rock as well.
    """
    one, other = side.T // 3
    links = ends(faces, side[:, 0])
    across = np.isin(links, links[rock[one] != rock[other]]).all(axis=1)
    held = rock[one] & rock[other] & ~across
    piece = connected_component_labels((side // 3)[held], len(area))
    return rock & (piece == int(np.argmax(np.bincount(piece[rock], weights=area[rock]))))


def seams(vertices: Array, faces: Indices, rock: Mask, found: Turns) -> tuple[Seam, ...]:
    """Loops between rock and ground.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3) [m]
    faces : ndarray of int, shape (m, 3)
    rock : ndarray of bool, shape (m,)
    """
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
