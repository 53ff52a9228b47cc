"""How compiled runs see their rock at the end of a step: its pose, velocity and lowest corner."""

from __future__ import annotations

import math

from vsr_core.engines.nonsmooth.body import Body, Motion, Points
from vsr_core.engines.nonsmooth.compiling import compiled
from vsr_core.engines.nonsmooth.vectors import assign, inertia_turned, matrix, turned
from vsr_core.run.watching import Rule, Watch


@compiled
def start_watch(watch: Watch, body: Body, rock: Motion, rule: Rule, interval: float) -> None:
    """Begin to watch a run.

    Parameters
    ----------
    interval : float [s], time step
    """
    rock.near = 0
    watch.peak_tilt = watch.slip = 0.0
    watch.rest_since = -1.0
    _pose(watch, body, rock, rule, interval)
    _find_lowest(watch, body, rock)
    assign(watch.start, watch.place)
    for k in range(2):
        watch.start_foot[k] = watch.place[k] - rule.foot * watch.rotation[k, 2]


@compiled
def look(
    watch: Watch, body: Body, rock: Motion, points: Points, rule: Rule, interval: float
) -> None:
    """Write the state of now, half a step before the place that the engine knows.

    Parameters
    ----------
    interval : float [s], time step
    """
    _pose(watch, body, rock, rule, interval)
    if not rock.near:
        _find_lowest(watch, body, rock)
        return
    watch.lever[2] = -math.inf
    for at in range(rock.near):
        _try_lowest(watch, body, rock, points[at].near)


@compiled
def _pose(watch: Watch, body: Body, rock: Motion, rule: Rule, interval: float) -> None:
    half = -0.5 * interval
    v, q = rock.velocity, rock.quaternion
    w, x, y, z = turned(half * v[3], half * v[4], half * v[5], q[0], q[1], q[2], q[3])
    watch.quaternion[0], watch.quaternion[1] = w, x
    watch.quaternion[2], watch.quaternion[3] = y, z
    matrix(w, x, y, z, rock.middle)
    inertia_turned(rock.middle, body.moments, watch.inertia)
    for k in range(3):
        watch.place[k] = rock.place[k] + half * v[k]
        for j in range(3):
            watch.rotation[k, j] = (
                rock.middle[k, 0] * rule.axes[j, 0]
                + rock.middle[k, 1] * rule.axes[j, 1]
                + rock.middle[k, 2] * rule.axes[j, 2]
            )
    assign(watch.velocity, v)


@compiled
def _find_lowest(watch: Watch, body: Body, rock: Motion) -> None:
    """Lowest corner of the rock, or of a sphere its lowest point."""
    watch.lever[0] = watch.lever[1] = 0.0
    watch.lever[2] = -math.inf if len(body.points) else body.radius
    for i in range(len(body.points)):
        _try_lowest(watch, body, rock, i)


@compiled
def _try_lowest(watch: Watch, body: Body, rock: Motion, i: int) -> None:
    """Take a corner for the lowest one if it is lower than that."""
    rotation, corner = rock.middle, body.points[i]
    height = rotation[2, 0] * corner[0] + rotation[2, 1] * corner[1] + rotation[2, 2] * corner[2]
    if -height > watch.lever[2]:
        for k in range(3):
            watch.lever[k] = -(
                rotation[k, 0] * corner[0] + rotation[k, 1] * corner[1] + rotation[k, 2] * corner[2]
            )
