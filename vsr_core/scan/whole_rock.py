"""A scan of a rock alone made a closed solid: cleaned, its holes closed, each of them told."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import get_args

import numpy as np
import trimesh

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.errors import InvalidPlace
from vsr_core.rock.solid import FLAT, LARGEST_LEVELLING, NoSolidYet, checked, flat
from vsr_core.rock.triangles import cross_products
from vsr_core.scan.cleaning import clean, with_area
from vsr_core.scan.closing import Closing, at, close
from vsr_core.scan.separation import Separation
from vsr_core.scan.thinning import MOST_FACES, thinned_out
from vsr_core.scan.topology import border, edges, ends, rims
from vsr_core.scan.underside import across, area_vector, frame, uncrossed
from vsr_core.scan.weighing import Measure, Seen, Tell, Trial, refusing, tipping_angles, tried

LARGEST_HOLE = 0.2
"""Width of a hole that is closed, as a share of the rock's longest side: on a sphere the surface
that triangles across it cut off holds 0.03 % of the volume."""

FOOT = 0.05
"""Share of the rock's height, from its lowest point, that the opening on which it stood reaches."""

_DOWN = math.cos(LARGEST_LEVELLING)  # of the angle from straight down of what faces down
_STEEPEST = math.radians(75.0)  # slope beyond which surfaces beside a hole hardly meet
_SLIT = 1e-6  # area of a hole over its width squared, below which its vertices lie on a line


@dataclass(frozen=True, eq=False)
class Hole:
    """A hole in the surface of a rock.

    Attributes
    ----------
    rim : ndarray of int, shape (n,), vertices in order, the surface to their left
    place : ndarray, shape (3,) [m], middle of the rim
    width : float [m], about the largest distance of two of its vertices
    beneath : bool, whether it is what the rock stood on: it faces down, reaches the foot, and is
        larger than what was seen of the base
    """

    rim: Indices
    place: Array
    width: float
    beneath: bool


def holes_of(vertices: Array, faces: Indices) -> tuple[Hole, ...]:
    """Holes of a surface, z up, that is closed elsewhere; that with most edges first."""
    low, high = vertices[:, 2].min(), vertices[:, 2].max()
    foot = low + FOOT * (high - low)
    sole = _sole(vertices, faces, foot)
    found = []
    for rim in rims(faces):
        points = vertices[rim]
        inward = area_vector(points)
        area = float(np.linalg.norm(inward))
        down = inward[2] >= _DOWN * area and area > sole
        beneath = bool(down and points[:, 2].min() <= foot)
        found.append(Hole(rim, points.mean(axis=0), _width(points), beneath))
    return tuple(found)


def _sole(vertices: Array, faces: Indices, foot: float) -> float:
    """Area of what was seen of a rock's base [m^2]: faces at its foot that look down."""
    low = faces[(vertices[faces, 2] <= foot).all(axis=1)]
    normal = cross_products(vertices, low)
    area = np.linalg.norm(normal, axis=1)
    return 0.5 * float(area[normal[:, 2] < -_DOWN * area].sum())


def _width(points: Array) -> float:
    """Largest distance of two of a loop's points, by going from one to the farthest in turn [m]."""
    at, width = points[0], 0.0
    for _ in range(4):
        away = np.linalg.norm(points - at, axis=1)
        at, width = points[int(np.argmax(away))], max(width, float(away.max()))
    return width


def without_slits(vertices: Array, faces: Indices) -> Indices:
    """Faces on one vertex where two of a rim without area lie at the same point."""
    name = np.arange(len(vertices))
    for rim in rims(faces):
        points = vertices[rim]
        if np.linalg.norm(area_vector(points)) <= _SLIT * _width(points) ** 2:
            _, first, same = np.unique(points, axis=0, return_index=True, return_inverse=True)
            name[rim] = rim[first[same.ravel()]]
    return name[faces]


