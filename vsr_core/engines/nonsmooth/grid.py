"""The ground under a rock as the compiled search wants it: features in the cells of a grid."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsr_core.arrays import Array, Indices
from vsr_core.engines.nonsmooth import features
from vsr_core.engines.nonsmooth.features import Features
from vsr_core.rock.body import Rock
from vsr_core.rock.hull import convex_hull, corners
from vsr_core.rock.triangles import cells_of_boxes
from vsr_core.terrain.surface import Terrain

CELL_SHARE = 0.08
"""Width of a cell as a share of the rock's radius."""

MOST_CELLS = 1 << 18
"""Number of cells, at most."""

MOST_PAIRS = 4096
"""Pairs of features that may be near each other at once."""

MOST_POINTS = 512
"""Points that may touch in one step."""

CELL = np.dtype(
    [
        ("low", float),  # m, heights between which the terrain lies in the cell
        ("high", float),
        ("due", float),  # m, path of the rock before which the cell is not near it
        ("stamp", int),  # of the last search that found it near
        ("hint", int),  # face of the rock that was last before it
        ("first", int, 3),  # where its faces, edges and vertices begin among the members, and
        ("last", int, 3),  # where they end
    ]
)
"""Square cell of the plan."""

PAIR = np.dtype([("kind", int), ("own", int), ("other", int)])
"""A feature of the rock and one of the terrain that may touch soon."""

SEARCH = np.dtype(
    [
        ("reserve", float),  # m, path that the rock may take before the near pairs are found anew
        ("way", float),  # m, path since the start
        ("pairs", int),  # number of near pairs
        ("stamp", int),  # number of the search, and
        ("query", int),  # of what was asked in all searches
        ("full", int),  # whether a list was too short
        ("low", int, 2),  # cells between which the near ones are
        ("high", int, 2),
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
    cells : array of ``CELL``, row by row along x
    members : ndarray of int, features by cell
    seen : ndarray of int, of each face and edge of the terrain the last query that looked at it
    pairs : array of ``PAIR``
    search : array of one ``SEARCH``
    x, y, width : float [m], corner of the grid and width of its cells
    columns, rows : int, cells along x and y
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
    cells: Array
    members: Indices
    seen: Indices
    pairs: Array
    search: Array
    x: float
    y: float
    width: float
    columns: int
    rows: int
    own_face: int
    own_edge: int
    flats: int
    lines: int


def ground(rock: Rock, terrain: Terrain) -> Ground:
    """Features of a rock and of its terrain, and a grid over them.

    Parameters
    ----------
    rock : Rock
    terrain : Terrain

    Returns
    -------
    Ground
    """
    under = features.of_terrain(terrain)
    points, own = np.empty((0, 3)), None
    if rock.shape != "sphere":
        hull = convex_hull(rock.hull.vertices[corners(rock.hull)] @ rock.axes)
        points, own = hull.vertices, features.of_rock(hull)
    faces, sides, edges = under.faces, under.sides, under.edges
    if own is not None:
        own.faces["first"] += len(sides)
        own.faces["flat"] = np.arange(len(own.faces))
        own.sides["across"] += len(faces)
        faces, sides = np.concatenate([faces, own.faces]), np.concatenate([sides, own.sides])
        edges = np.concatenate([edges, own.edges])
    origin, width, shape, cells, members = _grid(under, CELL_SHARE * rock.radius)
    cells["hint"] = len(under.faces)
    return Ground(
        faces,
        sides,
        edges,
        under.vertices,
        under.arms,
        np.ascontiguousarray(points),
        np.empty_like(points),
        np.empty((len(faces) - len(under.faces), 3)),
        cells,
        members,
        np.zeros(len(under.faces) + len(under.edges), np.int64),
        np.zeros(MOST_PAIRS, PAIR),
        np.zeros(1, SEARCH),
        float(origin[0]),
        float(origin[1]),
        width,
        shape[0],
        shape[1],
        len(under.faces),
        len(under.edges),
        int(under.faces["flat"].max()) + 1,
        int(under.edges["line"].max(initial=0)) + 1,
    )


def forget(ground: Ground) -> None:
    """Have the search begin anew, as at the first start."""
    ground.search["reserve"], ground.search["way"], ground.search["stamp"] = -1.0, 0.0, 0
    ground.search["pairs"] = ground.search["full"] = 0
    ground.cells["due"], ground.cells["stamp"] = -np.inf, 0
    ground.cells["hint"] = ground.own_face


def _grid(
    under: Features, width: float
) -> tuple[Array, float, tuple[int, int], Array, Indices]:
    """Corner, width and shape of a grid, its cells, and their members."""
    triangles = under.triangles
    corner = triangles[:, :, :2].min(axis=(0, 1))
    extent = triangles[:, :, :2].max(axis=(0, 1)) - corner
    width = max(width, float(np.sqrt(extent.prod() / MOST_CELLS)))
    columns, rows = (int(n) for n in np.floor(extent / width).astype(int) + 1)
    ends = under.edges["start"] + under.edges["length"][:, None] * under.edges["along"]
    places = under.vertices["place"]
    boxed = [
        (triangles.min(axis=1), triangles.max(axis=1)),
        (np.minimum(under.edges["start"], ends), np.maximum(under.edges["start"], ends)),
        (places, places),
    ]
    cells = np.zeros(columns * rows, CELL)
    members, begin = [], 0
    for kind, (low, high) in enumerate(boxed):
        lows, highs = (
            np.clip(
                np.floor((end[:, :2] - corner) / width).astype(np.int64),
                0,
                [columns - 1, rows - 1],
            )
            for end in (low, high)
        )
        feature, cell = cells_of_boxes(lows, highs)
        if kind == 0:
            _heights(cells, under, feature, cell, corner, width, rows)
        place = cell[:, 0] * rows + cell[:, 1]
        order = np.argsort(place, kind="stable")
        first = np.searchsorted(place[order], np.arange(len(cells) + 1)) + begin
        cells["first"][:, kind], cells["last"][:, kind] = first[:-1], first[1:]
        members.append(feature[order])
        begin += len(feature)
    return corner, width, (columns, rows), cells, np.concatenate(members)


def _heights(
    cells: Array,
    under: Features,
    face: Indices,
    cell: Indices,
    corner: Array,
    width: float,
    rows: int,
) -> None:
    """Heights between which the triangles lie in each cell."""
    heights, normal = under.triangles[face, :, 2], under.faces["normal"][face]
    low, high = heights.min(axis=1), heights.max(axis=1)
    up = np.where(np.abs(normal[:, 2]) > 1e-3, normal[:, 2], 1.0)
    middle = corner + (cell + 0.5) * width
    at = (under.faces["offset"][face] - (normal[:, :2] * middle).sum(axis=1)) / up
    reach = 0.5 * width * np.abs(normal[:, :2]).sum(axis=1) / np.abs(up)
    even = np.abs(normal[:, 2]) > 1e-3
    low = np.where(even, np.maximum(low, at - reach), low)
    high = np.where(even, np.minimum(high, at + reach), high)
    cells["low"], cells["high"] = np.inf, -np.inf
    place = cell[:, 0] * rows + cell[:, 1]
    np.minimum.at(cells["low"], place, np.minimum(low, high))
    np.maximum.at(cells["high"], place, np.maximum(low, high))
