"""The ground under a rock as the compiled search wants it: features in a tree of boxes."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from vsr_core.arrays import Array, Indices
from vsr_core.engines.nonsmooth import features
from vsr_core.engines.nonsmooth.features import Features
from vsr_core.rock.body import Rock
from vsr_core.rock.hull import convex_hull, corners
from vsr_core.terrain.surface import Terrain

LEAF = 4
"""Triangles in a box that is not divided further, at most."""

MOST_PAIRS = 1 << 14
"""Pairs of features that may be near each other at once."""

MOST_POINTS = 512
"""Points that may touch in one step."""

NODE = np.dtype(
    [
        ("middle", float, 3),  # m, of a box around its triangles, and
        ("half", float, 3),  # half its sides
        ("first", int, 3),  # of its triangles, edges and vertices, and
        ("last", int, 3),  # the one after the last
        ("skip", int),  # next node if this one is not entered
        ("is_leaf", int),
        ("due", float),  # m, path of the rock before which it is not near; likewise
        ("stamp", int),  # number of the last search that found it near
        ("hint", int),  # face of the rock that it was in front of
    ]
)
"""Box around a part of the terrain; a node that is entered is followed by its first child."""

PAIR = np.dtype([("kind", int), ("own", int), ("other", int), ("due", float)])
"""A feature of the rock and one of the terrain that may touch soon, not before ``due`` [m]."""

SEARCH = np.dtype(
    [
        ("reserve", float),  # m, path that the rock may take before the near pairs are found anew
        ("way", float),  # m, path since the start
        ("pairs", int),  # number of near pairs
        ("stamp", int),  # number of the search
        ("full", int),  # whether a list was too short
        ("low", float, 3),  # m, box around what is near
        ("high", float, 3),
    ]
)
"""State of the search."""


class Ground(NamedTuple):
    """Features of a rock and of the terrain under it.

    Attributes
    ----------
    faces, sides, edges : arrays of ``FACE``, ``SIDE``, ``EDGE``
        Those of the terrain [m, site's frame], then those of the rock [m, principal axes].
    vertices, arms : array of ``VERTEX``, and ndarray, shape (n, 3), of the terrain
    corners, spots : ndarray, shape (k, 3) [m], of the rock, and room for their places
    normals : ndarray, shape (f, 3), room for the normals of the rock's faces in the site's frame
    nodes : array of ``NODE``
    pairs : array of ``PAIR``
    search : array of one ``SEARCH``
    own_face, own_edge : int, first face and edge of the rock
    flats, lines : int, flat faces and straight edges of the terrain
    """

    faces: Array
    sides: Array
    edges: Array
    vertices: Array
    arms: Array
    corners: Array
    spots: Array
    normals: Array
    nodes: Array
    pairs: Array
    search: Array
    own_face: int
    own_edge: int
    flats: int
    lines: int


def ground(rock: Rock, terrain: Terrain) -> Ground:
    """Features of a rock and of its terrain, and a tree over them.

    Parameters
    ----------
    rock : Rock
    terrain : Terrain

    Returns
    -------
    Ground
    """
    under, nodes = _sorted(terrain)
    points, own = np.empty((0, 3)), None
    if rock.shape != "sphere":
        hull = convex_hull(rock.hull.vertices[corners(rock.hull)] @ rock.axes)
        points, own = hull.vertices, features.of_rock(hull)
    faces, sides, edges = under.faces, under.sides, under.edges
    if own is not None:
        own.faces["first"] += len(sides)
        own.sides["across"] += len(faces)
        faces, sides = np.concatenate([faces, own.faces]), np.concatenate([sides, own.sides])
        edges = np.concatenate([edges, own.edges])
    made = Ground(
        faces,
        sides,
        edges,
        under.vertices,
        under.arms,
        np.ascontiguousarray(points),
        np.empty_like(points, order="C"),
        np.empty((len(faces) - len(under.faces), 3)),
        nodes.copy(),
        np.zeros(MOST_PAIRS, PAIR),
        np.zeros(1, SEARCH),
        len(under.faces),
        len(under.edges),
        int(under.faces["flat"].max()) + 1,
        int(under.edges["line"].max(initial=0)) + 1,
    )
    forget(made)
    return made


def forget(ground: Ground) -> None:
    """Have the search begin anew, as at the first start."""
    ground.search["reserve"], ground.search["way"], ground.search["stamp"] = -1.0, 0.0, 0
    ground.search["pairs"] = ground.search["full"] = 0
    ground.nodes["due"], ground.nodes["stamp"] = -np.inf, 0
    ground.nodes["hint"] = ground.own_face


@lru_cache(maxsize=4)
def _sorted(terrain: Terrain) -> tuple[Features, Array]:
    """Features of a terrain in the order of a tree, and its nodes."""
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
    nodes = np.zeros((2 << levels) - 1, NODE)
    place = np.zeros(1, dtype=np.int64)
    for level in range(levels + 1):
        size = (2 << (levels - level)) - 1
        first, last = bounds[level][:-1], bounds[level][1:]
        bottom = np.minimum.reduceat(low[order], first)
        top = np.maximum.reduceat(high[order], first)
        nodes["middle"][place], nodes["half"][place] = 0.5 * (top + bottom), 0.5 * (top - bottom)
        for kind, owner in enumerate((np.arange(len(order)), *owners)):
            nodes["first"][place, kind] = np.searchsorted(owner, first)
            nodes["last"][place, kind] = np.searchsorted(owner, last)
        nodes["skip"][place], nodes["is_leaf"][place] = place + size, level == levels
        place = np.column_stack([place + 1, place + 1 + size // 2]).ravel()
    return under, nodes


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
