"""Which features of a rock and of the terrain are near each other, found once in some steps."""

from __future__ import annotations

import math

from vsr_core.arrays import Array, Indices
from vsr_core.engines.nonsmooth.body import Motion
from vsr_core.engines.nonsmooth.compiling import compiled
from vsr_core.engines.nonsmooth.tree import Ground
from vsr_core.engines.nonsmooth.vectors import cross

CORNER, EDGES, VERTEX = 0, 1, 2
"""Kinds of pairs: corner of the rock and face, two edges, vertex of the terrain and face."""


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
    search, shape, tree = ground.search[0], ground.shape, ground.tree
    search.stamp += 1
    search.pairs = 0
    _place(ground, rock)
    links, due, lists, sizes = tree.links, tree.due, shape.lists, shape.sizes
    corners, edges = len(shape.spots), len(shape.rods)
    way, free, found, at = search.way, math.inf, False, 0
    while at < len(links):
        gap = due[at] - way
        if gap <= near:
            gap = _apart(
                tree.boxes, tree.hints, shape.planes, shape.duals, shape.ring, rock, at, near
            )
            due[at] = way + gap
        if gap > near:
            free = min(free, gap)
            at = links[at, 0]
            continue
        level = links[at, 1]
        if level == 0:
            for i in range(corners):
                lists[0, i] = i
            for i in range(edges):
                lists[0, corners + i] = i
            sizes[0, 0], sizes[0, 1] = corners, edges
        else:
            _reach(tree.boxes, shape.spots, shape.rods, lists, sizes, at, level, near)
        if links[at, 2]:
            found = True
            _pair(ground, rock, at, level, near, near / radius, deepest)
        at += 1
    search.reserve = near if found else free


@compiled
def _place(ground: Ground, rock: Motion) -> None:
    """Corners, edges and faces of the rock in the site's frame."""
    turn, place, shape = rock.rotation, rock.place, ground.shape
    spots, planes, rods = shape.spots, shape.planes, shape.rods
    for i in range(len(spots)):
        x, y, z = ground.corners[i, 0], ground.corners[i, 1], ground.corners[i, 2]
        for k in range(3):
            spots[i, k] = place[k] + turn[k, 0] * x + turn[k, 1] * y + turn[k, 2] * z
    for i in range(len(planes)):
        normal = ground.faces[ground.own_face + i].normal
        x, y, z = normal[0], normal[1], normal[2]
        for k in range(3):
            planes[i, k] = turn[k, 0] * x + turn[k, 1] * y + turn[k, 2] * z
    for i in range(len(rods)):
        edge = ground.edges[ground.own_edge + i]
        a, b, size = edge.ends[0], edge.ends[1], 1.0 / edge.length
        for k in range(3):
            rods[i, k] = 0.5 * (spots[a, k] + spots[b, k])
            rods[i, 3 + k] = 0.5 * abs(spots[b, k] - spots[a, k])
            rods[i, 6 + k] = size * (spots[b, k] - spots[a, k])
            rods[i, 9 + k] = spots[a, k]


