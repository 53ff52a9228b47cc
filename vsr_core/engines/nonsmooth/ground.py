"""A rock on a terrain: the points at which it may touch that in the next step, and its steps."""

from __future__ import annotations

import math

from vsr_core.arrays import Array
from vsr_core.compiled.compiling import compiled, inlined
from vsr_core.compiled.vectors import length
from vsr_core.engines.nonsmooth.body import Body, Point, Points, RockState, Stepping
from vsr_core.engines.nonsmooth.near import NEAR_STEPS, move_on, renew
from vsr_core.engines.nonsmooth.pairs import CORNER, EDGES, beside
from vsr_core.engines.nonsmooth.peaks import Peaks, look
from vsr_core.engines.nonsmooth.sphere import gather_sphere, touch_sphere
from vsr_core.engines.nonsmooth.stepping import step
from vsr_core.engines.nonsmooth.touching import BORDER, DEEPEST, TINY, corner, edges, vertex
from vsr_core.engines.nonsmooth.tree import Ground

HASTE = 1.3
"""By how much faster an impact may make a rock, within a step."""

DEEP = 0.002
"""Depth of a corner, as a share of the radius and besides half a step's path, beyond which it is
seen whether it is in the ground: on rough ground it may as well be in front of another face."""

HOLLOW = 1e-4
"""How far a face goes on beyond a concave edge, as a share of the radius."""


@compiled
def find(  # noqa: C901 - split up, it takes twice as long
    body: Body, ground: Ground, rock: RockState, points: Points, time_step: float, speed: float
) -> None:
    """Find the points that may touch the terrain at the end of the next step.

    Parameters
    ----------
    ground : Ground, whose lists of near features are kept up to date
    time_step : float [s]
    speed : float [m/s], that what pushes the rock adds in a step
    """
    search, radius = ground.search[0], body.radius
    way = time_step * _pace(rock.velocity, radius)
    search.way += way
    search.reserve -= way
    # What landed in the last step and rebounds in this may be as far away as that took it.
    ahead = max(way, time_step * _pace(rock.before, radius)) + speed * time_step
    ahead = HASTE * ahead + HOLLOW * radius
    if len(ground.corners) > 0:
        move_on(ground, rock, time_step)
        renew(ground, rock, radius, ahead, DEEPEST * radius)
    elif not search.reserve >= ahead:
        gather_sphere(ground, rock, radius, DEEPEST * radius + NEAR_STEPS * ahead)
    rock.found = 0
    drop = HOLLOW * radius + 4.0 * speed * time_step
    dues, pairs, ways, nears = ground.dues, ground.pairs, ground.tree.ways, ground.tree.nears
    for at in range(search.pairs):
        leaf = pairs[at].leaf
        way = ways[leaf]
        if dues[at] - way > ahead:
            continue
        if rock.found == len(points):
            search.full = 1
            break
        point = points[rock.found]
        kind, own, other = pairs[at].kind, pairs[at].own, pairs[at].other
        if len(ground.corners) == 0:
            clear = touch_sphere(ground, rock, point, kind, other, time_step, ahead, radius)
        elif kind == CORNER:
            clear = corner(ground, rock, point, own, other, time_step, ahead, drop, radius)
            is_deep = clear == 0.0 and point.gap < -DEEP * radius - 0.5 * ahead
            if is_deep and not _is_inside(ground, rock, point, at, radius):
                clear = TINY
        elif kind == EDGES:
            clear = edges(ground, rock, point, own, other, time_step, ahead, radius)
        else:
            clear = vertex(ground, rock, point, at, other, time_step, ahead, radius)
        dues[at] = way + min(clear, nears[leaf])
        if clear == 0.0 and not _known(points, rock.found, point.key):
            rock.found += 1
    _sort(points, rock.found)


@inlined
def _sort(points: Points, number: int) -> None:
    """Put the points found in the order of their keys.

    Where a search ends within its tolerance depends on the order of points; so a run does not
    depend on how ground is cut and on what was near before.
    """
    for n in range(1, number):
        at = n
        while at > 0 and points[at].key < points[at - 1].key:
            one, other = points[at], points[at - 1]
            one.key, other.key = other.key, one.key
            one.gap, other.gap = other.gap, one.gap
            for k in range(3):
                one.lever[k], other.lever[k] = other.lever[k], one.lever[k]
                one.normal[k], other.normal[k] = other.normal[k], one.normal[k]
            at -= 1


@compiled
def _pace(velocity: Array, radius: float) -> float:
    """Bound of the speed of a rock's points [m/s]."""
    v, w = velocity[:3], velocity[3:]
    across = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    return across + radius * math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])


@inlined
def _known(points: Points, number: int, key: int) -> bool:
    """Whether a point is among the first ``number`` already."""
    known = False
    for i in range(number):
        known = known or points[i].key == key
    return known


@inlined
def _is_inside(ground: Ground, rock: RockState, point: Point, at: int, radius: float) -> bool:
    """Whether a corner that is deep behind a face has no other face nearer."""
    search, place, lever = ground.search[0], rock.place, point.lever
    x, y, z = place[0] + lever[0], place[1] + lever[1], place[2] + lever[2]
    pair = ground.pairs[at]
    for k in range(search.pairs):
        other = ground.pairs[k]
        if other.kind != CORNER or other.own != pair.own or other.other == pair.other:
            continue
        face = ground.faces[other.other]
        normal = face.normal
        gap = normal[0] * x + normal[1] * y + normal[2] * z - face.offset
        if abs(gap) > -point.gap or (gap == point.gap and k > at):
            continue
        p, q, r = x - gap * normal[0], y - gap * normal[1], z - gap * normal[2]
        if beside(ground.plates, other.other, p, q, r, BORDER * radius):
            return False
    return True


@compiled
def advance(
    body: Body,
    ground: Ground,
    rock: RockState,
    points: Points,
    peaks: Peaks,
    values: Array,
    now: int,
    until: int,
    stepping: Stepping,
) -> float:
    """Step a rock on a terrain from one sample of its table to another.

    Parameters
    ----------
    values : ndarray, shape (n, 3) [m/s^2], in the site's frame; beyond the last the table rests

    Returns
    -------
    float [m/s], integral of the table's absolute acceleration
    """
    push, given, interval, gravity = rock.push, 0.0, stepping.interval, stepping.gravity
    for n in range(now, until):
        push[0] = push[1] = 0.0
        push[2] = -gravity
        if n < len(values):
            for k in range(3):
                push[k] -= values[n, k]
            given += interval * length(values[n])
        speed = interval * (abs(push[0]) + abs(push[1]) + abs(push[2]))
        find(body, ground, rock, points, interval, speed)
        step(body, rock, points, push, interval, gravity, stepping.rounds, stepping.residual)
        look(peaks, rock)
    return given
