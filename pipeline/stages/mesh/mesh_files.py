"""Files of meshes: read by their format, of bounded size."""

from __future__ import annotations

import io
import math
import re
from functools import partial
from itertools import accumulate, takewhile
from os import SEEK_CUR
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from pipeline.config.outside import check_regular, of_json
from pipeline.stages.mesh import collada_files
from pipeline.stages.mesh.collada_files import other_count
from pipeline.workflow.grammar import listed
from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput, reason

if TYPE_CHECKING:
    import trimesh

LARGEST_FILE = 2 * 1024**3
"""Bytes of a file: of some forty million faces, which take some tens of gigabytes of memory."""


COARSEST = 1e-3
"""Largest step between neighbouring numbers of a file, as a share of what it shows."""


def read(path: Path, scale: float = 1.0) -> trimesh.Trimesh:
    """The mesh in a file; files that it names, such as textures, are not opened.

    Parameters
    ----------
    scale : float, length of its unit [m]

    Returns
    -------
    trimesh.Trimesh [m]
    """
    import trimesh

    check_regular(path, LARGEST_FILE)
    kind = path.suffix[1:].lower()
    try:
        with path.open("rb") as file:
            if kind in _CHECKS:
                _CHECKS[kind](file)
                file.seek(0)
            text = _REWRITTEN[kind](file) if kind in _REWRITTEN else file
            mesh = trimesh.load(text, file_type=kind, resolver={}, force="mesh", process=False)
    except InvalidInput:
        raise
    except Exception as error:  # noqa: BLE001 (readers of five formats raise what they like)
        raise InvalidInput(
            f"a file that cannot be read ({reason(error)})", "it is a mesh", "export it again"
        ) from None
    if not isinstance(mesh, trimesh.Trimesh):
        mesh = trimesh.Trimesh(np.empty((0, 3)), np.empty((0, 3), dtype=int))
    _require_faces_of_vertices(mesh)
    _require_fine_steps(mesh)
    if scale == 1.0 and mesh.units not in (None, "meters"):
        unit = f"{trimesh.units.unit_conversion(mesh.units, 'meters'):.10g}"
        remedy = f"export it in metres, or say rock.scale: {unit} of a rock"
        raise InvalidInput(f"a unit of {unit} m in the file", "it is the metre", remedy)
    return mesh.apply_scale(scale)


def _require_plain_gltf(file: BinaryIO) -> None:
    """Refuse what trimesh passes over: coordinates replaced, packed, made integers or deformed."""
    head = file.read(16)
    version, length = (int.from_bytes(head[at : at + 4], "little") for at in (4, 12))
    if version != _VERSION:
        raise InvalidInput(f"a file of glTF {version}", f"it is glTF {_VERSION}", "export it again")
    scene = of_json(file.read(length + 4)[4:])
    needed = [f"extension {name}" for name in scene.get("extensionsRequired", ())]
    if any("sparse" in accessor for accessor in scene.get("accessors", ())):
        needed.append("sparse accessors")
    nodes = scene.get("nodes", [])
    if any(any(part.get("weights", ())) for part in scene.get("meshes", []) + nodes):
        needed.append("morph targets")
    if any("skin" in node for node in nodes):
        needed.append("a skin")
    if any("matrix" in node and node.keys() & _MOVES for node in nodes):
        needed.append("a matrix and another move of one node")
    if any(node.get("matrix", _ONE)[3::4] != _ONE[3::4] for node in nodes):
        needed.append("a matrix that does more than move")
    if any(abs(math.hypot(*node.get("rotation", [1.0])) - 1.0) > _OFF_ONE for node in nodes):
        needed.append("a rotation whose length is not 1")
    parts = [part for mesh in scene.get("meshes", ()) for part in mesh.get("primitives", ())]
    if {part.get("mode", _TRIANGLES) for part in parts} & {_STRIP, _FAN}:
        needed.append("strips or fans of triangles")
    if needed:
        given = f"a glTF file that needs {listed(needed)}"
        raise InvalidInput(given, "its coordinates are plain", "export it without, or as .ply")
    file.seek(8, SEEK_CUR)
    _require_bounds(scene, file.read())


def _require_bounds(scene: dict[str, Any], data: bytes) -> None:
    """Refuse coordinates that are not within the bounds that a glTF file has for them, and at them.

    They are so by "glTF 2.0 Specification" (Khronos Group, 2021), 3.6.2.5.
    """
    used = {node["mesh"] for node in scene.get("nodes", ()) if "mesh" in node}
    parts = [part["attributes"] for at in used for part in scene["meshes"][at]["primitives"]]
    for at in {part["POSITION"] for part in parts if "POSITION" in part}:
        accessor = scene["accessors"][at]
        points = _stored(scene, accessor, data)
        if points is None:
            continue
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


