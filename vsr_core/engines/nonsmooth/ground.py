"""Points of a rock near a terrain: corner and face, vertex and face, edge and edge.

A corner of the rock touches the face of the terrain that it meets on its path, or, where it is a
little in the ground, the one that is nearest. A vertex or an edge of the terrain touches only in
directions in which the ground stands out there, and an edge of the rock likewise: with that a pair
of features touches at most where no other does, and nothing is felt of borders inside a plane.
"""

from __future__ import annotations

import math

from vsr_core.arrays import Array
from vsr_core.engines.nonsmooth.body import Body, Motion, Points
from vsr_core.engines.nonsmooth.compiling import compiled
from vsr_core.engines.nonsmooth.grid import Ground
from vsr_core.engines.nonsmooth.near import CORNER, EDGES, climb, gather
from vsr_core.engines.nonsmooth.sphere import gather_sphere, touch_sphere
from vsr_core.engines.nonsmooth.vectors import cross

NEAR_SHARE = 0.03
"""Distance up to which features are near, as a share of the radius, besides what a step needs."""

DEEPEST = 0.05
"""Depth of a corner in the ground, as a share of the radius, beyond which it is behind a face that
it has never been in front of; of edges and vertices likewise."""

BORDER = 1e-6
"""Width of the borders of faces, as a share of the radius."""

HOLLOW = 1e-4
"""How far a face goes on beyond a concave edge, as a share of the radius."""

CONE = 1e-5
"""Sine of the angle by which a normal may be outside its cone."""


@compiled
def find(
    body: Body, ground: Ground, rock: Motion, points: Points, time_step: float, speed: float
) -> None:
    """Find the points that may touch the terrain at the end of the next step.

    Parameters
    ----------
    body : Body
    ground : Ground, whose lists of near features are kept up to date
    rock : record of ``MOTION``
    points : array of ``POINT``, changed
    time_step : float [s]
    speed : float [m/s], that what pushes the rock adds in a step
    """
    search, radius = ground.search[0], body.radius
    is_sphere = len(ground.corners) == 0
    way = time_step * _pace(rock.velocity, radius)
    search.way += way
    search.reserve -= way
    # What landed in the last step and rebounds in this may be as far away as that took it.
    ahead = max(way, time_step * _pace(rock.before, radius)) + speed * time_step
    ahead = 2.0 * ahead + HOLLOW * radius
    if not search.reserve >= ahead:
        near = NEAR_SHARE * radius + ahead
        if is_sphere:
            gather_sphere(ground, rock, radius, near)
        else:
            gather(ground, rock, radius, near, DEEPEST * radius)
    rock.found = 0
    drop = HOLLOW * radius + 4.0 * speed * time_step
    for at in range(search.pairs):
        if rock.found == len(points):
            search.full = 1
            break
        pair, point = ground.pairs[at], points[rock.found]
        if is_sphere:
            touches = touch_sphere(
                ground, rock, point, pair.kind, pair.other, time_step, ahead, radius
            ) and not _known(points, rock.found, point.key)
        elif pair.kind == CORNER:
            touches = _corner(
                ground, rock, point, pair.own, pair.other, time_step, ahead, drop, radius
            )
            touches = touches and not _known(points, rock.found, point.key)
        elif pair.kind == EDGES:
            touches = _edges(ground, rock, point, pair.own, pair.other, time_step, ahead, radius)
        else:
            touches = _vertex(ground, rock, point, at, pair.other, time_step, ahead, radius)
        if touches:
            rock.found += 1


@compiled
def _pace(velocity: Array, radius: float) -> float:
    """Bound of the speed of a rock's points [m/s]."""
    v, w = velocity[:3], velocity[3:]
    across = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    return across + radius * math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])


@compiled
def _known(points: Points, number: int, key: int) -> bool:
    """Whether a point is among the first ``number`` already."""
    for i in range(number - 1, -1, -1):
        if points[i].key == key:
            return True
    return False


@compiled
def _time_to(gap: float, approach: float, time_step: float) -> float:
    """Time until a gap closes, in this step [s]; 0 where it is closed, or does not shrink."""
    if gap <= 0.0 or approach >= 0.0:
        return 0.0
    return min(time_step, -gap / approach)


