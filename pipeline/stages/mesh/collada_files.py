"""Whether a COLLADA file can be read whole: trimesh leaves out what it cannot read.

Names of parts are those of "COLLADA - Digital Asset Schema Release 1.4.1" (Khronos Group, 2008).
"""

from __future__ import annotations

import io
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable
from functools import cache
from typing import Any, BinaryIO
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from pipeline.stages.mesh.file_limits import check_repeated
from vsr_core.errors import InvalidInput

_SURFACES, _STRIPS = {"triangles", "polylist", "polygons"}, {"trifans", "tristrips"}

_NUMBERS = {"matrix": 16, "rotate": 4, "scale": 3, "translate": 3}
_MOVES = {name: f"{number} numbers" for name, number in _NUMBERS.items()} | {
    "matrix": "16 numbers, the last of them 0 0 0 1",
    "rotate": "4 numbers: an axis of length 1, and degrees",
}
"""What moves a node."""

_OF_NODES = {"asset", "lookat", "skew", "node", "extra", *_NUMBERS} | {
    f"instance_{kind}" for kind in ("camera", "controller", "geometry", "light", "node")
}
"""What stands in a node (COLLADA 1.4.1, Khronos Group 2008)."""

_OFF_ONE = 1e-4
"""Rounding of the length of an axis; by a longer one pycollada enlarges the rock."""

_SHAPES = {"instance_geometry", "instance_controller"}


def without_pictures(file: BinaryIO) -> BinaryIO:
    """A file's shapes alone: pycollada leaves out those whose material it cannot read.

    Raises
    ------
    InvalidInput
        If its numbers, faces, moves or shapes are not as many as it says.
    """
    import collada

    tree = ElementTree.parse(file).getroot()  # noqa: S314 (expat refuses texts that multiply)
    for one in tree.iter():
        for part in [part for part in one if _name(part) in _PICTURES]:
            one.remove(part)
    _check_unit(tree)
    _check_names(tree)
    for one in tree.iter():
        if _name(one) == "float_array" and len(_words(one)) != int(one.get("count", -1)):
            raise _other_count(f"{one.get('count')} numbers of which others are there")
        if _name(one) == "node":
            _check_moves(one)
        if _name(one) == "mesh":
            _check_order(one)
            _check_coordinates(one)
    shapes = io.BytesIO(ElementTree.tostring(tree))
    found = collada.Collada(shapes, ignore=[collada.common.DaeError])
    if found.scene is None:
        given = f"COLLADA {tree.get('version')} without a scene that can be read"
        raise InvalidInput(given, "it is COLLADA 1.4 with a scene", "export it again")
    faces = _require_faces(tree, found)
    told, held = _in_scene(tree, lambda _: 1), _held_shapes(found.scene.nodes)
    shown = _in_scene(tree, lambda one: faces[one.get("url", "").removeprefix("#")])
    check_repeated(told, shown, faces.total())
    if told != held:
        raise _other_count(f"{told} shapes in its scene, of which {held} can be read")
    shapes.seek(0)
    return shapes


_PICTURES = {"bind_material", "library_effects", "library_images", "library_materials"}


def _other_count(what: str) -> InvalidInput:
    """Of a file that does not hold as much as it says."""
    return InvalidInput(f"a file of {what}", "it holds as many as it says", "export it again")


def _name(one: Element) -> str:
    return one.tag.rpartition("}")[2]


def _words(one: Element) -> list[str]:
    return re.findall(r"[^ \t\r\n]+", one.text or "")


def _check_unit(tree: Element) -> None:
    """Refuse a unit that is no length, or another than its name says; 1 m is taken for none."""
    units = _units(tree)
    whole = units[0].get("meter", "1") if units else "1"
    for unit in _units(tree.iter()):
        name, metres = str(unit.get("name")).lower(), unit.get("meter", "1")
        known = [one for word, one in _LENGTHS.items() if name in (word, f"{word}s")]
        is_known = _is_number(metres) and float(metres) > 0.0
        is_off = not is_known or (float(metres) == 1.0 and known not in ([], [1.0]))
        if is_off or len(units) > 1 or metres != whole:
            given = f"a unit {unit.get('name')!r} of {metres} m"
            raise InvalidInput(given, "there is one, and a length", "export it in metres")


