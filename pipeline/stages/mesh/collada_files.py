"""Meshes in COLLADA files: all faces of the scene, or none.

Rules are those of "COLLADA - Digital Asset Schema Release 1.4.1" (Khronos Group, 2008).
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator
from functools import cache, partial
from typing import TYPE_CHECKING, BinaryIO
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np

from pipeline.stages.mesh.shapes import MOST_SHAPES, Shape, joined
from pipeline.stages.mesh.text_meshes import fans
from vsr_core.arrays import Array, Indices
from vsr_core.errors import InvalidInput

if TYPE_CHECKING:
    import trimesh

_SURFACES = {"triangles", "polylist", "polygons", "trifans", "tristrips"}

_GEOMETRIES = {"mesh", "spline", "asset", "extra"}
"""What stands in a geometry that can be read; a spline has no faces."""

_NUMBERS = {"matrix": 16, "rotate": 4, "scale": 3, "translate": 3}
_MOVES = {name: f"{number} numbers" for name, number in _NUMBERS.items()} | {
    "matrix": "16 numbers, the last of them 0 0 0 1",
    "rotate": "4 numbers: an axis of length 1, and degrees",
}
"""What moves a node."""

_BESIDE = {"asset", "lookat", "extra", "instance_camera", "instance_light"}
"""What else stands in a node beside shapes and nodes."""

_DEFORMS = {"skew", "instance_controller"}

_OFF_ONE = 1e-4
"""Rounding of the length of an axis."""

_LENGTHS = {
    **dict.fromkeys(("millimeter", "millimetre", "mm"), 1e-3),
    **dict.fromkeys(("centimeter", "centimetre", "cm"), 1e-2),
    **dict.fromkeys(("meter", "metre", "m"), 1.0),
    **dict.fromkeys(("kilometer", "kilometre", "km"), 1e3),
    **dict.fromkeys(("inch", "inches", "in"), 0.0254),
    **dict.fromkeys(("foot", "feet", "ft"), 0.3048),
    **dict.fromkeys(("yard", "yd"), 0.9144),
}

_NUMBER = re.compile(r"[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?")


def of_dae(file: BinaryIO) -> trimesh.Trimesh:
    """The shapes of a file's scene, in one mesh of the file's unit.

    Raises
    ------
    InvalidInput
        If its numbers, faces, moves or shapes are not as many as it says, or not understood.
    """
    tree = ElementTree.parse(file).getroot()  # noqa: S314 (expat refuses texts that multiply)
    for one in tree.iter():
        one.tag = one.tag.rpartition("}")[2]
    unit = _unit(tree)
    geometries = _by_id(tree.iter("geometry"))
    shapes = {name: [*_shapes(one)] for name, one in geometries.items()}
    placed, shown = [], set[Element]()
    for one, matrix in _placed(tree):
        shown.add(one)
        placed.append((_linked(geometries, one.get("url", ""), one.tag).get("id", ""), matrix))
    named = {name for name, _ in placed}
    beside = [name for name, parts in shapes.items() if parts and name not in named]
    if beside or shown != {*tree.iter("instance_geometry")}:
        given = f"shapes beside the scene{', such as ' if beside else ''}{', '.join(beside)[:40]}"
        raise InvalidInput(given, "its scene has all of them", "export the rock alone")
    return joined(shapes, placed, "meters" if unit == 1.0 else f"{unit} * meters")


def _other_count(what: str) -> InvalidInput:
    """Of a file that does not hold as much as it says."""
    return InvalidInput(f"a file of {what}", "it holds as many as it says", "export it again")


def _unit(tree: Element) -> float:
    """Length of the unit [m], which is one, and as its name says; 1 m is taken for none."""
    units = _units(tree)
    whole = units[0].get("meter", "1") if units else "1"
    for unit in _units(tree.iter()):
        name, metres = str(unit.get("name")).lower(), unit.get("meter", "1")
        known = [one for word, one in _LENGTHS.items() if name in (word, f"{word}s")]
        is_known = _NUMBER.fullmatch(metres) is not None and 0.0 < float(metres) < math.inf
        is_off = not is_known or (float(metres) == 1.0 and known not in ([], [1.0]))
        if is_off or len(units) > 1 or metres != whole:
            given = f"a unit {unit.get('name')!r} of {metres} m"
            raise InvalidInput(given, "there is one, and a length", "export it in metres")
    return float(whole)


def _units(parts: Iterable[Element]) -> list[Element]:
    return [one for asset in parts if asset.tag == "asset" for one in asset if one.tag == "unit"]


def _by_id(parts: Iterable[Element]) -> dict[str, Element]:
    """Parts by their names, of which none stands twice."""
    found: dict[str, Element] = {}
    for one in parts:
        if (name := one.get("id", "")) in found:
            given = f"two parts that are named {name!r}"
            raise InvalidInput(given, "a name is of one part", "export it again")
        found[name] = one
    return found


def _linked(parts: dict[str, Element], name: str, of: str) -> Element:
    """The part that another names."""
    if not name.startswith("#") or name[1:] not in parts:
        given = f"a file whose {of} is of {name[:40]!r}, which cannot be read"
        raise InvalidInput(given, "what it names is in it", "export it again")
    return parts[name[1:]]


def _placed(tree: Element) -> Iterator[tuple[Element, Array]]:
    """Shapes of the scene, each as often as it is there, and where they stand, shape (4, 4)."""
    scene = tree.find("scene/instance_visual_scene")
    if scene is None:
        given = f"COLLADA {tree.get('version')} without a scene that can be read"
        raise InvalidInput(given, "it is COLLADA 1.4 with a scene", "export it again")
    used = {one.get("url", "")[1:] for one in tree.iter("instance_node")}
    nodes = _by_id(one for one in tree.iter("node") if one.get("id") in used)
    root = _linked(_by_id(tree.iter("visual_scene")), scene.get("url", ""), scene.tag)
    left, number = [(one, np.eye(4)) for one in root if one.tag == "node"], 0
    while left:
        node, parent = left.pop()
        number += 1
        if number > MOST_SHAPES:
            given, rule = f"more than {MOST_SHAPES:,} nodes in a scene", "they are not more"
            raise InvalidInput(given, rule, "export the rock alone")
        matrix = parent @ _matrix(node)
        yield from ((one, matrix) for one in node if one.tag == "instance_geometry")
        left += [(one, matrix) for one in node if one.tag == "node"]
        links = [one for one in node if one.tag == "instance_node"]
        left += [(_linked(nodes, one.get("url", ""), one.tag), matrix) for one in links]


def _matrix(node: Element) -> Array:
    """What moves a node, shape (4, 4): its moves, the last of them first."""
    from trimesh.transformations import rotation_matrix, translation_matrix

    moves: dict[str, Callable[[Array], Array]] = {
        "matrix": lambda values: values.reshape(4, 4),
        "rotate": lambda values: rotation_matrix(np.radians(values[3]), values[:3]),
        "scale": lambda values: np.diag([*values, 1.0]),
        "translate": translation_matrix,
    }
    found: Array = np.eye(4)
    for one in node:
        if one.tag in moves:
            found = found @ moves[one.tag](_move(one))
        elif one.tag in _DEFORMS or (one.tag == "lookat" and _has_shapes(node)):
            rule = "it is turned, scaled and moved only"
            raise InvalidInput(f"a node with {one.tag}", rule, "export it without")
        elif one.tag not in {*_BESIDE, "node", "instance_geometry", "instance_node"}:
            given, rule = f"a node with a {one.tag[:40]!r}", "a node has none"
            raise InvalidInput(given, rule, "export it again")
    return found


def _has_shapes(node: Element) -> bool:
    return any(one.tag in ("instance_geometry", "instance_node") for one in node.iter())


def _move(one: Element) -> Array:
    words = _words(one)
    values = [float(word) if _NUMBER.fullmatch(word) else math.nan for word in words]
    is_one = len(words) == _NUMBERS[one.tag] and all(map(math.isfinite, values))
    if is_one and one.tag == "matrix":
        is_one = values[12:] == [0.0, 0.0, 0.0, 1.0]
    elif is_one and one.tag == "rotate":
        is_one = abs(math.hypot(*values[:3]) - 1.0) < _OFF_ONE
    if not is_one:
        given = f"a {one.tag} of {' '.join(words)[:40]!r}"
        raise InvalidInput(given, f"it has {_MOVES[one.tag]}", "export it again")
    return np.array(values)


def _words(one: Element) -> list[str]:
    return re.findall(r"[^ \t\r\n]+", one.text or "")


def _shapes(geometry: Element) -> Iterator[Shape]:
    """The parts of a geometry, but for lines, of the vertices that they have."""
    if odd := next((one.tag for one in geometry if one.tag not in _GEOMETRIES), None):
        raise InvalidInput(f"a geometry of {odd[:40]!r}", "it is a mesh", "export it as a mesh")
    parts = geometry.findall("mesh/*")
    named = _by_id(one for one in parts if one.tag in ("source", "vertices"))
    numbers = cache(partial(_numbers, named))
    found = (_shape(part, numbers) for part in parts if part.tag in _SURFACES)
    yield from (one for one in found if len(one.faces))


def _shape(part: Element, numbers: Callable[[str, str], Array]) -> Shape:
    """A part of a geometry.

    Parameters
    ----------
    numbers : of a source by its name, and what they are
    """
    inputs = [one for one in part if one.tag == "input"]
    offsets = [_whole(one.get("offset", "")) for one in inputs]
    of = {
        one.get("semantic"): (one.get("source", ""), at)
        for one, at in reversed([*zip(inputs, offsets, strict=True)])  # of several the first
    }
    if "VERTEX" not in of or min(offsets) < 0:
        raise _other_count(f"{part.tag} which do not say where their vertices stand")
    corners, faces = _faces(part, 1 + max(offsets))
    held, rows = [], []
    for name in ("VERTEX", "COLOR"):
        if name in of:
            values, row = numbers(of[name][0], name), corners[:, of[name][1]]
            if row.max(initial=-1) >= len(values):
                given = f"a face of number {row.max()}, of {len(values)}"
                raise InvalidInput(given, "faces are of what stands beside them", "export it again")
            held.append(values)
            rows.append(row)
    _, first, at = np.unique(
        np.ravel_multi_index(rows, [max(len(one), 1) for one in held]),
        return_index=True,
        return_inverse=True,
    )
    points, *colours = (values[row[first]] for values, row in zip(held, rows, strict=True))
    return Shape(points, at[faces], colours[0] if colours else None)


def _numbers(named: dict[str, Element], link: str, kind: str) -> Array:
    """Coordinates of vertices, or colours, shape (n, 3), one after the other."""
    source, letters = _linked(named, link, kind), [*"RGB"]
    if kind == "VERTEX":
        places = [one for one in source if one.get("semantic") == "POSITION"]
        if len(places) != 1:
            given = f"vertices at {'two places' if places else 'no place'}"
            raise InvalidInput(given, "each is at one", "export it again")
        source, letters = _linked(named, places[0].get("source", ""), "POSITION"), [*"XYZ"]
    accessor, numbers = source.find("technique_common/accessor"), source.find("float_array")
    if accessor is None or numbers is None or accessor.get("source") != f"#{numbers.get('id')}":
        given = "an accessor of other numbers than those beside which it stands"
        raise InvalidInput(given, "it is of these", "export it again")
    names = [str(one.get("name")) for one in accessor]
    start, step = _whole(accessor.get("offset", "0")), _whole(accessor.get("stride", "1"))
    if names[:3] != letters or (start, step) != (0, len(names)):
        given = f"numbers {', '.join(names)} from number {start} on in steps of {step}"
        rule = f"they are {', '.join(letters)}, each after the other"
        raise InvalidInput(given, rule, "export it again")
    words = _words(numbers)
    told = _whole(numbers.get("count", "")), step * _whole(accessor.get("count", ""))
    if told != (len(words), len(words)):
        raise _other_count(f"{told[0]} numbers of which others are there")
    if odd := next((word for word in words if not _NUMBER.fullmatch(word)), None):
        given = f"a coordinate {odd[:40]!r}"
        raise InvalidInput(given, "it is a number", "export it again")
    return np.array(words, dtype=float).reshape(-1, step)[:, :3]


def _whole(word: str) -> int:
    """A number from 0 on; -1 of what is none."""
    return int(word) if re.fullmatch(r"[ \t\r\n]*\+?[0-9]+[ \t\r\n]*", word) else -1


def _faces(part: Element, each: int) -> tuple[Indices, Indices]:
    """Corners of a part, and its triangles, where there are as many as it says.

    Parameters
    ----------
    each : int, how many numbers stand for a corner

    Returns
    -------
    corners : ndarray of int, shape (n, each), numbers of what stands there
    faces : ndarray of int, shape (k, 3), of the corners
    """
    texts = [_words(one) for one in part if one.tag == "p"]
    words = [word for one in texts for word in one]
    sizes = _sizes(part, [len(one) for one in texts], each)
    is_one = part.tag not in ("triangles", "polylist") or len(texts) < 2
    is_whole = each * sum(sizes) == len(words) and len(sizes) == _whole(part.get("count", ""))
    are_numbers = all(word.isascii() and word.isdigit() for word in words)
    if not (is_one and is_whole and are_numbers and min(sizes, default=3) > 2) or part.find("ph"):
        raise _other_count(f"{part.get('count')} {part.tag} whose corners are others")
    corners, many = (
        np.array(words, dtype=np.int64).reshape(-1, each),
        np.array(sizes, dtype=np.int64),
    )
    return corners, _strips(many) if part.tag == "tristrips" else fans(
        np.arange(len(corners)), many
    )


def _sizes(part: Element, lengths: list[int], each: int) -> list[int]:
    """How many corners each face, strip or fan has.

    Parameters
    ----------
    lengths : list of int, how many numbers its texts have
    """
    if part.tag == "triangles":
        return [3] * (sum(lengths) // (3 * each))
    if part.tag == "polylist":
        return [_whole(word) for one in part if one.tag == "vcount" for word in _words(one)]
    return [length // each for length in lengths]


def _strips(sizes: Indices) -> Indices:
    """Triangles of strips, shape (k, 3): each has two corners of the one before, in turn."""
    many = sizes - 2
    turn = np.arange(many.sum()) - np.repeat(np.cumsum(many) - many, many)
    at = np.repeat(np.cumsum(sizes) - sizes, many) + turn
    return np.column_stack([at + turn % 2, at + 1 - turn % 2, at + 2])
