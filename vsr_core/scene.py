"""The scene of a run: a rock on a pedestal, their contact; and what of it can be left out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from vsr_core import GRAVITY
from vsr_core.hull import convex_hull, tipping, touching
from vsr_core.servo import Servo
from vsr_core.terrain import Terrain

Array = NDArray[np.float64]

KEPT_TILT = np.radians(80.0)
"""Vertices that touch only beyond this tilt are left out of a reduced hull [rad]."""

CERTIFIED_WAYS = 72
"""Directions in which a reduced hull must tip as the complete one does."""


@dataclass(frozen=True, eq=False)
class Rock:
    """A rigid rock in its rest pose: origin at the centre of mass, z up, yaw 0.

    Attributes
    ----------
    shape : "box", "hull" or "sphere"
    vertices : ndarray, shape (n, 3) [m], corners of its convex hull; six poles of a sphere
    mass : float [kg]
    inertia : ndarray, shape (3,) [kg m^2], principal moments
    axes : ndarray, shape (3, 3), principal axes as columns, right-handed
    """

    shape: Literal["box", "hull", "sphere"]
    vertices: Array
    mass: float
    inertia: Array
    axes: Array

    @property
    def radius(self) -> float:
        """Largest distance of a vertex from the centre of mass [m]."""
        return float(np.linalg.norm(self.vertices, axis=1).max())

    @property
    def height(self) -> float:
        """Height of the centre of mass above the pedestal at rest [m]."""
        return float(-self.vertices[:, 2].min())


@dataclass(frozen=True)
class Contact:
    """Effective coefficients of the pair rock-pedestal, whatever an engine makes of them.

    Attributes
    ----------
    friction : float, Coulomb's coefficient
    restitution : float, normal coefficient of restitution
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
    spin: Array


@dataclass(frozen=True, eq=False)
class Scene:
    """One rock on its pedestal, turned by ``yaw`` before the table shakes along +x.

    On a terrain, ``yaw`` turns rock and terrain together. All is then told in the site's frame, in
    which they stay as they are and the table shakes along (cos yaw, -sin yaw).

    Attributes
    ----------
    rock : Rock
    contact : Contact
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


@dataclass(frozen=True)
class Reduction:
    """Something left out of a scene, and why the answer stays the same."""

    what: str
    why: str


STANDING_REDUCTIONS = (
    Reduction("trajectory", "only outcomes are wanted"),
    Reduction("settling before the pulse", "the rest pose is known from the hull's geometry"),
)
"""What ``simulate`` itself leaves out when a scene is reduced."""

TABLE_FRAME_REDUCTIONS = (
    Reduction(
        "joint, servo and moving pedestal",
        "the motion is prescribed, so the table's own frame is exact: gravity minus the table's "
        "acceleration",
    ),
    Reduction(
        "runs below the uplift and sliding limits",
        "the resultant stays inside the base and the friction cone: nothing moves",
    ),
    Reduction(
        "the motion before its first push",
        "until it leaves those limits nothing moves, so the run starts there; it passes over rests "
        "in a record as well",
    ),
    Reduction(
        "time after the outcome is certain",
        "energy too small for any way back, or falling past every support",
    ),
)
"""What it leaves out besides where no servo moves the table."""


def reduce(scene: Scene) -> tuple[Scene, tuple[Reduction, ...]]:
    """The least scene with the same outcome, and what was left out.

    Parameters
    ----------
    scene : Scene
        As the user described it.

    Returns
    -------
    scene : Scene
    reductions : tuple of Reduction
    """
    dropped = [*STANDING_REDUCTIONS]
    reduced = scene
    if scene.drive is None:
        dropped = [*TABLE_FRAME_REDUCTIONS, *dropped]
    if scene.drive is None and scene.rock.shape == "hull" and scene.contact.restitution == 0.0:
        # On a plane Bullet finds one corner of a landing edge at a time, on a slab both. With a
        # box that shifts the boundary of short pulses by 3-5 %, and no face rebounds as it should.
        reduced = replace(reduced, pedestal="plane")
        dropped.insert(
            0, Reduction("pedestal slab", "a flat pedestal is a plane; its edges are out of reach")
        )
    if scene.rock.shape == "hull":
        rock = simplified(scene.rock)
        left_out = len(scene.rock.vertices) - len(rock.vertices)
        if left_out:
            reduced = replace(reduced, rock=rock, kept_tilt=float(KEPT_TILT))
            dropped.append(
                Reduction(
                    f"{left_out} of {len(scene.rock.vertices)} hull vertices",
                    f"they cannot touch below {np.degrees(KEPT_TILT):.0f} deg of tilt, and it tips "
                    "as before without them; a run that tilts further is repeated with all",
                )
            )
    return reduced, tuple(dropped)


def resting(scene: Scene) -> State:
    """State of the rock at rest on the pedestal, turned by the scene's yaw."""
    cos, sin = np.cos(scene.yaw), np.sin(scene.yaw)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return State(np.array([0.0, 0.0, scene.rock.height]), turn, np.zeros(3), np.zeros(3))


@lru_cache(maxsize=8)
def simplified(rock: Rock) -> Rock:
    """The rock with those vertices of its hull that can touch below ``KEPT_TILT``.

    Certified: static uplift and tipping in ``CERTIFIED_WAYS`` directions are those of the complete
    hull, or the rock is returned as it is.
    """
    hull = convex_hull(rock.vertices)
    keep = touching(hull, KEPT_TILT)
    # Engines size their contact tolerances by the bounding box in the principal frame.
    along = hull.vertices @ rock.axes
    keep[[*along.argmin(axis=0), *along.argmax(axis=0)]] = True
    kept = hull.vertices[keep]
    ways = np.linspace(0.0, 2.0 * np.pi, CERTIFIED_WAYS, endpoint=False)
    before, after = tipping(hull, ways), tipping(convex_hull(kept), ways)
    same = np.allclose(after.overturning, before.overturning, rtol=1e-9, atol=0.0) and np.allclose(
        after.uplift, before.uplift, rtol=1e-9, atol=0.0
    )
    return replace(rock, vertices=kept) if same else rock
