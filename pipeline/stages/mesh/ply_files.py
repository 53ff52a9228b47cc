"""PLY files: that they are whole, and faces of any number of corners.

By "PLY - Polygon File Format" (Turk, 1994).
"""

from __future__ import annotations

import io
from array import array
from functools import partial
from itertools import accumulate, takewhile
from typing import Any, BinaryIO, NamedTuple

import numpy as np

from vsr_core.arrays import Array, Indices
from vsr_core.errors import InvalidInput

_LINE = 10_000
"""Bytes of a line of a header."""

_RULE = "it holds as many as it says"

_KINDS = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}


class _Element(NamedTuple):
    """What a header says of a kind of lines: the words of each of its properties."""

    name: str
    number: int
    properties: list[list[str]]


def of_triangles(file: BinaryIO) -> BinaryIO:
    """A file whose faces have three corners each, if it is binary; else the same.

    Raises
    ------
    InvalidInput
        Of a text with other lines than its header says; trimesh refuses binary ones.
    """
    lines = iter(partial(file.readline, _LINE), b"")
    header = [line.decode("latin-1").split() for line in takewhile(_is_before_end, lines)]
    elements = []
    for words in header:
        if words[:1] == ["element"]:
            elements.append(_Element(words[1], int(words[2]), []))
        elif words[:1] == ["property"]:
            elements[-1].properties.append(words[1:])
    if ["format", "ascii", "1.0"] in header:
        _require_lines(file, elements)
    elif [one.name for one in elements] == ["vertex", "face"]:
        order = "<" if ["format", "binary_little_endian", "1.0"] in header else ">"
        if (triangles := _triangles(file.read(), order, *elements)) is not None:
            return triangles
    file.seek(0)
    return file


def _is_before_end(line: bytes) -> bool:
    return line.split() != [b"end_header"]


def _require_lines(file: BinaryIO, elements: list[_Element]) -> None:
    held = [line.split() for line in file if line.strip()]
    counts = [one.number for one in elements]
    if len(held) != sum(counts):
        given = f"a file of {len(held)} lines where its header says {sum(counts)}"
        raise InvalidInput(given, _RULE, "export it again")
    for one, last in zip(elements, accumulate(counts), strict=True):
        lists = [words[0] == "list" for words in one.properties]
        own = held[last - one.number : last]
        if odd := next((line for line in own if _numbers(line, lists)), None):
            what = b" ".join(odd)[:40].decode("latin-1")
            given = f"a file of a line {what!r} of other numbers than its header says"
            raise InvalidInput(given, _RULE, "export it again")


def _numbers(line: list[bytes], lists: list[bool]) -> bool:
    """Whether a line has others than one for each property, or the length of a list."""
    at = 0
    for is_list in lists:
        at += 1 + (int(float(line[at])) if is_list and at < len(line) else 0)
    return at != len(line)


def _triangles(data: bytes, order: str, vertex: _Element, face: _Element) -> BinaryIO | None:
    """A file of triangles, where the faces of this one differ in their corners and have no more."""
    if [words[0] for words in face.properties] != ["list"] or not face.number:
        return None
    counted, corner = (np.dtype(order + _KINDS[kind]) for kind in face.properties[0][1:3])
    point = np.dtype([(words[-1], order + _KINDS[words[0]]) for words in vertex.properties])
    start, end = vertex.number * point.itemsize, len(data)
    places, sizes = array("q"), array("q")
    at = start
    while at < end and len(places) < face.number and counted.kind in "iu":
        size = int(np.frombuffer(data, counted, 1, at)[0])
        step = counted.itemsize + size * corner.itemsize
        if size < 0 or (at == start and end - start == face.number * step):
            return None
        places.append(at + counted.itemsize)
        sizes.append(size)
        at += step
    if at != end or len(places) != face.number:
        return None  # which trimesh refuses
    points = np.frombuffer(data, point, vertex.number)
    xyz = np.column_stack([points[name] for name in "xyz"]).astype("<f8")
    first, many = np.array(places), np.array(sizes)
    fans = [_fans(data, corner, first[many == size], int(size)) for size in np.unique(many)]
    return _written(xyz, np.concatenate(fans))


def _fans(data: bytes, corner: np.dtype[Any], places: Indices, size: int) -> Indices:
    """Triangles of faces of so many corners, shape (k, 3): each has the face's first."""
    beside = np.arange(size * corner.itemsize)
    held = np.frombuffer(data, np.uint8)[places[:, None] + beside]
    names = np.frombuffer(held.tobytes(), corner).reshape(-1, size).astype(np.int64)
    parts = [names[:, [0, at, at + 1]] for at in range(1, size - 1)]
    return np.concatenate([np.empty((0, 3), np.int64), *parts])


def _written(points: Array, corners: Indices) -> BinaryIO:
    rows = np.empty(len(corners), np.dtype([("number", "u1"), ("corners", "<i4", 3)]))
    rows["number"], rows["corners"] = 3, corners
    head = "".join(f"property double {name}\n" for name in "xyz")
    head = f"element vertex {len(points)}\n{head}element face {len(rows)}\n"
    head = f"ply\nformat binary_little_endian 1.0\n{head}property list uchar int vertex_indices\n"
    return io.BytesIO(f"{head}end_header\n".encode() + points.tobytes() + rows.tobytes())
