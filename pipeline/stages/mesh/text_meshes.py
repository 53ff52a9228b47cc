"""Meshes as text, OBJ and STL, and binary STL: each line is one of the format's, and whole.

trimesh passes over lines that it does not know, as those of a part that was cut, or that begin with
a blank.
"""

from __future__ import annotations

import re
from array import array
from collections.abc import Callable
from typing import TYPE_CHECKING, BinaryIO, TypeVar

import numpy as np

from vsr_core.arrays import Indices
from vsr_core.errors import InvalidInput

if TYPE_CHECKING:
    import trimesh

_T = TypeVar("_T", int, float)

_BOM = b"\xef\xbb\xbf"

_CORNER = re.compile(rb"([+-]?\d+)((?:/[+-]?\d*){0,2})")

_PASSED_OVER = frozenset(
    b"vt vn vp g s mg o p l usemtl mtllib usemap maplib bevel c_interp d_interp lod shadow_obj "
    b"trace_obj cstype deg bmat step curv curv2 parm trim hole scrv sp con end".split()
)
"""What an OBJ file has beside vertices and faces: materials, points, lines and curves."""

_FACET = (b"facet", b"outer", b"vertex", b"vertex", b"vertex", b"endloop", b"endfacet")

_WORDS = {b"facet": 5, b"outer": 2, b"vertex": 4, b"endloop": 1, b"endfacet": 1}

_STL_HEAD = 84
"""Bytes of a binary STL file before its facets."""

_STL_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])


def of_obj(file: BinaryIO) -> trimesh.Trimesh:
    """The faces of an OBJ file, by "Object Files", appendix B1 of Wavefront's manual.

    Negative numbers of vertices count back from the face's own line.

    Raises
    ------
    InvalidInput
        Of a line that is none of the format's, or not whole.
    """
    import trimesh

    text = file.read().removeprefix(_BOM)
    text = re.sub(rb"\\(?:\r\n|\r|\n)", b" ", text)  # lines that go on in the next
    vertices, colours, corners, sizes = array("d"), array("d"), array("q"), array("q")
    for line in text.splitlines():
        key, *words = line.partition(b"#")[0].split() or [b""]
        if key == b"v" and len(words) in (3, 4, 6, 7):
            point = _numbers(line, words, float)
            vertices.extend(point[:3])
            colours.extend(point[3:] if len(point) == 6 else ())
        elif key in (b"f", b"fo") and len(words) > 2:
            corners.extend(_corners(line, words, len(vertices) // 3))
            sizes.append(len(words))
        elif key and key not in _PASSED_OVER:
            raise _odd(line)
    points = np.array(vertices).reshape(-1, 3)
    shown = np.array(colours).reshape(-1, 3) if len(colours) == len(vertices) else None
    faces = fans(np.array(corners, dtype=np.int64), np.array(sizes, dtype=np.int64))
    return trimesh.Trimesh(points, faces, vertex_colors=shown, process=False)


def _corners(line: bytes, words: list[bytes], number: int) -> list[int]:
    """Vertices of a face, from 0 on, after so many vertices."""
    if b"/" in line:
        found = [_CORNER.fullmatch(word) for word in words]
        if len({one[2].count(b"/") for one in found if one}) > 1:
            raise _odd(line)
        words = [one[1] if one else b"" for one in found]
    named = _numbers(line, words, int)
    if 0 in named or min(named) < -number:
        given = f"a face of vertex {0 if 0 in named else f'{min(named)} after {number}'}"
        raise InvalidInput(given, "the first vertex is 1, the last one -1", "export it again")
    return [at - 1 if at > 0 else number + at for at in named]


def fans(corners: Indices, sizes: Indices) -> Indices:
    """Triangles of faces, shape (k, 3): each has the first corner of its face.

    Parameters
    ----------
    corners : ndarray of int, shape (n,), of all faces
    sizes : ndarray of int, shape (m,), how many each of them has
    """
    many = np.maximum(sizes - 2, 0)
    first = np.repeat(np.cumsum(sizes) - sizes, many)
    beside = np.arange(1, len(first) + 1) - np.repeat(np.cumsum(many) - many, many)
    return corners[np.column_stack([first, first + beside, first + beside + 1])]


def of_stl(file: BinaryIO) -> trimesh.Trimesh:
    """The facets of an STL file, by "StL Interface Specification" (3D Systems, 1989).

    Raises
    ------
    InvalidInput
        Of a line of text that is none of the format's, or in another place; of other facets than a
        binary file says.
    """
    import trimesh

    data = file.read()
    number = int.from_bytes(data[_STL_HEAD - 4 : _STL_HEAD], "little")
    if len(data) >= _STL_HEAD and len(data) == _STL_HEAD + _STL_FACET.itemsize * number:
        corners = np.frombuffer(data, _STL_FACET, number, _STL_HEAD)["corners"].reshape(-1, 3)
        faces = np.arange(len(corners)).reshape(-1, 3)
        return trimesh.Trimesh(corners.astype(np.float64), faces, process=False)
    if b"\0" in data:
        given = f"a file of {len(data)} bytes that says {number} facets"
        rule = f"it has {_STL_HEAD}, and {_STL_FACET.itemsize} for each"
        raise InvalidInput(given, rule, "export it again")
    vertices, at, is_open = array("d"), 0, False
    for line in data.removeprefix(_BOM).splitlines():
        words = line.split() or [b""]
        key = words[0].lower()
        if is_open and key == _FACET[at] and len(words) == _WORDS[key]:
            at = (at + 1) % len(_FACET)
            if key == b"vertex":
                vertices.extend(_numbers(line, words[1:], float))
        elif at == 0 and key == (b"endsolid" if is_open else b"solid"):
            is_open = not is_open
        elif key:
            raise _odd(line)
    if is_open:
        raise InvalidInput("a solid without its end", "a file is whole", "export it again")
    points = np.array(vertices).reshape(-1, 3)
    return trimesh.Trimesh(points, np.arange(len(points)).reshape(-1, 3), process=False)


def _numbers(line: bytes, words: list[bytes], kind: Callable[[bytes], _T]) -> list[_T]:
    try:
        if b"_" not in line:  # of which Python makes a number
            return [kind(word) for word in words]
    except ValueError:
        pass
    raise _odd(line)


def _odd(line: bytes) -> InvalidInput:
    given = f"a line {line.strip()[:40].decode('latin-1')!r}"
    return InvalidInput(given, "each is one of the format's, and whole", "export it again")