_LENGTHS = {"millimeter": 1e-3, "centimeter": 1e-2, "meter": 1.0, "inch": 0.0254, "foot": 0.3048}


def _units(parts: Iterable[Element]) -> list[Element]:
    assets = (part for part in parts if _name(part) == "asset")
    return [one for asset in assets for one in asset if _name(one) == "unit"]


def _check_order(mesh: Element) -> None:
    """Refuse coordinates in another order than x, y, z, or apart from each other."""
    parts = [(source, one) for source in mesh if _name(source) == "source" for one in source.iter()]
    for source, one in ((source, one) for source, one in parts if _name(one) == "accessor"):
        if one.get("source") not in [f"#{held.get('id')}" for held in source]:
            given = f"an accessor of {one.get('source')!r}, beside which it is not"
            raise InvalidInput(given, "it is of the numbers beside it", "export it again")
        names = [part.get("name") for part in one if _name(part) == "param"]
        told = int(one.get("offset", 0)), int(one.get("stride", 1))
        if told != (0, len(names)):
            given = f"an accessor from {told[0]} on in steps of {told[1]}, of {len(names)} numbers"
            rule = "its numbers stand one after the other, from the first on"
            raise InvalidInput(given, rule, "export it again")
        if sorted(map(str, names)) == [*"XYZ"] != names:
            raise InvalidInput(f"coordinates {names}", "they are X, Y, Z", "export it again")
    for one in (one for one in mesh if _name(one) == "vertices"):
        if sum(part.get("semantic") == "POSITION" for part in one) > 1:
            raise InvalidInput("vertices at two places", "each is at one", "export it again")


def _check_coordinates(mesh: Element) -> None:
    """Refuse NaN among the coordinates of vertices, which pycollada takes for 0."""
    inputs = [one for part in mesh if _name(part) == "vertices" for one in part]
    used = {one.get("source", "")[1:] for one in inputs if one.get("semantic") == "POSITION"}
    for numbers in (one for source in mesh if source.get("id") in used for one in source):
        if "nan" in (numbers.text or "").lower():
            given, rule = "coordinates with NaN among them", "each is a number"
            raise InvalidInput(given, rule, "export it again")


def _check_names(tree: Element) -> None:
    """Refuse two geometries of one name, two sources within one, or two nodes that are used."""
    used = {one.get("url", "") for one in tree.iter() if _name(one) == "instance_node"}
    nodes = [one for one in tree.iter() if _name(one) == "node" and f"#{one.get('id')}" in used]
    geometries = [one for one in tree.iter() if _name(one) == "geometry"]
    meshes = [list(one) for one in tree.iter() if _name(one) == "mesh"]
    for parts in (geometries, nodes, *meshes):
        names = Counter(one.get("id") for one in parts if one.get("id"))
        if twice := next((name for name, number in names.items() if number > 1), None):
            given = f"two parts that are named {twice!r}"
            raise InvalidInput(given, "a name is of one part", "export it again")


def _check_moves(node: Element) -> None:
    for one in node:
        name = _name(one)
        if name not in _OF_NODES:
            given, rule = f"a node with a {name[:40]!r}", "a node has none"
            raise InvalidInput(given, rule, "export it again")
        if name == "skew" or (name == "lookat" and _shapes_under(node)):
            rule = "it is turned, scaled and moved only"
            raise InvalidInput(f"a node with a {name}", rule, "export it without")
        if name in _MOVES and not _is_move(name, words := _words(one)):
            given = f"a {name} of {' '.join(words)[:40]!r}"
            raise InvalidInput(given, f"it has {_MOVES[name]}", "export it again")


