"""From a closed triangle mesh to a rock: checks, mass properties, principal frame, rest pose."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from vsr_core.arrays import Array, Indices, matrix_product
from vsr_core.errors import InvalidInput, InvalidPlace
from vsr_core.rock.body import Rock, convex_hull
from vsr_core.rock.size import check_size
from vsr_core.rock.tipping import settle
from vsr_core.rock.triangles import of_no_face, self_intersections

if TYPE_CHECKING:  # runs take rocks, and need not wait for what reads meshes
    import trimesh

FLAT = 1e-9
"""Volume, as a share of the cube of its size, below which a mesh is a sheet: a blade of
1:1000:1000 has a thousand times that, the rounding of a flat sheet a millionth."""

FARTHEST = 1e8
"""Largest coordinate of a scan [m]: easting and northing of maps reach 1e7."""

LARGEST_LEVELLING = np.radians(45.0)
"""A rock that stands on a slope or leans may turn this far to stand on a level pedestal [rad]."""

CROSSING_SHARE = 0.001
"""Share of the surface that may cross itself: a real scan holds a few folded faces, whose volume
is nothing to its mass; a surface that passes through itself has no inside."""

LARGEST_SURFACE = 10.0
"""Largest surface as a share of that of the box around it. Scans of rocks have about half; faces of
wrong vertices, each from one side to another, a hundred times as much."""

_FAR = 100.0
"""Sizes of a rock from which on integrals over its faces lose digits: 1e-9 of the moments there."""

_SHOWN = 50  # crossing faces whose places are told

_SWEEPS = 12  # of Jacobi's rotations; each squares what is left beside the diagonal


class NoSolidYet(InvalidInput):
    """A surface that is open, inside out, in pieces or without some vertices: it may be mended."""


@dataclass(frozen=True)
class Solid:
    """A rock and how it came to stand.

    Attributes
    ----------
    vertices : ndarray, shape (n, 3) [m], surface in the same frame
    faces : ndarray of int, shape (m, 3)
    volume : float [m^3]
    turned : float [rad], from the given pose to the rest pose
    """

    rock: Rock
    vertices: Array
    faces: Indices
    volume: float
    turned: float


def box(size: tuple[float, float, float], density: float) -> Solid:
    """Cuboid standing on its x-y face.

    Parameters
    ----------
    size : tuple of three floats [m], along x, y and z
    density : float [kg/m^3]

    Examples
    --------
    >>> box((1.0, 1.0, 2.0), 2000.0).rock.mass
    4000.0
    """
    from trimesh.creation import box as mesh_of_box

    rock = block(size, density)
    return Solid(
        rock, rock.vertices, np.array(mesh_of_box(extents=size).faces), math.prod(size), 0.0
    )


def block(size: tuple[float, float, float], density: float) -> Rock:
    """Cuboid as a rigid body; its corners are in the order of trimesh's box.

    Parameters
    ----------
    size : tuple of three floats [m], along x, y and z
    density : float [kg/m^3]

    Examples
    --------
    >>> block((1.0, 1.0, 2.0), 2000.0).mass
    4000.0
    """
    x, y, z = size
    mass = density * x * y * z
    inertia = mass / 12.0 * np.array([y * y + z * z, x * x + z * z, x * x + y * y])
    corners = np.array(list(product((-0.5, 0.5), repeat=3))) * size
    return Rock("box", corners, mass, inertia, np.eye(3))


def from_mesh(mesh: trimesh.Trimesh, density: float, *, as_scanned: bool = False) -> Solid:
    """Rock from a checked mesh (see ``checked``) of uniform ``density`` [kg/m^3].

    Volume, centre of mass and inertia are the surface integrals of a closed polyhedron
    (Eberly 2002, as in trimesh).

    Parameters
    ----------
    mesh : Trimesh [m]
    density : float [kg/m^3]
    as_scanned : bool
        Whether it keeps its pose, as on a terrain, or is set on a level pedestal.

    Raises
    ------
    InvalidInput
        If the rock is to stand on a level pedestal and does not as given.
    """
    volume, centre, own = integrals(mesh)
    surface = np.array(mesh.vertices) - centre
    hull = convex_hull(surface)
    rotation, turned = (np.eye(3), 0.0) if as_scanned else settle(hull)
    inertia = density * matrix_product(matrix_product(rotation, own), rotation.T)
    moments, axes = principal(inertia)
    rock = Rock("hull", hull.turned(rotation).vertices, density * volume, moments, axes)
    return Solid(rock, matrix_product(surface, rotation.T), np.array(mesh.faces), volume, turned)


def integrals(mesh: trimesh.Trimesh) -> tuple[float, Array, Array]:
    """Volume, centre, and moments about it per density, of a closed mesh anywhere.

    Far from the origin, as in coordinates of a map, the integrals over its faces cancel: at 50 km
    the moments of a rock of 1 m would be 4 % off. There they are taken about a place nearby.

    Returns
    -------
    volume : float [m^3]
    centre : ndarray, shape (3,) [m]
    inertia : ndarray, shape (3, 3) [m^5]
    """
    near, origin = _near(mesh)
    return float(near.volume), origin + near.center_mass, np.array(near.moment_inertia)


def _near(mesh: trimesh.Trimesh) -> tuple[trimesh.Trimesh, Array]:
    """A mesh about a place that is near to it, and that place [m]; about the origin if that is."""
    step = _FAR * float(np.max(mesh.extents))
    origin = step * np.round(np.mean(mesh.bounds, axis=0) / step)
    if not origin.any():
        return mesh, origin
    near = mesh.copy()
    near.vertices = np.array(mesh.vertices) - origin
    return near, origin


def principal(inertia: Array) -> tuple[Array, Array]:
    """Principal moments, ascending, and axes of a symmetric tensor, by Jacobi's rotations.

    Parameters
    ----------
    inertia : ndarray, shape (3, 3)

    Returns
    -------
    moments : ndarray, shape (3,)
    axes : ndarray, shape (3, 3), in columns, right-handed

    References
    ----------
    Golub, Van Loan (2013), Matrix Computations, 8.5.

    Examples
    --------
    >>> moments, axes = principal(np.diag([3.0, 1.0, 2.0]))
    >>> moments.tolist(), axes.T.tolist()
    ([1.0, 2.0, 3.0], [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    """
    tensor, axes = inertia.copy(), np.eye(3)
    for _ in range(_SWEEPS):
        for p, q in ((0, 1), (0, 2), (1, 2)):
            off = tensor[p, q]
            if abs(off) <= np.finfo(float).eps ** 2 * np.abs(tensor).max():
                continue
            half = (tensor[q, q] - tensor[p, p]) / (2.0 * off)
            tangent = math.copysign(1.0, half) / (abs(half) + math.sqrt(half * half + 1.0))
            cosine = 1.0 / math.sqrt(tangent * tangent + 1.0)
            turn = np.eye(3)
            turn[p, p] = turn[q, q] = cosine
            turn[p, q], turn[q, p] = tangent * cosine, -tangent * cosine
            tensor = matrix_product(matrix_product(turn.T, tensor), turn)
            axes = matrix_product(axes, turn)
    order = np.argsort(np.diag(tensor), kind="stable")
    axes = axes[:, order]
    axes[:, 0] *= np.sign(np.linalg.det(axes))
    return np.diag(tensor)[order], axes


def standing(rock: Rock) -> Rock:
    """A rock in the pose of a scan, set on a level pedestal as near to that pose as it stands.

    Its hull touches there, whatever touches a terrain.

    Raises
    ------
    InvalidInput
        If it has to turn by more than ``LARGEST_LEVELLING``.
    """
    rotation, _ = settle(rock.hull, LARGEST_LEVELLING)
    return replace(
        rock,
        vertices=matrix_product(rock.vertices, rotation.T),
        axes=matrix_product(rotation, rock.axes),
        pieces=(),
    )


def checked(mesh: trimesh.Trimesh) -> tuple[trimesh.Trimesh, tuple[str, ...]]:
    """A closed, outward-wound copy of a mesh in metres, and what was repaired.

    Vertices that an exporter split are merged and faces wound against their neighbours are
    turned. Anything else is refused.

    Returns
    -------
    mesh : trimesh.Trimesh [m]

    Raises
    ------
    NoSolidYet
        If the mesh is not finite, open, inside out or of several bodies.
    InvalidInput
        If it is empty, of an unlikely size or flat.
    InvalidPlace
        If it intersects itself.
    """
    repaired = of_no_face(len(mesh.vertices), np.asarray(mesh.faces))
    _require_a_rock(mesh)
    size = float(np.ptp(mesh.vertices, axis=0).max())
    mesh = mesh.copy()
    before = len(mesh.vertices)
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    mesh.update_faces(mesh.nondegenerate_faces(height=0.0))
    mesh.remove_unreferenced_vertices()
    if not len(mesh.faces):
        raise flat(0.0)
    if len(mesh.vertices) < before:
        repaired.append(f"{before - len(mesh.vertices)} split vertices merged")
    edges = np.unique(np.sort(mesh.edges, axis=1), axis=0, return_counts=True)[1]
    if (edges != 2).any():
        raise NoSolidYet(
            f"{int((edges == 1).sum())} open and {int((edges > 2).sum())} branching edges",
            "a solid is closed: each edge joins two faces",
            "close the scan, base included, before use",
        )
    if not mesh.is_winding_consistent:
        mesh.fix_normals(multibody=True)
        repaired.append("faces wound against their neighbours turned")
    if mesh.body_count > 1:
        raise NoSolidYet(
            f"{mesh.body_count} separate bodies", "one rock is one body", "keep the rock alone"
        )
    with np.errstate(divide="ignore", invalid="ignore"):  # by a volume of 0, which is refused
        volume = _near(mesh)[0].volume
    if abs(volume) <= FLAT * size**3:
        raise flat(volume)
    if volume <= 0.0:
        raise NoSolidYet(
            f"a mesh that is inside out (volume {volume:.3g} m3)",
            "faces look outward",
            "flip all faces and save it again",
        )
    crossing = self_intersections(np.array(mesh.vertices), np.array(mesh.faces))
    share = float(mesh.area_faces[np.unique(crossing)].sum() / mesh.area)
    if share > CROSSING_SHARE:
        raise InvalidPlace(
            f"a mesh that intersects itself ({len(crossing)} pairs of faces)",
            f"faces that cross make up at most {CROSSING_SHARE:.1%} of the surface",
            "remesh the scan",
            np.array(mesh.triangles_center)[crossing[:_SHOWN, 0]],
        )
    if len(crossing):
        repaired.append(
            f"{len(crossing)} crossings of faces left as they are ({share:.1e} of the surface)"
        )
    return mesh, tuple(repaired)


def flat(volume: float) -> InvalidInput:
    """The refusal of a mesh without volume [m^3]."""
    return InvalidInput(
        f"a flat mesh (volume {volume:.3g} m3)",
        "a rock has volume",
        "export the scan again, with all its coordinates",
    )


def _require_a_rock(mesh: trimesh.Trimesh) -> None:
    if len(mesh.faces) == 0:
        raise InvalidInput("a mesh without faces", "a rock has a surface", "export the scan again")
    if not np.isfinite(mesh.vertices).all():
        raise NoSolidYet(
            "vertices that are not finite", "coordinates are numbers", "clean the scan"
        )
    if (far := float(np.abs(mesh.vertices).max())) > FARTHEST:
        raise InvalidInput(
            f"coordinates up to {far:.3g} m",
            f"they are within {FARTHEST:g} m of the origin, where millimetres can be told",
            "move the scan to an origin near the rock",
        )
    x, y, z = np.ptp(mesh.vertices, axis=0).tolist()
    check_size(max(x, y, z))
    if mesh.area > LARGEST_SURFACE * (around := 2.0 * (x * y + y * z + z * x)):
        raise InvalidInput(
            f"a surface of {mesh.area:.3g} m2 in a box of {around:.3g} m2",
            f"it is at most {LARGEST_SURFACE:g} times as large",
            "export it again: faces name other vertices, as after one that is lost or twice there",
        )
