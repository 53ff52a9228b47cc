"""Whether a binary glTF file can be read whole: trimesh passes over much of what moves a shape.

Rules are those of "glTF 2.0 Specification" (Khronos Group, 2021).
"""

from __future__ import annotations

import math
from os import SEEK_CUR
from typing import Any, BinaryIO

import numpy as np

from pipeline.config.outside import of_json
from pipeline.stages.mesh.file_limits import COARSEST, check_repeated
from pipeline.workflow.grammar import listed
from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput

_VERSION = 2

_MOVES = {"translation", "rotation", "scale"}

_ONE = np.eye(4).ravel().tolist()
"""The matrix of a node that does not move, by columns."""

_OFF_ONE = 1e-3
"""Rounding of the length of a rotation, and of the angles of a matrix."""

_TRIANGLES, _STRIP, _FAN = 4, 5, 6
"""What the numbers of a primitive make."""

_SINGLE = 5126
"""Numbers in single precision."""


def plain(file: BinaryIO) -> BinaryIO:
    """A file whose coordinates are none that are replaced, packed, deformed, or not as stated.

    Raises
    ------
    InvalidInput
    """
    head = file.read(16)
    version, length = (int.from_bytes(head[at : at + 4], "little") for at in (4, 12))
    if version != _VERSION:
        raise InvalidInput(f"a file of glTF {version}", f"it is glTF {_VERSION}", "export it again")
    scene = of_json(file.read(length + 4)[4:])
    nodes = scene.get("nodes", [])
    parts = [part for mesh in scene.get("meshes", ()) for part in mesh.get("primitives", ())]
    shapes = scene.get("meshes", []) + nodes
    odd = {
        "sparse accessors": any("sparse" in one for one in scene.get("accessors", ())),
        "morph targets": any(any(one.get("weights", ())) for one in shapes),
        "a skin": any("skin" in node for node in nodes),
        "a matrix and another move of one node": any(
            "matrix" in node and node.keys() & _MOVES for node in nodes
        ),
        "a matrix that skews": not all(_moves(node.get("matrix", _ONE)) for node in nodes),
        "a rotation whose length is not 1": any(
            abs(math.hypot(*node.get("rotation", [1.0])) - 1.0) > _OFF_ONE for node in nodes
        ),
        "strips or fans of triangles": any(
            part.get("mode", _TRIANGLES) in (_STRIP, _FAN) for part in parts
        ),
        "a node with two parents": not _is_tree(scene),
    }
    needed = [f"extension {name}" for name in scene.get("extensionsRequired", ())]
    if needed := [*needed, *(name for name, has in odd.items() if has)]:
        given = f"a glTF file that needs {listed(needed)}"
        raise InvalidInput(given, "its coordinates are plain", "export it without, or as .ply")
    _require_few(scene)
    file.seek(8, SEEK_CUR)
    _require_bounds(scene, file.read())
    file.seek(0)
    return file


def _require_few(scene: dict[str, Any]) -> None:
    """Refuse a scene in which shapes stand more often than memory is for."""
    counts = {at: one["count"] // 3 for at, one in enumerate(scene.get("accessors", ()))}
    faces = [
        sum(counts.get(one.get("indices", one["attributes"].get("POSITION")), 0) for one in parts)
        for parts in (mesh["primitives"] for mesh in scene.get("meshes", ()))
    ]
    shown = [faces[node["mesh"]] for node in scene.get("nodes", ()) if "mesh" in node]
    check_repeated(len(shown), sum(shown), sum(faces))


def _moves(matrix: list[float]) -> bool:
    """Whether a matrix turns, moves and scales along axes alone (3.5.3)."""
    if len(matrix) != len(_ONE) or matrix[3::4] != _ONE[3::4]:
        return False
    axes = np.array(matrix).reshape(4, 4)[:3, :3]
    lengths = np.linalg.norm(axes, axis=1)
    beside = axes @ axes.T - np.diag(lengths**2)
    return bool((np.abs(beside) <= _OFF_ONE * np.outer(lengths, lengths)).all())


def _is_tree(scene: dict[str, Any]) -> bool:
    """Whether each node has one parent, and roots of scenes have none (3.5.1, 3.5.2)."""
    children = [at for node in scene.get("nodes", ()) for at in node.get("children", ())]
    roots = {at for one in scene.get("scenes", ()) for at in one.get("nodes", ())}
    return len({*children}) == len(children) and not roots & {*children}


def _require_bounds(scene: dict[str, Any], data: bytes) -> None:
    """Refuse coordinates that are not within the bounds that a glTF file has for them, and at them.

    They are so by "glTF 2.0 Specification" (Khronos Group, 2021), 3.6.2.5.
    """
    used = {node["mesh"] for node in scene.get("nodes", ()) if "mesh" in node}
    parts = [part["attributes"] for at in used for part in scene["meshes"][at]["primitives"]]
    for at in {part["POSITION"] for part in parts if "POSITION" in part}:
        accessor = scene["accessors"][at]
        points = _stored(scene, accessor, data)
        if points is None or not np.isfinite(points).all():
            continue  # the latter is refused of any mesh
        held = np.array([points.min(axis=0), points.max(axis=0)])
        bounds = accessor.get("min"), accessor.get("max")
        told = np.array([one or its for one, its in zip(bounds, held.tolist(), strict=True)])
        if np.abs(held - told).max() > COARSEST * np.ptp(held, axis=0).max():
            given = f"coordinates from {held[0]} to {held[1]} that say {told[0]} to {told[1]}"
            raise InvalidInput(given, "bounds are those of the coordinates", "export it again")


def _stored(scene: dict[str, Any], accessor: dict[str, Any], data: bytes) -> Array | None:
    """Coordinates in the file itself, in single precision; None of what is elsewhere or packed."""
    view = scene["bufferViews"][accessor["bufferView"]] if "bufferView" in accessor else {}
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    count, stride = accessor["count"], view.get("byteStride", 12)
    is_here = view.get("buffer", -1) == 0 and "uri" not in scene["buffers"][0]
    if not is_here or accessor["componentType"] != _SINGLE or count < 1:
        return None
    if start + (count - 1) * stride + 12 > len(data):
        return None  # which trimesh refuses
    return np.ndarray((count, 3), np.dtype("<f4"), data, start, (stride, 4)).astype(np.float64)
