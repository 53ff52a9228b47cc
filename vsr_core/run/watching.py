"""The rules of a run on a flat pedestal in compiled code: what is watched, and what ends it.

They are those of ``OverturningRules``, for a table in pure translation and an engine
that steps in compiled code too.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.engines.nonsmooth.compiling import compiled
from vsr_core.engines.nonsmooth.vectors import assign, assign_matrix
from vsr_core.outcome import DISPLACED_SHARE, DecidedBy, Outcome
from vsr_core.run import proofs
from vsr_core.run.guards import gained_too_much
from vsr_core.run.proofs import Barrier

BALANCED, OVERTURNED = int(Outcome.BALANCED), int(Outcome.OVERTURNED)
DISPLACED, UNSETTLED, UNSTABLE = (
    int(outcome) for outcome in (Outcome.DISPLACED, Outcome.UNSETTLED, Outcome.UNSTABLE)
)
SIMULATED, ENERGY_BOUND, NO_RETURN = (
    int(rule) for rule in (DecidedBy.SIMULATION, DecidedBy.ENERGY_BOUND, DecidedBy.NO_RETURN)
)
"""Outcomes and rules as compiled code knows them."""

GOES_ON = -1
"""In the place of an outcome: the run is not decided."""


class Rule(NamedTuple):
    """What a run is judged by.

    Attributes
    ----------
    axes : ndarray, shape (3, 3), principal axes of the rock in its rest pose, as columns
    radius : float [m]
    foot : float [m], height of the centre of mass above the base at rest
    rest_energy : float [m^2/s^2], kinetic energy of a rock at rest, per unit mass, at most
    rest_time : float [s], for which it has to keep to that
    creep : float [m], longest path in that time
    penetration, drift : float [m], deepest allowed, and longest path before anything moves the rock
    """

    limits: Barrier
    axes: Array
    friction: float
    rolling_friction: float
    radius: float
    foot: float
    rest_energy: float
    rest_time: float
    creep: float
    penetration: float
    drift: float
    proves: bool


WATCH = np.dtype(
    [
        ("place", float, 3),  # m, of the centre of mass, and
        ("rotation", float, (3, 3)),  # from the rest pose at yaw 0, when last looked at
        ("quaternion", float, 4),  # w x y z, from principal axes, then
        ("velocity", float, 6),  # m/s and rad/s
        ("inertia", float, (3, 3)),  # m^2, in the table's axes, per unit mass
        ("lever", float, 3),  # m, from the lowest corner to the centre of mass
        ("start", float, 3),  # m, centre of mass at the start
        ("start_foot", float, 2),  # m, centre of the base at the start, x and y
        ("kinetic", float),  # m^2/s^2
        ("energy", float),  # m^2/s^2, kinetic plus g z
        ("tilt", float),  # rad
        ("peak_tilt", float),  # rad
        ("slip", float),  # m, largest so far
        ("rest_since", float),  # s, less than 0 while it moves
        ("rest_place", float, 3),  # m, where it has rested since then
        ("rest_rotation", float, (3, 3)),
        ("change", float, 3),  # m/s, of the velocity by weight and shaking since the last look
        ("middle", float, 3),  # m, centre of mass in the middle of the wait for rest
    ]
)
"""What is known of a run when it is looked at."""

Watch = Any
"""A record of ``WATCH``."""


@compiled
def sound(watch: Watch, rule: Rule, time: float, impulse: float, moved: bool) -> bool:
    """Take note of tilt, slip, energy and rest; false if a guard fails.

    Parameters
    ----------
    watch : record of ``WATCH``, with place, rotation, velocity, inertia and lowest corner of now
    time : float [s]
    impulse : float [m/s], integral of the table's absolute acceleration so far
    moved : bool, whether anything can have moved the rock yet
    """
    place, velocity = watch.place, watch.velocity
    total = 0.0
    for k in range(3):
        total += place[k] + velocity[k] + velocity[3 + k] + watch.rotation[2, k]
    if not math.isfinite(total):
        return False
    note_energy(watch)
    watch.tilt = math.acos(max(-1.0, min(1.0, watch.rotation[2, 2])))
    watch.peak_tilt = max(watch.peak_tilt, watch.tilt)
    note_slip(watch, rule)
    note_rest(watch, rule, time)
    if place[2] - watch.lever[2] < -rule.penetration:
        return False
    if not moved and max(watch.slip, watch.tilt * rule.radius) > rule.drift:
        return False
    floor = rule.limits.floor
    return not gained_too_much(watch.energy, watch.start[2], floor, impulse, rule.radius)


@compiled
def note_energy(watch: Watch) -> None:
    """Kinetic energy, and that plus g z, per unit mass."""
    velocity, inertia = watch.velocity, watch.inertia
    kinetic = 0.0
    for k in range(3):
        turning = 0.0
        for j in range(3):
            turning += inertia[k, j] * velocity[3 + j]
        kinetic += velocity[k] * velocity[k] + velocity[3 + k] * turning
    watch.kinetic = 0.5 * kinetic
    watch.energy = watch.kinetic + GRAVITY * watch.place[2]


@compiled
def note_slip(watch: Watch, rule: Rule) -> None:
    """Largest horizontal displacement of the base's centre so far."""
    x = watch.place[0] - rule.foot * watch.rotation[0, 2] - watch.start_foot[0]
    y = watch.place[1] - rule.foot * watch.rotation[1, 2] - watch.start_foot[1]
    watch.slip = max(watch.slip, math.sqrt(x * x + y * y))


