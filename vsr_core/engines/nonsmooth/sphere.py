"""Points at which a sphere touches a terrain: the nearest of each face, convex edge and vertex."""

from __future__ import annotations

import math

from vsr_core.engines.nonsmooth.body import Motion, Points
from vsr_core.engines.nonsmooth.compiling import compiled
from vsr_core.engines.nonsmooth.grid import Ground
from vsr_core.engines.nonsmooth.near import add, cells, is_new

FACE, EDGE, VERTEX = 0, 1, 2
"""Kinds of features of the terrain."""

CONE = 1e-9
"""Sine of the angle by which a normal may be outside its cone, and border of a face over radius."""


@compiled
def gather_sphere(ground: Ground, rock: Motion, radius: float, near: float) -> None:
    """List the features that a sphere may touch before it has moved by ``near``.

    Parameters
    ----------
    ground : Ground, changed
    rock : record of ``MOTION``
    radius, near : float [m]
    """
    search, place, reach = ground.search[0], rock.place, radius + near
    search.pairs, search.reserve = 0, near
    search.query += 1
    first_x, last_x = cells(ground, place[0] - reach, place[0] + reach, 0)
    first_y, last_y = cells(ground, place[1] - reach, place[1] + reach, 1)
    for i in range(first_x, last_x + 1):
        for j in range(first_y, last_y + 1):
            cell = ground.cells[i * ground.rows + j]
            if cell.high < place[2] - reach or cell.low > place[2] + reach:
                continue
            for kind in range(3):
                for at in range(cell.first[kind], cell.last[kind]):
                    number = ground.members[at]
                    if kind == VERTEX or is_new(ground, kind * ground.own_face + number):
                        add(ground, kind, 0, number)


@compiled
def touch_sphere(
    ground: Ground,
    rock: Motion,
    point: Points,
    kind: int,
    number: int,
    time_step: float,
    ahead: float,
    radius: float,
) -> bool:
    """Write the point of a feature at which a sphere may touch; whether it may in the next step.

    Parameters
    ----------
    ground : Ground
    rock : record of ``MOTION``
    point : record of ``POINT``, changed
    kind, number : int, of the feature
    time_step : float [s]
    ahead : float [m], path of a step
    radius : float [m]

    Returns
    -------
    bool
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
            return False
        x, y, z = x - share * along[0], y - share * along[1], z - share * along[2]
        left, right = edge.left, edge.right
        if x * left[0] + y * left[1] + z * left[2] > CONE * radius:
            return False
        if x * right[0] + y * right[1] + z * right[2] > CONE * radius:
            return False
        point.key = 3 * edge.line + EDGE
    else:
        vertex = ground.vertices[number]
        spot = vertex.place
        x, y, z = place[0] - spot[0], place[1] - spot[1], place[2] - spot[2]
        for k in range(vertex.first, vertex.first + vertex.count):
            if x * ground.arms[k, 0] + y * ground.arms[k, 1] + z * ground.arms[k, 2] > CONE * radius:
                return False
        point.key = 3 * number + VERTEX
    size = math.sqrt(x * x + y * y + z * z)
    if size == 0.0:
        return False
    return _meets(point, x / size, y / size, z / size, size - radius, ahead, radius)


@compiled
def _meets(
    point: Points, x: float, y: float, z: float, gap: float, ahead: float, radius: float
) -> bool:
    if gap > ahead or gap < -0.5 * radius:
        return False
    point.normal[0], point.normal[1], point.normal[2] = x, y, z
    point.lever[0], point.lever[1], point.lever[2] = -radius * x, -radius * y, -radius * z
    point.gap = gap
    return True


@compiled
def _face(
    ground: Ground,
    rock: Motion,
    point: Points,
    number: int,
    time_step: float,
    ahead: float,
    radius: float,
) -> bool:
    face, place, velocity = ground.faces[number], rock.place, rock.velocity
    n = face.normal
    height = n[0] * place[0] + n[1] * place[1] + n[2] * place[2] - face.offset
    gap, speed = height - radius, n[0] * velocity[0] + n[1] * velocity[1] + n[2] * velocity[2]
    if gap > ahead or height < 0.5 * radius:
        return False
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
            return False
    point.key = 3 * face.flat + FACE
    return _meets(point, n[0], n[1], n[2], gap, ahead, radius)