_VERSION = 2

_MOVES = {"translation", "rotation", "scale"}

_ONE = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]
"""The matrix of a node that does not move, by columns."""

_OFF_ONE = 1e-3
"""Rounding of the length of a rotation."""

_TRIANGLES, _STRIP, _FAN = 4, 5, 6
"""What the numbers of a primitive make."""

_SINGLE = 5126
"""Numbers in single precision, of glTF."""


def _require_lines_of_ply(file: BinaryIO) -> None:
    """Refuse a PLY file of text with other lines than it says; trimesh refuses a binary one."""
    lines = (line.split() for line in iter(partial(file.readline, _LINE), b""))
    header = list(takewhile(lambda words: words != [b"end_header"], lines))
    if [b"format", b"ascii", b"1.0"] not in header:
        return
    held = [line.split() for line in file if line.strip()]
    elements = [at for at, line in enumerate(header) if line[:1] == [b"element"]]
    counts = [int(header[at][2]) for at in elements]
    if len(held) != sum(counts):
        raise other_count(f"{len(held)} lines where its header says {sum(counts)}")
    for at, count, last in zip(elements, counts, accumulate(counts), strict=True):
        of = takewhile(lambda line: line[:1] != [b"element"], header[at + 1 :])
        lists = [line[1] == b"list" for line in of if line[:1] == [b"property"]]
        if odd := next((one for one in held[last - count : last] if _numbers(one, lists)), None):
            what = b" ".join(odd)[:40].decode("latin-1")
            raise other_count(f"a line {what!r} of other numbers than its header says")


def _numbers(line: list[bytes], lists: list[bool]) -> bool:
    """Whether a line of PLY has others than one for each property, or the length of a list."""
    at = 0
    for is_list in lists:
        at += 1 + (int(float(line[at])) if is_list and at < len(line) else 0)
    return at != len(line)


_LINE = 10_000
"""Bytes of a line of PLY's header."""


def _counted_from_the_first(file: BinaryIO) -> BinaryIO:
    """An OBJ text whose faces name no vertices by how far before the face they are.

    Such negative numbers count back from the face's own line ("Object Files", appendix B1 of the
    manual of Wavefront's Advanced Visualizer); trimesh counts from the end of the file. Those of
    textures and normals are left, as neither is used.
    """
    text = file.read().replace(b"\t", b" ")  # which trimesh does not take for a blank
    text = b"\n" + re.sub(rb"\\\r?\n", b"", text.strip())  # without lines that go on in the next
    vertices, seen = range(1, 1), 0

    def face(line: re.Match[bytes]) -> bytes:
        nonlocal vertices, seen
        more = text.count(b"\nv ", seen, line.start())
        vertices, seen = range(1, len(vertices) + more + 1), line.start()
        return re.sub(rb"(?<= )-\d+", lambda back: b"%d" % vertices[int(back[0])], line[0])

    return io.BytesIO(re.sub(rb"^f .*-.*", face, text, flags=re.MULTILINE))


_CHECKS = {"glb": _require_plain_gltf, "ply": _require_lines_of_ply}

_REWRITTEN = {"dae": collada_files.without_pictures, "obj": _counted_from_the_first}


def _require_faces_of_vertices(mesh: trimesh.Trimesh) -> None:
    vertices, faces = mesh.vertices, mesh.faces
    if vertices.ndim != 2 or vertices.shape[1:] != (3,) or faces.shape[1:] != (3,):
        raise InvalidInput(
            "vertices or faces that have not three parts each",
            "a mesh is triangles in space",
            "export it again",
        )
    if len(faces) and not 0 <= faces.min() <= faces.max() < len(vertices):
        raise InvalidInput(
            f"faces of vertices {faces.min()} to {faces.max()}, of {len(vertices)}",
            "faces are made of the file's vertices",
            "export it again",
        )


def _require_fine_steps(mesh: trimesh.Trimesh) -> None:
    """Refuse what single precision has made coarse, as it does of a map's coordinates."""
    if not len(mesh.faces):
        return
    points = mesh.vertices
    largest = np.float32(min(np.abs(points).max(), np.finfo(np.float32).max))
    step, size = float(np.spacing(largest)), float(np.median(np.ptp(points, axis=0)))
    if step > COARSEST * size > 0.0 and (points == np.float32(points)).all():
        given = f"coordinates in single precision up to {largest:.3g}, in steps of {step:.2g}"
        rule = f"steps are at most {COARSEST:.1%} of the mesh"
        raise InvalidInput(given, rule, "export it about a local origin")
