"""Pairs of a feature of the rock and one of the terrain that may touch soon."""

from __future__ import annotations

import math

from vsr_core.arrays import Array, Indices
from vsr_core.compiled.compiling import compiled, inlined
from vsr_core.compiled.vectors import cross
from vsr_core.engines.nonsmooth.body import RockState
from vsr_core.engines.nonsmooth.tree import Ground

CORNER, EDGES, VERTEX = 0, 1, 2
"""Kinds of pairs: corner of the rock and face, two edges, vertex of the terrain and face."""


@compiled
def climb(duals: Array, ring: Indices, face: int, x: float, y: float, z: float) -> int:
    """Face of the rock that a ray from its centre of mass through (x, y, z) meets.

    It is found from ``face`` on, by neighbours: the measure that grows has no local maximum.

    Parameters
    ----------
    duals : ndarray, shape (m, 3), normals over offsets of faces
    """
    best = duals[face, 0] * x + duals[face, 1] * y + duals[face, 2] * z
    going = True
    while going:
        going = False
        here = face
        for k in range(ring.shape[1]):
            other = ring[here, k]
            if k > 0 and other == ring[here, k - 1]:
                break
            value = duals[other, 0] * x + duals[other, 1] * y + duals[other, 2] * z
            if value > best:
                best, face, going = value, other, True
    return face


@inlined
def list_pairs(
    ground: Ground, rock: RockState, at: int, near: float, angle: float, deepest: float
) -> None:
    """List pairs of what is in a leaf with what of the rock is near it.

    Parameters
    ----------
    near : float [m], by which the rock may move before pairs that are not listed touch, and
    angle : float [rad], by which it may turn meanwhile
    deepest : float [m], depth of a feature in the ground beyond which it is behind it
    """
    shape, links, plates = ground.shape, ground.tree.links, ground.plates
    lists, spots, corners = shape.lists, shape.spots, len(shape.spots)
    for k in range(shape.sizes[1, 0]):
        own = lists[1, k]
        x, y, z = spots[own, 0], spots[own, 1], spots[own, 2]
        for other in range(links[at, 2], links[at, 3]):
            gap = plates[other, 0] * x + plates[other, 1] * y + plates[other, 2] * z
            gap -= plates[other, 3]
            if -deepest - near <= gap <= near and beside(plates, other, x, y, z, 2.0 * near):
                add(ground, at, CORNER, own, other, gap)
    for other in range(links[at, 4], links[at, 5]):
        for k in range(shape.sizes[1, 1]):
            own = lists[1, corners + k]
            gap = _between_edges(ground, rock, own, other, near, angle, deepest)
            if gap <= near:
                add(ground, at, EDGES, ground.own_edge + own, other, gap)
    for other in range(links[at, 6], links[at, 7]):
        _vertex(ground, rock, at, other, near)


@inlined
def _vertex(ground: Ground, rock: RockState, at: int, number: int, near: float) -> None:
    """Pair a vertex with the face of the rock, or of each of its pieces, that is nearest."""
    turn, place, spot = rock.rotation, rock.place, ground.vertices[number].place
    planes, middles = ground.shape.planes, ground.shape.middles
    x, y, z = spot[0] - place[0], spot[1] - place[1], spot[2] - place[2]
    for piece in range(len(middles)):
        face = ground.above[number, piece]
        if planes[face, 0] * x + planes[face, 1] * y + planes[face, 2] * z - planes[face, 3] > near:
            continue
        p = turn[0, 0] * x + turn[1, 0] * y + turn[2, 0] * z - middles[piece, 0]
        q = turn[0, 1] * x + turn[1, 1] * y + turn[2, 1] * z - middles[piece, 1]
        r = turn[0, 2] * x + turn[1, 2] * y + turn[2, 2] * z - middles[piece, 2]
        face = climb(ground.shape.duals, ground.shape.ring, face, p, q, r)
        ground.above[number, piece] = face
        gap = planes[face, 0] * x + planes[face, 1] * y + planes[face, 2] * z - planes[face, 3]
        if gap <= near:
            add(ground, at, VERTEX, ground.own_face + face, number, gap)


