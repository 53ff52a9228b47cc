"""PLY files: that they are whole, and faces of any number of corners.

By "PLY - Polygon File Format" (Turk, 1994).
"""

from __future__ import annotations

import re
from array import array
from functools import partial
from itertools import accumulate, takewhile
from typing import TYPE_CHECKING, Any, BinaryIO, NamedTuple

import numpy as np

from pipeline.stages.mesh.text_meshes import fans
from vsr_core.arrays import Indices
from vsr_core.errors import InvalidInput

if TYPE_CHECKING:
    import trimesh

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

_CORNERS = ("vertex_indices", "vertex_index")

_COLOURS = ("red", "green", "blue")


class _Part(NamedTuple):
    """A property: its number, or, of a list, what counts its numbers, and one of them."""

    name: str
    kind: np.dtype[Any]
    counted: np.dtype[Any] | None


class _Element(NamedTuple):
    """What a header says of a kind of lines."""

    name: str
    number: int
    parts: list[_Part]

    @property
    def row(self) -> np.dtype[Any]:
        """Its numbers, but for lists."""
        return np.dtype([(one.name, one.kind) for one in self.parts if one.counted is None])

    @property
    def lists(self) -> list[_Part]:
        """Those of its properties that are lists."""
        return [one for one in self.parts if one.counted is not None]


def of_ply(file: BinaryIO) -> trimesh.Trimesh:
    """The mesh of a file; none of its faces if it has no faces.

    trimesh, by which others are read, takes each face of a binary file to have as many corners as
    the first.

    Raises
    ------
    InvalidInput
        If its lines, or its bytes, are not as many as its header says.
    """
    import trimesh

    lines = iter(partial(file.readline, _LINE), b"")
    header = [line.decode("latin-1").split() for line in takewhile(_is_before_end, lines)]
    order = "<" if ["format", "binary_little_endian", "1.0"] in header else ">"
    elements = []
    for words in header:
        if words[:1] == ["element"]:
            elements.append(_Element(words[1], int(words[2]), []))
        elif words[:1] == ["property"]:
            kinds = [np.dtype(order + _KINDS[word]) for word in words[1:-1] if word != "list"]
            counted = kinds[0] if words[1] == "list" else None
            elements[-1].parts.append(_Part(words[-1], kinds[-1], counted))
    if ["format", "ascii", "1.0"] in header:
        _require_lines(file, elements)
    elif any(one.name == "face" and one.number for one in elements):
        mesh = _of_polygons(file.read(), elements)
        if mesh is not None:
            return mesh
    file.seek(0)
    read = trimesh.load(file, file_type="ply", force="mesh", process=False)
    if isinstance(read, trimesh.Trimesh):
        held = read.metadata["_ply_raw"]["vertex"]["data"]  # by names; of a binary file one array
        names = held.dtype.names if isinstance(held, np.ndarray) else held
        if getattr(read.visual, "kind", None) == "texture" and {*_COLOURS} <= {*names}:
            colours = np.column_stack([np.ravel(held[name]) for name in _COLOURS])
            if len(colours) == len(read.vertices):  # which trimesh leaves out
                return trimesh.Trimesh(
                    read.vertices, read.faces, vertex_colors=colours, process=False
                )
        return read
    return trimesh.Trimesh(np.empty((0, 3)), np.empty((0, 3), dtype=int))


def _is_before_end(line: bytes) -> bool:
    return line.split() != [b"end_header"]


def _require_lines(file: BinaryIO, elements: list[_Element]) -> None:
    held = [line.split() for line in file if line.strip()]
    counts = [one.number for one in elements]
    if len(held) != sum(counts):
        given = f"a file of {len(held)} lines where its header says {sum(counts)}"
        raise InvalidInput(given, _RULE, "export it again")
    for one, last in zip(elements, accumulate(counts), strict=True):
        lists = [part.counted is not None for part in one.parts]
        own = held[last - one.number : last]
        if odd := next((line for line in own if _numbers(line, lists)), None):
            what = b" ".join(odd)[:40].decode("latin-1")
            given = f"a file of a line {what!r} of other numbers than its header says"
            raise InvalidInput(given, _RULE, "export it again")
        if one.lists:
            _require_whole_corners(own, one)
        else:
            _require_whole(own, one)


def _require_whole(lines: list[list[bytes]], element: _Element) -> None:
    """Refuse coordinates that are no such whole numbers as the header says."""
    for at, part in enumerate(element.parts):
        if part.name in "xyz" and part.kind.kind in "iu":
            low, high = np.iinfo(part.kind).min, np.iinfo(part.kind).max
            for line in lines:
                if not (_WHOLE.fullmatch(line[at]) and low <= int(line[at]) <= high):
                    given = f"{part.name} of {line[at][:40].decode('latin-1')!r}"
                    rule = f"it is a whole number, as the header says, from {low} to {high}"
                    raise InvalidInput(given, rule, "say float in the header, or export it again")


