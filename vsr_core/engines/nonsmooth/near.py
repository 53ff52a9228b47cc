"""Which parts of the terrain a rock may touch soon, and the pairs of features there."""

from __future__ import annotations

import math

import numpy as np

from vsr_core.arrays import Array, Indices
from vsr_core.compiled.compiling import compiled, inlined
from vsr_core.compiled.vectors import cross
from vsr_core.engines.nonsmooth.body import RockState
from vsr_core.engines.nonsmooth.pairs import climb, drop, list_pairs
from vsr_core.engines.nonsmooth.tree import Ground, Shape

FAR_STEPS, NEAR_STEPS = 10.0, 3.0
"""Distances up to which leaves of the tree, and features in one, are near, besides the depth seen,
in units of what may pass in a step."""


SPAN_SHARE = 0.7
"""Distance from a leaf, as a share of the radius, within which paths of the rock's points are
bounded together, so that a turn of the rock takes those by at least as much."""


@inlined
def move_on(ground: Ground, rock: RockState, time_step: float) -> None:
    """Add the path of a step to those of the rock beside near leaves.

    Parameters
    ----------
    time_step : float [s]
    """
    tree, place, velocity = ground.tree, rock.place, rock.velocity
    u, v, w = velocity[0], velocity[1], velocity[2]
    p, q, r = velocity[3], velocity[4], velocity[5]
    turning = math.sqrt(p * p + q * q + r * r)
    for n in range(ground.search[0].leaves):
        at = tree.leaves[n]
        box = tree.boxes[at]
        x, y, z = cross(p, q, r, box[0] - place[0], box[1] - place[1], box[2] - place[2])
        x, y, z = x + u, y + v, z + w
        pace = math.sqrt(x * x + y * y + z * z) + turning * tree.spans[at]
        tree.ways[at] += time_step * pace


@inlined
def renew(ground: Ground, rock: RockState, radius: float, ahead: float, deepest: float) -> None:
    """Have all pairs of features listed that may touch before the rock has moved by ``ahead``.

    Leaves of the tree near the rock are listed once in many steps; the pairs in one of them when
    it is about to be reached.

    Parameters
    ----------
    radius : float [m], of the rock
    ahead : float [m]
    deepest : float [m], depth of a feature in the ground beyond which it is behind it
    """
    search, tree = ground.search[0], ground.tree
    if not search.reserve >= ahead + deepest:
        _list_leaves(ground, rock, deepest + FAR_STEPS * ahead)
    _fill(ground, rock, radius, ahead, deepest, deepest + NEAR_STEPS * ahead)
    if search.full:
        search.full = search.pairs = 0
        tree.ready[:] = -np.inf
        _fill(ground, rock, radius, ahead, deepest, ahead)


@inlined
def _fill(
    ground: Ground, rock: RockState, radius: float, ahead: float, deepest: float, near: float
) -> None:
    """List the pairs that are ``near`` in leaves about to be reached, unless they are known."""
    search, tree, shape = ground.search[0], ground.tree, ground.shape
    way, soon, placed, span = search.way, ahead + deepest, False, SPAN_SHARE * radius
    for n in range(search.leaves):
        at = tree.leaves[n]
        if tree.due[at] - way > soon or tree.ready[at] - tree.ways[at] >= ahead:
            continue
        if not placed:
            _place_planes(ground, rock)
            _place(ground, rock)
            placed = True
        gap = _apart(tree.boxes, tree.hints, shape, rock, at, soon)
        tree.due[at] = way + gap
        if gap > soon:
            continue
        drop(ground, at)
        box = tree.boxes[at]
        size = math.sqrt(box[3] * box[3] + box[4] * box[4] + box[5] * box[5])
        tree.nears[at], tree.spans[at] = near, max(span, size + near + ahead)
        _reach(shape, 1, box[0], box[1], box[2], box[3], box[4], box[5], near)
        _face_to_face(shape, tree.cones, at, near / span)
        list_pairs(ground, rock, at, near, near / span, deepest)
        tree.ready[at] = tree.ways[at] + near


@compiled
def _list_leaves(ground: Ground, rock: RockState, near: float) -> None:
    """List the leaves that are ``near``, and the corners and edges of the rock near any of them."""
    search, shape, tree = ground.search[0], ground.shape, ground.tree
    links, due, corners, edges = tree.links, tree.due, len(shape.spots), len(shape.rods)
    for i in range(corners):
        shape.lists[0, i] = i
    for i in range(edges):
        shape.lists[0, corners + i] = i
    shape.sizes[0, 0], shape.sizes[0, 1] = corners, edges
    _place_planes(ground, rock)
    _place(ground, rock)
    low, high = np.inf, -np.inf
    a, b, c, d, e, f = low, low, low, high, high, high
    search.pairs = search.leaves = 0
    way, free, at = search.way, math.inf, 0
    while at < len(links):
        gap = due[at] - way
        if gap <= near:
            gap = _apart(tree.boxes, tree.hints, shape, rock, at, near)
            due[at] = way + gap
        if gap > near:
            free = min(free, gap)
            at = links[at, 0]
            continue
        if links[at, 1]:
            box = tree.boxes[at]
            a, b, c = min(a, box[0] - box[3]), min(b, box[1] - box[4]), min(c, box[2] - box[5])
            d, e, f = max(d, box[0] + box[3]), max(e, box[1] + box[4]), max(f, box[2] + box[5])
            tree.ready[at], tree.spans[at] = -np.inf, 0.0
            tree.leaves[search.leaves] = at
            search.leaves += 1
        at += 1
    search.reserve = free
    if search.leaves > 0:
        search.reserve = near
        x, y, z = 0.5 * (a + d), 0.5 * (b + e), 0.5 * (c + f)
        _reach(shape, 0, x, y, z, 0.5 * (d - a), 0.5 * (e - b), 0.5 * (f - c), near)


