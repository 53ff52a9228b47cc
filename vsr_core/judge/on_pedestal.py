"""What ends a run on a flat pedestal."""

from __future__ import annotations

import math

import numpy as np

from vsr_core import GRAVITY
from vsr_core.compiled.compiling import compiled
from vsr_core.judge import proofs
from vsr_core.judge.proofs import Barrier
from vsr_core.judge.record import (
    GOES_ON,
    OVERTURNED,
    UNSETTLED,
    UNSTABLE,
    Criteria,
    RunRecord,
    gained_too_much,
    is_finite,
    note,
    note_rest,
    rests,
    side,
)
from vsr_core.outcome import DISPLACED_SHARE, DecidedBy
from vsr_core.rock.body import Rock
from vsr_core.scene import Contact

SIMULATED, ENERGY_BOUND, NO_RETURN = (
    int(rule) for rule in (DecidedBy.SIMULATION, DecidedBy.ENERGY_BOUND, DecidedBy.NO_RETURN)
)

MONITORING_TIME = 0.16
"""Time from one judgement to the next, in units of sqrt(radius / g)."""

PENETRATION_SHARE = 0.01
"""Deepest penetration allowed, as a share of the rock's radius."""

REST_SHARE, REST_OF_BARRIER = 1e-6, 1e-3
"""Kinetic energy of a rock at rest, as a share of g times its radius, and of what it has to climb
to topple: a needle that hesitates on its edge is not at rest."""

REST_TIME = 0.28
"""Time with that little energy that makes a rest, in units of sqrt(radius / g)."""

CREEP_SHARE = 1e-4
"""Longest path of a rock in that time, as a share of its radius: even in the longest wait it would
not creep a sixth of the path that counts as displaced."""

DRIFT_SHARE = 0.01
"""Longest path of a rock that nothing has moved yet, as a share of its radius."""

SLIDING_LEAN = 0.02
"""Largest tilt [rad] of a rock that can only slide: none by Coulomb's law, and up to 0.004 in any
engine that holds to it."""

LEAST_WAIT, WAITING_TIMES = 4.0, 40.0
"""Longest wait after the motion: seconds, as in the published set-up, and units of
sqrt(radius / g), whichever is more."""


def criteria(
    rock: Rock, contact: Contact, limits: Barrier, *, proves: bool, slides: bool, whole: bool
) -> Criteria:
    """What a rock on a flat pedestal is judged by.

    Parameters
    ----------
    slides : bool, whether nothing can tip it
    proves, whole : bool, as in ``Criteria``
    """
    radius, climb = rock.radius, max(limits.edge_height - limits.upright_floor, 0.0)
    # One kind of arrays and numbers, wherever they were read, so that nothing is compiled twice.
    tilt, height, *numbers = limits
    return Criteria(
        Barrier(np.array(tilt), np.array(height), *map(float, numbers)),
        np.array([0.0, 0.0, 1.0]),
        float(contact.friction),
        float(contact.rolling_friction),
        radius,
        rock.height,
        GRAVITY * min(REST_SHARE * radius, REST_OF_BARRIER * climb),
        REST_TIME * math.sqrt(radius / GRAVITY),
        CREEP_SHARE * radius,
        PENETRATION_SHARE * radius,
        DRIFT_SHARE * radius,
        SLIDING_LEAN if slides else math.inf,
        proves,
        whole,
        follow=False,
    )


def monitored(interval: float, radius: float) -> int:
    """Samples from one judgement to the next.

    Parameters
    ----------
    interval : float [s], of a sample
    radius : float [m], of the rock
    """
    return max(1, round(MONITORING_TIME * math.sqrt(radius / GRAVITY) / interval))


def longest_wait(radius: float) -> float:
    """Longest time [s] to go on after the motion.

    Parameters
    ----------
    radius : float [m], of the rock
    """
    return max(LEAST_WAIT, WAITING_TIMES * math.sqrt(radius / GRAVITY))


@compiled
def judge(
    record: RunRecord,
    criteria: Criteria,
    time: float,
    impulse: float,
    remaining: float,
    moved: bool,
    shaken: bool,
) -> tuple[int, int]:
    """Outcome of a run that is decided or shows no sound run, ``GOES_ON`` else; what decided it.

    Parameters
    ----------
    time : float [s]
    impulse, remaining : float [m/s], integral of the table's absolute acceleration so far, and of
        what is still to come
    moved : bool, whether anything can have moved the rock yet
    shaken : bool, whether the motion is still under way
    """
    if not _is_sound(record, criteria, time, impulse, moved):
        return UNSTABLE, SIMULATED
    if not shaken and rests(record, criteria, time):
        return side(record, criteria), SIMULATED
    if not criteria.proves:
        return GOES_ON, SIMULATED
    lies = record.tilt > criteria.limits.toppled_tilt
    if lies and falls_on(record, criteria):
        return OVERTURNED, NO_RETURN
    ends = lies or (not criteria.whole and _slip_is_known(record, criteria, shaken))
    if ends and _proved(record, criteria, remaining):
        return side(record, criteria), ENERGY_BOUND
    return GOES_ON, SIMULATED


@compiled
def out_of_time(record: RunRecord, criteria: Criteria) -> int:
    """Outcome of a run that nothing has ended: its side, if that is proved."""
    return side(record, criteria) if _proved(record, criteria, 0.0) else UNSETTLED


@compiled
def _is_sound(
    record: RunRecord, criteria: Criteria, time: float, impulse: float, moved: bool
) -> bool:
    if not is_finite(record):
        return False
    note(record, criteria)
    note_rest(record, criteria, time)
    if record.position[2] - record.lever[2] < -criteria.penetration:
        return False
    if not moved and max(record.slip, record.tilt * criteria.radius) > criteria.drift:
        return False
    return record.tilt <= criteria.lean and not gained_too_much(record, criteria, impulse)


@compiled
def falls_on(record: RunRecord, criteria: Criteria) -> bool:
    """Whether no contact can stop a rock that falls."""
    return proofs.cannot_be_stopped(
        record.lever, record.spin, record.inertia, criteria.friction, criteria.rolling_friction
    )


@compiled
def _proved(record: RunRecord, criteria: Criteria, remaining: float) -> bool:
    """Whether the side on which the rock is can no longer change, by its energy."""
    limits, tilt, energy = criteria.limits, record.tilt, record.energy
    return proofs.cannot_topple(limits, tilt, energy, remaining) or proofs.cannot_return(
        limits, tilt, energy, remaining
    )


@compiled
def _slip_is_known(record: RunRecord, criteria: Criteria, shaken: bool) -> bool:
    """Whether the rest of the energy can no longer slide an upright rock past the limit.

    Friction takes mu g per unit length of sliding; one and a half times that path is allowed for a
    contact that is unloaded while the rock rocks.
    """
    limit = DISPLACED_SHARE * criteria.radius
    if record.slip > limit:
        return True
    if shaken or criteria.friction == 0.0:
        return False
    spare = record.energy - GRAVITY * criteria.limits.upright_floor
    return record.slip + 1.5 * spare / (criteria.friction * GRAVITY) <= limit
