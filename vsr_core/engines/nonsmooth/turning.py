"""A rock on a table that turns, seen in the table's own frame.

In a frame that turns at w with the rate w', whose origin accelerates by a, a body at r that moves
at v and spins at s relative to it feels, per unit mass, in its centre

    -a - w' x r - w x (w x r) - 2 w x v,

and its relative angular momentum I s, in the frame's axes, changes by the rate

    -I w' - w x I (w + s) - s x I w + I (s x w),

from the conservation of I (w + s) in axes that do not turn. Both are taken where the rock is in the
middle of the step, with v and s carried on to there from the step before.
"""

from __future__ import annotations

import math

from vsr_core.arrays import Array
from vsr_core.compiled.compiling import compiled
from vsr_core.compiled.vectors import cross, inertia_turned, product
from vsr_core.engines.nonsmooth.body import Body, RockState


@compiled
def feel(body: Body, rock: RockState, sample: Array, time_step: float, gravity: float) -> float:
    """Have a rock feel what a table does in the next step.

    Parameters
    ----------
    rock : RockState; ``push`` is written, the angular momentum changed
    sample : ndarray, shape (9,), of ``TableMotion.acceleration``
    time_step : float [s]
    gravity : float [m/s^2]

    Returns
    -------
    float [m/s]
        Upper bound of how much sqrt(2 e) grows by it, where e is the energy relative to the table
        per unit mass: by the force without Coriolis's, which does no work, and by the moment.
    """
    place, velocity, before, push = rock.place, rock.velocity, rock.before, rock.push
    w, rate = sample[3:6], sample[6:9]
    v = (
        1.5 * velocity[0] - 0.5 * before[0],
        1.5 * velocity[1] - 0.5 * before[1],
        1.5 * velocity[2] - 0.5 * before[2],
    )
    x, y, z = cross(w[0], w[1], w[2], place[0], place[1], place[2])
    p, q, r = cross(w[0], w[1], w[2], x, y, z)
    x, y, z = cross(rate[0], rate[1], rate[2], place[0], place[1], place[2])
    p, q, r = -sample[0] - x - p, -sample[1] - y - q, -sample[2] - z - r
    given = math.sqrt(p * p + q * q + r * r)
    x, y, z = cross(w[0], w[1], w[2], v[0], v[1], v[2])
    push[0], push[1], push[2] = p - 2.0 * x, q - 2.0 * y, r - 2.0 * z - gravity
    return time_step * (given + _turn(body, rock, w, rate, time_step))


@compiled
def _turn(body: Body, rock: RockState, w: Array, rate: Array, time_step: float) -> float:
    """Change the angular momentum; the length of the moment in the metric of the energy."""
    velocity, before, inertia = rock.velocity, rock.before, rock.inertia
    inertia_turned(rock.rotation, body.moments, inertia)
    inertia_turned(rock.rotation, body.flexibility, rock.flexibility)
    s = (
        1.5 * velocity[3] - 0.5 * before[3],
        1.5 * velocity[4] - 0.5 * before[4],
        1.5 * velocity[5] - 0.5 * before[5],
    )
    x, y, z = cross(s[0], s[1], s[2], w[0], w[1], w[2])
    p, q, r = product(inertia, x - rate[0], y - rate[1], z - rate[2])
    x, y, z = product(inertia, w[0] + s[0], w[1] + s[1], w[2] + s[2])
    x, y, z = cross(w[0], w[1], w[2], x, y, z)
    p, q, r = p - x, q - y, r - z
    x, y, z = product(inertia, w[0], w[1], w[2])
    x, y, z = cross(s[0], s[1], s[2], x, y, z)
    p, q, r = p - x, q - y, r - z
    momentum = rock.momentum
    momentum[0] += time_step * p
    momentum[1] += time_step * q
    momentum[2] += time_step * r
    x, y, z = product(rock.flexibility, p, q, r)
    return math.sqrt(max(0.0, x * p + y * q + z * r))
