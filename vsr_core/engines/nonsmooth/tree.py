"""The ground under a rock as the compiled search wants it: features in a tree of boxes."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from vsr_core.arrays import Array, Indices, matrix_product
from vsr_core.compiled import records
from vsr_core.compiled.records import Records
from vsr_core.engines.nonsmooth import features, rock_features
from vsr_core.engines.nonsmooth.body import corners_of, pieces_of
from vsr_core.engines.nonsmooth.features import Columns, Edge, Face, Features, Side, Vertex, unit
from vsr_core.engines.nonsmooth.rock_features import RockFeatures
from vsr_core.rock.body import Rock, convex_hull
from vsr_core.terrain.surface import Terrain

LEAF = 6
"""Triangles in a box that is not divided further, at most."""

MOST_PAIRS = 1 << 14
"""Pairs of features that may be near each other at once."""

MOST_POINTS = 512
"""Points that may touch in one step."""

SAME_SHARE = 1e-5
"""Distance to which pieces of a rock meet, as a share of its radius."""


class Pair:
    """A feature of the rock and one of the terrain, in a leaf of the tree, that may touch soon."""

    leaf: int
    kind: int
    own: int
    other: int


class Search:
    """State of the search."""

    reserve: float  # m, path that the rock may take before leaves are listed anew
    way: float  # m, longest path of a point of the rock since the start
    leaves: int  # number of near leaves
    pairs: int  # number of near pairs
    full: int  # whether a list was too short


class Tree(NamedTuple):
    """Boxes around parts of a terrain, parents before their children.

    Attributes
    ----------
    boxes : ndarray, shape (n, 6) [m], middle and half the sides of each
    links : ndarray of int, shape (n, 8)
        Next box if this one is not entered, whether it is a leaf, and where its triangles, its
        edges and its vertices begin and end.
    due : ndarray, shape (n,) [m], path of the rock before which a box is not near
    ways : ndarray, shape (n,) [m], path since the start of what of the rock is beside a leaf
    ready : ndarray, shape (n,) [m], such a path, up to which the pairs in a leaf are known
    spans : ndarray, shape (n,) [m], distance from the middle of a leaf for which its path holds
    nears : ndarray, shape (n,) [m], distance from what is in a leaf for which its path holds
    leaves : ndarray of int, shape (n,), room for the leaves near the rock
    hints : ndarray of int, shape (n,), face of the rock that it was last in front of
    cones : ndarray, shape (n, 5)
        Unit vector, and cosine and sine of the largest angle between it and a normal of a face at
        an edge of a leaf.
    """

    boxes: Array
    links: Indices
    due: Array
    ways: Array
    ready: Array
    spans: Array
    nears: Array
    leaves: Indices
    hints: Indices
    cones: Array


class Shape(NamedTuple):
    """The rock in the plain arrays that a search runs through.

    Attributes
    ----------
    duals : ndarray, shape (f, 3) [1/m], normals of its faces over their distances from the middle
        of their piece
    ring : ndarray of int, shape (f, k), neighbours of each face, the last repeated
    planes : ndarray, shape (f, 4), room for normals in the site's frame, and distances [m]
    spots : ndarray, shape (c, 3) [m], room for places of corners
    rods : ndarray, shape (e, 15), room for middles, half extents, directions and starts of edges,
        and for the mean normals of their two faces
    arcs : ndarray, shape (e, 5), these normals in principal axes, and cosine and sine of half the
        angle between the faces' normals
    lists : ndarray of int, shape (2, c + e), room for corners, then edges, that are near any leaf,
        and near one of them
    sizes : ndarray of int, shape (2, 2), number of these corners and edges
    middles, firsts, home, starts, points, begins : see ``RockFeatures``
    """

    duals: Array
    ring: Indices
    planes: Array
    spots: Array
    rods: Array
    arcs: Array
    lists: Indices
    sizes: Indices
    middles: Array
    firsts: Indices
    home: Indices
    starts: Indices
    points: Array
    begins: Indices


class Ground(NamedTuple):
    """Features of a rock and of the terrain under it.

    Attributes
    ----------
    faces, edges : Records
        Those of the terrain [m, site's frame], then those of the rock [m, principal axes].
    sides, vertices, arms : Records, and ndarray, shape (n, 3), of the terrain
    above : ndarray of int, shape (n, p), face of each piece that each vertex was last in front of
    corners : ndarray, shape (c, 3) [m], of the rock
    plates : ndarray, shape (m, 16), normal and offset of each triangle and of its sides
    dues : ndarray, path of the rock beside the leaf [m] before which a pair does not touch
    flats, lines : int, flat faces and straight edges of the terrain
    """

    faces: Records[Face]
    sides: Records[Side]
    edges: Records[Edge]
    vertices: Records[Vertex]
    arms: Array
    above: Indices
    corners: Array
    plates: Array
    tree: Tree
    shape: Shape
    pairs: Records[Pair]
    dues: Array
    search: Records[Search]
    own_face: int
    own_edge: int
    flats: int
    lines: int


def ground(rock: Rock, terrain: Terrain) -> Ground:
    """Features of a rock and of its terrain, and a tree over them."""
    under, boxes, links, cones, plates = _sorted(terrain)
    own = rock_features.of_sphere()
    if rock.shape != "sphere":
        hull = convex_hull(matrix_product(corners_of(rock), rock.axes))
        own = rock_features.of_rock(hull, pieces_of(rock), SAME_SHARE * rock.radius)
    faces = np.concatenate([under.faces, own.faces])
    edges = np.concatenate([under.edges, own.edges])
    made = Ground(
        records.of(Face, faces),
        records.of(Side, under.sides),
        records.of(Edge, edges),
        records.of(Vertex, under.vertices),
        under.arms,
        np.empty((len(under.vertices), len(own.firsts)), np.int64),
        own.corners,
        plates,
        _tree(boxes, links, cones),
        _shape(own),
        records.rows(Pair, MOST_PAIRS),
        np.zeros(MOST_PAIRS),
        records.rows(Search, 1),
        len(under.faces),
        len(under.edges),
        int(under.faces["flat"].max()) + 1,
        int(under.edges["line"].max(initial=0)) + 1,
    )
    forget(made)
    return made


def _tree(boxes: Array, links: Indices, cones: Array) -> Tree:
    """Boxes, and room for what a search notes of them."""
    due, ways, ready, spans, nears = np.empty((5, len(boxes)))
    leaves, hints = np.empty((2, len(boxes)), np.int64)
    return Tree(boxes, links, due, ways, ready, spans, nears, leaves, hints, cones)


def forget(ground: Ground) -> None:
    """Have the search begin anew, as at the first start."""
    search = ground.search[0]
    search.reserve, search.way = -1.0, 0.0
    search.leaves = search.pairs = search.full = 0
    ground.tree.due[:], ground.tree.ways[:], ground.tree.nears[:] = -np.inf, 0.0, 0.0
    ground.tree.hints[:], ground.above[:] = 0, ground.shape.firsts


def _shape(own: RockFeatures) -> Shape:
    """Faces of a rock for the search, and room for its corners and edges."""
    faces, edges, points = own.faces, own.edges, len(own.corners)
    planes = np.empty((len(faces), 4))
    planes[:, 3] = faces["offset"]
    left, right = _normals(edges)
    mean = unit(left + right)
    cosine = (mean * left).sum(axis=1)[:, None]
    arcs = np.hstack([mean, cosine, np.sqrt(np.maximum(0.0, 1.0 - cosine**2))])
    middles = np.vstack([own.middles, np.zeros(3)])[own.home]  # of a hull without a part in it
    return Shape(
        faces["normal"] / (faces["offset"] - (faces["normal"] * middles).sum(axis=1))[:, None],
        np.ascontiguousarray(own.ring),
        planes,
        np.empty((points, 3)),
        np.empty((len(edges), 15)),
        arcs,
        np.empty((2, points + len(edges)), np.int64),
        np.empty((2, 2), np.int64),
        *own[4:],
    )


def _normals(edges: Columns) -> tuple[Array, Array]:
    """Outward normals of the two faces at convex edges."""
    left, right = (np.cross(edges[side], edges["along"]) for side in ("left", "right"))
    # Each face is on the inner side of the other.
    left *= -np.sign((left * edges["right"]).sum(axis=1))[:, None]
    right *= -np.sign((right * edges["left"]).sum(axis=1))[:, None]
    return left, right


@lru_cache(maxsize=4)
def _sorted(terrain: Terrain) -> tuple[Features, Array, Indices, Array, Array]:
    """Features of a terrain in a tree's order, its boxes, links and cones, and its triangles."""
    found = features.of_terrain(terrain)
    low, high = found.triangles.min(axis=1), found.triangles.max(axis=1)
    levels = max(0, int(np.ceil(np.log2(len(low) / LEAF))))
    order, bounds = _halved(0.5 * (low + high), levels)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    by_edge = np.argsort(rank[found.edges["face"]], kind="stable")
    by_vertex = np.argsort(rank[found.vertices["face"]], kind="stable")
    under = Features(
        found.faces[order],
        found.sides,
        found.edges[by_edge],
        found.vertices[by_vertex],
        found.arms,
        found.triangles[order],
    )
    owners = rank[under.edges["face"]], rank[under.vertices["face"]]
    boxes, links = np.empty(((2 << levels) - 1, 6)), np.empty(((2 << levels) - 1, 8), np.int64)
    place = np.zeros(1, dtype=np.int64)
    for level in range(levels + 1):
        size = (2 << (levels - level)) - 1
        first, last = bounds[level][:-1], bounds[level][1:]
        bottom = np.minimum.reduceat(low[order], first)
        top = np.maximum.reduceat(high[order], first)
        boxes[place, :3], boxes[place, 3:] = 0.5 * (top + bottom), 0.5 * (top - bottom)
        links[place, 0], links[place, 1] = place + size, level == levels
        for kind, owner in enumerate((np.arange(len(order)), *owners)):
            links[place, 2 + 2 * kind] = np.searchsorted(owner, first)
            links[place, 3 + 2 * kind] = np.searchsorted(owner, last)
        place = np.column_stack([place + 1, place + 1 + size // 2]).ravel()
    sides = found.sides.reshape(-1, 3)[order]
    plates = np.column_stack(
        [
            under.faces["normal"],
            under.faces["offset"],
            np.concatenate([sides["inward"], sides["limit"][..., None]], axis=2).reshape(-1, 12),
        ]
    )
    return under, boxes, links, _cones(under.edges, links), plates


def _cones(edges: Columns, links: Indices) -> Array:
    """Cone of the normals at the edges of each leaf; of one leaf after another."""
    cones = np.zeros((len(links), 5))
    cones[:, 2], cones[:, 3] = 1.0, 1.0
    left, right = _normals(edges)
    for at in np.flatnonzero(links[:, 1] & (links[:, 5] > links[:, 4])):
        here = slice(links[at, 4], links[at, 5])
        normals = np.concatenate([left[here], right[here]])
        middle = unit(normals.sum(axis=0)[None])
        cosine = (normals @ middle.T).min()
        cones[at, :3], cones[at, 3] = middle, cosine
        cones[at, 4] = math.sqrt(max(0.0, 1.0 - cosine**2))
    return cones


def _halved(points: Array, levels: int) -> tuple[Indices, list[Indices]]:
    """Order of points in which halves of halves lie together, and where the parts of levels begin.

    Each part is halved along its longest side.
    """
    order, bounds = np.arange(len(points)), [np.array([0, len(points)])]
    for _ in range(levels):
        first, counts = bounds[-1][:-1], np.diff(bounds[-1])
        placed = points[order]
        extent = np.maximum.reduceat(placed, first) - np.minimum.reduceat(placed, first)
        part = np.repeat(np.arange(len(first)), counts)
        along = placed[np.arange(len(placed)), extent.argmax(axis=1)[part]]
        order = order[np.lexsort((along, part))]
        halves = np.column_stack([first, first + (counts + 1) // 2]).ravel()
        bounds.append(np.append(halves, len(points)))
    return order, bounds
