"""An open rock closed: a surface across each rim, along planes, a hull or Poisson's surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.errors import InvalidInput, InvalidPlace
from vsr_core.rock.solid import checked
from vsr_core.rock.triangles import self_intersections
from vsr_core.scan.concave import smoothed_normals
from vsr_core.scan.separation import Separation, laid, planes_beside
from vsr_core.scan.topology import means_beside, rims, touching
from vsr_core.scan.underside import (
    Frame,
    Height,
    across,
    area_vector,
    frame,
    lower_hull,
    planes,
    poisson,
    uncrossed,
)

Closing = Literal["caps", "hull", "poisson"]

_SNAP = 4.0  # times its scatter about a cap, or an edge: a rim's vertices so near move onto the cap
_ABOVE = 0.1  # of a rim's edge, that a vertex beside the rim lies above the cap at least
_UNFOLDING = 20  # rounds of smoothing folded faces
_FIXED = 5  # of these, in which the caps stay as they are
_SAME_FACE = 1e-6  # m: faces whose middles agree to this are one
_STEEPEST = 0.2  # cosine between a rim's normal and the ground's, below which the slope is capped


@dataclass(frozen=True, eq=False)
class Cap:
    """A surface across one rim of a rock.

    Attributes
    ----------
    rim, inner : ndarray of int, vertices of ``Closed`` on its rim, in order, and within it
    faces : ndarray of int, shape (m, 3), outward from the rock
    up : ndarray, shape (3,), unit normal of the rim, into the rock
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
    """

    vertices: Array
    rock: trimesh.Trimesh
    caps: tuple[Cap, ...]
    notes: tuple[str, ...]

    @property
    def added(self) -> Mask:
        """Which faces of the rock are of its caps."""
        return at(self.rock, self.vertices[np.concatenate([cap.faces for cap in self.caps])])


def at(mesh: trimesh.Trimesh, triangles: Array) -> Mask:
    """Which faces of a mesh are given triangles, by their middles.

    Parameters
    ----------
    triangles : ndarray, shape (k, 3, 3) [m]
    """
    if not len(triangles):
        return np.zeros(len(mesh.faces), dtype=bool)
    known = cKDTree(triangles.mean(axis=1))
    return np.asarray(known.query(mesh.triangles_center)[0] < _SAME_FACE)


class _Rim(NamedTuple):
    """A rim to close, seen in its own frame.

    ``frame`` has h along the rim's normal, into the rock; ``edge`` [m] is the mean length of its
    edges; ``points``, shape (n, 3) [m], are its u, v and h; ``slope``, shape (n, 2), is that of
    the ground beside along u and v, or 0 where there is none; ``against`` says which.
    """

    frame: Frame
    edge: float
    points: Array
    slope: Array
    against: str


class _Surface(NamedTuple):
    """What closes a rim: its height, whether that is flat, where the rim's points go, a note."""

    height: Height
    flat: bool
    placed: Array
    note: str


_Shape = Callable[[_Rim], _Surface]


def close(separation: Separation, closing: Closing) -> Closed:
    """Close the rock.

    Parameters
    ----------
    closing : "caps", "hull" or "poisson"
        caps: each rim by planes through it, with the slope of the joint surface, or of the rim's
        mean plane without any ground, where it is open.
        The rim's vertices that scatter about the planes are moved onto them, so that a base
        stands on its plane and not on the three lowest points of noise. hull: by the lower side
        of the convex hull of its vertices, which stay. poisson: by the surface that Poisson's
        equation continues from the scan, which stays.

    Raises
    ------
    InvalidInput
        If a rim crosses itself, or the result is no solid (see ``solid.checked``); with hull if a
        rim lies in a plane; with poisson if Open3D is missing, or its surface does not pass
        beneath the rim.
    """
    if closing == "poisson":
        shape = _poisson(separation)
    else:
        shape = _cap_of_planes if closing == "caps" else _lower_hull
    vertices, faces = separation.vertices, separation.faces[separation.rock]
    open_ = rims(faces)
    if not open_:
        raise InvalidInput("a closed rock", "there is a rim to close", "use it as it is")
    caps = []
    for rim in open_:
        vertices, cap = _cap(vertices, separation, rim, shape)
        caps.append(cap)
    whole = np.concatenate([faces, *[cap.faces for cap in caps]])
    fixed = np.concatenate([np.append(cap.rim, cap.inner) for cap in caps])
    vertices, unfolded = _unfolded(vertices, whole, fixed)
    used, local = np.unique(whole, return_inverse=True)
    rock, repaired = checked(trimesh.Trimesh(vertices[used], local, process=False))
    notes = [f"rim of {len(cap.rim)} edges: {cap.note}" for cap in caps]
    return Closed(vertices, rock, tuple(caps), (*separation.notes, *notes, *unfolded, *repaired))


