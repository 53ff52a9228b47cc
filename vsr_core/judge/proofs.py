"""Outcomes that can be proved without a simulation, or before its end.

The frame is the table's, so the pedestal is at rest and the table's acceleration a(t) acts on the
rock as a body force -a(t) per unit mass. All energies are per unit mass of the rock [m^2/s^2].

Every theorem here assumes

- a rigid rock on a rigid, flat and level pedestal, wide enough to be a half-space;
- a table in pure translation, along x where nothing else is said, and standard gravity;
- contact forces and impulses that push (N >= 0), stay inside Coulomb's cone, and neither add energy
  nor keep it in springs. So it is for sticking, sliding, rolling, spinning, and for impacts whose
  restitution, at most 1, is one of impulse or of energy; Newton's ratio of speeds can add energy
  where an impact meets friction (Stronge 1990);

and what its docstring adds. An engine obeys them up to its errors only: see ``simulate`` for the
guards, and ``tests/test_proofs_hunt.py`` for the hunt after counterexamples. ``static_limits`` and
all that take an ``impulse`` need a(t) in advance. A servo adds to it what the rock's push and its
own error make, also after the motion has ended, so that they must not be used there.

References
----------
Stronge, W. J. (1990). Rigid body collisions with friction. Proc. R. Soc. Lond. A 431, 169-181.
Pang, J.-S. & Trinkle, J. C. (2000). Stability characterizations of rigid body contact problems with
Coulomb friction. Z. Angew. Math. Mech. 80(10), 643-663.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from vsr_core import GRAVITY
from vsr_core.arrays import Array, matrix_product
from vsr_core.compiled.compiling import compiled
from vsr_core.rock.body import Hull, Rock, contact_tilts
from vsr_core.rock.tipping import TOPPLED_TILT, rest_tilts, tipping
from vsr_core.scene import Contact

LEANING_TILT = math.radians(30.0)
"""A rest pose tilted less than this still stands, on another part of its base [rad]."""

SLIDING_SHARE = 0.85
"""Friction, as a share of the least uplift acceleration [g], up to which a rock is held to slide
only. Bullet's pyramid of friction tips a few from 0.9 on."""

_SLIDING_DIRECTIONS = 72
_TILT_STEP = math.radians(0.5)
_AZIMUTHS = 1440


class Barrier(NamedTuple):
    """Lower bounds of the height of the centre of mass over all poses that touch the pedestal.

    Theorem: a rock whose ``down`` direction is n has its centre at H(n) = max_v n.v over its
    vertices v, or higher. ``height[i]`` bounds H from below over all azimuths at ``tilt[i]``:
    whoever passes that tilt, sliding, rolling, spinning or bouncing, has at least that much
    potential energy. Tilt is continuous in time, so a way from one tilt to another passes all
    between them, and needs the highest of their bounds.

    Proof: no vertex is below the pedestal, and vertex v is n.v below the centre.

    Attributes
    ----------
    tilt : ndarray, shape (n,) [rad], 0 to pi
    height : ndarray, shape (n,) [m]
    toppled_tilt : float [rad]
        Beyond it the rock counts as overturned: 1 rad as in the published set-up, or three
        quarters of the tilt of its first lying pose if that is less, but not before a squat rock's
        barrier.
    edge_tilt : float [rad]
        Where the barrier is highest on the way to ``toppled_tilt``.
    edge_height : float [m]
        The barrier there: what the centre must reach to topple.
    upright_floor, floor : float [m]
        Lowest possible height while not beyond ``edge_tilt``, and at all. Along an arc of
        directions on which one vertex touches, n.v is concave; so H has its minima over a cap of
        directions at facet normals, or on the cap's rim, where ``height`` bounds it.
    """

    tilt: Array
    height: Array
    toppled_tilt: float
    edge_tilt: float
    edge_height: float
    upright_floor: float
    floor: float


@compiled
def height_to_return(limits: Barrier, tilt: float) -> float:
    """Height that the centre must reach to come back to stand.

    Parameters
    ----------
    tilt : float [rad], from which to come back

    Returns
    -------
    float [m]; minus infinity from a tilt at which it has not toppled
    """
    highest = -math.inf
    for i in range(len(limits.tilt)):
        if limits.toppled_tilt <= limits.tilt[i] <= tilt:
            highest = max(highest, limits.height[i])
    return highest


