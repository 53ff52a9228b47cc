"""A rock on a level pedestal: its corners near that, or the lowest point of a sphere."""

from __future__ import annotations

from vsr_core.arrays import Array
from vsr_core.compiled.compiling import compiled
from vsr_core.compiled.vectors import length
from vsr_core.engines.nonsmooth.body import Body, Point, Points, RockState, Stepping
from vsr_core.engines.nonsmooth.peaks import Peaks, look
from vsr_core.engines.nonsmooth.stepping import step
from vsr_core.engines.nonsmooth.turning import feel

NEAR_SHARE = 0.03
"""Height up to which corners are near, as a share of the radius: they are looked at in every step,
the others once the rock has moved by as much."""

FASTER = 3.0
"""By how much an impact at one end of a rock may speed up the other."""


@compiled
def find(body: Body, rock: RockState, points: Points, time_step: float, speed: float) -> None:
    """Find the points that may touch the pedestal, z = 0, at the end of the next step.

    Parameters
    ----------
    time_step : float [s]
    speed : float [m/s], that what pushes the rock adds in a step
    """
    if not len(body.points):
        _lowest_of_sphere(body, rock, points[0])
        return
    v = rock.velocity
    way = abs(v[0]) + abs(v[1]) + abs(v[2])
    way = time_step * (way + (abs(v[3]) + abs(v[4]) + abs(v[5])) * body.radius)
    rock.reserve -= way  # the path of the step before
    ahead = FASTER * (way + time_step * speed)
    if rock.reserve < ahead:
        near = NEAR_SHARE * body.radius + ahead
        _gather(body, rock, points, near)
        rock.reserve = near
    rotation, corners, height = rock.rotation, body.points, rock.place[2]
    for at in range(rock.near):
        point = points[at]
        lever, i = point.lever, point.near
        x, y, z = corners[i, 0], corners[i, 1], corners[i, 2]
        point.key = i
        lever[0] = rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z
        lever[1] = rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z
        lever[2] = rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z
        point.gap = height + lever[2]
    rock.found = rock.near


@compiled
def _gather(body: Body, rock: RockState, points: Points, near: float) -> None:
    """Corners lower than ``near`` [m]."""
    corners, number = body.points, 0
    a, b, c = rock.rotation[2, 0], rock.rotation[2, 1], rock.rotation[2, 2]
    height = rock.place[2]
    for i in range(len(corners)):
        if height + a * corners[i, 0] + b * corners[i, 1] + c * corners[i, 2] < near:
            points[number].near = i
            _level(points[number])
            number += 1
    rock.near = number


@compiled
def _lowest_of_sphere(body: Body, rock: RockState, point: Point) -> None:
    point.key = 0
    point.lever[0] = point.lever[1] = 0.0
    point.lever[2] = -body.radius
    point.gap = rock.place[2] - body.radius
    _level(point)
    rock.found = 1


@compiled
def _level(point: Point) -> None:
    point.normal[0] = point.normal[1] = 0.0
    point.normal[2] = 1.0


@compiled
def advance(
    body: Body,
    rock: RockState,
    points: Points,
    peaks: Peaks,
    values: Array,
    now: int,
    until: int,
    stepping: Stepping,
    on_ground: bool,
) -> float:
    """Step a rock on a level pedestal from one sample of its table to another.

    Parameters
    ----------
    values : ndarray, shape (n, 3) or (n, 9), as of a motion; beyond the last the table rests
    on_ground : bool, whether there is a pedestal

    Returns
    -------
    float [m/s], how much the table can have added to sqrt(2 e)
    """
    push, given, interval, gravity = rock.push, 0.0, stepping.interval, stepping.gravity
    for n in range(now, until):
        push[0] = push[1] = 0.0
        push[2] = -gravity
        if n < len(values) and values.shape[1] == 9:
            given += feel(body, rock, values[n], interval, gravity)
        elif n < len(values):
            for k in range(3):
                push[k] -= values[n, k]
            given += interval * length(values[n])
        if on_ground:
            speed = interval * (abs(push[0]) + abs(push[1]) + abs(push[2]))
            find(body, rock, points, interval, speed)
        step(body, rock, points, push, interval, gravity, stepping.rounds, stepping.residual)
        look(peaks, rock)
    return given
