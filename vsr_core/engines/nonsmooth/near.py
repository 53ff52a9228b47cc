"""Which features of a rock and of the terrain are near each other, found once in some steps."""

from __future__ import annotations

import math

from vsr_core.arrays import Array
from vsr_core.engines.nonsmooth.body import Motion
from vsr_core.engines.nonsmooth.compiling import compiled
from vsr_core.engines.nonsmooth.tree import Ground
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
    search.stamp += 1
    search.pairs = 0
    _place(ground, rock)
    free = _mark(ground, rock, near)
    if search.high[0] < search.low[0]:
        search.reserve = free
        return
    search.reserve = near
    angle = near / radius
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
def _mark(ground: Ground, rock: Motion, near: float) -> float:
    """Mark the boxes near the rock, pair vertices in them; lower bound of the others' distance."""
    search, place, turn, nodes = ground.search[0], rock.place, rock.rotation, ground.nodes
    spots = ground.spots
    low_x, high_x = _range(spots, 0)
    low_y, high_y = _range(spots, 1)
    low_z, high_z = _range(spots, 2)
    search.low[:], search.high[:] = math.inf, -math.inf
    free, at = math.inf, 0
    while at < len(nodes):
        node = nodes[at]
        gap = node.due - search.way
        if gap <= near:
            m, h = node.middle, node.half
            gap = max(
                max(m[0] - h[0] - high_x, low_x - m[0] - h[0]),
                max(m[1] - h[1] - high_y, low_y - m[1] - h[1]),
                max(m[2] - h[2] - high_z, low_z - m[2] - h[2]),
            )
            if gap <= near:
                x, y, z = m[0] - place[0], m[1] - place[1], m[2] - place[2]
                gap = max(gap, _apart(ground, turn, node, x, y, z, near))
            node.due = search.way + gap
        if gap > near:
            free = min(free, gap)
            at = node.skip
            continue
        node.stamp = search.stamp
        at += 1
        if node.is_leaf:
            for k in range(3):
                search.low[k] = min(search.low[k], node.middle[k] - node.half[k])
                search.high[k] = max(search.high[k], node.middle[k] + node.half[k])
            for number in range(node.first[2], node.last[2]):
                _vertex(ground, rock, number, node.hint, near)
    return free


@compiled
def _range(spots: Array, axis: int) -> tuple[float, float]:
    low, high = spots[0, axis], spots[0, axis]
    for i in range(1, len(spots)):
        low, high = min(low, spots[i, axis]), max(high, spots[i, axis])
    return low, high


@compiled
def _apart(
    ground: Ground, turn: Array, node: Array, x: float, y: float, z: float, near: float
) -> float:
    """Lower bound of the distance of a box, with its middle at (x, y, z), from the rock."""
    gap = _before(ground, node.hint, x, y, z, node.half)
    if gap > near:
        return gap
    p = turn[0, 0] * x + turn[1, 0] * y + turn[2, 0] * z
    q = turn[0, 1] * x + turn[1, 1] * y + turn[2, 1] * z
    r = turn[0, 2] * x + turn[1, 2] * y + turn[2, 2] * z
    node.hint = climb(ground, node.hint, p, q, r)
    return _before(ground, node.hint, x, y, z, node.half)


@compiled
def _before(ground: Ground, face: int, x: float, y: float, z: float, half: Array) -> float:
    """How far a box is in front of a face of the rock [m]."""
    n = ground.normals[face - ground.own_face]
    reach = abs(n[0]) * half[0] + abs(n[1]) * half[1] + abs(n[2]) * half[2]
    return n[0] * x + n[1] * y + n[2] * z - ground.faces[face].offset - reach


@compiled
def _vertex(ground: Ground, rock: Motion, number: int, face: int, near: float) -> None:
    """Pair a vertex with the face of the rock that is nearest."""
    turn, place, spot = rock.rotation, rock.place, ground.vertices[number].place
    x, y, z = spot[0] - place[0], spot[1] - place[1], spot[2] - place[2]
    n = ground.normals[face - ground.own_face]
    if n[0] * x + n[1] * y + n[2] * z - ground.faces[face].offset > near:
        return
    p = turn[0, 0] * x + turn[1, 0] * y + turn[2, 0] * z
    q = turn[0, 1] * x + turn[1, 1] * y + turn[2, 1] * z
    r = turn[0, 2] * x + turn[1, 2] * y + turn[2, 2] * z
    face = climb(ground, face, p, q, r)
    n = ground.faces[face].normal
    gap = n[0] * p + n[1] * q + n[2] * r - ground.faces[face].offset
    if gap <= near:
        add(ground, VERTEX, face, number, gap)


@compiled
def add(ground: Ground, kind: int, own: int, other: int, gap: float) -> None:
    """List a pair that cannot touch before the rock has moved by ``gap`` [m]."""
    search = ground.search[0]
    if search.pairs == len(ground.pairs):
        search.full = 1
        return
    pair = ground.pairs[search.pairs]
    pair.kind, pair.own, pair.other, pair.due = kind, own, other, search.way + gap
    search.pairs += 1


@compiled
def _faces_at(ground: Ground, own: int, near: float, deepest: float) -> None:
    """Pairs of a corner and the faces of the terrain near it."""
    search, spot, nodes = ground.search[0], ground.spots[own], ground.nodes
    x, y, z = spot[0], spot[1], spot[2]
    for k in range(3):
        if spot[k] > search.high[k] + near or spot[k] < search.low[k] - near:
            return
    at = 0
    while at < len(nodes):
        node = nodes[at]
        m, h = node.middle, node.half
        is_off = node.stamp != search.stamp or (
            abs(x - m[0]) > h[0] + near
            or abs(y - m[1]) > h[1] + near
            or abs(z - m[2]) > h[2] + near
        )
        if is_off:
            at = node.skip
            continue
        at += 1
        if not node.is_leaf:
            continue
        for number in range(node.first[0], node.last[0]):
            face = ground.faces[number]
            n = face.normal
            gap = n[0] * x + n[1] * y + n[2] * z - face.offset
            if -deepest - near <= gap <= near and beside(ground, number, x, y, z, 2.0 * near):
                add(ground, CORNER, own, number, gap)


