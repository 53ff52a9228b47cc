"""Rock and ground of one scan, separated along a seam, whose vertices move to where the two meet.

A scan rounds a hollow off by about an edge, its seam follows edges as they come, and each vertex
has its noise. But the rock's side and the ground beside the seam are known from many faces: each
vertex of the seam is moved to where the two, locally planes, meet.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import trimesh
from scipy.spatial import cKDTree
from trimesh.graph import connected_component_labels

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.errors import InvalidInput, InvalidPlace
from vsr_core.rock.triangles import areas
from vsr_core.scan.concave import Turns, smoothed_normals, turns
from vsr_core.scan.cuts import Cut, split
from vsr_core.scan.topology import border, chains, edges, ends, means_beside, touching


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


def by_cut(mesh: trimesh.Trimesh, cut: Cut, near: Array | None = None) -> Separation:
    """Rock and ground by a user's cut through a clean scan.

    Parameters
    ----------
    cut : Plane, Box, Polygon or Colour, in the mesh's coordinates
    near : ndarray, shape (3,) [m], a point on the rock, where the cut parts several from the ground

    Raises
    ------
    InvalidInput
        If the cut leaves no rock or no ground, touches the border of the scan, or leaves the face
        nearest to the point to the ground.
    """
    vertices, faces, rock = split(mesh, cut)
    on_rock = None if near is None else nearest(vertices[faces].mean(axis=1), near)
    rock, notes = whole(vertices, faces, rock, on_rock)
    found = seams(vertices, faces, rock, turns(vertices, faces))
    return Separation(vertices, faces, rock, found, 1.0, notes)


def nearest(middle: Array, point: Array) -> int:
    """Which of faces, by their middles of shape (m, 3) [m], is nearest to a point."""
    return int(np.argmin(np.linalg.norm(middle - point, axis=1)))


def whole(
    vertices: Array, faces: Indices, rock: Mask, on_rock: int | None = None
) -> tuple[Mask, tuple[str, ...]]:
    """Rock in one piece without islands of ground: the largest piece of what is given.

    Parameters
    ----------
    on_rock : int, a face whose piece it is in place of the largest; of a face on an island of
        ground, the one rock around it

    Returns
    -------
    rock : ndarray of bool, shape (m,)

    Raises
    ------
    InvalidInput
        If there is no rock, no ground, the rock reaches the border of the scan, or that face is of
        the ground.
    """
    area = areas(vertices, faces)
    outer = at_border(faces)
    if not rock.any():
        raise InvalidInput("a cut that leaves no rock", "part of the scan is rock", "move the cut")
    side = edges(faces).pairs
    one, other = side.T // 3

    def pieces(alike: Mask) -> Indices:
        """Numbers of the pieces of faces that hang together by some of the sides."""
        return connected_component_labels((side // 3)[alike], len(faces))

    def touched(part: Mask) -> Mask:
        """Faces on both sides of the edge of a part."""
        found = np.zeros(len(faces), dtype=bool)
        found[(side // 3)[part[one] != part[other]]] = True
        return found

    before, given, chosen = rock, None, on_rock
    if on_rock is not None and not rock[on_rock]:  # an island in rock, or between several rocks
        piece = pieces(rock[one] == rock[other])
        outside = np.isin(piece, piece[outer & ~rock])
        outermost = np.isin(piece, piece[rock & (outer | touched(outside))])
        within = ~(outside | outermost)
        together = pieces(within[one] & within[other])
        island = within & (together == together[on_rock])
        around = np.unique(piece[touched(island) & ~island])
        if len(around) == 1:
            rock, chosen = piece == around[0], None
    while given is None or (rock != given).any():
        given = rock
        rock = _one_piece(faces, side, area, rock, chosen)
        if (rock & outer).any():
            raise InvalidInput(
                "a cut that touches the border of the scan",
                "the ground surrounds the rock",
                "move the cut, or scan more of the ground",
            )
        piece = pieces(rock[one] == rock[other])
        rock = ~np.isin(piece, piece[outer])
    if on_rock is not None and not rock[on_rock]:
        raise InvalidInput(
            "a cut that leaves pedestal.point_on_rock to the ground",
            "the point lies on the rock",
            "move the cut, or the point",
        )
    lost, won = area[before & ~rock].sum(), area[rock & ~before].sum()
    notes = [f"{lost:.2g} m2 cut off beside the rock left to the ground"] if lost > 0.0 else []
    if won > 0.0:
        notes.append(f"{won:.2g} m2 of ground within the rock made rock")
    return rock, tuple(notes)


def at_border(faces: Indices) -> Mask:
    """Faces at the border of a scan, which are ground.

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


