"""The scene of a run: a rock on a pedestal, their contact, and the state of the rock."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from vsr_core import GRAVITY
from vsr_core.arrays import Array, matrix_product
from vsr_core.rock.body import Rock
from vsr_core.table.servo import Servo
from vsr_core.terrain.surface import Terrain


@dataclass(frozen=True)
class Contact:
    """Effective coefficients of the pair rock-pedestal, whatever an engine makes of them.

    Attributes
    ----------
    friction : float, Coulomb's coefficient
    energetic : bool, whether an impact gives back no more than the square of that of the energy
        that it takes
    rolling_friction : float [m], offset of the contact force that resists rolling
    stiffness, damping : float [N/m, N s/m]
        A spring and a dashpot at each point of contact, as discrete-element codes have them; no
        stiffness is a rigid contact. Along a face there are four points, along an edge two.
    """

    friction: float
    restitution: float = 0.0
    rolling_friction: float = 0.0
    stiffness: float | None = None
    damping: float = 0.0
    energetic: bool = False


@dataclass(frozen=True)
class State:
    """Motion of the rock relative to the table.

    Attributes
    ----------
    position : ndarray, shape (3,) [m], centre of mass; z above the pedestal, or in a site's frame
    rotation : ndarray, shape (3, 3), takes the rest pose at yaw 0 to the present pose
    velocity : ndarray, shape (3,) [m/s], of the centre of mass
    spin : ndarray, shape (3,) [rad/s], angular velocity in the table's axes
    """

    position: Array
    rotation: Array
    velocity: Array
    angular_velocity: Array


@dataclass(frozen=True, eq=False)
class Scene:
    """One rock on its pedestal, turned by ``yaw`` before the table shakes along +x.

    On a terrain, ``yaw`` turns rock and terrain together. All is then told in the site's frame, in
    which they stay as they are and the table shakes along (cos yaw, -sin yaw); its own y is then
    (sin yaw, cos yaw).

    Attributes
    ----------
    yaw : float [rad], counter-clockwise seen from above
    pedestal : "plane", "box", "mesh", "none" or "terrain"
        A half-space, a slab of finite size as the user would draw it, a level surface of triangles,
        nothing to fall on, or the ``terrain``.
    kept_tilt : float [rad]
        Tilt up to which the rock's vertices are complete.
    start : State, where it does not start at rest on the pedestal
    gravity : float [m/s^2]
    terrain : Terrain, where the rock stands on one; it then has a ``start``
    drive : Servo, where one moves the pedestal along x and the rock can push it back
        Without one the motion is prescribed and the scene is seen in the table's own frame.
    """

    rock: Rock
    contact: Contact
    yaw: float = 0.0
    pedestal: Literal["plane", "box", "mesh", "none", "terrain"] = "box"
    kept_tilt: float = float(np.pi)
    start: State | None = None
    gravity: float = GRAVITY
    drive: Servo | None = None
    terrain: Terrain | None = None


def in_site(values: Array, yaw: float) -> Array:
    """Accelerations of the table in a site's frame.

    Parameters
    ----------
    values : ndarray, shape (n,) along the table's +x, or (n, 3) [m/s^2]
    yaw : float [rad]

    Returns
    -------
    ndarray, shape (n, 3) [m/s^2]
    """
    cos, sin = math.cos(yaw), -math.sin(yaw)
    axes = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    given = values.reshape(len(values), -1)
    return matrix_product(given, axes[: given.shape[1]])


def resting(scene: Scene) -> State:
    """State of the rock at rest on the pedestal, turned by the scene's yaw."""
    cos, sin = np.cos(scene.yaw), np.sin(scene.yaw)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return State(np.array([0.0, 0.0, scene.rock.height]), turn, np.zeros(3), np.zeros(3))
