"""What of a rock touches its terrain in runs: its hull, or pieces where the hull would err."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation
from trimesh.proximity import closest_point

from vsr_core.arrays import Array, Mask
from vsr_core.rock import solid
from vsr_core.rock.body import Rock
from vsr_core.rock.reduction import BASE_SHARE
from vsr_core.scan.pieces import TooManyPieces, convex_pieces
from vsr_core.scan.weighing import DIRECTIONS, spread, tipping_angles
from vsr_core.terrain.surface import Terrain

Wanted = Literal["auto", "hull", "pieces"]

NUMBER = 12
"""Directions in which a rock is tipped to see whether ground comes into its hull."""

_SAMPLES = 2000  # points of a hull
_MOST = 300  # of which so many are looked at in tipped poses, and as many of the rock
_WITHOUT_REST = np.radians(30.0)  # tilt of a rock that does not stand on level ground


@dataclass(frozen=True, eq=False)
class ContactShape:
    """What of a rock touches its terrain.

    Attributes
    ----------
    pieces : tuple of ndarray, each of shape (k, 3) [m], in the rock's frame; none: its hull
    error : float [m], of the pieces; nan of a hull
    told : str, which of both, and why
    """

    pieces: tuple[Array, ...]
    error: float
    told: str


def contact_shape(
    mesh: trimesh.Trimesh, ground: Terrain, unseen: Mask, wanted: Wanted, share: float
) -> ContactShape:
    """Choose the hull or pieces.

    Parameters
    ----------
    mesh : trimesh.Trimesh [m], a closed rock on its ground
    ground : Terrain
    unseen : ndarray of bool, shape (m,), its faces that lie on the rock's underside
    share : float, largest error of pieces, as a share of the rock's radius

    Raises
    ------
    InvalidInput
        If the rock wants too many pieces and pieces were asked for; see ``convex_pieces``.
    """
    if wanted == "hull":
        return ContactShape((), np.nan, "the rock's hull, as asked for")
    rock = solid.from_mesh(mesh, 1.0, as_scanned=True).rock
    why, tolerance = "as asked for", share * rock.radius
    if wanted == "auto":
        off = _off_the_rock(mesh, tolerance)
        if not len(off):
            mm = f"{1e3 * tolerance:.0f} mm"
            return ContactShape((), np.nan, f"the rock's hull, which is within {mm} of it")
        own = spread(mesh, _MOST)[-_MOST:]
        depth = _deepest(rock, np.array(mesh.center_mass), own, off, ground, unseen)
        if depth <= 0.0:
            told = (
                "the rock's hull: no ground comes into what it has besides the rock, as scanned "
                f"or tipped in {NUMBER} directions as far as it stands"
            )
            return ContactShape((), np.nan, told)
        why = f"as ground comes {1e3 * depth:.0f} mm into what its hull has besides it"
    try:
        found = convex_pieces(mesh, tolerance)
    except TooManyPieces as error:
        if wanted == "pieces":
            raise
        return ContactShape((), np.nan, f"the rock's hull, {why}: {error.given}")
    told = f"{len(found.corners)} convex pieces to within {1e3 * found.error:.0f} mm, {why}"
    return ContactShape(found.corners, found.error, told)


def _off_the_rock(mesh: trimesh.Trimesh, tolerance: float) -> Array:
    """Points of a rock's hull that are farther than a tolerance [m] from the rock, shape (n, 3)."""
    points = spread(mesh.convex_hull, _SAMPLES)
    off = points[closest_point(mesh, points)[1] > tolerance]
    return np.asarray(off[:: 1 + len(off) // _MOST])


def _deepest(
    rock: Rock, centre: Array, own: Array, off: Array, ground: Terrain, unseen: Mask
) -> float:
    """Largest depth in the ground [m] of points of a hull, where they are deeper than the rock is.

    The rock is as scanned, or tipped about the outermost point that bears it in each direction, by
    half and all of the tilt from which it falls by itself. Where the rock meets the ground before,
    its hull matters less than that.

    Parameters
    ----------
    own, off : ndarray, shape (n, 3) and (m, 3) [m], points of the rock, and of its hull beside it
    """
    corners = rock.vertices + centre
    seen = Terrain(ground.vertices, ground.faces[~unseen])

    def depth(point: Array) -> float:
        return seen.depth(point) or 0.0

    angles = np.nan_to_num(tipping_angles(rock.vertices), nan=_WITHOUT_REST)
    low = corners[corners[:, 2] <= corners[:, 2].min() + BASE_SHARE * rock.radius]
    poses = [(off, own)]
    every = len(angles) // NUMBER
    for turn, tilt in zip(DIRECTIONS[::every], angles[::every], strict=True):
        along = np.array([np.cos(turn), np.sin(turn), 0.0])
        pivot = low[int((low @ along).argmax())]
        for share in (0.5, 1.0):
            tipped = Rotation.from_rotvec(share * tilt * np.cross([0.0, 0.0, 1.0], along))
            poses.append(tuple(pivot + tipped.apply(points - pivot) for points in (off, own)))
    found = [tuple(max(map(depth, points)) for points in pose) for pose in poses]
    return max(hull if hull > itself else 0.0 for hull, itself in found)
