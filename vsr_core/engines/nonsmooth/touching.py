"""Where a corner, an edge or a vertex near its counterpart touches in the next step.

A corner of the rock touches the face of the terrain that it meets on its path, or, where it is a
little in the ground, the one that is nearest. A vertex or an edge of the terrain touches only in
directions in which the ground stands out there, and an edge of the rock likewise: with that a pair
of features touches at most where no other does, and nothing is felt of borders inside a plane.

Each function writes the point and returns 0, or the path before which the pair does not touch.
"""

from __future__ import annotations

import math

from vsr_core.arrays import Array
from vsr_core.compiled.compiling import compiled, inlined
from vsr_core.compiled.vectors import cross
from vsr_core.engines.nonsmooth.body import Point, RockState
from vsr_core.engines.nonsmooth.features import Vertex
from vsr_core.engines.nonsmooth.near import SPAN_SHARE
from vsr_core.engines.nonsmooth.pairs import between, climb
from vsr_core.engines.nonsmooth.pieces import edge_shows, face_shows
from vsr_core.engines.nonsmooth.tree import Ground

DEEPEST = 0.01
"""Depth of a feature in the ground, as a share of the radius, beyond which it is not seen."""

BORDER = 1e-6
"""Width of the borders of faces, as a share of the radius."""

TINY = 1e-300
"""Path until a touch where none is known but that there is no touch yet [m]."""

CONE = 1e-5
"""Sine of the angle by which a normal may be outside its cone."""


@inlined
def corner(
    ground: Ground,
    rock: RockState,
    point: Point,
    own: int,
    other: int,
    time_step: float,
    ahead: float,
    drop: float,
    radius: float,
) -> float:
    """Corner of the rock and face of the terrain.

    Parameters
    ----------
    point : Point, written where they may touch
    time_step : float [s]
    ahead : float [m], path of a step
    drop : float [m], by which a face goes on beyond a concave edge
    radius : float [m]

    Returns
    -------
    float [m], path until they may touch, 0 where they do
    """
    turn, place, corner, face = rock.rotation, rock.place, ground.corners[own], ground.faces[other]
    normal = face.normal
    a = turn[0, 0] * corner[0] + turn[0, 1] * corner[1] + turn[0, 2] * corner[2]
    b = turn[1, 0] * corner[0] + turn[1, 1] * corner[1] + turn[1, 2] * corner[2]
    c = turn[2, 0] * corner[0] + turn[2, 1] * corner[1] + turn[2, 2] * corner[2]
    x, y, z = place[0] + a, place[1] + b, place[2] + c
    gap = normal[0] * x + normal[1] * y + normal[2] * z - face.offset
    if gap > ahead:
        return gap
    if gap < -DEEPEST * radius:
        return -DEEPEST * radius - gap
    u, v, w = _moves(rock, a, b, c)
    time = _time_to(gap, normal[0] * u + normal[1] * v + normal[2] * w, time_step)
    x, y, z = x + time * u, y + time * v, z + time * w
    hollow = drop - 2.0 * min(gap, 0.0)
    for k in range(face.first, face.first + face.count):
        side = ground.sides[k]
        within = side.inward[0] * x + side.inward[1] * y + side.inward[2] * z - side.limit
        within += BORDER * radius + side.hollow * hollow
        if within < 0.0:
            return max(-within - side.hollow * 2.0 * ahead - ahead, TINY)
    point.key = 3 * (own * ground.flats + face.flat)
    point.lever[0], point.lever[1], point.lever[2] = a, b, c
    point.normal[0], point.normal[1], point.normal[2] = normal[0], normal[1], normal[2]
    point.gap = gap
    return 0.0


