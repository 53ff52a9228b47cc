"""What each step from scan to solid changed, weighed; what was made of a scan that is refused."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.spatial import cKDTree
from trimesh.proximity import closest_point

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.errors import InvalidInput, InvalidPlace
from vsr_core.rock.body import convex_hull
from vsr_core.rock.solid import FARTHEST, LARGEST_LEVELLING, integrals
from vsr_core.rock.tipping import settle, tipping
from vsr_core.rock.triangles import chunks
from vsr_core.scan.cleaning import whole_metres
from vsr_core.scan.topology import edges

SAMPLES = 20_000
"""Points, beside the vertices, at which a distance between surfaces is measured."""

_ON = 1e-9  # a barycentric share below this is none
_AT_ONCE = 10_000  # points looked up at a time, to save memory
_FARTHEST_AT_ONCE = 500  # those that may be farthest first, to look up few


def signed_distance(mesh: trimesh.Trimesh, points: Array) -> tuple[Array, Array, Indices]:
    """Distance of points from a surface, positive on the side to which its normals point.

    The sign is that of the pseudonormal of the nearest face, edge or vertex, which is exact
    (Baerentzen & Aanaes 2005) but for points nearest to an open rim.

    Returns
    -------
    distance : ndarray, shape (n,) [m]
    nearest : ndarray, shape (n, 3) [m], on the surface
    face : ndarray of int, shape (n,), that it is on

    Examples
    --------
    >>> cube = trimesh.creation.box((2.0, 2.0, 2.0))
    >>> signed_distance(cube, np.array([[0.0, 0.0, 0.9], [0.0, 0.0, 1.5]]))[0].round(9).tolist()
    [-0.1, 0.5]
    """
    distance, nearest = np.empty(len(points)), np.empty((len(points), 3))
    face = np.empty(len(points), dtype=np.int64)
    for chunk in chunks(len(points), _AT_ONCE):
        nearest[chunk], distance[chunk], face[chunk] = closest_point(mesh, points[chunk])
    share = trimesh.triangles.points_to_barycentric(mesh.triangles[face], nearest)
    side = np.einsum("ij,ij->i", points - nearest, _pseudonormals(mesh, face, share))
    return np.where(side < 0.0, -distance, distance), nearest, face


def _pseudonormals(mesh: trimesh.Trimesh, face: Indices, share: Array) -> Array:
    """Normal of the face, edge or vertex that a point with these barycentric shares lies on."""
    faces = np.asarray(mesh.faces, dtype=np.int64)
    normal = np.array(mesh.face_normals[face])
    off = share < _ON
    side = edges(faces).pairs
    across = np.arange(3 * len(faces)) // 3
    across[side[:, 0]], across[side[:, 1]] = side[:, 1] // 3, side[:, 0] // 3
    for k in range(3):
        on_edge = off[:, k] & (off.sum(axis=1) == 1)
        opposite = 3 * face[on_edge] + (k + 1) % 3
        normal[on_edge] += mesh.face_normals[across[opposite]]
        at_vertex = ~off[:, k] & (off.sum(axis=1) == 2)
        normal[at_vertex] = mesh.vertex_normals[faces[face[at_vertex], k]]
    return normal


def hausdorff(one: trimesh.Trimesh, other: trimesh.Trimesh) -> float:
    """Largest distance from either surface to the other.

    Measured at all vertices of both and at ``SAMPLES`` points spread over each by area, exactly
    to the other's faces: a lower bound, as every sampled one, that is exact where the largest
    distance is at a vertex.

    Parameters
    ----------
    one, other : trimesh.Trimesh [m]

    Returns
    -------
    float [m]

    Examples
    --------
    >>> small, large = (trimesh.creation.box((1.0, 1.0, height)) for height in (1.0, 1.5))
    >>> round(hausdorff(small, large), 6)
    0.25
    """
    return max(farthest(spread(one, SAMPLES), other), farthest(spread(other, SAMPLES), one))


def farthest(points: Array, surface: trimesh.Trimesh, *, in_front: bool = False) -> float:
    """Largest distance of points from a surface.

    Parameters
    ----------
    points : ndarray, shape (n, 3) [m]
    in_front : bool, whether only those count that are on the side of its normals

    Returns
    -------
    float [m]
    """
    if not len(points):
        return 0.0
    at_most = cKDTree(spread(surface, SAMPLES)).query(points)[0]
    order = np.argsort(-at_most)
    largest = 0.0
    for chunk in chunks(len(points), _FARTHEST_AT_ONCE):
        if at_most[order[chunk][0]] <= largest:
            break  # no other point can be farther
        own = points[order[chunk]]
        found = signed_distance(surface, own)[0] if in_front else closest_point(surface, own)[1]
        largest = max(largest, float(found.max()))
    return largest


def spread(mesh: trimesh.Trimesh, number: int) -> Array:
    """Vertices of a surface, and a number of points spread over it by area.

    Returns
    -------
    ndarray, shape (n, 3) [m]
    """
    spread = trimesh.sample.sample_surface(mesh, number, seed=0)[0]
    return np.concatenate([np.array(mesh.vertices)[np.unique(mesh.faces)], spread])


DIRECTIONS = np.radians(np.arange(0.0, 360.0, 5.0))
"""Directions [rad] in which tipping is compared."""


Tell = Callable[[str], None]
"""Takes what is being done, in a few words: scans of millions of faces take minutes."""


@dataclass(frozen=True)
class Measure:
    """A mesh in figures.

    Attributes
    ----------
    volume : float [m^3], nan if open, as are the next ones
    mass : float [kg]
    centre_of_mass : ndarray, shape (3,) [m]
    inertia : ndarray, shape (3, 3) [kg m^2], about the centre of mass
    tipping : ndarray, shape (72,) [rad], static tipping angles in ``DIRECTIONS``; nan where the
        solid does not stand
    """

    faces: int
    vertices: int
    watertight: bool
    volume: float
    mass: float
    centre_of_mass: Array
    inertia: Array
    tipping: Array


@dataclass(frozen=True)
class Step:
    """A step from scan to solid.

    Attributes
    ----------
    hausdorff : float [m], largest distance between the two surfaces, sampled; nan if not compared
    """

    name: str
    before: Measure
    after: Measure
    hausdorff: float
    notes: tuple[str, ...]

    @property
    def tipping_change(self) -> float:
        """Largest change of a static tipping angle [rad]; nan where one of the two is open."""
        return largest_change(self.before, self.after)


@dataclass(frozen=True)
class Trial:
    """Another closing, to see what an unseen underside does to the result.

    Attributes
    ----------
    moved : float [m], of the centre of mass from that of the closing chosen
    tipping_change : float [rad], largest change of a static tipping angle against it
    """

    closing: str
    measure: Measure | None
    moved: float
    tipping_change: float
    reason: str


def tried(
    closing: str, make: Callable[[], trimesh.Trimesh], chosen: Measure, density: float
) -> Trial:
    """Another closing weighed against the one chosen.

    Parameters
    ----------
    density : float [kg/m^3]
    """
    try:
        other = measured(make(), density)
    except InvalidInput as error:
        return Trial(closing, None, np.nan, np.nan, error.given)
    moved = float(np.linalg.norm(other.centre_of_mass - chosen.centre_of_mass))
    return Trial(closing, other, moved, largest_change(chosen, other), "")


def measured(mesh: trimesh.Trimesh, density: float) -> Measure:
    """Figures of a mesh of uniform density.

    Parameters
    ----------
    density : float [kg/m^3]

    Examples
    --------
    >>> measured(trimesh.creation.box((1.0, 1.0, 2.0)), 2000.0).mass
    4000.0
    """
    nothing = np.full(3, np.nan), np.full((3, 3), np.nan), np.full(len(DIRECTIONS), np.nan)
    counts = len(mesh.faces), len(mesh.vertices)
    if (edges(np.asarray(mesh.faces)).count != 2).any():
        return Measure(*counts, False, np.nan, np.nan, *nothing)
    volume, centre, own = integrals(mesh)
    inertia = density * own
    tipping = tipping_angles(np.array(mesh.vertices) - centre)
    return Measure(*counts, True, volume, density * volume, centre, inertia, tipping)


def tipping_angles(points: Array) -> Array:
    """Static tipping angles of the hull of points, set on a level plane.

    Parameters
    ----------
    points : ndarray, shape (n, 3) [m], about the centre of mass

    Returns
    -------
    ndarray, shape (72,) [rad], in ``DIRECTIONS``; nan where it does not stand
    """
    try:
        hull = convex_hull(points)
        return np.asarray(
            tipping(hull.turned(settle(hull, LARGEST_LEVELLING)[0]), DIRECTIONS).angle
        )
    except InvalidInput:
        return np.full(len(DIRECTIONS), np.nan)


def largest_change(one: Measure, other: Measure) -> float:
    """Largest difference of static tipping angles of two solids.

    Returns
    -------
    float [rad]
    """
    return float(np.abs(one.tipping - other.tipping).max())


@dataclass(frozen=True, eq=False)
class Seen:
    """What was made of a scan.

    Attributes
    ----------
    vertices : ndarray, shape (n, 3) [m]
    faces : ndarray of int, shape (m, 3)
    offset : ndarray, shape (3,) [m], the scan's coordinates are those of ``vertices`` plus these
    parts : dict of ndarray of bool, shape (m,), what was taken for what, by name
    """

    vertices: Array
    faces: Indices
    offset: Array
    parts: dict[str, Mask]

    @classmethod
    def nothing_of(cls, mesh: trimesh.Trimesh) -> Seen:
        """Nothing yet but the scan itself, as far as it can be drawn, where ``clean`` puts it."""
        vertices = np.array(mesh.vertices, dtype=np.float64)
        faces = np.array(mesh.faces, dtype=np.int64)
        near = np.asarray((np.abs(vertices) < FARTHEST).all(axis=1))
        used, local = np.unique(faces[near[faces].all(axis=1)], return_inverse=True)
        offset = whole_metres(vertices[near]) if near.any() else np.zeros(3)
        return cls(vertices[used] - offset, local.reshape(-1, 3), offset, {})


class Refused(InvalidInput):
    """A refusal of a scan, and where it fails."""

    def __init__(self, error: InvalidInput, seen: Seen) -> None:
        places = [*error.places] if isinstance(error, InvalidPlace) else []
        self.seen, self.places = seen, np.array(places).reshape(-1, 3) + seen.offset
        super().__init__(error.given + _told(self.places), error.rule, error.remedy)


def _told(places: Array) -> str:
    if not len(places):
        return ""
    more = f" and {len(places) - 1} more places" if len(places) > 1 else ""
    return f" at {place(places[0])}{more}"


def place(point: Array) -> str:
    """Coordinates as they are told.

    Parameters
    ----------
    point : ndarray, shape (3,) [m]

    Examples
    --------
    >>> place(np.array([1.0, 2.5, -0.001]))
    '(1.00, 2.50, 0.00)'
    """
    return f"({', '.join(f'{round(x, 2) + 0.0:.2f}' for x in point.tolist())})"


@contextmanager
def refusing(
    seen: Callable[[], Seen], kind: Callable[[InvalidInput, Seen], Refused] = Refused
) -> Iterator[None]:
    """Add to a refusal what was made of the scan until then.

    Parameters
    ----------
    seen : function, called only where something is refused, as scans are large

    Raises
    ------
    Refused
        In place of an InvalidInput.
    """
    try:
        yield
    except Refused:
        raise
    except InvalidInput as error:
        raise kind(error, seen()) from error
