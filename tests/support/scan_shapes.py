"""Rocks of known shape on known ground, and raw scans of the two as one open mesh."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import manifold3d
import numpy as np
import trimesh
from numpy.typing import NDArray

Array = NDArray[np.float64]
Implicit = Callable[[float, float, float], float]
"""Positive inside, about the distance to the surface [m] near it."""


@dataclass(frozen=True)
class Truth:
    """A rock as a closed mesh and as a function, on ground given as a function, z up."""

    solid: trimesh.Trimesh
    rock: Implicit
    ground: Implicit
    up: Array
    reach: float = 1.5


def as_trimesh(solid: manifold3d.Manifold) -> trimesh.Trimesh:
    mesh = solid.to_mesh64()
    return trimesh.Trimesh(mesh.vert_properties[:, :3], mesh.tri_verts, process=False)


def as_manifold(mesh: trimesh.Trimesh) -> manifold3d.Manifold:
    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    return manifold3d.Manifold(manifold3d.Mesh64(vertices, np.asarray(mesh.faces, dtype=np.uint64)))


def box_on_slope(
    slope: float = 10.0,
    size: tuple[float, float, float] = (0.9, 0.7, 1.5),
    at: tuple[float, float] = (0.0, 0.0),
) -> Truth:
    """Box, its edges cut off but for those of the base, square on ground of ``slope`` [degree]."""
    x, y, z, cut = 0.5 * size[0], 0.5 * size[1], size[2], 0.08
    outline = [(sx * a, sy * b) for sx in (1, -1) for sy in (1, -1)
               for a, b in ((x - cut, y), (x, y - cut))]  # fmt: skip
    low = [(a, b, h) for a, b in outline for h in (-0.0, z - cut)]
    high = [(a - math.copysign(cut, a), b - math.copysign(cut, b), z) for a, b in outline]
    solid = trimesh.convex.convex_hull(np.array(low + high))
    turn = trimesh.transformations.euler_matrix(math.radians(25.0), math.radians(slope), 0, "rzyx")
    turn[:2, 3] = at
    turn[2, 3] = -math.tan(math.radians(slope)) * (
        at[0] * math.cos(math.radians(25.0)) + at[1] * math.sin(math.radians(25.0))
    )
    solid.apply_transform(turn)
    up = turn[:3, 2]
    normals = solid.face_normals
    planes = np.unique(
        np.round(np.column_stack([normals, (normals * solid.triangles[:, 0]).sum(axis=1)]), 9),
        axis=0,
    ).tolist()
    ux, uy, uz = up.tolist()

    def rock(px: float, py: float, pz: float) -> float:
        return min(d - a * px - b * py - c * pz for a, b, c, d in planes)

    def ground(px: float, py: float, pz: float) -> float:
        return -(ux * px + uy * py + uz * pz)

    return Truth(solid, rock, ground, up)


def egg_on_dome(relief: float = 0.04) -> Truth:
    """Irregular ellipsoid, 1.35 m tall and cut flat below, on the flat top of a dome."""
    centre, axes = (0.03, -0.02, 0.55), (0.55, 0.45, 0.75)

    def radius(x: float, y: float, z: float) -> float:
        wave = math.sin(4.0 * x + 1.0) * math.cos(3.0 * y) + 0.5 * math.sin(5.0 * z + 2.0)
        return 1.0 + relief * wave

    def rock(px: float, py: float, pz: float) -> float:
        x, y, z = (px - centre[0]) / axes[0], (py - centre[1]) / axes[1], (pz - centre[2]) / axes[2]
        far = math.sqrt(x * x + y * y + z * z) + 1e-12
        return min(0.5 * (radius(x / far, y / far, z / far) - far), pz)

    def ground(px: float, py: float, pz: float) -> float:
        return min(0.0, 0.03 - 0.1 * (px * px + py * py)) - pz

    sphere = trimesh.creation.icosphere(5)
    far = np.array([radius(*u) for u in sphere.vertices.tolist()])
    points = far[:, None] * sphere.vertices * axes + centre
    body = as_manifold(trimesh.Trimesh(points, sphere.faces, process=False))
    solid = as_trimesh(body.trim_by_plane((0.0, 0.0, 1.0), 0.0))
    return Truth(solid, rock, ground, np.array([0.0, 0.0, 1.0]))


def scan(truth: Truth, edge: float = 0.04, *others: Truth) -> trimesh.Trimesh:
    """Open mesh of even triangles without noise; they lie across the seam as they come."""
    rocks, ground, reach = [t.rock for t in (truth, *others)], truth.ground, truth.reach

    def inside(x: float, y: float, z: float) -> float:
        return max(ground(x, y, z), *[rock(x, y, z) for rock in rocks])

    whole = as_trimesh(
        manifold3d.Manifold.level_set(
            inside, (-reach, -reach, -1.0, reach, reach, 2.2), edge * 1.15
        )
    )
    return _without_sides(whole, reach - edge)


def _without_sides(whole: trimesh.Trimesh, reach: float) -> trimesh.Trimesh:
    corners = np.abs(whole.triangles[:, :, :2]).max(axis=(1, 2))
    keep = (corners < reach) & (whole.triangles_center[:, 2] > -0.9)
    return whole.submesh([np.flatnonzero(keep)], append=True, repair=False)


def noisy(mesh: trimesh.Trimesh, sigma: float = 0.005, seed: int = 0) -> trimesh.Trimesh:
    """Every vertex moved in any direction, by ``sigma`` [m] along each axis."""
    shift = sigma * np.random.default_rng(seed).standard_normal(mesh.vertices.shape)
    return trimesh.Trimesh(mesh.vertices + shift, mesh.faces, process=False)


@lru_cache(maxsize=8)
def standard(name: str) -> tuple[Truth, trimesh.Trimesh]:
    """The two test rocks with their scans, made once."""
    truth = box_on_slope() if name == "box" else egg_on_dome()
    return truth, scan(truth)
