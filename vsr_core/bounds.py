"""Outcomes that can be proved without a simulation, or before its end.

The frame is the table's, so the pedestal is at rest and the table's acceleration a(t) acts on the
rock as a body force -a(t) per unit mass. All energies are per unit mass of the rock [m^2/s^2].
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vsr_core import GRAVITY
from vsr_core.hull import TOPPLED_TILT, contact_tilts, convex_hull, rest_tilts, tipping
from vsr_core.scene import Contact, Rock

Array = NDArray[np.float64]

LEANING_TILT = math.radians(30.0)
"""A rest pose tilted less than this still stands, on another part of its base [rad]."""

_TILT_STEP = math.radians(0.5)
_AZIMUTHS = 1440


@dataclass(frozen=True)
class Barrier:
    """Lower bounds of the height of the centre of mass over all poses that touch the pedestal.

    A convex rock whose ``down`` direction is n cannot have its centre lower than
    H(n) = max_v n.v over its vertices v. ``height[i]`` bounds H from below over all azimuths at
    ``tilt[i]``: whoever passes that tilt, sliding, rolling, spinning or bouncing, has at least
    that much potential energy.

    Attributes
    ----------
    tilt : ndarray, shape (n,) [rad], 0 to pi
    height : ndarray, shape (n,) [m]
    toppled_tilt : float [rad]
        Beyond it the rock counts as overturned: 1 rad as in the seed, or three quarters of the
        tilt of its first lying pose if that is less, but not before a squat rock's barrier.
    edge_tilt : float [rad]
        Where the barrier is highest on the way to ``toppled_tilt``.
    edge_height : float [m]
        The barrier there: what the centre must reach to topple.
    upright_floor, floor : float [m]
        Lowest possible height while not beyond ``edge_tilt``, and at all.
    """

    tilt: Array
    height: Array
    toppled_tilt: float
    edge_tilt: float
    edge_height: float
    upright_floor: float
    floor: float

    def to_return(self, tilt: float) -> float:
        """Height [m] that the centre must reach to come back from ``tilt`` to stand."""
        between = (self.tilt >= self.toppled_tilt) & (self.tilt <= tilt)
        return float(self.height[between].max(initial=-math.inf))


def barrier(rock: Rock) -> Barrier:
    """Barrier of a rock with its complete hull.

    H(n) changes by at most the rock's radius per radian, so the least of the sampled azimuths,
    less half a spacing's change, is a bound for all of them. It is exact in tilt: any set of
    tilts bounds a path that has to cross them.
    """
    tilt = np.arange(0.0, math.pi + _TILT_STEP / 2, _TILT_STEP)
    azimuth = np.linspace(0.0, 2.0 * math.pi, _AZIMUTHS, endpoint=False)
    circle = np.column_stack([np.cos(azimuth), np.sin(azimuth)])
    hull = convex_hull(rock.vertices)
    least, greatest = contact_tilts(hull)
    height = np.empty_like(tilt)
    for i, t in enumerate(tilt):
        low = hull.vertices[(least <= t) & (t <= greatest)]
        support = math.sin(t) * circle @ low[:, :2].T - math.cos(t) * low[:, 2]
        height[i] = support.max(axis=1).min()
    height -= rock.radius * np.sin(tilt) * math.pi / _AZIMUTHS
    highest = float(tilt[np.argmax(np.where(tilt <= math.pi / 2, height, -math.inf))])
    rests = rest_tilts(hull)
    lying = rests[rests > LEANING_TILT].min(initial=math.inf)
    toppled = max(min(TOPPLED_TILT, 0.75 * float(lying)), highest)
    floor = float(hull.offsets.min())
    edge = int(np.argmax(np.where(tilt <= toppled, height, -math.inf)))
    upright = np.arccos(np.clip(-hull.normals[:, 2], -1.0, 1.0)) <= tilt[edge]
    upright_floor = min(float(hull.offsets[upright].min()), float(height[edge]))
    edge_tilt, edge_height = float(tilt[edge]), float(height[edge])
    return Barrier(tilt, height, toppled, edge_tilt, edge_height, upright_floor, floor)


def still_range(rock: Rock, contact: Contact, yaw: float) -> tuple[float, float]:
    """Range of table accelerations (lowest, highest) [m/s^2] in which a resting rock stays at rest.

    Theorem: while the resultant of weight and inertia passes through the interior of the base
    and of the friction cone, contact forces exist that hold the rock still, and a rock at rest
    stays so. Assumes a rigid rough pedestal, shaking along x and the rest pose of the hull, turned
    by ``yaw`` [rad]; rolling friction can only help. A positive acceleration tips toward -x.
    """
    hull = convex_hull(rock.vertices)
    toward_plus_x, toward_minus_x = tipping(hull, np.array([-yaw, math.pi - yaw])).uplift
    return (
        -GRAVITY * min(float(toward_plus_x), contact.friction),
        GRAVITY * min(float(toward_minus_x), contact.friction),
    )


def reachable_energy(energy: float, impulse: float) -> float:
    """Most energy above the floor that a rock can have after more shaking.

    Theorem: with e the energy above the lowest possible one, de/dt <= |a| v and v <= sqrt(2 e),
    because contacts with a pedestal at rest never add energy; so sqrt(2 e) grows by at most the
    integral of |a|. Holds with sliding, spinning, bouncing (restitution <= 1) and any direction.

    Parameters
    ----------
    energy : float [m^2/s^2], kinetic and potential above the floor
    impulse : float [m/s], integral of |a| still to come
    """
    return 0.5 * (math.sqrt(2.0 * max(energy, 0.0)) + impulse) ** 2


def cannot_topple(limits: Barrier, tilt: float, energy: float, impulse: float) -> bool:
    """Whether an upright rock at ``tilt`` [rad] can no longer pass ``edge_tilt``, so not topple.

    ``energy`` is kinetic plus g z [m^2/s^2], ``impulse`` as in ``reachable_energy``.
    """
    if tilt > limits.edge_tilt:
        return False
    gap = GRAVITY * (limits.edge_height - limits.upright_floor)
    return reachable_energy(energy - GRAVITY * limits.upright_floor, impulse) < gap


def cannot_return(limits: Barrier, tilt: float, energy: float, impulse: float) -> bool:
    """Whether a rock lying at ``tilt`` [rad] can no longer come back below ``toppled_tilt``."""
    if tilt <= limits.toppled_tilt:
        return False
    gap = GRAVITY * (limits.to_return(tilt) - limits.floor)
    return reachable_energy(energy - GRAVITY * limits.floor, impulse) < gap


def falls_on(lever: Array, spin: Array, inertia: Array, peak: float) -> bool:
    """Whether a rock past ``toppled_tilt`` keeps falling whatever is left of the shaking.

    Theorem: a rock turns about a touching point, its centre beyond that point by the angle gamma
    from the vertical. Shaking of at most ``peak`` tilts gravity by at most beta = atan(peak/g).
    Once gamma >= beta the moment has the sign of the fall, until another point lands. Before
    that, the worst shaking takes g' rho (1 - cos(beta - gamma)) of energy per unit mass on the
    way to gamma = beta, with rho the lever and g' = hypot(g, peak); a rock that turns with more
    gets there. Proved for plane motion without sliding; for spinning and sliding rocks checked
    against complete runs (``make bench``).

    Parameters
    ----------
    lever : ndarray, shape (3,) [m], from the touching vertex to the centre of mass
    spin : ndarray, shape (3,) [rad/s], angular velocity
    inertia : ndarray, shape (3, 3) [m^2], about the centre of mass, per unit mass, same axes
    peak : float [m/s^2], largest acceleration still to come
    """
    x, y, z = (float(part) for part in lever)
    across = math.hypot(x, y)
    if across == 0.0:
        return False
    axis = np.array([-y, x, 0.0]) / across
    turning = float(spin @ axis)
    if turning <= 0.0:
        return False
    gap = math.atan(peak / GRAVITY) - math.atan2(across, z)
    if gap <= 0.0:
        return True
    rho_squared = across * across + z * z
    have = 0.5 * turning**2 * (rho_squared + float(axis @ inertia @ axis))
    return have > math.hypot(GRAVITY, peak) * math.sqrt(rho_squared) * (1.0 - math.cos(gap))