@inlined
def add(ground: Ground, leaf: int, kind: int, own: int, other: int, gap: float) -> None:
    """List a pair that cannot touch before the rock has moved by ``gap`` [m].

    Parameters
    ----------
    gap : float [m]
    """
    search = ground.search[0]
    if search.pairs == len(ground.pairs):
        search.full = 1
        return
    pair = ground.pairs[search.pairs]
    pair.leaf, pair.kind, pair.own, pair.other = leaf, kind, own, other
    ground.dues[search.pairs] = ground.tree.ways[leaf] + gap
    search.pairs += 1


@inlined
def drop(ground: Ground, leaf: int) -> None:
    """Take the pairs of a leaf off the list."""
    search, pairs, dues, kept = ground.search[0], ground.pairs, ground.dues, 0
    for n in range(search.pairs):
        if pairs[n].leaf == leaf:
            continue
        if kept < n:
            pair, other = pairs[kept], pairs[n]
            pair.leaf, pair.kind, pair.own = other.leaf, other.kind, other.own
            pair.other, dues[kept] = other.other, dues[n]
        kept += 1
    search.pairs = kept


@inlined
def beside(plates: Array, number: int, x: float, y: float, z: float, margin: float) -> bool:
    """Whether a point is on the inward side of all sides of a triangle, or within ``margin``.

    Parameters
    ----------
    plates : ndarray, shape (m, 16), planes of triangles and of their sides
    margin : float [m]
    """
    for k in range(4, 16, 4):
        within = plates[number, k] * x + plates[number, k + 1] * y + plates[number, k + 2] * z
        if within - plates[number, k + 3] < -margin:
            return False
    return True


@inlined
def _between_edges(
    ground: Ground, rock: RockState, own: int, other: int, near: float, angle: float, deepest: float
) -> float:
    """Distance of two edges, infinite if they cannot touch before the rock turned by ``angle``."""
    rods, edge = ground.shape.rods, ground.edges[other]
    d, left, right = edge.along, edge.left, edge.right
    e, f, g = rods[own, 6], rods[own, 7], rods[own, 8]
    i, j, k = cross(e, f, g, d[0], d[1], d[2])
    on_left = left[0] * i + left[1] * j + left[2] * k
    on_right = right[0] * i + right[1] * j + right[2] * k
    if on_left + on_right > 0.0:
        i, j, k, on_left, on_right = -i, -j, -k, -on_left, -on_right
    # The rock's own faces turn too. Edges along each other may turn to any side.
    is_along = i * i + j * j + k * k <= 4.0 * angle * angle
    if not is_along and (on_left > angle or on_right > angle):
        return math.inf
    mine = ground.edges[ground.own_edge + own]
    if not is_along:
        turn = rock.rotation
        p = turn[0, 0] * i + turn[1, 0] * j + turn[2, 0] * k
        q = turn[0, 1] * i + turn[1, 1] * j + turn[2, 1] * k
        r = turn[0, 2] * i + turn[1, 2] * j + turn[2, 2] * k
        left, right = mine.left, mine.right
        if left[0] * p + left[1] * q + left[2] * r < -2.0 * angle:
            return math.inf
        if right[0] * p + right[1] * q + right[2] * r < -2.0 * angle:
            return math.inf
    start, cosine = edge.start, e * d[0] + f * d[1] + g * d[2]
    x, y, z = start[0] - rods[own, 9], start[1] - rods[own, 10], start[2] - rods[own, 11]
    on_own, on_other = x * e + y * f + z * g, -(x * d[0] + y * d[1] + z * d[2])
    size = mine.length, edge.length
    gap = math.sqrt(between(x, y, z, e, f, g, size[0], d, size[1], on_own, on_other, cosine))
    if is_along or i * x + j * y + k * z > 0.0:
        gap = max(0.0, gap - deepest)
    return gap


@inlined
def between(
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

    Parameters
    ----------
    x, y, z : float [m], beginning of the second from that of the first
    own : float [m], its length
    along : ndarray, shape (3,), direction of the second
    other : float [m], its length
    on_own, on_other : float [m], where each has the other's beginning beside it

    Returns
    -------
    float [m^2]

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
