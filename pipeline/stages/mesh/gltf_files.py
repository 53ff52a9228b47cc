"""Meshes in binary glTF files: all triangles of the scene, or none.

Rules are those of "glTF 2.0 Specification" (Khronos Group, 2021).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any, BinaryIO, TypeAlias

import numpy as np

from pipeline.config.outside import of_json
from pipeline.stages.mesh.shapes import COARSEST, MOST_REPEATED, Shape, joined
from pipeline.workflow.grammar import listed
from vsr_core.arrays import Array, Indices
from vsr_core.errors import InvalidInput

if TYPE_CHECKING:
    import trimesh

_VERSION = 2

_MOVES = {"translation", "rotation", "scale"}

_ONE = np.eye(4).ravel().tolist()
"""The matrix of a node that does not move, by columns."""

_OFF_ONE = 1e-3
"""Rounding of the length of a rotation, and of the angles of a matrix."""

_TRIANGLES = 4
"""What the corners of a primitive make."""

_Kinds: TypeAlias = dict[tuple[str, int], str]
"""Types of numbers, by how many stand together and by their name in a file (3.6.2.2)."""

_WIDTHS = {"VEC4": 4, "VEC3": 3, "SCALAR": 1}

_COORDINATES: _Kinds = {("VEC3", 5126): "<f4"}
_CORNERS: _Kinds = {("SCALAR", 5121): "<u1", ("SCALAR", 5123): "<u2", ("SCALAR", 5125): "<u4"}
_COLOURS: _Kinds = {
    (width, name): kind
    for width in ("VEC3", "VEC4")
    for name, kind in {5126: "<f4", 5121: "<u1", 5123: "<u2"}.items()
}

_ANY = {"name", "extensions", "extras"}
_KEYS = {
    "scenes": {"nodes"},
    "nodes": {"camera", "children", "skin", "matrix", "mesh", "weights", *_MOVES},
    "meshes": {"primitives", "weights"},
    "primitives": {"attributes", "indices", "material", "mode", "targets"},
    "accessors": {"bufferView", "byteOffset", "componentType", "normalized", "count", "type"}
    | {"max", "min", "sparse"},
    "buffers": {"byteLength"},
    "bufferViews": {"buffer", "byteOffset", "byteLength", "byteStride", "target"},
}
"""What is said of parts of a file (5), beside what any may have."""

_LOOKS = re.compile("[A-Z]+_(lights|materials|texture)_")
"""Extensions by which a shape looks otherwise and is the same."""

_BESIDE = {"KHR_lights_punctual", "KHR_materials_variants", "KHR_draco_mesh_compression"}
"""Extensions that change no shape, or stand beside one that is not packed."""


def of_glb(file: BinaryIO) -> trimesh.Trimesh:
    """The shapes of a file's scene, in one mesh; its unit is the metre, or what its shapes state.

    Raises
    ------
    InvalidInput
        If coordinates are replaced, packed, deformed or elsewhere, or not as the file states, or
        not all shapes are in the scene.
    """
    scene, data = _parts(file)
    _require_plain(scene)
    placed = dict(_placed(scene))
    nodes = sum("mesh" in node for node in scene.get("nodes", ()))
    shown, number = {mesh for mesh, _ in placed.values()}, len(scene.get("meshes", ()))
    if not shown or len(placed) != nodes or len(shown) != number:
        given = f"a glTF file of {nodes} shapes of {number} meshes, not all of them in its scene"
        raise InvalidInput(given, "its scene has all of them", "export the rock alone")
    _require_little_repeated(scene)
    shapes = {mesh: [*_shapes(scene, mesh, data)] for mesh in sorted(shown)}
    return joined(shapes, [*placed.values()], _unit(scene, shapes))


def _parts(file: BinaryIO) -> tuple[dict[str, Any], bytes]:
    """The scene of a file, and the bytes of its buffer (4.4)."""
    head = file.read(20)
    version, whole, length = (int.from_bytes(head[at : at + 4], "little") for at in (4, 8, 12))
    if (head[:4], version) != (b"glTF", _VERSION):
        raise InvalidInput(f"a file of glTF {version}", f"it is glTF {_VERSION}", "export it again")
    content = file.read()
    if len(head) + len(content) != whole:
        given = f"{len(head) + len(content):,} bytes of a file of {whole:,}"
        raise InvalidInput(given, "it is whole", "export it again")
    if head[16:] != b"JSON":
        given = f"a glTF file whose first part is {head[16:].decode('latin-1')!r}"
        raise InvalidInput(given, "it is 'JSON'", "export it again")
    return of_json(content[:length]), content[length + 8 :]


def _require_plain(scene: dict[str, Any]) -> None:
    """Refuse a scene of which something moves, deforms or packs the coordinates."""
    nodes = scene.get("nodes", [])
    parts = [part for mesh in scene.get("meshes", ()) for part in mesh.get("primitives", ())]
    shapes = scene.get("meshes", []) + nodes
    odd = {
        "morph targets": any(any(one.get("weights", ())) for one in shapes),
        "a skin": any("skin" in node for node in nodes),
        "a matrix and another move of one node": any(
            "matrix" in node and node.keys() & _MOVES for node in nodes
        ),
        "a matrix that skews": not all(_moves(node.get("matrix", _ONE)) for node in nodes),
        "a rotation whose length is not 1": any(
            abs(math.hypot(*node.get("rotation", [1.0])) - 1.0) > _OFF_ONE for node in nodes
        ),
        "strips or fans": any(part.get("mode", _TRIANGLES) > _TRIANGLES for part in parts),
        "a node with two parents": not _is_tree(scene),
        "coordinates in another file": any("uri" in one for one in scene.get("buffers", ())),
    }
    extensions = (one for one in scene.get("extensionsRequired", ()) if not _LOOKS.match(one))
    needed = [f"extension {one}" for one in extensions]
    if needed := [*needed, *(name for name, has in odd.items() if has)]:
        given = f"a glTF file that needs {listed(needed)}"
        raise InvalidInput(given, "its coordinates are plain", "export it without, or as .ply")


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
    scenes = [one.get("nodes", []) for one in scene.get("scenes", ())]
    below = {*children}
    return len(below) == len(children) and all(
        len({*roots}) == len(roots) and not below & {*roots} for roots in scenes
    )


def _placed(scene: dict[str, Any]) -> Iterator[tuple[int, tuple[int, Array]]]:
    """Nodes of the scene with a mesh: their numbers, those of the meshes, and where they stand."""
    roots = _item(scene, "scenes", scene.get("scene", 0)).get("nodes", ())
    left = [(at, np.eye(4)) for at in roots]
    while left:
        at, parent = left.pop()
        node = _item(scene, "nodes", at)
        matrix = parent @ _matrix(node)
        left += [(child, matrix) for child in node.get("children", ())]
        if "mesh" in node:
            yield at, (node["mesh"], matrix)


def _item(scene: dict[str, Any], kind: str, at: int) -> dict[str, Any]:
    """A part of a file by its number, of which nothing is said that is not understood."""
    number = len(scene.get(kind, ()))
    if not 0 <= at < number:
        given, rule = f"a glTF file that names {kind} {at} of {number}", "they are in it"
        raise InvalidInput(given, rule, "export it again")
    one: dict[str, Any] = scene[kind][at]
    told = one.keys() | one.get("extensions", {}).keys()
    if unknown := told - _KEYS[kind] - _ANY - _BESIDE:
        given = f"{kind} with {min(unknown)[:40]!r}"
        raise InvalidInput(given, "a plain glTF file has none", "export it without, or as .ply")
    return one


def _matrix(node: dict[str, Any]) -> Array:
    """What moves a node, shape (4, 4): a matrix, or first a scale, then a turn, then a shift."""
    from trimesh.transformations import quaternion_matrix, translation_matrix

    if "matrix" in node:
        return np.array(node["matrix"], dtype=float).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    scale = np.diag([*node.get("scale", (1.0, 1.0, 1.0)), 1.0])
    shift = translation_matrix(node.get("translation", (0.0, 0.0, 0.0)))
    return np.asarray(shift @ quaternion_matrix((w, x, y, z)) @ scale)


def _require_little_repeated(scene: dict[str, Any]) -> None:
    """Refuse numbers that stand in far more shapes than memory is for."""
    meshes = [mesh["primitives"] for mesh in scene["meshes"]]
    used = [part["indices"] for parts in meshes for part in parts if "indices" in part]
    used += [at for parts in meshes for at in {one["attributes"]["POSITION"] for one in parts}]
    counts = [_item(scene, "accessors", at)["count"] for at in used]
    if sum(counts) - sum(dict(zip(used, counts, strict=True)).values()) > MOST_REPEATED:
        given, rule = "a glTF file whose numbers stand in many shapes", "each is in its own"
        raise InvalidInput(given, rule, "export the rock alone")


def _shapes(scene: dict[str, Any], mesh: int, data: bytes) -> Iterator[Shape]:
    """The parts of a mesh but points and lines, those of the same vertices as one."""
    found: dict[tuple[int, int | None], list[Indices]] = {}
    parts = _item(scene, "meshes", mesh)
    for number in range(len(parts["primitives"])):
        part = _item(parts, "primitives", number)
        if part.get("mode", _TRIANGLES) == _TRIANGLES:
            names = part["attributes"]
            of = names["POSITION"], names.get("COLOR_0")
            if "indices" in part:
                corners = _stored(scene, part["indices"], data, _CORNERS).astype(np.int64)
            else:
                corners = np.arange(_item(scene, "accessors", of[0])["count"])
            found.setdefault(of, []).append(corners.reshape(-1, 3))
    for (at, shades), faces in found.items():
        points = _stored(scene, at, data, _COORDINATES).astype(np.float64)
        _require_bounds(_item(scene, "accessors", at), points)
        colours = None
        if shades is not None:
            held = _stored(scene, shades, data, _COLOURS)[:, :3]
            largest = 1.0 if held.dtype.kind == "f" else float(np.iinfo(str(held.dtype)).max)
            colours = held / largest
        yield Shape(points, np.concatenate(faces), colours)


def _stored(scene: dict[str, Any], at: int, data: bytes, kinds: _Kinds) -> Array:
    """Numbers of an accessor, shape (count, width), of one of some kinds (3.6.2)."""
    accessor = _item(scene, "accessors", at)
    of = accessor["type"], accessor["componentType"]
    if of not in kinds or "bufferView" not in accessor or "sparse" in accessor:
        known = listed([f"{name} {kind}" for name, kind in kinds])
        given = f"{of[0]} {of[1]}" if "bufferView" in accessor else "numbers in no buffer"
        given = "sparse numbers" if "sparse" in accessor else given
        raise InvalidInput(f"{given} in a glTF file", f"these are {known}", "export it again")
    number, width = np.dtype(kinds[of]), _WIDTHS[of[0]]
    view = _item(scene, "bufferViews", accessor["bufferView"])
    count, end = accessor["count"], view["byteLength"]
    start, first = view.get("byteOffset", 0), accessor.get("byteOffset", 0)
    whole = min(_item(scene, "buffers", view["buffer"])["byteLength"], len(data))
    row = width * number.itemsize
    stride = view.get("byteStride", row)
    is_here = view["buffer"] == 0 and min(start, first) >= 0 and start + end <= whole
    if not is_here or count < 1 or stride < row or first + (count - 1) * stride + row > end:
        given = f"{count:,} numbers in steps of {stride} bytes from {first:,} on, of {end:,}"
        raise InvalidInput(given, "they are in the file", "export it again")
    return np.ndarray((count, width), number, data, start + first, (stride, number.itemsize))


def _require_bounds(accessor: dict[str, Any], points: Array) -> None:
    """Refuse coordinates not within the bounds that a file has for them, and at them (3.6.2.5)."""
    if not np.isfinite(points).all():
        return  # which is refused of any mesh
    held = np.array([points.min(axis=0), points.max(axis=0)])
    bounds = accessor.get("min"), accessor.get("max")
    told = np.array([one or its for one, its in zip(bounds, held.tolist(), strict=True)])
    if np.abs(held - told).max() > COARSEST * np.ptp(held, axis=0).max():
        given = f"coordinates from {held[0]} to {held[1]} that say {told[0]} to {told[1]}"
        raise InvalidInput(given, "bounds are those of the coordinates", "export it again")


def _unit(scene: dict[str, Any], shapes: Iterable[int]) -> str:
    """The unit that shapes state, as trimesh writes it, or metres (3.4)."""
    stated = (_item(scene, "meshes", at).get("extras") for at in shapes)
    units = {
        str(one.get("units", "meters")) if isinstance(one, dict) else "meters" for one in stated
    }
    if len(units) > 1:
        given = f"shapes in {listed(sorted(units))}"
        raise InvalidInput(given, "their unit is one", "export it in metres")
    return units.pop()
