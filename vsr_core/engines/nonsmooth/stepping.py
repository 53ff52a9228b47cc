"""One time step of a rock: free motion, points that would close, impulses, and the path taken.

Places are known in the middle of a step, velocities at its ends (Verlet's positions). Contact is
asked for by the gap at the end of the path, impulses act where the path begins: as the SHAKE
method, this is of second order in the step and lets no gap drift. A point that closes within the
path is given the velocity that takes it to the ground just then, and the rest of its impulse in the
next step: both together lead to where an impact at the moment of touching would have led, so that
no such moment has to be searched.

References
----------
Ryckaert, Ciccotti & Berendsen (1977), J. Comput. Phys. 23, 327-341 (SHAKE).
Moreau (1988), in: Nonsmooth Mechanics and Applications, CISM Courses 302, 1-82.
"""

from __future__ import annotations

import math

from vsr_core.arrays import Array
from vsr_core.compiled.compiling import compiled
from vsr_core.compiled.vectors import assign, inertia_turned, matrix, turned
from vsr_core.engines.nonsmooth.body import Body, Point, Points, RockState, add_impulse
from vsr_core.engines.nonsmooth.impulses import solve
from vsr_core.engines.nonsmooth.landings import (
    LIFTING_SHARE,
    end_gap,
    enter,
    land,
    let_go,
    velocity_at,
    want,
)
from vsr_core.engines.nonsmooth.rebounds import hold_back, repay

ROUNDS = 6
"""Rounds of a step, at most: points that the impulses of others close come in by and by."""

CLOSED_SHARE = 1e-6
"""Depth of a point at the end of a path that needs no further round, as a share of the radius. The
next step makes up for it."""

TOUCHING_SHARE = 1e-6
"""Gap of a point that touches, as a share of the radius."""


@compiled
def step(
    body: Body,
    rock: RockState,
    points: Points,
    push: Array,
    time_step: float,
    gravity: float,
    rounds: int,
    residual: float,
) -> None:
    """Step a rock whose points near the ground are found.

    Parameters
    ----------
    points : Points, those found at the place of the rock
    push : ndarray, shape (3,) [m/s^2], gravity less the acceleration of the table
    time_step : float [s]
    gravity : float [m/s^2], by which speeds and tolerances are measured
    rounds : int, in the search for the impulses, at most
    residual : float, error of a velocity by them, as a share of what gravity adds in a step
    """
    _free(body, rock, push, time_step)
    limit = residual * gravity * time_step
    closed = CLOSED_SHARE * body.radius
    has_corners = len(body.points) > 0  # where a sphere touches does not turn with it
    if has_corners:
        _bend(rock, points, time_step)
    _bear(body, rock, points, time_step, gravity, rounds, limit)
    landed = False
    for _ in range(ROUNDS):
        if has_corners:
            _bend(rock, points, time_step)
        late = time_step * _wanted_anew(rock, points, time_step) > closed
        standing = rock.active
        entered, share = land(body, rock, points, push, time_step, gravity, closed)
        if not entered and not late:
            break
        if share <= 1.0 and not landed:
            landed = True
            for k in range(6):
                change = rock.velocity[k] - rock.before[k]
                rock.approach[k] = rock.before[k] + (0.5 + share) * change
            let_go(rock, points, standing, 0.5 + share)
        if entered and landed and body.restitution > 0.0:
            hold_back(body, rock, points, rounds, limit)
            _wanted_anew(rock, points, time_step)
        solve(rock, points, body.friction, rounds, limit)
    if body.restitution > 0.0:
        repay(body, rock, points, rounds, limit)
    _carry_over(rock, points)
    drift(rock, time_step)


@compiled
def _bear(
    body: Body,
    rock: RockState,
    points: Points,
    time_step: float,
    gravity: float,
    rounds: int,
    limit: float,
) -> None:
    """Impulses of what touches when the step begins."""
    if not _touch(body, rock, points, time_step, gravity):
        return
    solved = solve(rock, points, body.friction, rounds, limit)
    if not solved and _lower(rock, points, time_step):
        solve(rock, points, body.friction, rounds, limit)


@compiled
def drift(rock: RockState, time: float) -> None:
    """Move and turn a rock by its velocity for a time [s].

    Parameters
    ----------
    time : float [s]
    """
    place, velocity, quaternion = rock.place, rock.velocity, rock.quaternion
    for k in range(3):
        place[k] += time * velocity[k]
    w, x, y, z = turned(
        time * velocity[3],
        time * velocity[4],
        time * velocity[5],
        quaternion[0],
        quaternion[1],
        quaternion[2],
        quaternion[3],
    )
    quaternion[0], quaternion[1], quaternion[2], quaternion[3] = w, x, y, z
    matrix(w, x, y, z, rock.rotation)