def _require_whole_corners(lines: list[list[bytes]], element: _Element) -> None:
    """Refuse others in lines of whole numbers alone, as faces without textures are."""
    if all(part.kind.kind in "iu" for part in element.parts):
        for word in (word for line in lines for word in line):
            if not _WHOLE.fullmatch(_LENGTH.sub(b"", word)):
                given = f"a face of {word[:40].decode('latin-1')!r}"
                raise InvalidInput(given, "its numbers are whole", "export it again")


_WHOLE, _LENGTH = re.compile(rb"[+-]?[0-9]+"), re.compile(rb"\.0*$")
"""A whole number, and what may stand behind one, as some write the lengths of lists."""


def _numbers(line: list[bytes], lists: list[bool]) -> bool:
    """Whether a line has others than one for each property, or the length of a list."""
    at = 0
    for is_list in lists:
        at += 1 + (int(float(line[at])) if is_list and at < len(line) else 0)
    return at != len(line)


def _of_polygons(data: bytes, elements: list[_Element]) -> trimesh.Trimesh | None:
    """The mesh of faces; none if all are triangles, which trimesh reads."""
    import trimesh

    listed = [one.name for one in elements if one.lists]
    if listed != ["face"]:
        given = f"lists of {listed or 'no element'}"
        raise InvalidInput(given, "they are of faces", "export it again")
    names = [one.name for one in elements]
    at, of_points = names.index("face"), names.index("vertex")
    lengths = [one.number * one.row.itemsize for one in elements]
    lengths[at] += len(data) - sum(lengths)
    starts = [*accumulate(lengths, initial=0)]
    faces = _faces(data, elements[at], starts[at], starts[at + 1])
    if faces is None:
        return None
    vertex = elements[of_points]
    points = np.frombuffer(data, vertex.row, vertex.number, starts[of_points])
    has_colours = all(_Part(name, np.dtype("u1"), None) in vertex.parts for name in _COLOURS)
    colours = np.column_stack([points[name] for name in _COLOURS]) if has_colours else None
    xyz = np.column_stack([points[name] for name in "xyz"]).astype(np.float64)
    return trimesh.Trimesh(xyz, faces, vertex_colors=colours, process=False)


def _faces(data: bytes, face: _Element, start: int, end: int) -> Indices | None:
    """Triangles of faces between two places of a file; none if all have three corners each."""
    own = next(at for at, part in enumerate(face.lists) if part.name in _CORNERS)
    if _are_triangles(data, face, own, start, end):
        return None
    places, sizes = array("q"), array("q")
    at = start
    while at < end and len(sizes) < face.number:
        at, held = _row(data, at, face.parts)
        places.append(held[own][0])
        sizes.append(held[own][1])
    if at != end or len(sizes) != face.number:
        given = f"a file of other faces than the {face.number} that its header says"
        raise InvalidInput(given, _RULE, "export it again")
    many, kind = np.array(sizes), face.lists[own].kind
    behind = np.arange(many.sum()) - np.repeat(np.cumsum(many) - many, many)
    begin = np.repeat(np.array(places), many) + behind * kind.itemsize
    corners = np.frombuffer(data, np.uint8)[begin[:, None] + np.arange(kind.itemsize)]
    return fans(np.frombuffer(corners.tobytes(), kind).astype(np.int64), many)


def _are_triangles(data: bytes, face: _Element, own: int, start: int, end: int) -> bool:
    """Whether all faces are as the first one, and it is of three corners."""
    beyond, first = _row(data, start, face.parts)
    step = beyond - start
    if first[own][1] != 3 or start + face.number * step != end:
        return False
    lists = ((part, *held) for part, held in zip(face.lists, first, strict=True))
    counts = (
        np.ndarray(face.number, part.counted, data, place - part.counted.itemsize, (step,)) == size
        for part, place, size in lists
        if part.counted
    )
    return all(same.all() for same in counts)


def _row(data: bytes, at: int, parts: list[_Part]) -> tuple[int, list[tuple[int, int]]]:
    """Where a row ends that begins at a place; of its lists, where numbers are, and how many."""
    lists = []
    for part in parts:
        number = 1
        if part.counted is not None:
            word = data[at : at + part.counted.itemsize]
            big, signed = part.counted.byteorder == ">", part.counted.kind == "i"
            number = int.from_bytes(word, "big" if big else "little", signed=signed)
            at += part.counted.itemsize
            if number < 0 or part.counted.kind == "f":
                raise InvalidInput("a list of no length", _RULE, "export it again")
            lists.append((at, number))
        at += number * part.kind.itemsize
    return at, lists