def _cap_of_planes(rim: _Rim) -> _Surface:
    found = planes(rim.points, rim.slope)
    away = np.abs(found(rim.points[:, :2]) - rim.points[:, 2])
    near = away <= max(_SNAP * found.scatter, rim.edge)
    placed = rim.points.copy()
    placed[near, 2] = found(placed[near, :2])
    far = np.linalg.norm(placed - rim.points, axis=1).max()
    tilt = np.degrees(np.arctan(np.linalg.norm(found.rows[:, :2] - rim.slope.mean(axis=0), axis=1)))
    note = (
        f"planes: {len(found.rows)}, {', '.join(f'{t:.0f}' for t in tilt)} deg from "
        f"{rim.against}; the rim scatters by {1e3 * found.scatter:.1f} mm; "
        f"{int(near.sum())} of {len(near)} vertices moved onto them, by at most "
        f"{1e3 * far:.1f} mm"
    )
    return _Surface(found, len(found.rows) == 1 and bool(near.all()), placed, note)


def _lower_hull(rim: _Rim) -> _Surface:
    return _Surface(
        lower_hull(rim.points), False, rim.points, "lower side of the rim's convex hull"
    )


def _poisson(separation: Separation) -> _Shape:
    faces = separation.faces[separation.rock]
    used = np.unique(faces)
    normal = np.zeros_like(separation.vertices)
    for k in range(3):
        np.add.at(normal, faces[:, k], smoothed_normals(separation.vertices, faces, 1))
    vertices, triangles = poisson(separation.vertices[used], normal[used])

    def surface(rim: _Rim) -> _Surface:
        height = _lowest(rim.frame.into(vertices), triangles)
        return _Surface(height, False, rim.points, "Poisson's surface")

    return surface


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


def _cap(vertices: Array, separation: Separation, rim: Indices, shape: _Shape) -> tuple[Array, Cap]:
    """A cap across one rim, and the vertices with it."""
    faces = separation.faces[separation.rock]
    given = _rim(vertices, separation, rim)
    height, flat, placed, note = shape(given)
    apart = uncrossed(placed)
    if (far := float(np.linalg.norm(apart - placed, axis=1).max())) > 0.0:
        note += f"; it crossed itself and was smoothed by {1e3 * far:.1f} mm"
    placed = apart
    side = _mean_side(placed)
    inner, triangles = across(placed[:, :2], np.inf if flat else side)
    step = given.frame.back(placed) - vertices[rim]
    vertices = laid(vertices, faces, rim, step, side)
    vertices[rim] += step
    raised = _raise_onto(vertices, faces, rim, given.frame, height, side)
    if raised > 0.0:
        note += f"; vertices beside it that lay below raised, by at most {1e3 * raised:.1f} mm"
    name = np.concatenate([rim, len(vertices) + np.arange(len(inner))])
    deep = np.column_stack([inner, height(inner)]) if len(inner) else np.empty((0, 3))
    vertices = np.concatenate([vertices, given.frame.back(deep)])
    return vertices, Cap(rim, name[len(rim) :], name[triangles][:, ::-1], given.frame.axes[2], note)


def _rim(vertices: Array, separation: Separation, loop: Indices) -> _Rim:
    """A rim of the rock in its frame, with the slope of the ground beside it."""
    points = vertices[loop]
    inward = area_vector(points)
    if not np.linalg.norm(inward) > 0.0:
        raise InvalidPlace(
            f"a rim of {len(loop)} edges that encloses no area",
            "a rim is filled across the plane it lies in",
            "smooth or crop the scan there",
            points[:1],
        )
    own, edge = frame(points, inward), _mean_side(points)
    ground = separation.faces[~separation.rock]
    if not len(ground):
        return _Rim(own, edge, own.into(points), np.zeros((len(loop), 2)), "its mean plane")
    up = planes_beside(vertices, ground, loop, points, edge)[1] @ own.axes.T
    slope = -up[:, :2] / np.maximum(up[:, 2:], _STEEPEST)
    return _Rim(own, edge, own.into(points), slope, "the ground beside")


def _mean_side(loop: Array) -> float:
    """Mean distance of the points of a closed loop from the next [m]."""
    return float(np.linalg.norm(loop - np.roll(loop, 1, axis=0), axis=1).mean())


def _raise_onto(
    vertices: Array, faces: Indices, rim: Indices, into: Frame, height: Height, side: float
) -> float:
    """Raise the vertices beside a rim that lie below its cap onto it; by how much at most [m]."""
    beside = np.setdiff1d(faces[touching(faces, rim)], rim)
    placed = into.into(vertices[beside])
    least = height(placed[:, :2]) + _ABOVE * side
    low = placed[:, 2] < least
    raised = float((least - placed[:, 2])[low].max(initial=0.0))
    placed[low, 2] = least[low]
    vertices[beside] = into.back(placed)
    return raised


def _unfolded(vertices: Array, faces: Indices, fixed: Indices) -> tuple[Array, tuple[str, ...]]:
    """Vertices of faces that cross moved to the middle of their neighbours.

    Fixed ones stay, unless that does not end it.
    """
    given = vertices
    for rounds in range(_UNFOLDING):
        crossing = np.unique(faces[self_intersections(vertices, faces)])
        if rounds < _FIXED:
            crossing = np.setdiff1d(crossing, fixed)
        elif len(crossing) == 0:
            break
        middle = means_beside(faces, vertices, crossing)
        vertices = vertices.copy()
        vertices[crossing] = middle
    away = np.linalg.norm(vertices - given, axis=1)
    if not (away > 0.0).any():
        return vertices, ()
    return vertices, (
        f"{int((away > 0.0).sum())} vertices of folded faces smoothed, by at most "
        f"{1e3 * away.max():.1f} mm",
    )
