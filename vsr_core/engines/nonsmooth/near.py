"""Which features of a rock and of the terrain are near each other, found once in some steps."""

from __future__ import annotations

import math

from vsr_core.arrays import Array
from vsr_core.engines.nonsmooth.body import Motion
from vsr_core.engines.nonsmooth.compiling import compiled
from vsr_core.engines.nonsmooth.grid import Ground
from vsr_core.engines.nonsmooth.vectors import cross

CORNER, EDGES, VERTEX = 0, 1, 2
"""Kinds of pairs: a corner of the rock and a face, two edges, a vertex of the terrain and a face."""

FLIGHT_SHARE = 0.3
"""Distance over which a rock in flight looks ahead, as a share of its radius."""


@compiled
def gather(ground: Ground, rock: Motion, radius: float, near: float, deepest: float) -> None:
    """List the pairs of features that may touch before the rock has moved by ``near``.

    Parameters
    ----------
    ground : Ground, changed
    rock : record of ``MOTION``
    radius : float [m], of the rock
    near : float [m]
    deepest : float [m], depth of a feature in the ground beyond which it is behind it
    """
    search = ground.search[0]
    reach = near if search.pairs > 0 else near + FLIGHT_SHARE * radius
    search.stamp += 1
    search.pairs = 0
    _place(ground, rock)
    free = _mark(ground, rock, near, reach)
    search.reserve = min(reach, free)
    if search.high[0] < search.low[0]:
        return
    search.reserve = near
    angle = near / radius
    _vertices(ground, rock, near, angle)
    for own in range(len(ground.spots)):
        _faces_at(ground, own, near, deepest)
    for own in range(ground.own_edge, len(ground.edges)):
        _edges_at(ground, rock, own, near, angle, deepest)


@compiled
def climb(ground: Ground, face: int, x: float, y: float, z: float) -> int:
    """Face of the rock that a ray from its centre of mass through (x, y, z) meets.

    It is found from ``face`` on, by neighbours: the measure that grows has no local maximum.
    """
    normal = ground.faces[face].normal
    best = (normal[0] * x + normal[1] * y + normal[2] * z) / ground.faces[face].offset
    going = True
    while going:
        going = False
        first = ground.faces[face].first
        for k in range(first, first + ground.faces[face].count):
            other = ground.sides[k].across
            normal = ground.faces[other].normal
            value = normal[0] * x + normal[1] * y + normal[2] * z
            value /= ground.faces[other].offset
            if value > best:
                best, face, going = value, other, True
    return face


@compiled
def _place(ground: Ground, rock: Motion) -> None:
    """Places of corners, and normals of faces, in the site's frame."""
    turn, place = rock.rotation, rock.place
    for i in range(len(ground.spots)):
        corner, spot = ground.corners[i], ground.spots[i]
        for k in range(3):
            spot[k] = (
                place[k] + turn[k, 0] * corner[0] + turn[k, 1] * corner[1] + turn[k, 2] * corner[2]
            )
    for i in range(len(ground.normals)):
        normal, out = ground.faces[ground.own_face + i].normal, ground.normals[i]
        for k in range(3):
            out[k] = turn[k, 0] * normal[0] + turn[k, 1] * normal[1] + turn[k, 2] * normal[2]


@compiled
def cells(ground: Ground, low: float, high: float, axis: int) -> tuple[int, int]:
    """First and last cell along x or y that a range reaches into; none if the last is less."""
    origin = ground.x if axis == 0 else ground.y
    number = ground.columns if axis == 0 else ground.rows
    first = math.floor((low - origin) / ground.width)
    last = math.floor((high - origin) / ground.width)
    return max(0, int(first)), min(number - 1, int(last))


@compiled
def _mark(ground: Ground, rock: Motion, near: float, reach: float) -> float:
    """Mark the cells near the rock; lower bound of the distance of the others within ``reach``."""
    search, spots, place, turn = ground.search[0], ground.spots, rock.place, rock.rotation
    box = _box(spots, 0), _box(spots, 1), _box(spots, 2)
    first_x, last_x = cells(ground, box[0][0] - reach, box[0][1] + reach, 0)
    first_y, last_y = cells(ground, box[1][0] - reach, box[1][1] + reach, 1)
    bottom, top = box[2][0] - reach, box[2][1] + reach
    search.low[:], search.high[:] = len(ground.cells), -1
    free, half = math.inf, 0.5 * ground.width
    for i in range(first_x, last_x + 1):
        for j in range(first_y, last_y + 1):
            cell = ground.cells[i * ground.rows + j]
            if cell.high < bottom or cell.low > top:
                continue
            gap = cell.due - search.way
            if gap <= near:
                x = ground.x + (i + 0.5) * ground.width - place[0]
                y = ground.y + (j + 0.5) * ground.width - place[1]
                z = 0.5 * (cell.low + cell.high) - place[2]
                gap = _apart(ground, turn, cell, x, y, z, half, near)
                cell.due = search.way + gap
            if gap <= near:
                cell.stamp = search.stamp
                search.low[0], search.low[1] = min(search.low[0], i), min(search.low[1], j)
                search.high[0], search.high[1] = max(search.high[0], i), max(search.high[1], j)
            else:
                free = min(free, gap)
    return free


