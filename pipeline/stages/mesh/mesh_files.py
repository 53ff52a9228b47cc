"""Files of meshes: read by their format, of bounded size."""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from pipeline.config.outside import check_regular
from pipeline.stages.mesh import collada_files, gltf_files, ply_files
from pipeline.stages.mesh.gltf_files import COARSEST
from vsr_core.errors import InvalidInput, reason

if TYPE_CHECKING:
    import trimesh

LARGEST_FILE = 2 * 1024**3
"""Bytes of a file: of some forty million faces, which take some tens of gigabytes of memory."""


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
            taken = _AS_READ[kind](file) if kind in _AS_READ else file
            mesh = trimesh.load(taken, file_type=kind, resolver={}, force="mesh", process=False)
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


def _counted_from_the_first(file: BinaryIO) -> BinaryIO:
    """An OBJ text whose faces name no vertices by how far before the face they are.

    Such negative numbers count back from the face's own line ("Object Files", appendix B1 of the
    manual of Wavefront's Advanced Visualizer); trimesh counts from the end of the file. Those of
    textures and normals are left, as neither is used.
    """
    text = file.read().replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    text = re.sub(rb"#.*", b"", text.replace(b"\t", b" "))  # trimesh knows no tabs
    if _NO_VERTEX.search(text):
        raise InvalidInput("a face of vertex 0", "the first vertex is 1", "export it again")
    text = b"\n" + re.sub(rb"\\\r?\n", b"", text.strip())  # without lines that go on in the next
    vertices, seen = range(1, 1), 0

    def face(line: re.Match[bytes]) -> bytes:
        nonlocal vertices, seen
        more = text.count(b"\nv ", seen, line.start())
        vertices, seen = range(1, len(vertices) + more + 1), line.start()
        return re.sub(rb"(?<= )-\d+", lambda back: b"%d" % vertices[int(back[0])], line[0])

    return io.BytesIO(re.sub(rb"^f .*-.*", face, text, flags=re.MULTILINE))


_NO_VERTEX = re.compile(rb"^ *f (?:.* )?0(?=[ /\r\n]|\Z)", re.MULTILINE)

_AS_READ: dict[str, Callable[[BinaryIO], BinaryIO]] = {
    "dae": collada_files.without_pictures,
    "glb": gltf_files.plain,
    "obj": _counted_from_the_first,
    "ply": ply_files.of_triangles,
}
"""What trimesh reads of a file, by its format."""


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
