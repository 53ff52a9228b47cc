"""Points at which a sphere touches a terrain: the nearest of each face, convex edge and vertex."""

from __future__ import annotations

import math

from vsr_core.compiled.compiling import compiled
from vsr_core.engines.nonsmooth.body import Point, RockState
from vsr_core.engines.nonsmooth.pairs import add
from vsr_core.engines.nonsmooth.tree import Ground

FACE, EDGE, VERTEX = 0, 1, 2
"""Kinds of features of the terrain."""

TINY = 1e-300
"""Path until a touch where none is known but that there is no touch yet [m]."""

CONE = 1e-9
"""Sine of the angle by which a normal may be outside its cone, and border of a face over radius."""


@compiled
def gather_sphere(ground: Ground, rock: RockState, radius: float, near: float) -> None:
    """List the features that a sphere may touch before it has moved by ``near``.

    Parameters
    ----------
    radius, near : float [m]
    """
    search, place, reach = ground.search[0], rock.place, radius + near
    search.pairs, search.reserve = 0, near
    boxes, links, at = ground.tree.boxes, ground.tree.links, 0
    while at < len(boxes):
        square = 0.0
        for k in range(3):
            off = max(0.0, abs(boxes[at, k] - place[k]) - boxes[at, 3 + k])
            square += off * off
        if square > reach * reach:
            at = links[at, 0]
            continue
        if links[at, 1]:
            for kind in range(3):
                for number in range(links[at, 2 + 2 * kind], links[at, 3 + 2 * kind]):
                    add(ground, at, kind, 0, number, 0.0)
        at += 1


@compiled
def touch_sphere(
    ground: Ground,
    rock: RockState,
    point: Point,
    kind: int,
    number: int,
    time_step: float,
    ahead: float,
    radius: float,
) -> float:
    """Write the point of a feature at which a sphere may touch; the path until it may, as known.

    Parameters
    ----------
    time_step : float [s]
    ahead : float [m], path of a step
    radius : float [m]

    Returns
    -------
    float [m], 0 if it may touch in the next step
    """
    if kind == FACE:
        return _face(ground, rock, point, number, time_step, ahead, radius)
    place = rock.place
    if kind == EDGE:
        edge = ground.edges[number]
        start, along = edge.start, edge.along
        x, y, z = place[0] - start[0], place[1] - start[1], place[2] - start[2]
        share = x * along[0] + y * along[1] + z * along[2]
        if share < 0.0 or share > edge.length:
            return TINY
        x, y, z = x - share * along[0], y - share * along[1], z - share * along[2]
        left, right = edge.left, edge.right
        if x * left[0] + y * left[1] + z * left[2] > CONE * radius:
            return TINY
        if x * right[0] + y * right[1] + z * right[2] > CONE * radius:
            return TINY
        point.key = 3 * edge.line + EDGE
    else:
        vertex = ground.vertices[number]
        spot = vertex.place
        x, y, z = place[0] - spot[0], place[1] - spot[1], place[2] - spot[2]
        for k in range(vertex.first, vertex.first + vertex.count):
            if (
                x * ground.arms[k, 0] + y * ground.arms[k, 1] + z * ground.arms[k, 2]
                > CONE * radius
            ):
                return TINY
        point.key = 3 * number + VERTEX
    size = math.sqrt(x * x + y * y + z * z)
    if size == 0.0:
        return TINY
    return _meets(point, x / size, y / size, z / size, size - radius, ahead, radius)


@compiled
def _meets(
    point: Point, x: float, y: float, z: float, gap: float, ahead: float, radius: float
) -> float:
    if gap > ahead or gap < -0.5 * radius:
        return TINY
    point.normal[0], point.normal[1], point.normal[2] = x, y, z
    point.lever[0], point.lever[1], point.lever[2] = -radius * x, -radius * y, -radius * z
    point.gap = gap
    return 0.0


@compiled
def _face(
    ground: Ground,
    rock: RockState,
    point: Point,
    number: int,
    time_step: float,
    ahead: float,
    radius: float,
) -> float:
    face, place, velocity = ground.faces[number], rock.place, rock.velocity
    n = face.normal
    height = n[0] * place[0] + n[1] * place[1] + n[2] * place[2] - face.offset
    gap, speed = height - radius, n[0] * velocity[0] + n[1] * velocity[1] + n[2] * velocity[2]
    if gap > ahead or height < 0.5 * radius:
        return TINY
    time = 0.0 if gap <= 0.0 or speed >= 0.0 else min(time_step, -gap / speed)
    x, y, z = (
        place[0] - height * n[0] + time * (velocity[0] - speed * n[0]),
        place[1] - height * n[1] + time * (velocity[1] - speed * n[1]),
        place[2] - height * n[2] + time * (velocity[2] - speed * n[2]),
    )
    for k in range(face.first, face.first + face.count):
        side = ground.sides[k]
        inward = side.inward
        if inward[0] * x + inward[1] * y + inward[2] * z - side.limit < -CONE * radius:
            return TINY
    point.key = 3 * face.flat + FACE
    return _meets(point, n[0], n[1], n[2], gap, ahead, radius)