@compiled
def _moves(rock: Motion, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Velocity of the rock at a lever (x, y, z) [m/s]."""
    v = rock.velocity
    a, b, c = cross(v[3], v[4], v[5], x, y, z)
    return v[0] + a, v[1] + b, v[2] + c


@compiled
def _corner(
    ground: Ground,
    rock: Motion,
    point: Points,
    own: int,
    other: int,
    time_step: float,
    ahead: float,
    drop: float,
    radius: float,
) -> bool:
    """Corner of the rock and face of the terrain."""
    turn, place, corner, face = rock.rotation, rock.place, ground.corners[own], ground.faces[other]
    normal = face.normal
    a = turn[0, 0] * corner[0] + turn[0, 1] * corner[1] + turn[0, 2] * corner[2]
    b = turn[1, 0] * corner[0] + turn[1, 1] * corner[1] + turn[1, 2] * corner[2]
    c = turn[2, 0] * corner[0] + turn[2, 1] * corner[1] + turn[2, 2] * corner[2]
    x, y, z = place[0] + a, place[1] + b, place[2] + c
    gap = normal[0] * x + normal[1] * y + normal[2] * z - face.offset
    if gap > ahead or gap < -DEEPEST * radius:
        return False
    u, v, w = _moves(rock, a, b, c)
    time = _time_to(gap, normal[0] * u + normal[1] * v + normal[2] * w, time_step)
    x, y, z = x + time * u, y + time * v, z + time * w
    hollow = drop - 2.0 * min(gap, 0.0)
    for k in range(face.first, face.first + face.count):
        side = ground.sides[k]
        within = side.inward[0] * x + side.inward[1] * y + side.inward[2] * z - side.limit
        if within < -BORDER * radius - side.hollow * hollow:
            return False
    point.key = 3 * (own * ground.flats + face.flat)
    point.lever[0], point.lever[1], point.lever[2] = a, b, c
    point.normal[0], point.normal[1], point.normal[2] = normal[0], normal[1], normal[2]
    point.gap = gap
    return True


@compiled
def _vertex(
    ground: Ground,
    rock: Motion,
    point: Points,
    at: int,
    other: int,
    time_step: float,
    ahead: float,
    radius: float,
) -> bool:
    """Vertex of the terrain and face of the rock."""
    turn, place, vertex = rock.rotation, rock.place, ground.vertices[other]
    a, b, c = vertex.place[0] - place[0], vertex.place[1] - place[1], vertex.place[2] - place[2]
    x, y, z = _within(turn, a, b, c)
    number = climb(ground, ground.pairs[at].own, x, y, z)
    ground.pairs[at].own = number
    u, v, w = _moves(rock, a, b, c)
    u, v, w = _within(turn, u, v, w)
    p, q, r = x, y, z
    gap = 0.0
    for _ in range(3):
        face = ground.faces[number]
        n = face.normal
        gap = n[0] * x + n[1] * y + n[2] * z - face.offset
        if gap > ahead or gap < -DEEPEST * radius:
            return False
        time = _time_to(gap, -(n[0] * u + n[1] * v + n[2] * w), time_step)
        p, q, r = x - time * u, y - time * v, z - time * w
        if gap <= 0.0:
            break
        better = climb(ground, number, p, q, r)
        if better == number:
            break
        number = better
    face = ground.faces[number]
    n = face.normal
    if gap > 0.0:
        last = ground.faces[climb(ground, number, p, q, r)]
        m = last.normal
        if m[0] * p + m[1] * q + m[2] * r - last.offset > max(BORDER * radius, gap):
            return False
    i = -(turn[0, 0] * n[0] + turn[0, 1] * n[1] + turn[0, 2] * n[2])
    j = -(turn[1, 0] * n[0] + turn[1, 1] * n[1] + turn[1, 2] * n[2])
    k = -(turn[2, 0] * n[0] + turn[2, 1] * n[1] + turn[2, 2] * n[2])
    for m in range(vertex.first, vertex.first + vertex.count):
        if i * ground.arms[m, 0] + j * ground.arms[m, 1] + k * ground.arms[m, 2] > CONE:
            return False
    point.key = 3 * (other * len(ground.normals) + number - ground.own_face) + 1
    point.lever[0] = turn[0, 0] * p + turn[0, 1] * q + turn[0, 2] * r
    point.lever[1] = turn[1, 0] * p + turn[1, 1] * q + turn[1, 2] * r
    point.lever[2] = turn[2, 0] * p + turn[2, 1] * q + turn[2, 2] * r
    point.normal[0], point.normal[1], point.normal[2] = i, j, k
    point.gap = gap
    return True


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
def _edges(
    ground: Ground,
    rock: Motion,
    point: Points,
    own: int,
    other: int,
    time_step: float,
    ahead: float,
    radius: float,
) -> bool:
    """Edge of the rock and edge of the terrain."""
    turn, place, mine, edge = rock.rotation, rock.place, ground.edges[own], ground.edges[other]
    e, f, g = _out(turn, mine.along)
    along, start = edge.along, edge.start
    i, j, k = cross(e, f, g, along[0], along[1], along[2])
    square = i * i + j * j + k * k
    if square < 1e-12:
        return False
    size = math.sqrt(square)
    limit = CONE * size
    left, right, sign = _dot(edge.left, i, j, k), _dot(edge.right, i, j, k), 1.0 / square
    if left + right > 0.0:
        i, j, k, left, right, sign = -i, -j, -k, -left, -right, -sign
    if left > limit or right > limit:
        return False
    p, q, r = _out(turn, mine.left)
    if i * p + j * q + k * r < -limit:
        return False
    p, q, r = _out(turn, mine.right)
    if i * p + j * q + k * r < -limit:
        return False
    a, b, c = _out(turn, mine.start)
    x, y, z = start[0] - place[0] - a, start[1] - place[1] - b, start[2] - place[2] - c
    gap = -(i * x + j * y + k * z) / size
    if gap > ahead or gap < -DEEPEST * radius:
        return False
    s = sign * _volume(i, j, k, x, y, z, along[0], along[1], along[2])
    u, v, w = _moves(rock, a + s * e, b + s * f, c + s * g)
    time = _time_to(gap, (i * u + j * v + k * w) / size, time_step)
    x, y, z = x - time * u, y - time * v, z - time * w
    s = sign * _volume(i, j, k, x, y, z, along[0], along[1], along[2])
    t = sign * _volume(i, j, k, x, y, z, e, f, g)
    border = BORDER * radius
    if s < -border or s > mine.length + border or t < -border or t > edge.length + border:
        return False
    point.key = 3 * ((own - ground.own_edge) * ground.lines + edge.line) + 2
    point.lever[0], point.lever[1], point.lever[2] = a + s * e, b + s * f, c + s * g
    point.normal[0], point.normal[1], point.normal[2] = i / size, j / size, k / size
    point.gap = gap
    return True


@compiled
def _volume(
    i: float,
    j: float,
    k: float,
    x: float,
    y: float,
    z: float,
    p: float,
    q: float,
    r: float,
) -> float:
    """Product of (i, j, k) with the cross product of the other two vectors."""
    a, b, c = cross(x, y, z, p, q, r)
    return i * a + j * b + k * c
