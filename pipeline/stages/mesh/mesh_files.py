"""Files of meshes: read by their format, of bounded size."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from pipeline.config.outside import check_regular
from pipeline.stages.mesh import collada_files, gltf_files, ply_files, text_meshes
from pipeline.stages.mesh.shapes import require_fine, require_vertices, step
from vsr_core.errors import InvalidInput, reason

if TYPE_CHECKING:
    import trimesh

LARGEST_FILE = 2 * 1024**3
"""Bytes of a file: of some forty million faces, which take some tens of gigabytes of memory."""


_SAME_UNIT = 1e-3
"""Rounding of a unit, as of 0.0254 m."""


def read(path: Path, scale: float = 1.0) -> trimesh.Trimesh:
    """The mesh in a file; files that it names, such as textures, are not opened.

    Parameters
    ----------
    scale : float, length of its unit [m]

    Returns
    -------
    trimesh.Trimesh [m]
    """
    check_regular(path, LARGEST_FILE)
    kind = path.suffix[1:].lower()
    try:
        with path.open("rb") as file:
            mesh = _AS_READ[kind](file)
    except InvalidInput:
        raise
    except Exception as error:  # noqa: BLE001 (readers of five formats raise what they like)
        raise InvalidInput(
            f"a file that cannot be read ({reason(error)})", "it is a mesh", "export it again"
        ) from None
    _require_faces_of_vertices(mesh)
    require_fine(step(mesh.vertices), mesh)
    of_file = _unit(mesh.units or "meters")
    if of_file != 1.0 and abs(scale / of_file - 1.0) > _SAME_UNIT:
        beside = "" if scale == 1.0 else f", and rock.scale: {scale:g}"
        remedy = f"export it in metres, or say rock.scale: {of_file:.10g} of a rock"
        given = f"a unit of {of_file:.10g} m in the file{beside}"
        raise InvalidInput(given, "it is the metre" if scale == 1.0 else "they agree", remedy)
    return mesh.apply_scale(scale)


def _unit(name: Any) -> float:
    """Length [m] of the unit that a file states."""
    from trimesh.units import unit_conversion

    with suppress(AttributeError, ValueError):
        if 0.0 < (length := unit_conversion(name, "meters")) < math.inf:
            return float(length)
    given = f"a unit of {str(name)[:40]!r} in the file"
    raise InvalidInput(given, "it is one of length", "export it in metres")


_AS_READ: dict[str, Callable[[BinaryIO], trimesh.Trimesh]] = {
    "dae": collada_files.of_dae,
    "glb": gltf_files.of_glb,
    "obj": text_meshes.of_obj,
    "ply": ply_files.of_ply,
    "stl": text_meshes.of_stl,
}
"""The mesh of a file, by its format."""


def _require_faces_of_vertices(mesh: trimesh.Trimesh) -> None:
    vertices, faces = mesh.vertices, mesh.faces
    if vertices.ndim != 2 or vertices.shape[1:] != (3,) or faces.shape[1:] != (3,):
        raise InvalidInput(
            "vertices or faces that have not three parts each",
            "a mesh is triangles in space",
            "export it again",
        )
    require_vertices(faces, len(vertices))