@compiled
def decided(
    watch: Watch, rule: Rule, time: float, remaining: float, shaken: bool
) -> tuple[int, int]:
    """Outcome of a run that is decided, ``GOES_ON`` else; and what decided it.

    Parameters
    ----------
    time : float [s]
    remaining : float [m/s], integral of the table's absolute acceleration still to come
    shaken : bool, whether the motion is still under way

    Returns
    -------
    (int, int)
    """
    if not shaken and rests(watch, rule, time):
        return side(watch, rule), SIMULATED
    if not rule.proves:
        return GOES_ON, SIMULATED
    lies = watch.tilt > rule.limits.toppled_tilt
    if lies and proofs.cannot_be_stopped(
        watch.lever, watch.velocity[3:], watch.inertia, rule.friction, rule.rolling_friction
    ):
        return OVERTURNED, NO_RETURN
    if (lies or _slip_is_known(watch, rule, shaken)) and proved(watch, rule, remaining):
        return side(watch, rule), ENERGY_BOUND
    return GOES_ON, SIMULATED


@compiled
def proved(watch: Watch, rule: Rule, remaining: float) -> bool:
    """Whether the side on which the rock is can no longer change, by its energy.

    Parameters
    ----------
    remaining : float [m/s], integral of the table's absolute acceleration still to come
    """
    return proofs.cannot_topple(
        rule.limits, watch.tilt, watch.energy, remaining
    ) or proofs.cannot_return(rule.limits, watch.tilt, watch.energy, remaining)


@compiled
def side(watch: Watch, rule: Rule) -> int:
    """Outcome by where the rock is now."""
    if watch.tilt > rule.limits.toppled_tilt:
        return OVERTURNED
    return DISPLACED if watch.slip > DISPLACED_SHARE * rule.radius else BALANCED


@compiled
def _slip_is_known(watch: Watch, rule: Rule, shaken: bool) -> bool:
    """Whether the rest of the energy can no longer slide an upright rock past the limit.

    Friction takes mu g per unit length of sliding; one and a half times that path is allowed for a
    contact that is unloaded while the rock rocks.
    """
    limit = DISPLACED_SHARE * rule.radius
    if watch.slip > limit:
        return True
    if shaken or rule.friction == 0.0:
        return False
    spare = watch.energy - GRAVITY * rule.limits.upright_floor
    return watch.slip + 1.5 * spare / (rule.friction * GRAVITY) <= limit


@compiled
def note_rest(watch: Watch, rule: Rule, time: float) -> None:
    """Since when the rock has hardly any energy, and where.

    Parameters
    ----------
    time : float [s]
    """
    if not watch.kinetic < rule.rest_energy:
        watch.rest_since = -1.0
    elif watch.rest_since < 0.0:
        _rest_from(watch, time)


@compiled
def _rest_from(watch: Watch, time: float) -> None:
    watch.rest_since = time
    assign(watch.rest_place, watch.place)
    assign_matrix(watch.rest_rotation, watch.rotation)


@compiled
def rests(watch: Watch, rule: Rule, time: float) -> bool:
    """Whether it has stood still for a while; it is watched anew if it creeps.

    Parameters
    ----------
    time : float [s]
    """
    if watch.rest_since < 0.0 or time - watch.rest_since < rule.rest_time:
        return False
    path = turn = 0.0
    for k in range(3):
        path += (watch.place[k] - watch.rest_place[k]) ** 2
        for j in range(3):
            turn += (watch.rotation[k, j] - watch.rest_rotation[k, j]) ** 2
    _rest_from(watch, time)
    return math.sqrt(path) + math.sqrt(0.5 * turn) * rule.radius <= rule.creep


def watch() -> Watch:
    """Room for what is watched of a run: a record of ``WATCH``."""
    return np.zeros(1, WATCH)[0]