def _one_piece(faces: Indices, side: Indices, area: Array, rock: Mask, on_rock: int | None) -> Mask:
    """The part of the rock that holds a face, or the largest.

    It hangs together by more than an edge across it.
    An edge from seam to seam would be an edge of the surface that closes the rock as well.
    """
    one, other = side.T // 3
    links = ends(faces, side[:, 0])
    across = np.isin(links, links[rock[one] != rock[other]]).all(axis=1)
    held = rock[one] & rock[other] & ~across
    piece = connected_component_labels((side // 3)[held], len(area))
    if on_rock is None:
        return rock & (piece == np.argmax(np.bincount(piece[rock], weights=area[rock])))
    return rock & (piece == piece[on_rock])


def seams(vertices: Array, faces: Indices, rock: Mask, found: Turns) -> tuple[Seam, ...]:
    """Loops between rock and ground."""
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


_REACH = 2.5  # width, in edges, of the weight that faces have on the plane beside a seam
_NO_MORE = 16.0  # edges, beyond which that weight is nothing
_LARGEST_MOVE = 2.0  # edges by which a vertex moves at most: further off, a plane says nothing
_FACES = 48  # nearest faces looked at on each side
_SHIFTS = 10  # rounds in which the plane beside a point settles on like faces
_ALIKE = 0.25  # width, in |difference of normals|, of the weight of faces of another plane
_MEET = 0.94  # cosine between normals beyond which planes meet nowhere in particular


SEAM_MOVED = "seam moved"


def settled(separation: Separation) -> Separation:
    """The same with the vertices of the seams where rock and ground meet.

    The weights of the faces fall with distance and with the difference of their normals from the
    mean (Zheng et al. 2011), so that a corner of the rock is not averaged away. Faces at the seam
    itself count for neither side; vertices beside it are laid onto their side's plane.
    """
    vertices, faces = separation.vertices, separation.faces
    loop = np.concatenate([seam.loop for seam in separation.seams])
    sides = [faces[separation.rock], faces[~separation.rock]]
    # The side of the equilateral triangle of the mean area beside the seam.
    mean = areas(vertices, faces[touching(faces, loop)]).mean()
    edge = float(np.sqrt(4.0 / np.sqrt(3.0) * mean))
    planes = [planes_beside(vertices, side, loop, vertices[loop], edge) for side in sides]
    step = _to_both(vertices[loop], *planes[0], *planes[1], _LARGEST_MOVE * edge)
    for side in sides:
        vertices = laid(vertices, side, loop, step, edge)
    vertices[loop] += step
    length = np.linalg.norm(step, axis=1)
    return replace(
        separation,
        vertices=vertices,
        seams=tuple(replace(seam, points=vertices[seam.loop]) for seam in separation.seams),
        notes=(
            *separation.notes,
            f"{SEAM_MOVED} to where rock and ground meet, by {1e3 * np.median(length):.1f} mm in "
            f"the median, at most {1e3 * length.max():.1f} mm",
        ),
    )


def planes_beside(
    vertices: Array, faces: Indices, loop: Indices, points: Array, edge: float
) -> tuple[Array, Array]:
    """Planes of a surface beside points.

    Parameters
    ----------
    loop : ndarray of int, vertices whose faces do not count
    points : ndarray, shape (p, 3) [m]
    edge : float [m], length of the mesh's edges

    Returns
    -------
    centre : ndarray, shape (p, 3) [m], on each plane
    normal : ndarray, shape (p, 3), of unit length

    Raises
    ------
    InvalidPlace
        If all of its faces touch the loop.
    """
    faces = faces[~touching(faces, loop)]
    if not len(faces):
        raise InvalidPlace(
            "a rock or ground all of whose faces touch the seam",
            "its sides are known from faces beyond the seam",
            "scan in triangles smaller than the rock, or move pedestal.cut where there is one",
            [points.mean(axis=0)],
        )
    middle = vertices[faces].mean(axis=1)
    reach = _NO_MORE * edge
    within = (middle > points.min(axis=0) - reach) & (middle < points.max(axis=0) + reach)
    near = within.all(axis=1)
    if near.sum() > _FACES:
        faces, middle = faces[near], middle[near]
    used, local = np.unique(faces, return_inverse=True)
    normal = smoothed_normals(vertices[used], local, 2)
    area = areas(vertices, faces)
    away, near = cKDTree(middle).query(points, 1 + np.arange(min(_FACES, len(faces))))
    weight = area[near] * (np.exp(-0.5 * (away / (_REACH * edge)) ** 2) + 1e-12)
    own = weight
    for _ in range(_SHIFTS):
        mean = np.einsum("pk,pkj->pj", own, normal[near])
        mean /= np.linalg.norm(mean, axis=1, keepdims=True)
        unlike = np.linalg.norm(normal[near] - mean[:, None], axis=2)
        own = weight * np.exp(-0.5 * (unlike / _ALIKE) ** 2)
    centre = np.einsum("pk,pkj->pj", own, middle[near]) / own.sum(axis=1, keepdims=True)
    return centre, mean


def _to_both(points: Array, c: Array, n: Array, d: Array, m: Array, farthest: float) -> Array:
    """Shortest steps from points to the lines in which planes (c, n) and (d, m) meet, (p, 3) [m].

    0 where the planes are about parallel, or meet beyond ``farthest`` [m].
    """
    first = np.einsum("ij,ij->i", c - points, n)
    second = np.einsum("ij,ij->i", d - points, m)
    cosine = np.einsum("ij,ij->i", n, m)
    meet = np.abs(cosine) < _MEET
    square = np.where(meet, 1.0 - cosine**2, 1.0)
    along_n = np.where(meet, first - cosine * second, 0.0) / square
    along_m = np.where(meet, second - cosine * first, 0.0) / square
    step = along_n[:, None] * n + along_m[:, None] * m
    return step * (np.linalg.norm(step, axis=1, keepdims=True) <= farthest)


def laid(vertices: Array, faces: Indices, loop: Indices, step: Array, edge: float) -> Array:
    """Vertices of a surface beside a loop that moves, laid onto the surface's planes there.

    They follow the loop by half first, lest faces fold.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3) [m], with the loop not yet moved
    faces : ndarray of int, shape (m, 3), of the surface on one side of the loop
    loop : ndarray of int, shape (p,)
    step : ndarray, shape (p, 3) [m], of the loop's vertices
    edge : float [m], length of the mesh's edges
    """
    moved = np.full(vertices.shape, np.nan)
    moved[loop] = step
    beside = np.setdiff1d(faces[touching(faces, loop)], loop)
    points = vertices[beside] + 0.5 * means_beside(faces, moved, beside)
    centre, normal = planes_beside(vertices, faces, loop, points, edge)
    off = np.einsum("ij,ij->i", centre - points, normal)
    off[np.abs(off) > _LARGEST_MOVE * edge] = 0.0
    vertices = vertices.copy()
    vertices[beside] = points + off[:, None] * normal
    return vertices