@compiled
def _box(spots: Array, axis: int) -> tuple[float, float]:
    low, high = spots[0, axis], spots[0, axis]
    for i in range(1, len(spots)):
        low, high = min(low, spots[i, axis]), max(high, spots[i, axis])
    return low, high


@compiled
def _apart(
    ground: Ground,
    turn: Array,
    cell: Array,
    x: float,
    y: float,
    z: float,
    half: float,
    near: float,
) -> float:
    """Lower bound of the distance of a cell's ground, with its middle at (x, y, z), from the rock."""
    tall = 0.5 * (cell.high - cell.low)
    gap = _before(ground, cell.hint, x, y, z, half, tall)
    if gap > near:
        return gap
    p = turn[0, 0] * x + turn[1, 0] * y + turn[2, 0] * z
    q = turn[0, 1] * x + turn[1, 1] * y + turn[2, 1] * z
    r = turn[0, 2] * x + turn[1, 2] * y + turn[2, 2] * z
    cell.hint = climb(ground, cell.hint, p, q, r)
    return _before(ground, cell.hint, x, y, z, half, tall)


@compiled
def _before(
    ground: Ground, face: int, x: float, y: float, z: float, half: float, tall: float
) -> float:
    """How far a box is in front of a face of the rock [m]."""
    n = ground.normals[face - ground.own_face]
    reach = (abs(n[0]) + abs(n[1])) * half + abs(n[2]) * tall
    return n[0] * x + n[1] * y + n[2] * z - ground.faces[face].offset - reach


@compiled
def add(ground: Ground, kind: int, own: int, other: int) -> None:
    search = ground.search[0]
    if search.pairs == len(ground.pairs):
        search.full = 1
        return
    pair = ground.pairs[search.pairs]
    pair.kind, pair.own, pair.other = kind, own, other
    search.pairs += 1


@compiled
def _vertices(ground: Ground, rock: Motion, near: float, angle: float) -> None:
    """Pairs of vertices and the faces of the rock that are nearest."""
    search, turn, place = ground.search[0], rock.rotation, rock.place
    for i in range(search.low[0], search.high[0] + 1):
        for j in range(search.low[1], search.high[1] + 1):
            cell = ground.cells[i * ground.rows + j]
            if cell.stamp != search.stamp:
                continue
            face = cell.hint
            for at in range(cell.first[2], cell.last[2]):
                vertex = ground.vertices[ground.members[at]]
                x, y, z = vertex.place[0], vertex.place[1], vertex.place[2]
                x, y, z = x - place[0], y - place[1], z - place[2]
                if _before(ground, face, x, y, z, 0.0, 0.0) > near:
                    continue
                p = turn[0, 0] * x + turn[1, 0] * y + turn[2, 0] * z
                q = turn[0, 1] * x + turn[1, 1] * y + turn[2, 1] * z
                r = turn[0, 2] * x + turn[1, 2] * y + turn[2, 2] * z
                face = climb(ground, face, p, q, r)
                if _before(ground, face, x, y, z, 0.0, 0.0) <= near:
                    add(ground, VERTEX, face, ground.members[at])


@compiled
def _faces_at(ground: Ground, own: int, near: float, deepest: float) -> None:
    """Pairs of a corner and the faces of the terrain near it."""
    search, spot = ground.search[0], ground.spots[own]
    x, y, z = spot[0], spot[1], spot[2]
    first_x, last_x = cells(ground, x - near, x + near, 0)
    first_y, last_y = cells(ground, y - near, y + near, 1)
    search.query += 1
    for i in range(first_x, last_x + 1):
        for j in range(first_y, last_y + 1):
            cell = ground.cells[i * ground.rows + j]
            if cell.stamp != search.stamp or cell.high < z - near:
                continue
            for at in range(cell.first[0], cell.last[0]):
                number = ground.members[at]
                if not is_new(ground, number):
                    continue
                face = ground.faces[number]
                n = face.normal
                gap = n[0] * x + n[1] * y + n[2] * z - face.offset
                if gap > near or gap < -deepest - near:
                    continue
                if _beside(ground, number, x, y, z, 2.0 * near + deepest):
                    add(ground, CORNER, own, number)


