"""Bullet, through PyBullet's direct connection.

Bullet's tolerances are lengths and speeds in absolute units: 1 mm of margin around a hull, 2 cm
to break a contact, 0.2 m/s below which nothing bounces. Every rock is therefore scaled to one
size by similarity: lengths by s, times by sqrt(s), accelerations unchanged. The same tolerances
are then the same share of any rock, and geometrically similar scenes give the same numbers.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import cache
from importlib.metadata import version

import numpy as np
import pybullet
from numpy.typing import NDArray

from vsr_core import GRAVITY
from vsr_core.engines import State
from vsr_core.scene import Rock, Scene

Array = NDArray[np.float64]

VERSION = version("pybullet")

SCALED_RADIUS = 10.0
"""Radius of every rock inside the engine, in Bullet's length unit."""

SOLVER_ITERATIONS = 50
"""Bullet's default; it ends earlier once the residual is below 1e-7."""

QUIET_STEPS = 12
"""Steps at rest that let Bullet gather the contact points of a known rest pose."""

HULL_MARGIN = 0.001
"""Bullet's collision margin around a convex hull, in its length unit; boxes have none outside."""

RESTITUTION_THRESHOLD = 0.01
"""Normal speed below which nothing bounces, in Bullet's unit of speed."""


@cache
def _client() -> int:
    return int(pybullet.connect(pybullet.DIRECT))


class BulletWorld:
    """One rock in the one world of this process; building the next world ends this one."""

    def __init__(self, scene: Scene, time_step: float) -> None:
        self._client = _client()
        self._scale = SCALED_RADIUS / scene.rock.radius
        self._axes = scene.rock.axes
        pybullet.resetSimulation(physicsClientId=self._client)
        pybullet.setPhysicsEngineParameter(
            numSolverIterations=SOLVER_ITERATIONS,
            restitutionVelocityThreshold=RESTITUTION_THRESHOLD,
            deterministicOverlappingPairs=1,
            physicsClientId=self._client,
        )
        pybullet.setTimeStep(time_step * math.sqrt(self._scale), physicsClientId=self._client)
        self._add_pedestal(scene)
        self._rock = self._add_rock(scene)
        self.advance([0.0] * QUIET_STEPS)

    def advance(self, acceleration: Iterable[float]) -> None:
        """Step once per table acceleration along +x [m/s^2]."""
        set_gravity, step, client = pybullet.setGravity, pybullet.stepSimulation, self._client
        for along_x in acceleration:
            set_gravity(-along_x, 0.0, -GRAVITY, client)
            step(client)

    def state(self) -> State:
        """Present state in SI units."""
        position, quaternion = pybullet.getBasePositionAndOrientation(self._rock, self._client)
        velocity, spin = pybullet.getBaseVelocity(self._rock, self._client)
        pace = math.sqrt(self._scale)
        return State(
            np.array(position) / self._scale,
            _matrix(quaternion) @ self._axes.T,
            np.array(velocity) / pace,
            np.array(spin) * pace,
        )

    def close(self) -> None:
        """Empty the world."""
        pybullet.resetSimulation(physicsClientId=self._client)

    def _add_pedestal(self, scene: Scene) -> None:
        if scene.pedestal == "plane":
            shape = pybullet.createCollisionShape(
                pybullet.GEOM_PLANE, physicsClientId=self._client
            )
            centre = [0.0, 0.0, 0.0]
        else:
            half = [20.0 * SCALED_RADIUS, 20.0 * SCALED_RADIUS, SCALED_RADIUS]
            shape = pybullet.createCollisionShape(
                pybullet.GEOM_BOX, halfExtents=half, physicsClientId=self._client
            )
            centre = [0.0, 0.0, -half[2]]
        body = pybullet.createMultiBody(0.0, shape, -1, centre, physicsClientId=self._client)
        # Bullet multiplies friction and restitution of two bodies, and combines rolling friction
        # as r1 mu2 + r2 mu1: with these values the rock's are the pair's.
        pybullet.changeDynamics(
            body,
            -1,
            lateralFriction=1.0,
            restitution=1.0,
            rollingFriction=0.0,
            spinningFriction=0.0,
            physicsClientId=self._client,
        )

    def _add_rock(self, scene: Scene) -> int:
        rock, contact = scene.rock, scene.contact
        half = 0.5 * scene.yaw
        turn = np.array([0.0, 0.0, math.sin(half), math.cos(half)])
        body = pybullet.createMultiBody(
            rock.mass,
            self._collision_shape(rock),
            -1,
            [0.0, 0.0, rock.height * self._scale + (HULL_MARGIN if rock.shape == "hull" else 0.0)],
            _product(turn, _quaternion(rock.axes)),
            physicsClientId=self._client,
        )
        pybullet.changeDynamics(
            body,
            -1,
            lateralFriction=contact.friction,
            restitution=contact.restitution,
            rollingFriction=contact.rolling_friction * self._scale,
            spinningFriction=0.0,
            linearDamping=0.0,
            angularDamping=0.0,
            localInertiaDiagonal=(rock.inertia * self._scale**2).tolist(),
            physicsClientId=self._client,
        )
        return int(body)

    def _collision_shape(self, rock: Rock) -> int:
        if rock.shape == "box":
            half = np.abs(rock.vertices).max(axis=0) * self._scale
            return int(
                pybullet.createCollisionShape(
                    pybullet.GEOM_BOX, halfExtents=half.tolist(), physicsClientId=self._client
                )
            )
        corners = rock.vertices @ rock.axes * self._scale
        return int(
            pybullet.createCollisionShape(
                pybullet.GEOM_MESH, vertices=corners.tolist(), physicsClientId=self._client
            )
        )


def build(scene: Scene, time_step: float) -> BulletWorld:
    """World with the rock at rest on the pedestal; ``time_step`` in s."""
    return BulletWorld(scene, time_step)


def _matrix(q: tuple[float, float, float, float]) -> Array:
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def _quaternion(rotation: Array) -> Array:
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(rotation).as_quat()


def _product(a: Array, b: Array) -> list[float]:
    from scipy.spatial.transform import Rotation

    return (Rotation.from_quat(a) * Rotation.from_quat(b)).as_quat().tolist()