@compiled
def climb(duals: Array, ring: Indices, face: int, x: float, y: float, z: float) -> int:
    """Face of the rock that a ray from its centre of mass through (x, y, z) meets.

    It is found from ``face`` on, by neighbours: the measure that grows has no local maximum.

    Parameters
    ----------
    duals : ndarray, shape (m, 3), normals over offsets of faces
    ring : ndarray of int, neighbours of each face
    face : int, with which to begin
    x, y, z : float

    Returns
    -------
    int, a face
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


@compiled
def _apart(
    boxes: Array,
    hints: Indices,
    planes: Array,
    duals: Array,
    ring: Indices,
    rock: Motion,
    at: int,
    near: float,
) -> float:
    """Lower bound of the distance of a box from the rock."""
    place, turn = rock.place, rock.rotation
    x, y, z = boxes[at, 0] - place[0], boxes[at, 1] - place[1], boxes[at, 2] - place[2]
    face = hints[at]
    for again in range(2):
        n, m, o = planes[face, 0], planes[face, 1], planes[face, 2]
        reach = abs(n) * boxes[at, 3] + abs(m) * boxes[at, 4] + abs(o) * boxes[at, 5]
        gap = n * x + m * y + o * z - planes[face, 3] - reach
        if gap > near or again == 1:
            break
        p = turn[0, 0] * x + turn[1, 0] * y + turn[2, 0] * z
        q = turn[0, 1] * x + turn[1, 1] * y + turn[2, 1] * z
        r = turn[0, 2] * x + turn[1, 2] * y + turn[2, 2] * z
        face = climb(duals, ring, face, p, q, r)
        if face == hints[at]:
            break
        hints[at] = face
    return gap


@compiled
def _reach(
    boxes: Array,
    spots: Array,
    rods: Array,
    lists: Indices,
    sizes: Indices,
    at: int,
    level: int,
    near: float,
) -> None:
    """List the corners and edges of the rock near a box, of those near its parent."""
    x, y, z = boxes[at, 0], boxes[at, 1], boxes[at, 2]
    a, b, c = boxes[at, 3], boxes[at, 4], boxes[at, 5]
    number = 0
    for k in range(sizes[level - 1, 0]):
        i = lists[level - 1, k]
        if (
            abs(spots[i, 0] - x) <= a + near
            and abs(spots[i, 1] - y) <= b + near
            and abs(spots[i, 2] - z) <= c + near
        ):
            lists[level, number] = i
            number += 1
    sizes[level, 0] = number
    corners, number = len(spots), 0
    for k in range(sizes[level - 1, 1]):
        i = lists[level - 1, corners + k]
        p, q, r = x - rods[i, 0], y - rods[i, 1], z - rods[i, 2]
        if (
            abs(p) > a + near + rods[i, 3]
            or abs(q) > b + near + rods[i, 4]
            or abs(r) > c + near + rods[i, 5]
        ):
            continue
        # Across the edge and each side of the box.
        e, f, g = rods[i, 6], rods[i, 7], rods[i, 8]
        if (
            abs(q * g - r * f) > b * abs(g) + c * abs(f) + near
            or abs(r * e - p * g) > c * abs(e) + a * abs(g) + near
            or abs(p * f - q * e) > a * abs(f) + b * abs(e) + near
        ):
            continue
        lists[level, corners + number] = i
        number += 1
    sizes[level, 1] = number


@compiled
def _pair(
    ground: Ground,
    rock: Motion,
    at: int,
    level: int,
    near: float,
    angle: float,
    deepest: float,
) -> None:
    """Pair what is in a box with what of the rock is near it."""
    shape, links, plates = ground.shape, ground.tree.links, ground.plates
    lists, spots, corners = shape.lists, shape.spots, len(shape.spots)
    for k in range(shape.sizes[level, 0]):
        own = lists[level, k]
        x, y, z = spots[own, 0], spots[own, 1], spots[own, 2]
        for other in range(links[at, 3], links[at, 4]):
            gap = plates[other, 0] * x + plates[other, 1] * y + plates[other, 2] * z
            gap -= plates[other, 3]
            if -deepest - near <= gap <= near and beside(plates, other, x, y, z, 2.0 * near):
                add(ground, CORNER, own, other, gap)
    for other in range(links[at, 5], links[at, 6]):
        for k in range(shape.sizes[level, 1]):
            own = lists[level, corners + k]
            gap = _between_edges(ground, rock, own, other, near, angle, deepest)
            if gap <= near:
                add(ground, EDGES, ground.own_edge + own, other, gap)
    for other in range(links[at, 7], links[at, 8]):
        _vertex(ground, rock, other, ground.tree.hints[at], near)


@compiled
def _vertex(ground: Ground, rock: Motion, number: int, face: int, near: float) -> None:
    """Pair a vertex with the face of the rock that is nearest."""
    turn, place, spot = rock.rotation, rock.place, ground.vertices[number].place
    planes = ground.shape.planes
    x, y, z = spot[0] - place[0], spot[1] - place[1], spot[2] - place[2]
    if planes[face, 0] * x + planes[face, 1] * y + planes[face, 2] * z - planes[face, 3] > near:
        return
    p = turn[0, 0] * x + turn[1, 0] * y + turn[2, 0] * z
    q = turn[0, 1] * x + turn[1, 1] * y + turn[2, 1] * z
    r = turn[0, 2] * x + turn[1, 2] * y + turn[2, 2] * z
    face = climb(ground.shape.duals, ground.shape.ring, face, p, q, r)
    gap = planes[face, 0] * x + planes[face, 1] * y + planes[face, 2] * z - planes[face, 3]
    if gap <= near:
        add(ground, VERTEX, ground.own_face + face, number, gap)


@compiled
def add(ground: Ground, kind: int, own: int, other: int, gap: float) -> None:
    """List a pair that cannot touch before the rock has moved by ``gap`` [m].

    Parameters
    ----------
    ground : Ground
    kind : int, kind of pair
    own : int, feature of the rock
    other : int, feature of the terrain
    gap : float [m]
    """
    search = ground.search[0]
    if search.pairs == len(ground.pairs):
        search.full = 1
        return
    pair = ground.pairs[search.pairs]
    pair.kind, pair.own, pair.other = kind, own, other
    ground.dues[search.pairs] = search.way + gap
    search.pairs += 1


@compiled
def beside(plates: Array, number: int, x: float, y: float, z: float, margin: float) -> bool:
    """Whether a point is on the inward side of all sides of a triangle, or within ``margin``.

    Parameters
    ----------
    plates : ndarray, shape (m, 16), planes of triangles and of their sides
    number : int, of a triangle
    x, y, z : float
    margin : float [m]

    Returns
    -------
    bool
    """
    for k in range(4, 16, 4):
        within = plates[number, k] * x + plates[number, k + 1] * y + plates[number, k + 2] * z
        if within - plates[number, k + 3] < -margin:
            return False
    return True


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
    rods, edge = ground.shape.rods, ground.edges[other]
    d, start = edge.along, edge.start
    mine, turn = ground.edges[ground.own_edge + own], rock.rotation
    e, f, g = rods[own, 6], rods[own, 7], rods[own, 8]
    x, y, z = start[0] - rods[own, 9], start[1] - rods[own, 10], start[2] - rods[own, 11]
    on_own, on_other = x * e + y * f + z * g, -(x * d[0] + y * d[1] + z * d[2])
    cosine = e * d[0] + f * d[1] + g * d[2]
    size = mine.length, edge.length
    gap = math.sqrt(between(x, y, z, e, f, g, size[0], d, size[1], on_own, on_other, cosine))
    if gap > near + deepest:
        return math.inf
    i, j, k = cross(e, f, g, d[0], d[1], d[2])
    left, right = edge.left, edge.right
    on_left, on_right = (
        left[0] * i + left[1] * j + left[2] * k,
        right[0] * i + right[1] * j + right[2] * k,
    )
    if on_left + on_right > 0.0:
        i, j, k, on_left, on_right = -i, -j, -k, -on_left, -on_right
    # The rock's own faces turn too. Edges along each other may turn to any side.
    is_along = i * i + j * j + k * k <= 4.0 * angle * angle
    if not is_along:
        if on_left > angle or on_right > angle:
            return math.inf
        p = turn[0, 0] * i + turn[1, 0] * j + turn[2, 0] * k
        q = turn[0, 1] * i + turn[1, 1] * j + turn[2, 1] * k
        r = turn[0, 2] * i + turn[1, 2] * j + turn[2, 2] * k
        left, right = mine.left, mine.right
        if left[0] * p + left[1] * q + left[2] * r < -2.0 * angle:
            return math.inf
        if right[0] * p + right[1] * q + right[2] * r < -2.0 * angle:
            return math.inf
    if is_along or i * x + j * y + k * z > 0.0:
        gap = max(0.0, gap - deepest)
    return gap


@compiled
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
