"""An open rock closed: a surface across each rim, along planes, a hull or Poisson's surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely
import trimesh

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.errors import InvalidInput
from vsr_core.rock.solid import checked, self_intersections
from vsr_core.scan.concave import smoothed_normals
from vsr_core.scan.fill import Frame, across, area_vector, frame
from vsr_core.scan.rim import LARGEST_MOVE, laid, planes_beside, to_both
from vsr_core.scan.separation import Separation
from vsr_core.scan.topology import rims
from vsr_core.scan.underside import Height, Planes, lower_hull, planes, poisson

SNAP = 4.0
"""A rim's vertices within this many times its scatter about a cap, or an edge, move onto it."""

_ABOVE = 0.1  # of a rim's edge, that a vertex beside the rim lies above the cap at least
_UNFOLDING = 10  # rounds of smoothing folded faces
_UNCROSSING = 20  # rounds of smoothing a rim along itself
_STEEPEST = 0.2  # cosine between a rim's normal and the ground's, below which the slope is capped


@dataclass(frozen=True, eq=False)
class Cap:
    """A surface across one rim of a rock.

    Attributes
    ----------
    rim, inner : ndarray of int, vertices of ``Closed`` on its rim, in order, and within it
    faces : ndarray of int, shape (m, 3), outward from the rock
    up : ndarray, shape (3,), unit normal of the rim, into the rock
    note : str
    """

    rim: Indices
    inner: Indices
    faces: Indices
    up: Array
    note: str


@dataclass(frozen=True, eq=False)
class Closed:
    """A closed rock in the vertices of its scan.

    Attributes
    ----------
    vertices : ndarray, shape (n, 3) [m], the scan's first, those of rims moved, then the caps'
    rock : trimesh.Trimesh [m], closed and outward
    caps : tuple of Cap, that of the longest rim first
    notes : tuple of str
    """

    vertices: Array
    rock: trimesh.Trimesh
    caps: tuple[Cap, ...]
    notes: tuple[str, ...]

    @property
    def up(self) -> Array:
        """Unit normal of the longest rim, shape (3,)."""
        return self.caps[0].up


@dataclass(frozen=True, eq=False)
class Rim:
    """A rim to close, seen in its own frame.

    Attributes
    ----------
    frame : Frame, h along the rim's normal, into the rock
    edge : float [m], length of its edges in the mean
    points : ndarray, shape (n, 3) [m], u, v and h
    slope : ndarray, shape (n, 2), slope along u and v of the ground beside; 0 without ground
    centre, normal : ndarray, shape (n, 3) each, plane of the rock's side at each point
    """

    frame: Frame
    edge: float
    points: Array
    slope: Array
    centre: Array
    normal: Array


Shape = Callable[[Rim], tuple[Height, bool, Array, str]]
"""From a rim: the height of what closes it, whether that is flat, where the rim's points go and a
note."""


def caps(separation: Separation) -> Closed:
    """Close each rim by planes through it, with the slope of the joint surface where it is open.

    The rim's vertices that scatter about the planes are moved onto them; a strip of triangles
    joins the others. So a base stands on its plane and not on the three lowest points of noise.

    Raises
    ------
    InvalidInput
        If a rim crosses itself, or the result is no solid (see ``solid.checked``).
    """

    def cap(rim: Rim) -> tuple[Height, bool, Array, str]:
        found = planes(rim.points, rim.slope)
        away = np.abs(found(rim.points[:, :2]) - rim.points[:, 2])
        near = away <= max(SNAP * found.scatter, rim.edge)
        placed = _onto(found, rim, near, straight=separation.settled)
        far = np.linalg.norm(placed - rim.points, axis=1).max()
        slope = rim.slope.mean(axis=0)
        tilt = np.degrees(np.arctan(np.linalg.norm(found.rows[:, :2] - slope, axis=1)))
        note = (
            f"{len(found.rows)} plane(s), {', '.join(f'{t:.0f}' for t in tilt)} deg from the "
            f"ground beside; the rim scatters by {1e3 * found.scatter:.1f} mm; "
            f"{int(near.sum())} of {len(near)} vertices moved onto them, by at most "
            f"{1e3 * far:.1f} mm"
        )
        return found, len(found.rows) == 1 and bool(near.all()), placed, note

    return _closed(separation, cap)


