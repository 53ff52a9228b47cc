"""Points that land in a step: when they do, and the velocity that they are to have."""

from __future__ import annotations

import math

from vsr_core.arrays import Array
from vsr_core.compiled.compiling import compiled
from vsr_core.compiled.vectors import cross
from vsr_core.engines.nonsmooth.body import (
    OPEN,
    Body,
    Point,
    Points,
    RockState,
    add_impulse,
    tangents,
)

LIFTING_SHARE = 2e-3
"""Speed at which a point that is in the ground is lifted at most, as a share of sqrt(g radius)."""

BOUNCING_STEPS = 2.0
"""Approach speed below which nothing rebounds, in units of what gravity adds in a step."""


@compiled
def velocity_at(point: Point, velocity: Array) -> tuple[float, float, float]:
    """Velocity of a point of the rock [m/s].

    Parameters
    ----------
    velocity : ndarray, shape (6,) [m/s] and [rad/s]

    Returns
    -------
    tuple of three floats [m/s]
    """
    lever = point.lever
    x, y, z = cross(velocity[3], velocity[4], velocity[5], lever[0], lever[1], lever[2])
    return velocity[0] + x, velocity[1] + y, velocity[2] + z


@compiled
def end_gap(point: Point, x: float, y: float, z: float, time_step: float) -> float:
    """Gap of a point at the end of the path if it moves by (x, y, z) [m/s].

    Parameters
    ----------
    x, y, z : float [m/s], its velocity
    time_step : float [s]

    Returns
    -------
    float [m]
    """
    normal, bend = point.normal, point.bend
    return (
        point.gap
        + normal[0] * (time_step * x + bend[0])
        + normal[1] * (time_step * y + bend[1])
        + normal[2] * (time_step * z + bend[2])
    )


@compiled
def want(point: Point, time_step: float) -> float:
    """Have a point reckon with ``bend``.

    One that touches is to be at the ground at the end of its bent path; one that leaves has turned
    freely for (1/2 + after) h since its impact.

    Parameters
    ----------
    time_step : float [s]

    Returns
    -------
    float [m/s], change of the velocity wanted
    """
    rows, bend, wanted = point.rows, point.bend, point.wanted
    largest = 0.0
    for k in range(3):
        along = rows[k, 0] * bend[0] + rows[k, 1] * bend[1] + rows[k, 2] * bend[2]
        value = point.base[k] + point.follows * along / time_step
        largest = max(largest, abs(value - wanted[k]))
        wanted[k] = value
    return largest


@compiled
def enter(rock: RockState, points: Points, i: int) -> None:
    """Make a point active: its directions, and what an impulse there does."""
    point = points[i]
    points[rock.active].active = i
    rock.active += 1
    point.is_active = 1
    point.state = OPEN
    point.rebound = point.leaving = 0.0
    point.after = 1.0
    point.follows = -1.0
    rows, turning, lever, flexibility = point.rows, point.turning, point.lever, rock.flexibility
    tangents(point.normal, rows)
    for k in range(3):
        point.base[k] = point.impulse[k] = point.given[k] = 0.0
        a, b, c = cross(lever[0], lever[1], lever[2], rows[k, 0], rows[k, 1], rows[k, 2])
        rows[k, 3], rows[k, 4], rows[k, 5] = a, b, c
        for j in range(3):
            turning[k, j] = flexibility[j, 0] * a + flexibility[j, 1] * b + flexibility[j, 2] * c
    at = 0
    for k in range(3):
        for j in range(k, 3):
            value = 1.0 if j == k else 0.0
            for n in range(3):
                value += rows[k, 3 + n] * turning[j, n]
            point.mass[at] = value
            at += 1


@compiled
def land(
    body: Body,
    rock: RockState,
    points: Points,
    push: Array,
    time_step: float,
    gravity: float,
    closed: float,
) -> tuple[bool, float]:
    """Make those points active that would be in the ground at the end of the path.

    Slow ones may be as deep there as ``closed`` [m].

    Returns whether there are any, and the share of the path after which the first of them lands;
    more than 1 if none lands fast. What comes slowly takes the weight over by and by: to tell when
    would add energy to a rock that comes to rest.

    Parameters
    ----------
    push : ndarray, shape (3,) [m/s^2]
    time_step : float [s]
    gravity : float [m/s^2]
    closed : float [m]
    """
    first, entered, slow = 2.0, False, body.slow * gravity * time_step
    for i in range(rock.found):
        point = points[i]
        if point.is_active:
            continue
        x, y, z = velocity_at(point, rock.velocity)
        end = end_gap(point, x, y, z, time_step)
        if end >= 0.0:
            continue
        normal = point.normal
        fast = x * normal[0] + y * normal[1] + z * normal[2] < -slow
        if end >= -closed and not fast:
            continue
        enter(rock, points, i)
        share = _aim(body, rock, point, x, y, z, push, time_step, gravity)
        want(point, time_step)
        entered = True
        if fast:
            first = min(first, share)
    return entered, first


@compiled
def _aim(
    body: Body,
    rock: RockState,
    point: Point,
    x: float,
    y: float,
    z: float,
    push: Array,
    time_step: float,
    gravity: float,
) -> float:
    """Velocity that a landing point is to have, which moves by (x, y, z) [m/s] before it touches.

    Returns the share of the path after which it touches.
    """
    rows, base, gap = point.rows, point.base, point.gap
    approach = rows[0, 0] * x + rows[0, 1] * y + rows[0, 2] * z
    share = min(1.0, max(0.0, gap / (-time_step * approach))) if approach < 0.0 else 1.0
    base[0] = -gap / time_step
    if gap < 0.0:
        base[0] = min(base[0], LIFTING_SHARE * math.sqrt(gravity * body.radius))
    for k in range(1, 3):
        base[k] = share * (rows[k, 0] * x + rows[k, 1] * y + rows[k, 2] * z)
    if body.restitution > 0.0:
        earlier = 0.0
        for k in range(6):
            earlier += rows[0, k] * rock.before[k]
        fall = earlier + (0.5 + share) * (approach - earlier)
        if -fall > BOUNCING_STEPS * gravity * time_step:
            pushed = rows[0, 0] * push[0] + rows[0, 1] * push[1] + rows[0, 2] * push[2]
            leaving, after = -body.restitution * fall, 1.0 - share
            point.leaving, point.after = leaving, after
            point.rebound = leaving + (0.5 + after) * time_step * pushed
            base[0] = min(base[0], 0.0) + after * (leaving + 0.5 * after * time_step * pushed)
    return share


@compiled
def let_go(rock: RockState, points: Points, standing: int, share: float) -> None:
    """Have points that touched before bear the rock until it lands elsewhere, and no longer.

    Their impulses are those of a step; ``share`` is the time from its begin to the landing, in
    steps. They may bear it again, but what they gave is not taken back. Points that rebound, from
    an impact of the step before, do so in full.
    """
    for at in range(standing):
        point = points[points[at].active]
        if point.leaving > 0.0:
            continue
        add_impulse(point, share, rock.free)
        add_impulse(point, share - 1.0, rock.velocity)
        for k in range(3):
            point.given[k] = share * point.impulse[k]
            point.impulse[k] = 0.0