@inlined
def _place_planes(ground: Ground, rock: RockState) -> None:
    """Faces of the rock in the site's frame."""
    turn, planes = rock.rotation, ground.shape.planes
    for i in range(len(planes)):
        normal = ground.faces[ground.own_face + i].normal
        x, y, z = normal[0], normal[1], normal[2]
        for k in range(3):
            planes[i, k] = turn[k, 0] * x + turn[k, 1] * y + turn[k, 2] * z


@inlined
def _place(ground: Ground, rock: RockState) -> None:
    """Corners and edges of the rock that are listed, in the site's frame."""
    turn, place, shape = rock.rotation, rock.place, ground.shape
    spots, rods, arcs, corners = shape.spots, shape.rods, shape.arcs, len(shape.spots)
    for n in range(shape.sizes[0, 0]):
        i = shape.lists[0, n]
        x, y, z = ground.corners[i, 0], ground.corners[i, 1], ground.corners[i, 2]
        for k in range(3):
            spots[i, k] = place[k] + turn[k, 0] * x + turn[k, 1] * y + turn[k, 2] * z
    for n in range(shape.sizes[0, 1]):
        i = shape.lists[0, corners + n]
        edge = ground.edges[ground.own_edge + i]
        start, along, half = edge.start, edge.along, 0.5 * edge.length
        for k in range(3):
            at = turn[k, 0] * start[0] + turn[k, 1] * start[1] + turn[k, 2] * start[2]
            to = turn[k, 0] * along[0] + turn[k, 1] * along[1] + turn[k, 2] * along[2]
            rods[i, 9 + k] = place[k] + at
            rods[i, 6 + k] = to
            rods[i, k] = rods[i, 9 + k] + half * to
            rods[i, 3 + k] = half * abs(to)
            rods[i, 12 + k] = (
                turn[k, 0] * arcs[i, 0] + turn[k, 1] * arcs[i, 1] + turn[k, 2] * arcs[i, 2]
            )


@inlined
def _apart(
    boxes: Array, hints: Indices, shape: Shape, rock: RockState, at: int, near: float
) -> float:
    """Lower bound of the distance of a box from the rock."""
    place, turn = rock.place, rock.rotation
    x, y, z = boxes[at, 0] - place[0], boxes[at, 1] - place[1], boxes[at, 2] - place[2]
    face, planes = hints[at], shape.planes
    for again in range(2):
        n, m, o = planes[face, 0], planes[face, 1], planes[face, 2]
        reach = abs(n) * boxes[at, 3] + abs(m) * boxes[at, 4] + abs(o) * boxes[at, 5]
        gap = n * x + m * y + o * z - planes[face, 3] - reach
        if gap > near or again == 1:
            break
        p = turn[0, 0] * x + turn[1, 0] * y + turn[2, 0] * z
        q = turn[0, 1] * x + turn[1, 1] * y + turn[2, 1] * z
        r = turn[0, 2] * x + turn[1, 2] * y + turn[2, 2] * z
        face = climb(shape.duals, shape.ring, face, p, q, r)
        if face == hints[at]:
            break
        hints[at] = face
    return gap


@compiled
def _reach(
    shape: Shape,
    level: int,
    x: float,
    y: float,
    z: float,
    a: float,
    b: float,
    c: float,
    near: float,
) -> None:
    """List at ``level`` those of the listed corners and edges that are near a box."""
    spots, rods, lists, corners = shape.spots, shape.rods, shape.lists, len(shape.spots)
    number = 0
    for k in range(shape.sizes[0, 0]):
        i = lists[0, k]
        if (
            abs(spots[i, 0] - x) <= a + near
            and abs(spots[i, 1] - y) <= b + near
            and abs(spots[i, 2] - z) <= c + near
        ):
            lists[level, number] = i
            number += 1
    shape.sizes[level, 0] = number
    number = 0
    for k in range(shape.sizes[0, 1]):
        i = lists[0, corners + k]
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
    shape.sizes[level, 1] = number


@inlined
def _face_to_face(shape: Shape, cones: Array, at: int, angle: float) -> None:
    """Keep those of the edges near a leaf that may face its edges when turned by ``angle``.

    Two edges touch where a direction between the normals of the faces at one is opposite to one
    between those at the other.

    References
    ----------
    Johnson & Cohen (2001), Spatialized normal cone hierarchies, Proc. Symp. Interactive 3D
    Graphics, 129-134.
    """
    rods, arcs, lists, corners = shape.rods, shape.arcs, shape.lists, len(shape.spots)
    c, s = math.cos(angle), math.sin(angle)
    cosine, sine = c * cones[at, 3] - s * cones[at, 4], s * cones[at, 3] + c * cones[at, 4]
    number = 0
    for k in range(shape.sizes[1, 1]):
        i = lists[1, corners + k]
        toward = (
            rods[i, 12] * cones[at, 0] + rods[i, 13] * cones[at, 1] + rods[i, 14] * cones[at, 2]
        )
        both = cosine * arcs[i, 3] - sine * arcs[i, 4]
        beyond = sine * arcs[i, 3] + cosine * arcs[i, 4]  # negative where all directions may meet
        if beyond > 0.0 and -toward < both:
            continue
        lists[1, corners + number] = i
        number += 1
    shape.sizes[1, 1] = number
