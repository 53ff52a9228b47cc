"""A rock as several convex pieces, where its hull would touch and the rock does not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import coacd
import fast_simplification
import numpy as np
import trimesh
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, cKDTree

from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.scan.weighing import SAMPLES, farthest, spread

CONCAVITIES = (0.1, 0.06, 0.04, 0.025, 0.016, 0.01)
"""Concavities of a piece that are allowed, one after the other, until the error is within bounds:
``threshold`` of CoACD, in a rock that is scaled to the cube from -1 to 1."""

MOST_PIECES = 32
"""More are a rock that wants a larger error."""

MOST_FACES = 4000
"""Faces of the surface that is cut: it is simplified to so many before, and compared with all."""

SAME_SHARE = 1e-4
"""Distance of points in which pieces meet, as a share of the rock's size."""

LARGE_SHARE = 0.01
"""Share of the volume from which on what a thin waist holds is a part of the rock."""

_WAYS = 180  # in which a section is measured


class TooManyPieces(InvalidInput):
    """A rock that few convex pieces do not come near enough."""


@dataclass(frozen=True, eq=False)
class Pieces:
    """Convex pieces of a rock.

    Attributes
    ----------
    corners : tuple of ndarray, each of shape (k, 3) [m]
    error : float [m], largest distance of a point of them outside the rock from it, and of a
        point of the rock outside them from them, at vertices and points spread over both
    """

    corners: tuple[Array, ...]
    error: float


def convex_pieces(rock: trimesh.Trimesh, tolerance: float) -> Pieces:
    """Cut a rock into few convex pieces that are the rock to within a tolerance.

    Parameters
    ----------
    rock : trimesh.Trimesh [m], closed
    tolerance : float [m]

    Raises
    ------
    TooManyPieces
        If it takes more than ``MOST_PIECES``.
    InvalidInput
        If a waist is thinner than the tolerance, so that it is not known whether it holds.

    References
    ----------
    Wei, X., Liu, M., Ling, Z. & Su, H. (2022). Approximate convex decomposition for 3D meshes with
    collision-aware concavity and tree search. ACM Trans. Graph. 41(4), 42.
    """
    surface, least = _simplified(rock), np.inf
    for concavity in CONCAVITIES:
        corners = _cut(surface, concavity)
        if len(corners) > MOST_PIECES:
            break
        error = _error(rock, corners)
        least = min(least, error)
        if error <= tolerance:
            _require_sound_waists(corners, tolerance)
            return Pieces(corners, error)
    raise TooManyPieces(
        f"a rock that {MOST_PIECES} convex pieces are to {1e3 * least:.1f} mm at best",
        f"the contact of runs is within {1e3 * tolerance:.1f} mm of it",
        "give a larger rock.contact_error, or rock.contact_shape: hull",
    )


def _simplified(rock: trimesh.Trimesh) -> trimesh.Trimesh:
    """A surface with few faces; the rock itself where it has few, or does not stay closed."""
    if len(rock.faces) <= MOST_FACES:
        return rock
    vertices, faces = np.array(rock.vertices), np.array(rock.faces)
    made = fast_simplification.simplify(vertices, faces, target_count=MOST_FACES)
    lighter = trimesh.Trimesh(*made)
    return lighter if lighter.is_volume else rock


def _cut(rock: trimesh.Trimesh, concavity: float) -> tuple[Array, ...]:
    """Corners of convex pieces; those that the rock's hull has are its own."""
    coacd.set_log_level("off")
    vertices = np.array(rock.vertices)
    mesh = coacd.Mesh(vertices, np.array(rock.faces, dtype=np.int32))
    made = coacd.run_coacd(mesh, threshold=concavity, preprocess_mode="off", seed=0)
    # CoACD moves corners by up to 1e-4: those that were vertices are those again, as a rock would
    # rock on a foot that is no longer plane.
    tree, near = cKDTree(vertices), 2e-4 * float(np.ptp(vertices, axis=0).max())
    found = []
    for points, _ in made:
        away, at = tree.query(points)
        snapped = np.where((away <= near)[:, None], vertices[at], points)
        found.append(snapped[ConvexHull(snapped).vertices])
    return tuple(found)


def _error(rock: trimesh.Trimesh, pieces: tuple[Array, ...]) -> float:
    """Largest distance of pieces from the rock where they stand out of it, and the reverse [m]."""
    surfaces = [trimesh.convex.convex_hull(piece) for piece in pieces]
    planes = [ConvexHull(piece).equations for piece in pieces]
    margin = SAME_SHARE * float(np.ptp(rock.vertices, axis=0).max())
    points = []
    for number, surface in enumerate(surfaces):
        own = spread(surface, SAMPLES // len(pieces))
        points.append(own[_beyond(own, planes[:number] + planes[number + 1 :]) > margin])
    out = farthest(np.concatenate(points), rock, in_front=True)
    own = spread(rock, SAMPLES)
    own = own[_beyond(own, planes) > 0.0]
    made = [np.array(surface.triangles) for surface in surfaces]
    together = trimesh.Trimesh(**trimesh.triangles.to_kwargs(np.concatenate(made)))
    return max(out, farthest(own, together))


def _beyond(points: Array, bodies: Sequence[Array]) -> Array:
    """How far points, shape (n, 3), are beyond the sides of the nearest of convex bodies [m]."""
    least = np.full(len(points), np.inf)
    for planes in bodies:
        np.minimum(least, (points @ planes[:, :3].T + planes[:, 3]).max(axis=1), out=least)
    return least


def _require_sound_waists(pieces: tuple[Array, ...], noise: float) -> None:
    """Refuse pieces of which large parts hold together by waists thinner than ``noise`` [m]."""
    size = float(np.ptp(np.concatenate(pieces), axis=0).max())
    joined, thinnest = np.zeros((len(pieces), len(pieces))), np.inf
    for one, other in combinations(range(len(pieces)), 2):
        width = _width(pieces[one], pieces[other], SAME_SHARE * size)
        joined[one, other] = width > noise
        thinnest = min(thinnest, width if 0.0 < width <= noise else np.inf)
    part = connected_components(joined, directed=False)[1]
    volume = np.bincount(part, weights=[ConvexHull(piece).volume for piece in pieces])
    if (volume > LARGE_SHARE * volume.sum()).sum() > 1:
        raise InvalidInput(
            f"a rock with a waist {1e3 * thinnest:.1f} mm thin",
            f"it is thicker than the {1e3 * noise:.1f} mm to which its surface is known",
            "give a smaller rock.contact_error if it holds, or scan the parts as rocks",
        )


def _width(one: Array, other: Array, margin: float) -> float:
    """Least width of the section in which two pieces meet [m], 0 where they do not."""
    meeting = []
    for own, body in ((one, other), (other, one)):
        planes = ConvexHull(body).equations
        meeting.append(own[(own @ planes[:, :3].T + planes[:, 3]).max(axis=1) <= margin])
    points = np.concatenate(meeting)
    if len(points) < 3:
        return 0.0
    _, extent, ways = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    section = points @ ways[:2].T
    if extent[1] <= margin:
        return 0.0
    turn = np.linspace(0.0, np.pi, _WAYS, endpoint=False)
    return float(np.ptp(section @ [np.cos(turn), np.sin(turn)], axis=0).min())
