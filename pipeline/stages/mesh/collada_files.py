"""Meshes in COLLADA files: all faces of the scene, or none.

Rules are those of "COLLADA - Digital Asset Schema Release 1.4.1" (Khronos Group, 2008).
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator
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

_FANS = {"triangles", "polylist", "polygons", "trifans"}

_SURFACES = {*_FANS, "tristrips"}

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

_LENGTHS = {"millimeter": 1e-3, "centimeter": 1e-2, "meter": 1.0, "inch": 0.0254, "foot": 0.3048}

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
        placed.append((_linked(geometries, one).get("id", ""), matrix))
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


def _linked(parts: dict[str, Element], link: Element, key: str = "url") -> Element:
    """The part that another names."""
    name = link.get(key, "")
    if not name.startswith("#") or name[1:] not in parts:
        given = f"a file whose {link.tag} is of {name[:40]!r}, which cannot be read"
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
    root = _linked(_by_id(tree.iter("visual_scene")), scene)
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
        left += [(_linked(nodes, one), matrix) for one in node if one.tag == "instance_node"]


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
    """The parts of a geometry, but for lines."""
    surfaces = [one for one in geometry.findall("mesh/*") if one.tag in _SURFACES]
    if len(surfaces) != sum(one.tag in _SURFACES for one in geometry.iter()):
        raise _other_count(f"faces of {geometry.get('id')!r} which cannot be read")
    named = _by_id(one for one in geometry.findall("mesh/*") if one.tag in ("source", "vertices"))
    for part in surfaces:
        inputs = [one for one in part if one.tag == "input"]
        (of,) = (one for one in inputs if one.get("semantic") == "VERTEX")
        points = _points(named, _linked(named, of, "source"))
        faces = _faces(part, 1 + max(_whole(one.get("offset", "")) for one in inputs), of)
        yield Shape(points, faces)


def _points(named: dict[str, Element], vertices: Element) -> Array:
    """Coordinates of vertices, shape (n, 3): numbers x, y and z, one after the other."""
    places = [one for one in vertices if one.get("semantic") == "POSITION"]
    if len(places) != 1:
        given = f"vertices at {'two places' if places else 'no place'}"
        raise InvalidInput(given, "each is at one", "export it again")
    source = _linked(named, places[0], "source")
    accessor, numbers = source.find("technique_common/accessor"), source.find("float_array")
    if accessor is None or numbers is None or accessor.get("source") != f"#{numbers.get('id')}":
        given = "an accessor of other numbers than those beside which it stands"
        raise InvalidInput(given, "it is of these", "export it again")
    names = [str(one.get("name")) for one in accessor]
    start, step = _whole(accessor.get("offset", "0")), _whole(accessor.get("stride", "1"))
    if names != [*"XYZ"] or (start, step) != (0, 3):
        given = f"coordinates {', '.join(names)} from number {start} on in steps of {step}"
        raise InvalidInput(given, "they are X, Y, Z, and nothing else", "export it again")
    words = _words(numbers)
    told = _whole(numbers.get("count", "")), 3 * _whole(accessor.get("count", ""))
    if told != (len(words), len(words)):
        raise _other_count(f"{told[0]} numbers of which others are there")
    if odd := next((word for word in words if not _NUMBER.fullmatch(word)), None):
        given = f"a coordinate {odd[:40]!r}"
        raise InvalidInput(given, "it is a number", "export it again")
    return np.array(words, dtype=float).reshape(-1, 3)


def _whole(word: str) -> int:
    """A number from 0 on; -1 of what is none."""
    return int(word) if word.isascii() and word.isdigit() else -1


def _faces(part: Element, each: int, of: Element) -> Indices:
    """Triangles of a part, shape (k, 3), where its corners are as many as it says.

    Parameters
    ----------
    each : int, how many numbers stand for a corner
    of : the input whose numbers are those of vertices
    """
    count, kind = _whole(part.get("count", "")), part.tag
    texts = [_words(one) for one in part if one.tag == "p"]
    is_whole = all(word.isascii() and word.isdigit() for words in texts for word in words)
    lengths = np.array([len(words) for words in texts], dtype=np.int64) / each
    sizes = lengths
    if kind == "triangles":
        sizes = np.full(max(count, 0), 3)
    elif kind == "polylist":
        sizes = np.array([_whole(word) for one in part.iter("vcount") for word in _words(one)])
    is_one = kind not in ("triangles", "polylist") or (
        len(texts) < 2 and lengths.sum() == sizes.sum()
    )
    if not (is_whole and is_one and len(sizes) == count and (sizes >= 3).all()) or (
        (lengths % 1.0).any() or any(one.tag == "ph" for one in part)
    ):
        raise _other_count(f"{count} {kind} whose corners are others")
    numbers = np.array([word for words in texts for word in words], dtype=np.int64)
    corners = numbers.reshape(-1, each)[:, _whole(of.get("offset", ""))]
    if kind in _FANS:
        return fans(corners, sizes.astype(np.int64))
    return np.concatenate(
        [_strip(one) for one in np.split(corners, np.cumsum(sizes.astype(int))[:-1])]
    )


def _strip(corners: Indices) -> Indices:
    """Triangles of a strip: each has two corners of the one before, and every second is turned."""
    faces = np.column_stack([corners[:-2], corners[1:-1], corners[2:]])
    faces[1::2] = faces[1::2, [1, 0, 2]]
    return faces