@compiled
def beside(ground: Ground, number: int, x: float, y: float, z: float, margin: float) -> bool:
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
    search, mine, nodes = ground.search[0], ground.edges[own], ground.nodes
    a, b = ground.spots[mine.ends[0]], ground.spots[mine.ends[1]]
    for k in range(3):
        if min(a[k], b[k]) > search.high[k] + near or max(a[k], b[k]) < search.low[k] - near:
            return
    x, y, z = 0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2])
    p, q, r = 0.5 * abs(b[0] - a[0]), 0.5 * abs(b[1] - a[1]), 0.5 * abs(b[2] - a[2])
    e, f, g = (b[0] - a[0]) / mine.length, (b[1] - a[1]) / mine.length, (b[2] - a[2]) / mine.length
    at = 0
    while at < len(nodes):
        node = nodes[at]
        m, h = node.middle, node.half
        i, j, k = m[0] - x, m[1] - y, m[2] - z
        is_off = node.stamp != search.stamp or (
            abs(i) > h[0] + p + near
            or abs(j) > h[1] + q + near
            or abs(k) > h[2] + r + near
            or node.first[1] == node.last[1]
        )
        if not is_off:
            # Axes across the edge and each axis of the box.
            is_off = (
                abs(j * g - k * f) > h[1] * abs(g) + h[2] * abs(f) + near
                or abs(k * e - i * g) > h[2] * abs(e) + h[0] * abs(g) + near
                or abs(i * f - j * e) > h[0] * abs(f) + h[1] * abs(e) + near
            )
        if is_off:
            at = node.skip
            continue
        at += 1
        if not node.is_leaf:
            continue
        for number in range(node.first[1], node.last[1]):
            gap = _between_edges(ground, rock, own, number, near, angle, deepest)
            if gap <= near:
                add(ground, EDGES, own, number, gap)


@compiled
def _between_edges(
    ground: Ground,
    rock: Motion,
    own: int,
    other: int,
    near: float,
    angle: float,
    deepest: float,
) -> float:
    """Distance of two edges, infinite if they cannot touch before the rock turned by ``angle``."""
    mine, edge, turn = ground.edges[own], ground.edges[other], rock.rotation
    a, b = ground.spots[mine.ends[0]], ground.spots[mine.ends[1]]
    d, m = edge.along, mine.length
    e, f, g = (b[0] - a[0]) / m, (b[1] - a[1]) / m, (b[2] - a[2]) / m
    i, j, k = cross(e, f, g, d[0], d[1], d[2])
    left = edge.left[0] * i + edge.left[1] * j + edge.left[2] * k
    right = edge.right[0] * i + edge.right[1] * j + edge.right[2] * k
    if left + right > 0.0:
        i, j, k, left, right = -i, -j, -k, -left, -right
    # The rock's own faces turn too. Edges along each other may turn to any side.
    is_along = i * i + j * j + k * k <= 4.0 * angle * angle
    if not is_along:
        if left > angle or right > angle:
            return math.inf
        if _facing(turn, mine.left, i, j, k) < -2.0 * angle:
            return math.inf
        if _facing(turn, mine.right, i, j, k) < -2.0 * angle:
            return math.inf
    x, y, z = edge.start[0] - a[0], edge.start[1] - a[1], edge.start[2] - a[2]
    on_own, on_other = x * e + y * f + z * g, -(x * d[0] + y * d[1] + z * d[2])
    cosine = e * d[0] + f * d[1] + g * d[2]
    gap = math.sqrt(
        _between(x, y, z, e, f, g, m, d, edge.length, on_own, on_other, cosine)
    )
    if is_along or i * x + j * y + k * z > 0.0:
        gap = max(0.0, gap - deepest)
    return gap


@compiled
def _between(
    x: float,
    y: float,
    z: float,
    e: float,
    f: float,
    g: float,
    own: float,
    along: Array,
    other: float,
    on_own: float,
    on_other: float,
    cosine: float,
) -> float:
    """Square of the distance of two segments.

    They have the directions (e, f, g) and ``along`` and the lengths ``own`` and ``other``; the
    second begins at (x, y, z) from the first. ``on_own`` and ``on_other`` are where each has the
    other's beginning beside it, ``cosine`` is of the angle between them.

    References
    ----------
    Ericson (2005), Real-Time Collision Detection, 5.1.9.
    """
    square = 1.0 - cosine * cosine
    s = 0.5 * own
    if square > 1e-9:
        s = min(own, max(0.0, (on_own + cosine * on_other) / square))
    t = on_other + cosine * s
    if t < 0.0 or t > other:
        t = min(other, max(0.0, t))
        s = min(own, max(0.0, on_own + cosine * t))
    p = x + t * along[0] - s * e
    q = y + t * along[1] - s * f
    r = z + t * along[2] - s * g
    return p * p + q * q + r * r


@compiled
def _facing(turn: Array, vector: Array, i: float, j: float, k: float) -> float:
    value = 0.0
    value += i * (turn[0, 0] * vector[0] + turn[0, 1] * vector[1] + turn[0, 2] * vector[2])
    value += j * (turn[1, 0] * vector[0] + turn[1, 1] * vector[1] + turn[1, 2] * vector[2])
    value += k * (turn[2, 0] * vector[0] + turn[2, 1] * vector[1] + turn[2, 2] * vector[2])
    return value