def barrier(rock: Rock) -> Barrier:
    """Barrier of a rock with its complete hull.

    At tilt t, H changes by at most radius * sin(t) per radian of azimuth, so the least of the
    sampled azimuths, less half a spacing's change, is a bound for all of them. Nothing is lost by
    the sampling in tilt: any set of tilts bounds a path that has to cross them. Leaving out
    vertices that do not touch at a tilt only lowers its bound.
    """
    tilt = np.arange(0.0, math.pi + _TILT_STEP / 2, _TILT_STEP)
    azimuth = np.linspace(0.0, 2.0 * math.pi, _AZIMUTHS, endpoint=False)
    circle = np.column_stack([np.cos(azimuth), np.sin(azimuth)])
    hull = rock.hull
    least, greatest = contact_tilts(hull)
    height = np.empty_like(tilt)
    for i, t in enumerate(tilt):
        low = hull.vertices[(least <= t) & (t <= greatest)]
        across = np.ascontiguousarray(low[:, :2].T)  # five times as fast
        support = math.sin(t) * matrix_product(circle, across) - math.cos(t) * low[:, 2]
        height[i] = support.max(axis=1).min()
    height -= rock.radius * np.sin(tilt) * math.pi / _AZIMUTHS
    highest = float(tilt[np.argmax(np.where(tilt <= math.pi / 2, height, -math.inf))])
    rests = rest_tilts(hull)
    lying = rests[rests > LEANING_TILT].min(initial=math.inf)
    toppled = max(min(TOPPLED_TILT, 0.75 * float(lying)), highest)
    floor = float(hull.offsets.min())
    edge = int(np.argmax(np.where(tilt <= toppled, height, -math.inf)))
    upright = np.arccos(np.clip(-hull.normals[:, 2], -1.0, 1.0)) <= tilt[edge]
    upright_floor = min(float(hull.offsets[upright].min(initial=math.inf)), float(height[edge]))
    edge_tilt, edge_height = float(tilt[edge]), float(height[edge])
    return Barrier(tilt, height, toppled, edge_tilt, edge_height, upright_floor, floor)


def only_slides(rock: Rock, contact: Contact) -> bool:
    """Whether a rock shaken level from rest slides and never tips, whichever way it has turned.

    Friction on the base is at most mu times the normal force. It meets the line of both through
    the centre of mass within the base where mu is less than the least uplift acceleration [g].
    """
    if rock.shape == "sphere":
        return False
    return contact.friction < SLIDING_SHARE * _least_uplift(rock.hull)


@lru_cache(maxsize=16)
def _least_uplift(hull: Hull) -> float:
    """Least uplift acceleration of all directions [g], once for all yaws of a rock."""
    around = np.linspace(0.0, 2.0 * np.pi, _SLIDING_DIRECTIONS, endpoint=False)
    return float(tipping(hull, around).uplift.min())


def static_limits(rock: Rock, contact: Contact, yaw: float) -> tuple[float, float]:
    """Range of table accelerations (lowest, highest) [m/s^2] in which a resting rock stays at rest.

    Theorem: the rock rests on its lowest face, and shaking along x presses it with (-a, 0, -g) at
    its centre of mass. Forces at the corners of that face which hold it still, each in its own
    friction cone, exist if and only if |a| <= mu g and the line of (-a, 0, -g) through the centre
    meets the pedestal at a point p of the face. The range is where both are so.

    Proof: p is a mean of the corners r_i with weights w_i >= 0 of sum 1. The forces w_i (a, 0, g)
    add up to (a, 0, g), are in the cone if |a| <= mu g, and their moment about the centre,
    p x (a, 0, g), is zero about all three axes because p is parallel to the force: however far p is
    from the foot of the centre, nothing is left to twist the rock. Conversely, the normal forces
    of any others add up to g, so their friction to mu g at most, and their moment needs the
    centre of pressure at p.

    So rest obeys all laws. No other motion from rest does that starts without turning about the
    vertical, as in a plane: then all touching points start to slide by the same acceleration s;
    N >= g, because the centre is above the face and no part of it sinks; and with the rise n >= 0
    of p, twice the kinetic energy grows as t^2 times -a s_x - mu N |s| - g n <= 0. For turning
    without lifting mu hypot(I_xz, I_yz) < I_zz is enough (moments about the centre, z vertical).
    Leaning bodies beyond that can have a second solution, in which they start to turn by themselves
    ("weak" stability, Pang & Trinkle 2000). Of six million random bodies that might pivot about one
    corner, none below it could.

    Assumes besides a start at rest in the hull's rest pose, turned by ``yaw`` [rad]. Restitution
    has no part in it, and rolling friction can only widen the range. A positive acceleration tips
    toward -x.

    Parameters
    ----------
    yaw : float [rad], by which the rock is turned

    Returns
    -------
    (float, float)
        Lowest and highest [m/s^2]: not above and not below 0.
    """
    toward_plus_x, toward_minus_x = tipping(rock.hull, np.array([-yaw, math.pi - yaw])).uplift
    return (
        -GRAVITY * min(float(toward_plus_x), contact.friction),
        GRAVITY * min(float(toward_minus_x), contact.friction),
    )