@compiled
def _free(body: Body, rock: RockState, push: Array, time_step: float) -> None:
    """Velocity at the end of the step without contact, and the inertia in the middle of its path.

    The angular momentum stays; the angular velocity follows from the pose half-way along the path,
    which makes free rotation of second order.
    """
    velocity, quaternion = rock.velocity, rock.quaternion
    assign(rock.before, velocity)
    half = 0.5 * time_step
    w, x, y, z = turned(
        half * velocity[3],
        half * velocity[4],
        half * velocity[5],
        quaternion[0],
        quaternion[1],
        quaternion[2],
        quaternion[3],
    )
    matrix(w, x, y, z, rock.middle)
    inertia_turned(rock.middle, body.moments, rock.inertia)
    inertia_turned(rock.middle, body.flexibility, rock.flexibility)
    flexibility, momentum = rock.flexibility, rock.momentum
    for k in range(3):
        velocity[k] += time_step * push[k]
        velocity[3 + k] = (
            flexibility[k, 0] * momentum[0]
            + flexibility[k, 1] * momentum[1]
            + flexibility[k, 2] * momentum[2]
        )
    assign(rock.free, velocity)
    assign(rock.turning, velocity[3:])


@compiled
def _bend(rock: RockState, points: Points, time_step: float) -> None:
    """Path that points take besides h w x r, by its curvature: h^2/2 w x (w x r)."""
    x, y, z = rock.velocity[3], rock.velocity[4], rock.velocity[5]
    half = 0.5 * time_step * time_step
    square = x * x + y * y + z * z
    for i in range(rock.found):
        lever, bend = points[i].lever, points[i].bend
        along = x * lever[0] + y * lever[1] + z * lever[2]
        bend[0] = half * (x * along - square * lever[0])
        bend[1] = half * (y * along - square * lever[1])
        bend[2] = half * (z * along - square * lever[2])


@compiled
def _wanted_anew(rock: RockState, points: Points, time_step: float) -> float:
    """Have active points reckon with ``bend``; the largest change of what is wanted [m/s]."""
    largest = 0.0
    for at in range(rock.active):
        largest = max(largest, want(points[points[at].active], time_step))
    return largest


@compiled
def _touch(body: Body, rock: RockState, points: Points, time_step: float, gravity: float) -> bool:
    """Make those points active that touch already and would close; whether there are any."""
    rock.active = 0
    touching = TOUCHING_SHARE * body.radius
    slowest = LIFTING_SHARE * math.sqrt(gravity * body.radius)
    for i in range(rock.found):
        point = points[i]
        point.is_active = 0
        kept = _kept(rock, points, point.key)
        if kept < 0 and point.gap > touching:
            continue
        leaves = kept >= 0 and points[kept].kept_rebound > 0.0
        x, y, z = velocity_at(point, rock.velocity)
        if kept < 0 and _comes(rock, point) > body.slow * gravity * time_step:
            continue  # it lands
        if not leaves and end_gap(point, x, y, z, time_step) >= 0.0:
            continue
        enter(rock, points, i)
        if leaves:
            point.base[0] = point.leaving = points[kept].kept_rebound
            point.follows = 2.0 * points[kept].kept_after
        else:
            point.base[0] = min(-point.gap / time_step, slowest)
        want(point, time_step)
        if kept >= 0 and not leaves:
            assign(point.impulse, points[kept].kept_impulse)
    for at in range(rock.active):
        add_impulse(points[points[at].active], 1.0, rock.velocity)
    return rock.active > 0


@compiled
def _comes(rock: RockState, point: Point) -> float:
    """Speed at which a point approached the ground before the step [m/s]."""
    x, y, z = velocity_at(point, rock.before)
    normal = point.normal
    return -(normal[0] * x + normal[1] * y + normal[2] * z)


@compiled
def _lower(rock: RockState, points: Points, time_step: float) -> bool:
    """No longer lift what is in the ground, as a wedged rock cannot be; whether any was."""
    lifted = False
    for at in range(rock.active):
        point = points[points[at].active]
        if point.base[0] > 0.0 and point.leaving == 0.0:
            point.base[0] = 0.0
            want(point, time_step)
            lifted = True
    return lifted


@compiled
def _kept(rock: RockState, points: Points, key: int) -> int:
    """Place of a point among those of the step before; -1 if it was not active then."""
    for at in range(rock.kept):
        if points[at].kept_key == key:
            return at
    return -1


@compiled
def _carry_over(rock: RockState, points: Points) -> None:
    """Give the impulses to the angular momentum, and keep them for the next step."""
    momentum = rock.momentum
    rock.kept = rock.active
    for at in range(rock.active):
        point, kept = points[points[at].active], points[at]
        for k in range(3):
            p = point.impulse[k]
            for j in range(3):
                momentum[j] += (p + point.given[k]) * point.rows[k, 3 + j]
            kept.kept_impulse[k] = p
        kept.kept_key = point.key
        kept.kept_rebound = point.rebound
        kept.kept_after = point.after
