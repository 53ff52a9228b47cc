"""Sweeps over points of contact: slow ways to their impulses, which need no good start."""

from __future__ import annotations

import math

from vsr_core.compiled.compiling import compiled
from vsr_core.compiled.vectors import assign
from vsr_core.engines.nonsmooth.body import Point, Points, RockState, add_impulse, excess

SLIDING_SWEEPS = 6
"""Turns between normal impulse and friction of a sliding point, each time it is looked at."""


@compiled
def begin(rock: RockState, points: Points) -> None:
    """Take all impulses of active points away."""
    assign(rock.velocity, rock.free)
    for at in range(rock.active):
        points[points[at].active].impulse[:] = 0.0


@compiled
def save(rock: RockState, points: Points) -> None:
    """Remember all impulses of active points."""
    for at in range(rock.active):
        point = points[points[at].active]
        assign(point.saved, point.impulse)


@compiled
def go_back(rock: RockState, points: Points) -> None:
    """Go back to the impulses that were saved, and to the velocity that they lead to."""
    assign(rock.velocity, rock.free)
    for at in range(rock.active):
        point = points[points[at].active]
        assign(point.impulse, point.saved)
        add_impulse(point, 1.0, rock.velocity)


@compiled
def sweep_together(rock: RockState, points: Points, friction: float) -> None:
    """Move all impulses toward those that each point alone would need, by equal shares."""
    number = rock.active
    for at in range(number):
        point = points[points[at].active]
        p, q, r = _alone(rock, point, friction)
        point.trial[0], point.trial[1], point.trial[2] = p, q, r
    share = 1.0 / number
    for at in range(number):
        point = points[points[at].active]
        trial = point.trial
        _change(rock, point, share * trial[0], share * trial[1], share * trial[2])


@compiled
def sweep(rock: RockState, points: Points, friction: float, most: int, tolerance: float) -> bool:
    """Solve one point after another (Gauss & Seidel) until none changes; whether that was reached.

    Parameters
    ----------
    tolerance : float [m/s], change of a velocity at a point by its impulse
    """
    for _ in range(most):
        largest = 0.0
        for at in range(rock.active):
            point = points[points[at].active]
            p, q, r = _alone(rock, point, friction)
            largest = max(largest, abs(p), abs(q), abs(r))
            _change(rock, point, p, q, r)
        if largest <= tolerance:
            return True
    return False


@compiled
def _change(rock: RockState, point: Point, p: float, q: float, r: float) -> None:
    velocity, rows, turning, impulse = rock.velocity, point.rows, point.turning, point.impulse
    for j in range(3):
        velocity[j] += p * rows[0, j] + q * rows[1, j] + r * rows[2, j]
        velocity[3 + j] += p * turning[0, j] + q * turning[1, j] + r * turning[2, j]
    impulse[0] += p
    impulse[1] += q
    impulse[2] += r


@compiled
def _alone(rock: RockState, point: Point, friction: float) -> tuple[float, float, float]:
    """Change of a point's impulse that makes it obey all laws while the others stay."""
    mass = point.mass
    nn, ny, nz, yy, yz, zz = mass[0], mass[1], mass[2], mass[3], mass[4], mass[5]
    p, q, r = point.impulse[0], point.impulse[1], point.impulse[2]
    u = excess(point, 0, rock.velocity) - (nn * p + ny * q + nz * r)
    v = excess(point, 1, rock.velocity) - (ny * p + yy * q + yz * r)
    w = excess(point, 2, rock.velocity) - (nz * p + yz * q + zz * r)
    if u >= 0.0:
        return -p, -q, -r
    a, b, c = yy * zz - yz * yz, nz * yz - ny * zz, ny * yz - nz * yy
    share = -1.0 / (nn * a + ny * b + nz * c)
    new = share * (a * u + b * v + c * w)
    new_y = share * (b * u + (nn * zz - nz * nz) * v + (ny * nz - nn * yz) * w)
    new_z = share * (c * u + (ny * nz - nn * yz) * v + (nn * yy - ny * ny) * w)
    size = math.sqrt(new_y * new_y + new_z * new_z)
    if size <= friction * new:
        return new - p, new_y - q, new_z - r
    new_y, new_z, pace = q, r, 2.0 / (yy + zz)
    for _ in range(SLIDING_SWEEPS):
        new = max(0.0, -(u + ny * new_y + nz * new_z) / nn)
        new_y, new_z = (
            new_y - pace * (v + ny * new + yy * new_y + yz * new_z),
            new_z - pace * (w + nz * new + yz * new_y + zz * new_z),
        )
        size = math.sqrt(new_y * new_y + new_z * new_z)
        if size > friction * new:
            share = friction * new / size
            new_y, new_z = share * new_y, share * new_z
    return new - p, new_y - q, new_z - r
