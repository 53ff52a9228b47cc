"""A rock on a table that turns, seen in the table's own frame, in Bullet's units.

In a frame that turns at w with the rate w', whose origin accelerates by a, a body at r that moves
at v and spins at s relative to it feels, per unit mass, in its centre

    -a - w' x r - w x (w x r) - 2 w x v

and, with its inertia I and in its own axes, the moment

    -I (w' - s x w) - (w + s) x I (w + s) + s x I s,

the rate of change of the absolute angular momentum I (w + s), less that of I s, which the engine
makes itself. Both are exact for a rigid body. Bullet holds them for a step; v and s in them are
carried on to its middle from the step before.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from vsr_core.engines.bullet.binding import pybullet

Vector = tuple[float, float, float]

Moving = tuple[Vector, Vector]
"""Velocity, and angular velocity."""


def turn(
    client: int,
    rock: int,
    inertia: Sequence[float],
    samples: Iterable[Sequence[float]],
    step: float,
    weight: float,
    before: Moving | None,
) -> tuple[float, Moving | None]:
    """Step through samples of a table that turns.

    Parameters
    ----------
    inertia : three principal moments of inertia per unit mass, in the body's axes
    step, weight : length of a step and gravity
        All in Bullet's units.
    before : velocities at the start of the step before these; None where it was set there

    Returns
    -------
    float
        Upper bound of how much sqrt(2 e) grew by it, where e is the rock's energy per unit mass
        relative to the table: the integral of the length of the force, without Coriolis's, which
        does no work, and of that of the moment, each in the metric of the kinetic energy.
    velocities at the start of the last step
    """
    mass = pybullet.getDynamicsInfo(rock, -1, client)[0]
    given = 0.0
    for ax, ay, az, *rest in samples:
        omega, rate = _vector(rest[:3]), _vector(rest[3:])
        place, quaternion = pybullet.getBasePositionAndOrientation(rock, client)
        now = pybullet.getBaseVelocity(rock, client)
        (v, s), before = _carried_on(now, before), now
        r = _sum(place, v, 0.5 * step)
        carried = _sum(_cross(rate, r), _cross(omega, _cross(omega, r)))
        coriolis = _cross(omega, v)
        x, y, z = (-ax - carried[0], -ay - carried[1], -az - carried[2])
        pybullet.setGravity(
            x - 2.0 * coriolis[0], y - 2.0 * coriolis[1], z - 2.0 * coriolis[2] - weight, client
        )
        given += step * math.sqrt(x * x + y * y + z * z)
        axes = pybullet.getMatrixFromQuaternion(quaternion)
        moment = _moment(inertia, *(_in_body(axes, part) for part in (omega, rate, s)))
        given += step * math.sqrt(sum(m * m / i for m, i in zip(moment, inertia, strict=True)))
        torque = [mass * part for part in _in_table(axes, moment)]
        pybullet.applyExternalTorque(rock, -1, torque, pybullet.WORLD_FRAME, client)
        pybullet.stepSimulation(client)
    return given, before


def _moment(inertia: Sequence[float], omega: Vector, rate: Vector, spin: Vector) -> Vector:
    """The moment per unit mass, all in the body's axes."""
    a, b, c = inertia
    changed = _sum(rate, _cross(spin, omega), -1.0)
    total = _sum(omega, spin)
    whole = _cross(total, (a * total[0], b * total[1], c * total[2]))
    own = _cross(spin, (a * spin[0], b * spin[1], c * spin[2]))
    return (
        own[0] - whole[0] - a * changed[0],
        own[1] - whole[1] - b * changed[1],
        own[2] - whole[2] - c * changed[2],
    )


def _carried_on(now: Moving, before: Moving | None) -> Moving:
    """Velocity and angular velocity half a step on."""
    if before is None:
        return now
    (v, s), (v0, s0) = now, before
    return _sum(v, _sum(v, v0, -1.0), 0.5), _sum(s, _sum(s, s0, -1.0), 0.5)


def _sum(a: Vector, b: Vector, factor: float = 1.0) -> Vector:
    return (a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2])


def _cross(a: Vector, b: Vector) -> Vector:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _in_body(m: Sequence[float], v: Vector) -> Vector:
    return (
        m[0] * v[0] + m[3] * v[1] + m[6] * v[2],
        m[1] * v[0] + m[4] * v[1] + m[7] * v[2],
        m[2] * v[0] + m[5] * v[1] + m[8] * v[2],
    )


def _in_table(m: Sequence[float], v: Vector) -> Vector:
    return (
        m[0] * v[0] + m[1] * v[1] + m[2] * v[2],
        m[3] * v[0] + m[4] * v[1] + m[5] * v[2],
        m[6] * v[0] + m[7] * v[1] + m[8] * v[2],
    )


def _vector(values: Sequence[float]) -> Vector:
    x, y, z = values
    return (x, y, z)