def hull(separation: Separation) -> Closed:
    """Close each rim by the lower side of the convex hull of its vertices, which stay.

    Raises
    ------
    InvalidInput
        As ``caps``; or if a rim lies in a plane.
    """

    def cap(rim: Rim) -> tuple[Height, bool, Array, str]:
        return lower_hull(rim.points), False, rim.points, "lower side of the rim's convex hull"

    return _closed(separation, cap)


def by_poisson(separation: Separation) -> Closed:
    """Close each rim by the surface that Poisson's equation continues from the scan, which stays.

    Raises
    ------
    InvalidInput
        As ``caps``; or if Open3D is missing, or its surface does not pass beneath the rim.
    """
    faces = separation.faces[separation.rock]
    used = np.unique(faces)
    normal = np.zeros_like(separation.vertices)
    for k in range(3):
        np.add.at(normal, faces[:, k], smoothed_normals(separation.vertices, faces, 1))
    surface = poisson(separation.vertices[used], normal[used])

    def cap(rim: Rim) -> tuple[Height, bool, Array, str]:
        height = _lowest(rim.frame.into(surface[0]), surface[1])
        return height, False, rim.points, "Poisson's surface"

    return _closed(separation, cap)


def _lowest(vertices: Array, faces: Indices) -> Height:
    """Height of the lowest point of a surface over each point."""
    mesh = trimesh.Trimesh(vertices, faces, process=False)

    def height(at: Array) -> Array:
        start = np.column_stack([at, np.full(len(at), vertices[:, 2].min() - 1.0)])
        up = np.tile([0.0, 0.0, 1.0], (len(at), 1))
        hit, ray, _ = mesh.ray.intersects_location(start, up)
        lowest = np.full(len(at), np.inf)
        np.minimum.at(lowest, ray, hit[:, 2])
        if not np.isfinite(lowest).all():
            raise InvalidInput(
                "a surface of Poisson's equation that leaves part of the rim open",
                "it passes beneath the whole rim",
                "close with caps or hull",
            )
        return lowest

    return height


def _closed(separation: Separation, shape: Shape) -> Closed:
    vertices, faces = separation.vertices, separation.faces[separation.rock]
    open_ = rims(faces)
    if not open_:
        raise InvalidInput("a closed rock", "there is a rim to close", "use it as it is")
    found = []
    for rim in open_:
        vertices, cap = _cap(vertices, separation, rim, shape)
        found.append(cap)
    whole = np.concatenate([faces, *[cap.faces for cap in found]])
    fixed = np.concatenate([np.append(cap.rim, cap.inner) for cap in found])
    vertices, unfolded = _unfolded(vertices, whole, fixed)
    used, local = np.unique(whole, return_inverse=True)
    rock, repaired = checked(trimesh.Trimesh(vertices[used], local.reshape(-1, 3), process=False))
    notes = [f"rim of {len(cap.rim)} edges: {cap.note}" for cap in found]
    return Closed(vertices, rock, tuple(found), (*separation.notes, *notes, *unfolded, *repaired))


def _unfolded(vertices: Array, faces: Indices, fixed: Indices) -> tuple[Array, tuple[str, ...]]:
    """Vertices of faces that cross moved to the middle of their neighbours, but for fixed ones."""
    given = vertices
    for _ in range(_UNFOLDING):
        crossing = np.unique(faces[self_intersections(vertices, faces)])
        crossing = np.setdiff1d(crossing, fixed)
        if len(crossing) == 0:
            break
        near = faces[np.isin(faces, crossing).any(axis=1)]
        count, total = np.zeros(len(vertices)), np.zeros_like(vertices)
        for k in range(3):
            for j in (1, 2):
                np.add.at(total, near[:, k], vertices[near[:, (k + j) % 3]])
                np.add.at(count, near[:, k], 1.0)
        vertices = vertices.copy()
        vertices[crossing] = total[crossing] / count[crossing, None]
    away = np.linalg.norm(vertices - given, axis=1)
    if not (away > 0.0).any():
        return vertices, ()
    return vertices, (
        f"{int((away > 0.0).sum())} vertices of folded faces smoothed, by at most "
        f"{1e3 * away.max():.1f} mm",
    )


