"""Fewer faces within an error that is measured, with parts of a surface kept as they are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vsr_core.errors import Unfit
from vsr_core.scan.distance import farthest, hausdorff
from vsr_core.scan.topology import edges, ends

if TYPE_CHECKING:
    import trimesh

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Mask = NDArray[np.bool_]

FEWEST = 0.02
"""At most this reduction is tried, as a share of the faces that may go."""

_SOME = 1000  # vertices at which a trial is looked at before it is measured
_AGGRESSION = 4.0  # of the decimation; a lower one stops before it has reached a small number
_TRIALS = 6  # of the number of faces, halving the range of its logarithm


@dataclass(frozen=True, eq=False)
class Simplified:
    """A surface of fewer faces.

    Attributes
    ----------
    mesh : trimesh.Trimesh [m]
    error : float [m], largest distance between the two surfaces, measured (see ``hausdorff``)
    """

    mesh: trimesh.Trimesh
    error: float


def simplified(mesh: trimesh.Trimesh, bound: float, kept: Mask) -> Simplified:
    """Decimate a surface by quadric edge collapse, by as much as an error bound allows.

    Faces at kept vertices and open borders stay exactly as they are. The number of faces of the
    rest is found by bisection; every trial is measured.

    Parameters
    ----------
    mesh : trimesh.Trimesh [m]
    bound : float [m], largest distance between the two surfaces
    kept : ndarray of bool, shape (n,), vertices that stay with all their faces

    Raises
    ------
    Unfit
        If the bound is not positive.
    """
    if not bound > 0.0:
        raise Unfit(f"an error bound of {bound} m", "it is positive", "give it in metres")
    free = np.asarray(~kept[mesh.faces].any(axis=1))
    best = Simplified(mesh, 0.0)
    some = np.array(mesh.vertices)[:: max(len(mesh.vertices) // _SOME, 1)]
    most, fewest = 0.0, np.log(FEWEST)
    share = fewest
    for _ in range(_TRIALS):
        if free.sum() < 8:
            break
        tried = _decimated(mesh, free, float(np.exp(share)))
        near = _as_sound(mesh, tried) and farthest(some, tried) <= bound
        if near and (error := hausdorff(mesh, tried)) <= bound:
            best, most = Simplified(tried, error), share
        else:
            fewest = share
        if most == fewest:
            break
        share = 0.5 * (most + fewest)
    return best


def base_band(mesh: trimesh.Trimesh, up: Array, height: float) -> Mask:
    """Vertices within ``height`` [m] of the lowest one along ``up``, shape (n,)."""
    level = np.array(mesh.vertices) @ (up / np.linalg.norm(up))
    return np.asarray(level <= level.min() + height)


def beside(mesh: trimesh.Trimesh, outline: tuple[tuple[float, float], ...], width: float) -> Mask:
    """Vertices within ``width`` [m] of a polygon or in it, seen from above, shape (n,).

    Parameters
    ----------
    outline : tuple of (x, y) [m]
    """
    import shapely

    region = shapely.buffer(shapely.Polygon(outline), width)
    return np.asarray(shapely.contains(region, shapely.points(np.array(mesh.vertices)[:, :2])))


def _decimated(mesh: trimesh.Trimesh, free: Mask, share: float) -> trimesh.Trimesh:
    """A copy whose free faces are decimated to a share of them, joined to the others exactly."""
    import fast_simplification
    import trimesh
    from scipy.spatial import cKDTree

    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int64)
    used, local = np.unique(faces[free], return_inverse=True)
    local = local.reshape(-1, 3)
    points, fewer = fast_simplification.simplify(
        vertices[used],
        local.astype(np.int32),
        target_count=max(int(share * len(local)), 4),
        agg=_AGGRESSION,
        preserve_border=True,
    )
    border = used[np.unique(ends(local, edges(local).open))]
    name = len(vertices) + np.arange(len(points))
    if len(border):
        away, same = cKDTree(points).query(vertices[border])
        name[same[away == 0.0]] = border[away == 0.0]
    whole = np.concatenate([faces[~free], name[fewer]])
    every = np.concatenate([vertices, points])
    used, local = np.unique(whole, return_inverse=True)
    return trimesh.Trimesh(every[used], local.reshape(-1, 3), process=False)


def _as_sound(mesh: trimesh.Trimesh, other: trimesh.Trimesh) -> bool:
    """Whether a surface is closed, or open along the same edges, as another is."""
    counts = [edges(np.array(m.faces, dtype=np.int64)).count for m in (mesh, other)]
    rims = [int((count == 1).sum()) for count in counts]
    return rims[0] == rims[1] and bool((counts[1] <= 2).all())
