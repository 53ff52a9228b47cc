"""A small rock on sloping ground as a coarse, noisy scan with colours sees it, and its file."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from support import scan_shapes

Array = NDArray[np.float64]

EDGE, NOISE = 0.07, 0.002
FAR = np.array([712345.25, 3894567.5, 251.5])
"""Where a survey's coordinates put the origin."""

STONE, SOIL = (110, 80, 70), (190, 180, 150)


def tapered(at: tuple[float, float] = (0.0, 0.0), slope: float = 4.0) -> scan_shapes.Truth:
    """A rock that narrows upward, 0.72 m x 0.6 m at its foot, square on sloping ground."""
    low = [(sx * 0.36, sy * 0.30, 0.0) for sx in (1, -1) for sy in (1, -1)]
    high = [(sx * 0.22 + 0.02, sy * 0.2, 1.1) for sx in (1, -1) for sy in (1, -1)]
    solid = trimesh.convex.convex_hull(np.array(low + high))
    turn = trimesh.transformations.euler_matrix(np.radians(20.0), np.radians(slope), 0, "rzyx")
    up = turn[:3, 2]
    turn[:3, 3] = *at, -(up[:2] @ at) / up[2]
    solid.apply_transform(turn)
    planes = np.unique(np.round(ConvexHull(solid.vertices).equations, 9), axis=0).tolist()
    ux, uy, uz = up.tolist()
    return scan_shapes.Truth(
        solid,
        lambda x, y, z: min(-(a * x + b * y + c * z + d) for a, b, c, d in planes),
        lambda x, y, z: -(ux * x + uy * y + uz * z),
        up,
        1.0,
    )


@lru_cache(maxsize=2)
def survey(edge: float = EDGE, noise: float = NOISE) -> trimesh.Trimesh:
    """The tapered rock as a scan of this edge of triangles and noise [m] sees it, with colours."""
    truth = tapered()
    mesh = scan_shapes.scan(truth, edge)
    above = np.array(mesh.vertices) @ truth.up > 0.3 * edge
    mesh = scan_shapes.noisy(mesh, noise)
    mesh.visual.vertex_colors = np.where(above[:, None], STONE, SOIL).astype(np.uint8)
    return mesh


def write_ply(path: Path, mesh: trimesh.Trimesh, shift: Array | None = None) -> None:
    """As text in double precision: trimesh's own writer keeps single precision only."""
    vertices = np.array(mesh.vertices) + (0.0 if shift is None else shift)
    colours = np.asarray(mesh.visual.vertex_colors)[:, :3]
    head = ["ply", "format ascii 1.0", f"element vertex {len(vertices)}"]
    head += [f"property double {axis}" for axis in "xyz"]
    head += [f"property uchar {name}" for name in ("red", "green", "blue")]
    head += [f"element face {len(mesh.faces)}", "property list uchar int vertex_indices"]
    rows = [
        " ".join(map(repr, [*point, *colour]))
        for point, colour in zip(vertices.tolist(), colours.tolist(), strict=True)
    ]
    faces = [f"3 {a} {b} {c}" for a, b, c in np.array(mesh.faces).tolist()]
    path.write_text("\n".join([*head, "end_header", *rows, *faces]) + "\n")