def _cap(vertices: Array, separation: Separation, rim: Indices, shape: Shape) -> tuple[Array, Cap]:
    """A cap across one rim, and the vertices with it."""
    faces = separation.faces[separation.rock]
    given = _rim(vertices, separation, rim)
    height, flat, placed, note = shape(given)
    placed, smoothing = _uncrossed(placed)
    note += smoothing
    side = float(np.linalg.norm(placed - np.roll(placed, 1, axis=0), axis=1).mean())
    inner, triangles = across(placed[:, :2], np.inf if flat else side)
    way = given.frame.back(placed) - vertices[rim]
    vertices = laid(vertices, faces, rim, way, side)
    vertices[rim] += way
    raised = _clear(vertices, faces, rim, given.frame, height, side)
    if raised > 0.0:
        note += f"; vertices beside it that lay below raised, by at most {1e3 * raised:.1f} mm"
    name = np.concatenate([rim, len(vertices) + np.arange(len(inner))])
    deep = np.column_stack([inner, height(inner)]) if len(inner) else np.empty((0, 3))
    vertices = np.concatenate([vertices, given.frame.back(deep)])
    return vertices, Cap(rim, name[len(rim) :], name[triangles][:, ::-1], given.frame.axes[2], note)


def _uncrossed(rim: Array) -> tuple[Array, str]:
    """A rim smoothed along itself, level, until it does not cross itself; and a note."""
    placed = rim.copy()
    for _ in range(_UNCROSSING):
        if shapely.Polygon(placed[:, :2]).is_valid:
            break
        beside = 0.5 * (np.roll(placed, 1, axis=0) + np.roll(placed, -1, axis=0))
        placed = 0.5 * (placed + beside)
    far = float(np.linalg.norm(placed - rim, axis=1).max())
    return placed, f"; it crossed itself and was smoothed by {1e3 * far:.1f} mm" if far else ""


def _rim(vertices: Array, separation: Separation, loop: Indices) -> Rim:
    """A rim of the rock in its frame, with the ground and the rock's side beside it."""
    points = vertices[loop]
    into = frame(points, area_vector(points))
    edge = float(np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1).mean())
    side, ground = (separation.faces[of] for of in (separation.rock, ~separation.rock))
    centre, normal = planes_beside(vertices, side, loop, points, edge)
    slope = np.zeros((len(loop), 2))
    if len(ground):
        up = planes_beside(vertices, ground, loop, points, edge)[1] @ into.axes.T
        slope = -up[:, :2] / np.maximum(up[:, 2:], _STEEPEST)
    return Rim(into, edge, into.into(points), slope, into.into(centre), normal @ into.axes.T)


def _onto(found: Planes, rim: Rim, near: Mask, *, straight: bool) -> Array:
    """A rim's points near the planes of its cap moved onto them.

    Straight up or down, or else to where the rock's side meets the planes.
    """
    placed = rim.points.copy()
    if not straight:
        which = np.argmax(found.sign * found.each(rim.points[:, :2]), axis=1)
        rows = found.rows[which]
        plane = np.column_stack([-rows[:, :2], np.ones(len(rows))])
        plane /= np.linalg.norm(plane, axis=1, keepdims=True)
        on_plane = np.column_stack([np.zeros((len(rows), 2)), rows[:, 2]])
        farthest = LARGEST_MOVE * rim.edge
        way = to_both(rim.points, rim.centre, rim.normal, on_plane, plane, farthest)
        placed[near] += way[near]
    placed[near, 2] = found(placed[near, :2])
    return placed


def _clear(
    vertices: Array, faces: Indices, rim: Indices, into: Frame, height: Height, side: float
) -> float:
    """Raise the vertices beside a rim that lie below its cap onto it; the largest way [m]."""
    on_rim = np.zeros(len(vertices), dtype=bool)
    on_rim[rim] = True
    beside = np.unique(faces[on_rim[faces].any(axis=1)])
    beside = beside[~on_rim[beside]]
    placed = into.into(vertices[beside])
    least = height(placed[:, :2]) + _ABOVE * side
    low = placed[:, 2] < least
    way = float((least - placed[:, 2])[low].max(initial=0.0))
    placed[low, 2] = least[low]
    vertices[beside] = into.back(placed)
    return way