@compiled
def is_new(ground: Ground, feature: int) -> bool:
    """Whether a feature, which may reach into several cells, is looked at first in this query."""
    query = ground.search[0].query
    is_new = ground.seen[feature] != query
    ground.seen[feature] = query
    return bool(is_new)


@compiled
def _beside(ground: Ground, number: int, x: float, y: float, z: float, margin: float) -> bool:
    """Whether a point is on the inward side of all sides of a face, or near it."""
    face = ground.faces[number]
    for k in range(face.first, face.first + face.count):
        side = ground.sides[k]
        inward = side.inward
        if inward[0] * x + inward[1] * y + inward[2] * z - side.limit < -margin:
            return False
    return True


@compiled
def _edges_at(
    ground: Ground, rock: Motion, own: int, near: float, angle: float, deepest: float
) -> None:
    """Pairs of an edge of the rock and the edges of the terrain near it."""
    search, mine = ground.search[0], ground.edges[own]
    a, b = ground.spots[mine.ends[0]], ground.spots[mine.ends[1]]
    low = min(a[2], b[2]) - near
    first_x, last_x = cells(ground, min(a[0], b[0]) - near, max(a[0], b[0]) + near, 0)
    first_y, last_y = cells(ground, min(a[1], b[1]) - near, max(a[1], b[1]) + near, 1)
    first_x, last_x = max(first_x, search.low[0]), min(last_x, search.high[0])
    first_y, last_y = max(first_y, search.low[1]), min(last_y, search.high[1])
    if last_x < first_x or last_y < first_y:
        return
    search.query += 1
    for i in range(first_x, last_x + 1):
        for j in range(first_y, last_y + 1):
            cell = ground.cells[i * ground.rows + j]
            if cell.stamp != search.stamp or cell.high < low:
                continue
            for at in range(cell.first[1], cell.last[1]):
                number = ground.members[at]
                if not is_new(ground, ground.own_face + number):
                    continue
                if _crosses(ground, rock, own, number, near, angle, deepest):
                    add(ground, EDGES, own, number)


@compiled
def _crosses(
    ground: Ground,
    rock: Motion,
    own: int,
    other: int,
    near: float,
    angle: float,
    deepest: float,
) -> bool:
    """Whether two edges may touch before the rock has moved by ``near`` and turned by ``angle``."""
    mine, edge, turn = ground.edges[own], ground.edges[other], rock.rotation
    a, b = ground.spots[mine.ends[0]], ground.spots[mine.ends[1]]
    d, m = edge.along, mine.length
    e, f, g = (b[0] - a[0]) / m, (b[1] - a[1]) / m, (b[2] - a[2]) / m
    i, j, k = cross(e, f, g, d[0], d[1], d[2])
    size = math.sqrt(i * i + j * j + k * k)
    left = edge.left[0] * i + edge.left[1] * j + edge.left[2] * k
    right = edge.right[0] * i + edge.right[1] * j + edge.right[2] * k
    if left + right > 0.0:
        i, j, k, left, right = -i, -j, -k, -left, -right
    if size > angle:
        if left > angle or right > angle:
            return False
        # The rock's own faces turn too.
        if _facing(turn, mine.left, i, j, k) < -2.0 * angle:
            return False
        if _facing(turn, mine.right, i, j, k) < -2.0 * angle:
            return False
    x, y, z = edge.start[0] - a[0], edge.start[1] - a[1], edge.start[2] - a[2]
    if size > 0.1:
        gap = -(i * x + j * y + k * z) / size
        slack = 2.0 * near + angle * (m + edge.length) / size
        return -deepest - slack <= gap <= slack
    return True


@compiled
def _facing(turn: Array, vector: Array, i: float, j: float, k: float) -> float:
    value = 0.0
    value += i * (turn[0, 0] * vector[0] + turn[0, 1] * vector[1] + turn[0, 2] * vector[2])
    value += j * (turn[1, 0] * vector[0] + turn[1, 1] * vector[1] + turn[1, 2] * vector[2])
    value += k * (turn[2, 0] * vector[0] + turn[2, 1] * vector[1] + turn[2, 2] * vector[2])
    return value
