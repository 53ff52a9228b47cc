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
from vsr_core.hull import TOPPLED_TILT, convex_hull, tipping
from vsr_core.scene import Contact, Rock

Array = NDArray[np.float64]

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
        Beyond it the rock counts as overturned: 1 rad, or the highest barrier of a squat rock.
    upright_floor, floor : float [m]
        Lowest possible height while not beyond ``toppled_tilt``, and at all.
    """

    tilt: Array
    height: Array
    toppled_tilt: float
    upright_floor: float
    floor: float

    def to_topple(self, tilt: float) -> float:
        """Height [m] that the centre must reach to go from ``tilt`` beyond ``toppled_tilt``."""
        between = (self.tilt >= tilt) & (self.tilt <= self.toppled_tilt)
        return float(self.height[between].max(initial=-math.inf))

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
    around = np.column_stack([np.cos(azimuth), np.sin(azimuth)]) @ rock.vertices[:, :2].T
    height = np.array([_lowest(math.sin(t) * around, -math.cos(t) * rock.vertices[:, 2]) for t in tilt])
    height -= rock.radius * np.sin(tilt) * math.pi / _AZIMUTHS
    highest = float(tilt[np.argmax(np.where(tilt <= math.pi / 2, height, -math.inf))])
    toppled = max(TOPPLED_TILT, highest)
    hull = convex_hull(rock.vertices)
    floor = float(hull.offsets.min())
    upright = np.arccos(np.clip(-hull.normals[:, 2], -1.0, 1.0)) <= toppled
    upright_floor = min(float(hull.offsets[upright].min()), float(height[tilt >= toppled][0]))
    return Barrier(tilt, height, toppled, upright_floor, floor)


def _lowest(horizontal: Array, vertical: Array) -> float:
    return float((horizontal + vertical).max(axis=1).min())


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
    """Whether an upright rock at ``tilt`` [rad] can no longer pass ``toppled_tilt``.

    ``energy`` is kinetic plus g z [m^2/s^2], ``impulse`` as in ``reachable_energy``.
    """
    if tilt >= limits.toppled_tilt:
        return False
    gap = GRAVITY * (limits.to_topple(tilt) - limits.upright_floor)
    return reachable_energy(energy - GRAVITY * limits.upright_floor, impulse) < gap


def cannot_return(limits: Barrier, tilt: float, energy: float, impulse: float) -> bool:
    """Whether a rock lying at ``tilt`` [rad] can no longer come back below ``toppled_tilt``."""
    if tilt <= limits.toppled_tilt:
        return False
    gap = GRAVITY * (limits.to_return(tilt) - limits.floor)
    return reachable_energy(energy - GRAVITY * limits.floor, impulse) < gap


def falls_on(lever: Array, falling: Array, peak: float) -> bool:
    """Whether a rock past ``toppled_tilt`` keeps falling whatever is left of the shaking.

    While it turns about a touching point, with the centre beyond that point by more than the
    angle atan(peak/g) that the shaking can tilt gravity by, the moment about the point has the
    sign of the fall until another point lands. Proved for the plane motion of a rock that does
    not slide; for spinning and sliding rocks checked against complete runs.

    Parameters
    ----------
    lever : ndarray, shape (3,) [m], from the touching vertex to the centre of mass
    falling : ndarray, shape (3,) [m/s], velocity of the centre relative to that vertex
    peak : float [m/s^2], largest acceleration still to come
    """
    across = math.hypot(lever[0], lever[1])
    if falling[2] >= 0.0 or lever[0] * falling[0] + lever[1] * falling[1] <= 0.0:
        return False
    return across * GRAVITY > peak * lever[2]
