"""One impact of a block or a sphere on a slope, against rigid-body impact theory.

The point that touches leaves with e times the normal speed at which it came (Newton). Its impulse
lies in the cone of friction: if what keeps the point from sliding does, the point sticks, else it
slides and the impulse is on the cone, against the slip that is left. An edge acts in its middle. A
face that comes down flat cannot turn: its impulse acts wherever that needs it. Weightless, so that
nothing else acts.

References
----------
Kane & Levinson (1985), Dynamics: Theory and Applications, 4.12; Brach (1989), J. Appl. Mech. 56(1),
133-138, for the plane; Stronge (2000), Impact Mechanics, ch. 3 and 4, where this law gains energy.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from vsr_core.arrays import Array
from vsr_core.rock.body import Rock
from vsr_core.scene import Contact, State
from vsr_core.terrain.surface import Terrain
from vsr_core.verification.reference import REBOUNDS, Reference, case
from vsr_core.verification.reference._run import Path, run, scene, seen, slope
from vsr_core.verification.rocks import box, sphere

ANGLE = math.radians(25.0)
"""Of the slope."""

SIZE = (1.0, 0.8, 0.6)
"""Sides of the block [m]."""

GAP = 0.02
"""Height of the lowest point above the slope at the start [m]."""

AFTER = 3
"""Time steps after the first impulse within which an impact is over. Where nothing rebounds Bullet
takes the approach of an open contact in one step and the rest of it in the next."""

FALLS = 4
"""Times that the moment of touching is made better."""

RIGID = 1e9
"""Times the inertia of what cannot turn."""

DIRECTIONS = 180
"""Directions between which those of slip are looked for; none is straight ahead or back."""

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class SlopeThrow:
    """A rock thrown at a slope, told in its axes: downhill, across, normal.

    Attributes
    ----------
    rotation : ndarray, shape (3, 3)
    velocity : ndarray, shape (3,) [m/s]
    angular_velocity : ndarray, shape (3,) [rad/s]
    """

    rock: Callable[[], Rock]
    rotation: Array
    velocity: Array
    angular_velocity: Array


@dataclass(frozen=True)
class Motion:
    """Velocity [m/s] and angular velocity [rad/s] of a rock at one time, shape (3,) each."""

    velocity: Array
    angular_velocity: Array

    def at(self, arm: Array) -> Array:
        """Velocity [m/s] of the point at ``arm``, shape (3,) [m], from the centre of mass."""
        return self.velocity + np.cross(self.angular_velocity, arm)

    def energy(self, inertia: Array) -> float:
        """Kinetic energy per unit mass [m^2/s^2]."""
        return 0.5 * float(
            self.velocity @ self.velocity + self.angular_velocity @ inertia @ self.angular_velocity
        )


def rebound(before: Motion, arm: Array, inertia: Array, restitution: float, mu: float) -> Motion:
    """Motion after the impact of one point on ground whose normal is +z.

    Parameters
    ----------
    arm : ndarray, shape (3,) [m], from the centre of mass to the point
    inertia : ndarray, shape (3, 3) [m^2], about the centre of mass over mass
    """
    point = before.at(arm)
    yields = compliance(arm, inertia)
    wanted = -(1.0 + restitution) * point[2]
    impulse = np.linalg.solve(yields, wanted * UP - point * [1.0, 1.0, 0.0])
    if math.hypot(impulse[0], impulse[1]) > mu * impulse[2]:
        impulse = _sliding(point, yields, wanted, mu)
    return Motion(
        before.velocity + impulse,
        before.angular_velocity + np.linalg.solve(inertia, np.cross(arm, impulse)),
    )


def compliance(arm: Array, inertia: Array) -> Array:
    """Change of a point's velocity per impulse over mass.

    Parameters
    ----------
    arm : ndarray, shape (3,) [m], from the centre of mass to the point
    inertia : ndarray, shape (3, 3) [m^2], about the centre of mass over mass

    Returns
    -------
    ndarray, shape (3, 3)
    """
    x, y, z = arm
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) - cross @ np.linalg.solve(inertia, cross)


def _sliding(point: Array, yields: Array, wanted: float, mu: float) -> Array:
    """Impulse over mass on the cone of friction, against the slip it leaves, shape (3,).

    Of several directions of slip that go with their impulse, the one nearest to that before.
    """

    def direction(angle: float) -> Array:
        return np.array([math.cos(angle), math.sin(angle), 0.0])

    def impulse(angle: float) -> Array:
        ray = UP - mu * direction(angle)
        return wanted / float(UP @ yields @ ray) * ray

    def slip(angle: float) -> Array:
        return point + yields @ impulse(angle)

    def aside(angle: float) -> float:
        return float(np.cross(direction(angle), slip(angle))[2])

    tried = math.atan2(point[1], point[0]) + np.linspace(-3.0, 2.0 * math.pi - 3.0, DIRECTIONS)
    off = np.array([aside(angle) for angle in tried])
    ends = [
        float(brentq(aside, tried[k], tried[k + 1]))
        for k in np.flatnonzero(off[1:] * off[:-1] <= 0)
    ]
    fit = [end for end in ends if direction(end) @ slip(end) >= 0.0 and impulse(end)[2] > 0.0]
    return impulse(max(fit, key=lambda end: float(direction(end) @ point)))


def thrown(
    throw: SlopeThrow, contact: Contact, ground: Terrain, engine: str, time_step: float
) -> tuple[Motion, Motion, Motion, Array]:
    """An impact in an engine and in theory.

    Parameters
    ----------
    ground : Terrain, a slope of ``ANGLE`` through the origin
    time_step : float [s]

    Returns
    -------
    tuple of Motion, Motion, Motion and ndarray, shape (3, 3) [m^2]
        Before and after in the engine, after in theory, and inertia over mass, all in the slope's
        axes, and in the pose of the moment of touching: angular momentum is kept before and after.
    """
    rock = throw.rock()
    corners = rock.vertices @ throw.rotation.T
    start = State(
        (GAP - _lowest(rock, corners)) * UP, throw.rotation, throw.velocity, throw.angular_velocity
    )
    steps = math.ceil(2.0 * GAP / abs(float(throw.velocity[2])) / time_step) + AFTER
    world = scene(rock, contact, ground, ANGLE, start, gravity=0.0)
    path = seen(run(engine, world, time_step, np.zeros(steps)), ANGLE)
    jump = np.linalg.norm(path.velocity - throw.velocity, axis=1)
    last = int(np.argmax(jump > 1e-3 * np.linalg.norm(throw.velocity))) - 1
    pose = _when_it_touches(rock, path, last)
    inertia = _inertia(rock, pose)
    before, after = (_in_pose(rock, path, k, inertia) for k in (last, last + AFTER))
    touching = _touching(rock, pose)
    resisting = inertia if len(touching) < 3 else RIGID * inertia
    theory = rebound(
        before, touching.mean(axis=0), resisting, contact.restitution, contact.friction
    )
    return before, after, theory, inertia


def error(
    throw: SlopeThrow, contact: Contact, cell: float, cut: bool, engine: str, time_step: float
) -> float:
    """Error of velocity, or of angular velocity times radius; relative to the speed before.

    Parameters
    ----------
    cell : float [m], of the ground's squares
    cut : bool, whether these are convex parts, else triangles
    time_step : float [s]
    """
    ground = slope(ANGLE, (-3.0, 3.0), 3.0, cell, cut)
    before, after, theory, _ = thrown(throw, contact, ground, engine, time_step)
    scale = float(np.linalg.norm(before.velocity))
    moved = float(np.linalg.norm(after.velocity - theory.velocity))
    turned = float(np.linalg.norm(after.angular_velocity - theory.angular_velocity))
    return max(moved, turned * throw.rock().radius) / scale


def _when_it_touches(rock: Rock, path: Path, number: int) -> Array:
    """Pose in which the rock touches the slope, from a reading just before it."""
    pose, velocity = path.rotation[number], path.velocity[number]
    inertia = _inertia(rock, pose)
    momentum, spin, time = (
        inertia @ path.angular_velocity[number],
        path.angular_velocity[number],
        0.0,
    )
    for _ in range(FALLS):
        turned = Rotation.from_rotvec(time * spin).as_matrix() @ pose
        low = _touching(rock, turned).mean(axis=0)
        half_way = Rotation.from_rotvec(0.5 * time * spin).as_matrix() @ pose
        spin = np.linalg.solve(_inertia(rock, half_way), momentum)
        gap = path.position[number, 2] + time * velocity[2] + low[2]
        time -= gap / (velocity[2] + np.cross(spin, low)[2])
    return np.asarray(Rotation.from_rotvec(time * spin).as_matrix() @ pose)


def _inertia(rock: Rock, rotation: Array) -> Array:
    turn = rotation @ rock.axes
    return np.asarray(turn @ np.diag(rock.inertia / rock.mass) @ turn.T)


def _in_pose(rock: Rock, path: Path, number: int, inertia: Array) -> Motion:
    """Motion that has the angular momentum of a reading where the inertia is ``inertia``."""
    momentum = _inertia(rock, path.rotation[number]) @ path.angular_velocity[number]
    return Motion(path.velocity[number], np.linalg.solve(inertia, momentum))


def _lowest(rock: Rock, corners: Array) -> float:
    return -rock.radius if rock.shape == "sphere" else float(corners[:, 2].min())


def _touching(rock: Rock, rotation: Array) -> Array:
    """Points that touch, from the centre of mass, shape (n, 3) [m]."""
    if rock.shape == "sphere":
        return -rock.radius * UP[None]
    corners = rock.vertices @ rotation.T
    return corners[corners[:, 2] < corners[:, 2].min() + 1e-3 * rock.radius]


def _turned(*degrees: float) -> Array:
    return Rotation.from_euler("xyz", degrees, degrees=True).as_matrix()


_BLOCK = partial(box, *SIZE)

THROWS = {
    "corner": SlopeThrow(_BLOCK, _turned(30.0, 25.0, 10.0), np.array([2.0, 0.5, -3.0]),
                    np.array([0.5, 2.0, 0.3])),
    "edge": SlopeThrow(_BLOCK, _turned(0.0, 25.0, 0.0), np.array([2.0, 0.0, -3.0]),
                  np.array([0.0, 1.0, 0.0])),
    "face": SlopeThrow(_BLOCK, np.eye(3), np.array([2.0, 0.0, -3.0]), np.zeros(3)),
    "sphere": SlopeThrow(partial(sphere, 0.5), np.eye(3), np.array([2.0, 0.0, -3.0]),
                    np.array([0.0, -3.0, 0.0])),
}  # fmt: skip
"""What hits the slope."""


def _impact(what: str, e: float, mu: float, cut: bool, tolerance: float, law: str) -> Reference:
    cell, kind = (1.5, "parts") if cut else (0.5, "triangles")
    return case(f"impact on {kind}, {what}, e = {e:g}, mu = {mu:g}", law, tolerance,
                error, THROWS[what], Contact(mu, e), cell, cut, engines=REBOUNDS)  # fmt: skip


STICKS = "Newton's restitution, and the tangential impulse that stops the point"
SLIDES = "Newton's restitution, and Coulomb's impulse against the slip"

CASES = (
    _impact("corner", 0.0, 0.6, True, 0.02,
            f"{STICKS}; Bullet repairs by a speed what sank in by then"),
    _impact("corner", 0.38, 0.6, False, 2e-3, STICKS),
    _impact("corner", 0.38, 0.3, True, 0.03, f"{SLIDES}; Bullet's is a little off its direction"),
    _impact("edge", 0.38, 0.6, True, 0.01, f"{STICKS}; Bullet lands one end before the other"),
    _impact("face", 0.38, 0.3, False, 1e-3, SLIDES),
    _impact("sphere", 0.8, 0.3, False, 0.04,
            f"{SLIDES}; on a border it meets the next edge aslant"),
)  # fmt: skip