@inlined
def vertex(
    ground: Ground,
    rock: RockState,
    point: Point,
    at: int,
    other: int,
    time_step: float,
    ahead: float,
    radius: float,
) -> float:
    """Vertex of the terrain and face of the rock.

    Parameters
    ----------
    point : Point, written where they may touch
    time_step : float [s]
    ahead : float [m], path of a step
    radius : float [m]

    Returns
    -------
    float [m], path until they may touch, 0 where they do
    """
    turn, place, vertex = rock.rotation, rock.place, ground.vertices[other]
    a, b, c = vertex.place[0] - place[0], vertex.place[1] - place[1], vertex.place[2] - place[2]
    x, y, z = _within(turn, a, b, c)
    number = _face_at(ground, ground.pairs[at].own, x, y, z)
    ground.pairs[at].own = number
    u, v, w = _moves(rock, a, b, c)
    u, v, w = _within(turn, u, v, w)
    p, q, r = x, y, z
    gap = 0.0
    for _ in range(3):
        face = ground.faces[number]
        n = face.normal
        gap = n[0] * x + n[1] * y + n[2] * z - face.offset
        if gap > ahead:
            return gap
        if gap < -DEEPEST * radius:
            return TINY
        time = _time_to(gap, -(n[0] * u + n[1] * v + n[2] * w), time_step)
        p, q, r = x - time * u, y - time * v, z - time * w
        if gap <= 0.0:
            break
        better = _face_at(ground, number, p, q, r)
        if better == number:
            break
        number = better
    face = ground.faces[number]
    n = face.normal
    if gap > 0.0:
        last = ground.faces[_face_at(ground, number, p, q, r)]
        m = last.normal
        if m[0] * p + m[1] * q + m[2] * r - last.offset > BORDER * radius:
            return TINY
    i = -(turn[0, 0] * n[0] + turn[0, 1] * n[1] + turn[0, 2] * n[2])
    j = -(turn[1, 0] * n[0] + turn[1, 1] * n[1] + turn[1, 2] * n[2])
    k = -(turn[2, 0] * n[0] + turn[2, 1] * n[1] + turn[2, 2] * n[2])
    if not _is_out(ground, vertex, i, j, k):
        return TINY
    if len(ground.shape.middles) > 1 and not face_shows(ground, number, p, q, r, gap, radius):
        return TINY
    point.key = 3 * (other * len(ground.shape.planes) + number - ground.own_face) + 1
    point.lever[0] = turn[0, 0] * p + turn[0, 1] * q + turn[0, 2] * r
    point.lever[1] = turn[1, 0] * p + turn[1, 1] * q + turn[1, 2] * r
    point.lever[2] = turn[2, 0] * p + turn[2, 1] * q + turn[2, 2] * r
    point.normal[0], point.normal[1], point.normal[2] = i, j, k
    point.gap = gap
    return 0.0


@inlined
def edges(
    ground: Ground,
    rock: RockState,
    point: Point,
    own: int,
    other: int,
    time_step: float,
    ahead: float,
    radius: float,
) -> float:
    """Edge of the rock and edge of the terrain.

    Parameters
    ----------
    point : Point, written where they may touch
    time_step : float [s]
    ahead : float [m], path of a step
    radius : float [m]

    Returns
    -------
    float [m], path until they may touch, 0 where they do
    """
    turn, place, mine, edge = rock.rotation, rock.place, ground.edges[own], ground.edges[other]
    e, f, g = _out(turn, mine.along)
    along, start = edge.along, edge.start
    i, j, k = cross(e, f, g, along[0], along[1], along[2])
    square = i * i + j * j + k * k
    if square < 1e-12:
        return TINY
    size = math.sqrt(square)
    limit = CONE * size
    left, right, sign = _dot(edge.left, i, j, k), _dot(edge.right, i, j, k), 1.0 / square
    if left + right > 0.0:
        i, j, k, left, right, sign = -i, -j, -k, -left, -right, -sign
    if left > limit or right > limit:
        return (max(left, right) - limit) * SPAN_SHARE * radius
    p, q, r = _out(turn, mine.left)
    beyond = -limit - (i * p + j * q + k * r)
    if beyond > 0.0:
        return 0.5 * beyond * SPAN_SHARE * radius
    p, q, r = _out(turn, mine.right)
    beyond = -limit - (i * p + j * q + k * r)
    if beyond > 0.0:
        return 0.5 * beyond * SPAN_SHARE * radius
    a, b, c = _out(turn, mine.start)
    x, y, z = start[0] - place[0] - a, start[1] - place[1] - b, start[2] - place[2] - c
    gap = -(i * x + j * y + k * z) / size
    most = max(ahead, DEEPEST * radius)
    if gap > ahead or gap < -DEEPEST * radius:
        return max(abs(gap) - most, TINY)
    s = sign * _volume(i, j, k, x, y, z, along[0], along[1], along[2])
    u, v, w = _moves(rock, a + s * e, b + s * f, c + s * g)
    time = _time_to(gap, (i * u + j * v + k * w) / size, time_step)
    p, q, r = x - time * u, y - time * v, z - time * w
    s = sign * _volume(i, j, k, p, q, r, along[0], along[1], along[2])
    t = sign * _volume(i, j, k, p, q, r, e, f, g)
    border = BORDER * radius
    if s < -border or s > mine.length + border or t < -border or t > edge.length + border:
        on_own, on_other = x * e + y * f + z * g, -_dot(along, x, y, z)
        cosine = _dot(along, e, f, g)
        sizes = mine.length, edge.length
        square = between(x, y, z, e, f, g, sizes[0], along, sizes[1], on_own, on_other, cosine)
        return max(math.sqrt(square) - most, TINY)
    if len(ground.shape.middles) > 1:
        p, q, r = _within(turn, -i / size, -j / size, -k / size)
        if not edge_shows(ground, mine, s, p, q, r, radius):
            return TINY
    point.key = 3 * ((own - ground.own_edge) * ground.lines + edge.line) + 2
    point.lever[0], point.lever[1], point.lever[2] = a + s * e, b + s * f, c + s * g
    point.normal[0], point.normal[1], point.normal[2] = i / size, j / size, k / size
    point.gap = gap
    return 0.0