def _is_move(name: str, words: list[str]) -> bool:
    """Whether numbers are those of a move; pycollada takes the length of an axis to be 1."""
    if len(words) != _NUMBERS[name] or not all(map(_is_number, words)):
        return False
    values = [float(word) for word in words]
    if name == "matrix":
        return values[12:] == [0.0, 0.0, 0.0, 1.0]
    return name != "rotate" or abs(math.hypot(*values[:3]) - 1.0) < _OFF_ONE


def _is_number(word: str) -> bool:
    """Whether it is one to every reader; Python's own takes underscores, and other digits."""
    return _NUMBER.fullmatch(word) is not None and math.isfinite(float(word))


_NUMBER = re.compile(r"[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?")


def _require_faces(tree: Element, found: Any) -> Counter[str]:
    """How many faces each geometry has, which are all that can be read of it."""
    import collada

    told, held = Counter[str](), Counter[str]()
    for one in tree.iter():
        if _name(one) == "geometry":
            told[str(one.get("id"))] = sum(map(_faces, one.iter()))
    lines = collada.lineset.LineSet  # which trimesh has no use for
    for geometry in found.geometries:
        faces = [len(one) for one in geometry.primitives if not isinstance(one, lines)]
        held[str(geometry.id)] = sum(faces)
    if lost := next((name for name in told if told[name] != held[name]), None):
        raise _other_count(f"{told[lost]} faces of {lost!r}, of which {held[lost]} can be read")
    return told


def _faces(part: Element) -> int:
    """Faces of a part of a geometry, where its corners are as many as it says.

    In a strip or fan, each face has two corners of the one before.
    """
    name = _name(part)
    if name not in _SURFACES | _STRIPS:
        return 0
    count = int(part.get("count", 0))
    each = 1 + max(int(one.get("offset", 0)) for one in part if _name(one) == "input")
    words = [_words(one) for one in part if _name(one) == "p"]
    corners = [len(one) / each for one in words]
    sizes = [int(word) for one in part if _name(one) == "vcount" for word in _words(one)]
    together = name in ("triangles", "polylist")
    told = [sum(sizes) if name == "polylist" else 3 * count] if together else corners
    fits = (corners or [0.0]) == told if together else len(corners) == count
    fits = fits and (name != "polylist" or len(sizes) == count)
    are_whole = all(word.isdigit() for one in words for word in one)
    if not (fits and are_whole and all(map(float.is_integer, corners))) or _has_holes(part):
        raise _other_count(f"{count} {name} whose corners are others")
    return int(sum(corners)) - 2 * count if name in _STRIPS else count


def _has_holes(part: Element) -> bool:
    """Whether faces have holes, which pycollada leaves out."""
    return any(_name(one) == "ph" for one in part)


def _in_scene(tree: Element, of: Callable[[Element], int]) -> int:
    """Sum over the shapes in the scene, by the file's text, each as often as it is there."""
    named = {one.get("id"): one for one in tree.iter() if _name(one) in ("node", "visual_scene")}
    shown = (one for one in tree.iter() if _name(one) == "instance_visual_scene")
    scene = named[next(shown).get("url", "").removeprefix("#")]

    @cache
    def shapes(one: Element) -> int:
        if _name(one) in _SHAPES:
            return of(one)
        if _name(one) == "instance_node":
            return shapes(named[one.get("url", "").removeprefix("#")])
        return sum(shapes(part) for part in one if _name(part) in _SHAPES | _NODES)

    return shapes(scene)


def _shapes_under(node: Element) -> bool:
    return any(_name(one) in _SHAPES | {"instance_node"} for one in node.iter())


_NODES = {"node", "instance_node"}


def _held_shapes(nodes: Iterable[Any]) -> int:
    """Shapes in the scene that trimesh reads: of geometries, not of controllers."""
    import collada

    @cache
    def shapes(node: Any) -> int:
        if isinstance(node, collada.scene.GeometryNode):
            return 1
        return sum(map(shapes, node.children)) if isinstance(node, collada.scene.Node) else 0

    return sum(map(shapes, nodes))