@compiled
def reachable_energy(energy: float, impulse: float) -> float:
    """Most energy above the floor that a rock can have after more shaking.

    Theorem: let e be the energy, kinetic and potential, above the lowest possible potential one.
    Then sqrt(2 e) grows by at most the integral of |a|, whatever the rock does: slides, spins,
    rolls, bounces, flies.

    Proof: contacts with a pedestal at rest take energy or leave it, so de/dt <= -a.v <= |a| |v|
    with v the velocity of the centre of mass; |v| <= sqrt(2 e), because the kinetic energy of
    turning and the potential energy above its lowest are not negative; and impacts lower e at
    once. Hence d sqrt(2 e)/dt <= |a|. No better bound holds for all rocks: pushes at the lowest
    point of a rock that only moves there, and does not turn, reach it.

    Assumes a(t) prescribed. It may be any vector, also a vertical one: the proof asks nothing of
    its direction. ``impulse`` is that of its length.

    Parameters
    ----------
    energy : float [m^2/s^2], kinetic and potential above the floor
    impulse : float [m/s], integral of |a| still to come

    Returns
    -------
    float [m^2/s^2]

    Examples
    --------
    Without shaking it is what there is:

    >>> reachable_energy(8.0, 0.0), reachable_energy(8.0, 2.0)
    (8.0, 18.0)
    """
    return 0.5 * (math.sqrt(2.0 * max(energy, 0.0)) + impulse) ** 2


@compiled
def cannot_topple(limits: Barrier, tilt: float, energy: float, impulse: float) -> bool:
    """Whether an upright rock at ``tilt`` [rad] can no longer pass ``edge_tilt``, so not topple.

    Theorem: if true, the tilt stays at ``edge_tilt`` or below for ever. Proof: until it first
    passes there, ``upright_floor`` is the lowest possible height, so that ``reachable_energy``
    bounds the energy above it; and passing takes at least ``edge_height``. It says nothing about
    sliding: the rock may still be displaced.

    ``energy`` is kinetic plus g z [m^2/s^2], ``impulse`` as in ``reachable_energy``, with its
    assumptions: a servo's table is not at rest after the motion, and no bound for it.

    Parameters
    ----------
    tilt : float [rad], now
    energy : float [m^2/s^2], kinetic plus g z, per unit mass
    impulse : float [m/s], integral of |a| still to come
    """
    if tilt > limits.edge_tilt:
        return False
    gap = GRAVITY * (limits.edge_height - limits.upright_floor)
    return reachable_energy(energy - GRAVITY * limits.upright_floor, impulse) < gap


@compiled
def cannot_return(limits: Barrier, tilt: float, energy: float, impulse: float) -> bool:
    """Whether a rock lying at ``tilt`` [rad] can no longer come back below ``toppled_tilt``.

    Theorem: if true, the tilt stays above ``toppled_tilt`` for ever. Proof: as of
    ``cannot_topple``, with the highest bound on the way back and the lowest height of all.

    Parameters
    ----------
    tilt : float [rad], now
    energy : float [m^2/s^2], kinetic plus g z, per unit mass
    impulse : float [m/s], integral of |a| still to come
    """
    if tilt <= limits.toppled_tilt:
        return False
    gap = GRAVITY * (height_to_return(limits, tilt) - limits.floor)
    return reachable_energy(energy - GRAVITY * limits.floor, impulse) < gap


@compiled
def cannot_be_stopped(
    lever: Array, angular_velocity: Array, inertia: Array, friction: float, rolling_friction: float
) -> bool:
    """Whether no shaking can stop the fall of a rock, because friction has no hold on it.

    Theorem: let f be a fixed horizontal axis, and every point that touches lie behind the centre
    of mass, toward the side that a turn about f comes from, by at least mu times its depth below
    the centre, plus the length of rolling friction. Then the angular momentum about f through the
    centre never decreases, whatever the table does, and also while the rock slides, bounces or
    flies. In plane motion about f the rock therefore goes on turning at its present rate or faster
    until another point comes down, from where the same holds if that point is as far behind.

    Proof: weight and inertia act in the centre and have no moment about it. A contact force in the
    cone, at (-q, -z) from the centre, has the moment N q - T z >= N (q - mu z) about f, less N
    times the length of rolling friction: not negative. The same for an impulse. While a point
    stays the lowest, q grows and z shrinks as the rock turns, in contact or in the air.

    Nothing is assumed of the motion, which may be a servo's. The conclusion on the turning is for
    plane motion; a rock that also spins is checked against complete runs (``make test-slow``).
    That it "falls" means that it comes down on another part: it counts as overturned then, as a
    block of Housner's does at 90 deg, whatever shaking might do to it afterwards.

    Parameters
    ----------
    lever : ndarray, shape (3,) [m], from the lowest vertex to the centre of mass
    angular_velocity : ndarray, shape (3,) [rad/s]; f is along its horizontal part
    inertia : ndarray, shape (3, 3) [m^2], about the centre of mass, per unit mass, same axes
    rolling_friction : float [m]
    """
    x, y = angular_velocity[0], angular_velocity[1]
    turning = math.sqrt(x * x + y * y)
    if turning == 0.0:
        return False
    behind = (lever[0] * y - lever[1] * x) / turning
    reach = friction * lever[2] + rolling_friction
    about_axis = 0.0
    for k in range(3):
        about_axis += (x * inertia[0, k] + y * inertia[1, k]) * angular_velocity[k]
    return behind >= max(reach, 0.0) and about_axis > 0.0