def without_chords(vertices: Array, faces: Indices) -> tuple[Array, Indices]:
    """The same surface with a vertex in the middle of each edge between two vertices of rims.

    Such an edge would be an edge of a surface across the hole as well.

    Returns
    -------
    vertices : ndarray, shape (k, 3) [m], the given ones first
    faces : ndarray of int, shape (l, 3)

    Examples
    --------
    >>> square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    >>> points, faces = without_chords(square, np.array([[0, 1, 2], [0, 2, 3]]))
    >>> points[4:].tolist(), len(faces)
    ([[0.5, 0.5, 0.0]], 4)
    """
    while True:
        pairs = edges(faces).pairs
        open_ = np.unique(border(faces))
        pairs = pairs[np.isin(ends(faces, pairs[:, 0]), open_).all(axis=1)]
        if not len(pairs):
            return vertices, faces
        seen: set[int] = set()
        chosen = []  # no two of one face, which would be split in two ways
        for pair in pairs.tolist():
            both = {side // 3 for side in pair}
            if not both & seen:
                seen |= both
                chosen.append(pair)
        side = np.array(chosen)
        middle = len(vertices) + np.arange(len(side))
        start, end = ends(faces, side[:, 0]).T
        vertices = np.concatenate([vertices, 0.5 * (vertices[start] + vertices[end])])
        halves = []
        for column in side.T:
            face, corner = np.divmod(column, 3)
            one, other = ends(faces, column).T
            apex = faces[face, (corner + 2) % 3]
            halves += [np.column_stack([one, middle, apex]), np.column_stack([middle, other, apex])]
        keep = np.ones(len(faces), dtype=bool)
        keep[side.ravel() // 3] = False
        faces = np.concatenate([faces[keep], *halves])


def triangles_across(vertices: Array, rim: Indices) -> Indices:
    """Faces that fill a hole between the vertices of its rim, which stay where they are.

    Parameters
    ----------
    rim : ndarray of int, shape (k,), see ``Hole``

    Returns
    -------
    ndarray of int, shape (k - 2, 3), outward

    Raises
    ------
    InvalidInput
        If the rim crosses itself, seen along its normal, however it is smoothed.

    Examples
    --------
    >>> triangles_across(np.eye(3), np.array([0, 1, 2])).tolist()
    [[0, 2, 1]]
    """
    points = vertices[rim]
    inward = area_vector(points)
    if np.linalg.norm(inward) <= _SLIT * _width(points) ** 2:
        fan = [np.full(len(rim) - 2, rim[0]), rim[2:], rim[1:-1]]
        return np.column_stack(fan)
    level = uncrossed(frame(points, inward).into(points))
    return rim[across(level[:, :2], np.inf)[1]][:, ::-1]


@dataclass(frozen=True)
class Bulge:
    """What surfaces that go straight on from the rim of a hole would add to flat triangles.

    Attributes
    ----------
    volume : float [m^3], negative where it would take away
    top : ndarray, shape (3,) [m], its highest point
    """

    volume: float
    top: Array


def bulge(vertices: Array, faces: Indices, hole: Hole) -> Bulge:
    """The cone over a hole's area that leaves its rim at the slope of the faces beside.

    A round surface stays within it: the cap of a sphere that leaves the rim at a small slope has
    three quarters of its volume.

    Parameters
    ----------
    faces : ndarray of int, shape (m, 3), outward, with the hole open
    """
    points = vertices[hole.rim]
    inward = area_vector(points)
    area = float(np.linalg.norm(inward))
    outward = -inward / max(area, np.finfo(float).tiny)
    radius = math.sqrt(area / math.pi)
    slope = np.clip(_slope(vertices, faces, hole.rim, outward), -_STEEPEST, _STEEPEST)
    height = radius * math.tan(slope)
    return Bulge(area * height / 3.0, hole.place + height * outward)


def _slope(vertices: Array, faces: Indices, rim: Indices, outward: Array) -> float:
    """Mean angle, over the length of a rim, by which the surface beside it falls away [rad]."""
    beside = faces[edges(faces).open // 3]
    links = border(faces)
    own = np.isin(links[:, 0], rim)
    beside, links = beside[own], links[own]
    normal = cross_products(vertices, beside)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    along = vertices[links[:, 1]] - vertices[links[:, 0]]
    length = np.linalg.norm(along, axis=1)
    into = np.cross(normal, along / length[:, None])  # within the face, away from the hole
    fall = np.arcsin(np.clip(-into @ outward, -1.0, 1.0))
    return float(fall @ length / length.sum())


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


def whole_rock(load: Callable[[], trimesh.Trimesh], closing: Closing, tell: Tell) -> WholeRock:
    """Closed solid of a scan of a rock alone.

    A mesh that is one already, and of at most ``MOST_FACES``, is taken as it is. Else it is
    cleaned (see ``clean``) and thinned out; holes up to
    ``LARGEST_HOLE`` of its size are filled between the vertices of their rims; the opening on
    which it stood, of whatever size, is closed as that of a rock on a terrain is (see ``close``).

    Parameters
    ----------
    load : function that gives the scan [m]; it is kept no longer than needed, as scans are large
    closing : "caps", "hull" or "poisson", of the opening beneath

    Raises
    ------
    Refused
        If it cannot be cleaned or closed, has a larger hole, or is no solid then.
    """
    tell("checking the surface")
    mesh = load()
    with refusing(lambda: Seen.nothing_of(load())):
        if (already := _solid_already(mesh)) is not None:
            return already
        cleaned = clean(mesh, alone=True)
        del mesh
        cleaned = thinned_out(cleaned, alone=True)
    vertices, faces = np.array(cleaned.mesh.vertices), np.array(cleaned.mesh.faces, dtype=np.int64)
    vertices, faces = without_chords(vertices, without_slits(vertices, faces))
    all_rock = {"rock": np.ones(len(faces), dtype=bool)}
    with refusing(lambda: Seen(vertices, faces, cleaned.offset, all_rock)):
        longest, _, thickness = np.linalg.svd(vertices - vertices.mean(axis=0), compute_uv=False)
        if thickness <= FLAT * longest:
            raise flat(0.0)
        holes = _closable(vertices, faces)
        tell(f"closing the rock, holes: {len(holes)}")
        solid, added, notes = _closed(vertices, faces, holes, closing)
    notes = (*cleaned.notes, *notes)
    return WholeRock(solid, added, notes, vertices, faces, holes, cleaned.offset)


def _solid_already(mesh: trimesh.Trimesh) -> WholeRock | None:
    """A mesh that is a closed rock, of few faces enough, as it is."""
    if len(mesh.faces) > MOST_FACES:
        return None
    try:
        rock, repaired = checked(mesh)
    except NoSolidYet:
        return None
    faces, none = np.array(rock.faces, dtype=np.int64), np.zeros(len(rock.faces), bool)
    return WholeRock(rock, none, repaired, np.array(rock.vertices), faces, (), np.zeros(3))


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
    """A surface all of which is rock."""
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
