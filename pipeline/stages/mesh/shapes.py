"""Shapes of a scene as one mesh, and how coarse and how many they may be."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from vsr_core.arrays import Array, Indices
from vsr_core.errors import InvalidInput

if TYPE_CHECKING:
    import trimesh

COARSEST = 1e-3
"""Largest step between neighbouring numbers of a file, as a share of what it shows."""

MOST_SHAPES, MOST_REPEATED = 10_000, 1_000_000
"""In a scene, each as often as it is there."""

_OFF = 0.01
"""Rounding of a colour."""

_Name = TypeVar("_Name", bound=Hashable)


@dataclass(frozen=True, eq=False)
class Shape:
    """A part of a file.

    Attributes
    ----------
    points : ndarray, shape (n, 3)
    faces : ndarray of int, shape (k, 3)
    colours : ndarray, shape (n, 3), 0 to 1; None without

    Raises
    ------
    InvalidInput
        If a face is of a vertex that is not there, or colours are not one for each vertex, 0 to 1.
    """

    points: Array
    faces: Indices
    colours: Array | None = None

    def __post_init__(self) -> None:
        require_vertices(self.faces, len(self.points))
        if self.colours is not None and len(self.colours) != len(self.points):
            given = f"{len(self.colours)} colours of {len(self.points)} vertices"
            raise InvalidInput(given, "each has one", "export it again")
        if self.colours is not None and not (np.abs(self.colours - 0.5) < 0.5 + _OFF).all():
            given = f"colours from {self.colours.min():g} to {self.colours.max():g}"
            raise InvalidInput(given, "they are from 0 to 1", "export it again")


def require_vertices(faces: Indices, number: int) -> None:
    """Refuse faces of vertices that are not among so many.

    Raises
    ------
    InvalidInput
    """
    if faces.size and not 0 <= faces.min() <= faces.max() < number:
        given = f"faces of vertices {faces.min()} to {faces.max()}, of {number}"
        raise InvalidInput(given, "faces are made of the file's vertices", "export it again")


def joined(
    shapes: Mapping[_Name, Sequence[Shape]], placed: Sequence[tuple[_Name, Array]], unit: str
) -> trimesh.Trimesh:
    """Shapes where they stand, as one mesh; coloured if all of them are.

    Parameters
    ----------
    placed : names of shapes, each as often as it is there, and what moves it, shape (4, 4)

    Raises
    ------
    InvalidInput
        If there are none, too many, or far more faces than are stored, or they are too coarse.
    """
    import trimesh

    faces = {name: sum(len(one.faces) for one in parts) for name, parts in shapes.items()}
    shown, stored = sum(faces[name] for name, _ in placed), sum(faces.values())
    if len(placed) > MOST_SHAPES or shown - stored > MOST_REPEATED:
        given = f"{len(placed):,} shapes of {shown:,} faces in a scene, where {stored:,} are stored"
        rule = f"they are at most {MOST_SHAPES:,}, of {MOST_REPEATED:,} faces more than that"
        raise InvalidInput(given, rule, "export the rock alone")
    parts = [(one, matrix) for name, matrix in placed for one in shapes[name]]
    if not parts:
        raise InvalidInput("a file without faces", "a mesh has some", "export the rock's surface")
    found = [
        trimesh.Trimesh(one.points, one.faces, process=False).apply_transform(matrix)
        for one, matrix in parts
    ]
    mesh = trimesh.util.append_faces([one.vertices for one in found], [one.faces for one in found])
    colours = [one.colours for one, _ in parts if one.colours is not None]
    shades = (
        np.rint(255.0 * np.clip(np.vstack(colours), 0.0, 1.0))
        if len(colours) == len(parts) > 0
        else None
    )
    whole = trimesh.Trimesh(
        *mesh, vertex_colors=None if shades is None else shades.astype(np.uint8), process=False
    )
    scales = [float(np.linalg.norm(matrix[:3, :3], 2)) for _, matrix in parts]
    require_fine(
        max(step(one.points) * by for (one, _), by in zip(parts, scales, strict=True)), whole
    )
    whole.units = unit
    return whole


def step(points: Array) -> float:
    """Step between neighbouring numbers, if single precision has made it; else 0."""
    if not len(points) or not (points == np.float32(points)).all():
        return 0.0
    return float(np.spacing(np.float32(min(np.abs(points).max(), np.finfo(np.float32).max))))


def require_fine(step: float, mesh: trimesh.Trimesh) -> None:
    """Refuse coordinates in coarse steps, as those of a map in single precision.

    Raises
    ------
    InvalidInput
    """
    if not len(mesh.faces):
        return
    size = float(np.median(np.ptp(mesh.vertices, axis=0)))
    if step > COARSEST * size > 0.0:
        given = f"coordinates in single precision, in steps of {step:.2g} of {size:.3g}"
        rule = f"steps are at most {COARSEST:.1%} of the mesh"
        raise InvalidInput(given, rule, "export it about a local origin")