@inlined
def _is_out(ground: Ground, vertex: Vertex, i: float, j: float, k: float) -> bool:
    """Whether (i, j, k) leads out of the ground at a vertex, from all edges there."""
    for at in range(vertex.first, vertex.first + vertex.count):
        arm = ground.arms[at]
        if i * arm[0] + j * arm[1] + k * arm[2] > CONE:
            return False
    return True


@compiled
def _time_to(gap: float, approach: float, time_step: float) -> float:
    """Time until a gap closes, in this step [s]; 0 where it is closed, or does not shrink."""
    if gap <= 0.0 or approach >= 0.0:
        return 0.0
    return min(time_step, -gap / approach)


@compiled
def _moves(rock: RockState, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Velocity of the rock at a lever (x, y, z) [m/s]."""
    v = rock.velocity
    a, b, c = cross(v[3], v[4], v[5], x, y, z)
    return v[0] + a, v[1] + b, v[2] + c


@inlined
def _face_at(ground: Ground, face: int, x: float, y: float, z: float) -> int:
    """Face of the rock that a ray through (x, y, z) meets, sought from ``face`` on."""
    first, shape = ground.own_face, ground.shape
    middle = shape.middles[shape.home[face - first]]
    x, y, z = x - middle[0], y - middle[1], z - middle[2]
    return first + climb(shape.duals, shape.ring, face - first, x, y, z)


@compiled
def _within(turn: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A vector in principal axes."""
    return (
        turn[0, 0] * x + turn[1, 0] * y + turn[2, 0] * z,
        turn[0, 1] * x + turn[1, 1] * y + turn[2, 1] * z,
        turn[0, 2] * x + turn[1, 2] * y + turn[2, 2] * z,
    )


@compiled
def _out(turn: Array, vector: Array) -> tuple[float, float, float]:
    """A vector of the rock in the site's frame."""
    return (
        turn[0, 0] * vector[0] + turn[0, 1] * vector[1] + turn[0, 2] * vector[2],
        turn[1, 0] * vector[0] + turn[1, 1] * vector[1] + turn[1, 2] * vector[2],
        turn[2, 0] * vector[0] + turn[2, 1] * vector[1] + turn[2, 2] * vector[2],
    )


@compiled
def _dot(vector: Array, x: float, y: float, z: float) -> float:
    return vector[0] * x + vector[1] * y + vector[2] * z


@compiled
def _volume(
    i: float, j: float, k: float, x: float, y: float, z: float, p: float, q: float, r: float
) -> float:
    """Product of (i, j, k) with the cross product of the other two vectors."""
    a, b, c = cross(x, y, z, p, q, r)
    return i * a + j * b + k * c
