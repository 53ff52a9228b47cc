"""How the rock of a compiled run is written into its record at the end of a step."""

from __future__ import annotations

import math

from vsr_core.arrays import Array
from vsr_core.compiled.compiling import compiled
from vsr_core.compiled.vectors import assign, inertia_turned, matrix, turned
from vsr_core.engines.nonsmooth.body import Body, Points, RockState
from vsr_core.engines.nonsmooth.peaks import Peaks
from vsr_core.engines.nonsmooth.world import begin
from vsr_core.judge import record as records
from vsr_core.judge.record import Criteria, RunRecord


@compiled
def start(
    record: RunRecord,
    criteria: Criteria,
    body: Body,
    axes: Array,
    rock: RockState,
    points: Points,
    peaks: Peaks,
    interval: float,
) -> None:
    """Begin a run and its record, with no contact yet.

    Parameters
    ----------
    axes : ndarray, shape (3, 3), principal axes of the rock in its rest pose, as columns
    interval : float [s], time step
    """
    begin(body, rock, peaks, interval)
    write(record, body, axes, rock, points, interval)
    records.begin(record, criteria)


@compiled
def write(
    record: RunRecord, body: Body, axes: Array, rock: RockState, points: Points, interval: float
) -> None:
    """Write the state of now, half a step before the place that the engine knows.

    Parameters
    ----------
    axes : ndarray, shape (3, 3), principal axes of the rock in its rest pose, as columns
    interval : float [s], time step
    """
    half = -0.5 * interval
    v, q, middle = rock.velocity, rock.quaternion, rock.middle
    w, x, y, z = turned(half * v[3], half * v[4], half * v[5], q[0], q[1], q[2], q[3])
    matrix(w, x, y, z, middle)
    inertia_turned(middle, body.moments, record.inertia)
    for k in range(3):
        record.position[k] = rock.place[k] + half * v[k]
        for j in range(3):
            record.rotation[k, j] = (
                middle[k, 0] * axes[j, 0] + middle[k, 1] * axes[j, 1] + middle[k, 2] * axes[j, 2]
            )
    assign(record.velocity, v[:3])
    assign(record.spin, v[3:])
    record.lever[0] = record.lever[1] = 0.0
    record.lever[2] = -math.inf if len(body.points) else body.radius
    for at in range(rock.near):
        _try_lowest(record, middle, body.points[points[at].near])
    if not rock.near:
        for i in range(len(body.points)):
            _try_lowest(record, middle, body.points[i])


@compiled
def _try_lowest(record: RunRecord, rotation: Array, corner: Array) -> None:
    """Take a corner for the lowest one if it is lower than that."""
    height = rotation[2, 0] * corner[0] + rotation[2, 1] * corner[1] + rotation[2, 2] * corner[2]
    if -height > record.lever[2]:
        for k in range(3):
            record.lever[k] = -(
                rotation[k, 0] * corner[0] + rotation[k, 1] * corner[1] + rotation[k, 2] * corner[2]
            )
