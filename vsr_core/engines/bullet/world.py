"""One rock and its pedestal in Bullet."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from vsr_core import GRAVITY
from vsr_core.arrays import Array, matrix_product
from vsr_core.engines.bullet.binding import pybullet
from vsr_core.engines.bullet.collision_shapes import leave_to_the_rock, pedestal_shape, rock_shape
from vsr_core.engines.bullet.ground import GroundBlocks
from vsr_core.engines.bullet.springs import RIGID, Springs, exact_springs
from vsr_core.engines.bullet.turning_table import Moving, turn
from vsr_core.engines.interface import Solver
from vsr_core.scene import Scene, State, resting

SCALED_RADIUS = 10.0
"""Radius of every rock inside the engine, in Bullet's length unit."""

ERP = 0.02
"""Share of a penetration that Bullet corrects in a step. It does so by speed: with the default of
0.2 an impact is followed by a kick that no finer step makes smaller."""

MASS = 0.001
"""Mass of every rock inside the engine. Beside a pedestal that is at rest it changes nothing, but
Bullet caps the impulse of rolling friction at the coefficient times one unit of impulse, so that
a heavy rock has none."""

QUIET_STEPS, QUIET_TIME = 12, 0.03
"""Steps, and time in Bullet's unit, that let a rock touch down and Bullet gather its contacts."""

START_GAP = 2e-4
"""Height above the known rest pose from which the rock is set down, in Bullet's length unit."""

HULL_MARGIN = 0.001
"""Bullet's collision margin around a convex hull, in its length unit; boxes have none outside."""

RESTITUTION_THRESHOLD = 0.01
"""Normal speed below which nothing bounces, in Bullet's unit of speed."""

FASTEST = 1e9
"""Speed to which Bullet holds a body in a joint tree, in its unit; 100 if not stated."""


BOUNCING_ERP = 1e-4
"""Share of a penetration that Bullet corrects in a step where contacts bounce. It does so by speed,
so that 0.2 makes a drop of e = 0.38 rebound by up to 14 % too high."""

GAP, SMALL_GAP = 0.02, 1e-4
"""Gap below which a contact is kept, in Bullet's length unit: its default, and where contacts
bounce or the ground is made of parts. Within it the approach is stopped without a rebound: with
0.02 fine steps lose it all, and a rock that slides over parts is held by those behind a border."""

STEP_BITS = 40
"""Binary digits of a step; the other 13 are for the number of steps in a sample."""


class BulletWorld:
    """One rock in a world of its own, on its own connection.

    Building a hull costs more than many a run, so a world is kept and rewound for the next run.
    Rewinding lifts the rock out of contact for a step, which empties Bullet's contact cache, and
    sets it down again: every run starts from the same bits, whatever ran before.
    """

    def __init__(self, scene: Scene) -> None:
        self._client = int(pybullet.connect(pybullet.DIRECT))
        self._scale = SCALED_RADIUS / scene.rock.radius
        self._axes = scene.rock.axes
        # In maximal coordinates (no joint tree) a step costs less than half, but a contact that is
        # still open takes the approach speed away without giving the rebound back. On a driven
        # table, a joint tree itself, they save next to nothing. On triangles they are without the
        # filter of inner edges.
        in_parts = scene.terrain is not None and bool(scene.terrain.parts)
        triangles = scene.pedestal == "mesh" or (scene.terrain is not None and not in_parts)
        bounces = scene.contact.restitution > 0.0
        self._maximal = int(not bounces and not triangles and scene.drive is None)
        margin = HULL_MARGIN if scene.rock.shape == "hull" and scene.terrain is None else 0.0
        self._lift = np.array([0.0, 0.0, margin])
        self._start = scene.start or resting(scene)
        self._moving = scene.start is not None
        self._springs = _springs(scene, self._scale)
        self._weight = scene.gravity
        self._along = 1.0, 0.0
        self._aloft = 10.0 * SCALED_RADIUS
        if scene.terrain is not None:
            # Its yaw turns the rock and the ground it stands on: the same as turning the shaking.
            self._along = math.cos(scene.yaw), -math.sin(scene.yaw)
            self._aloft += self._scale * float(scene.terrain.vertices[:, 2].max())
        pybullet.setPhysicsEngineParameter(
            restitutionVelocityThreshold=RESTITUTION_THRESHOLD,
            deterministicOverlappingPairs=1,
            physicsClientId=self._client,
        )
        self._gap = SMALL_GAP if bounces or in_parts else GAP
        erp = BOUNCING_ERP if bounces else ERP
        pybullet.setPhysicsEngineParameter(erp=erp, contactERP=erp, physicsClientId=self._client)
        if scene.pedestal != "none" and scene.pedestal != "terrain":
            self._add_pedestal(scene, scene.pedestal)
        self._rock = self._add_rock(scene)
        self._known: State | None = None  # as last read, until the next step
        self._impulse = 0.0
        self._before: Moving | None = None  # velocities a step ago, where a table turns
        self._moments = scene.rock.inertia / scene.rock.mass * self._scale**2
        self._ground: GroundBlocks | None = None
        if scene.terrain is not None:
            self._ground = GroundBlocks(
                scene.terrain, scene.rock, self._scale, self._client, self._maximal
            )
        if self._springs:
            exact_springs(self._client)
            self._springs.under(self._rock, -1, self._client)

    def rewind(self, time_step: float, substeps: int, solver: Solver) -> None:
        """Put the rock back to its start, for ``substeps`` steps of ``time_step`` [s] a sample."""
        interval = substeps * _divisible(time_step * math.sqrt(self._scale))
        pybullet.setTimeStep(interval, physicsClientId=self._client)
        pybullet.setPhysicsEngineParameter(
            numSubSteps=substeps if substeps > 1 else 0,
            numSolverIterations=solver.iterations,
            contactBreakingThreshold=self._gap,  # one for all worlds of a process
            solverResidualThreshold=(solver.residual * GRAVITY * interval / substeps) ** 2,
            physicsClientId=self._client,
        )
        self._sample = substeps * time_step
        self._impulse = 0.0
        if self._ground is not None:
            self._ground.clear()
        start = self._start
        aloft = np.array([0.0, 0.0, self._aloft / self._scale])
        self.put(replace(start, position=aloft, velocity=np.zeros(3), angular_velocity=np.zeros(3)))
        pybullet.stepSimulation(self._client)
        if self._moving:
            self.put(start)
        else:
            self._set_down(substeps, interval)

    def advance(self, acceleration: Iterable[float]) -> None:
        """Step through samples of the table's acceleration along the shaking [m/s^2]."""
        set_gravity, step, client = pybullet.setGravity, pybullet.stepSimulation, self._client
        (x, y), down = self._along, -self._weight
        if self._ground is not None:
            acceleration = list(acceleration)
            most = math.hypot(max(map(abs, acceleration)), self._weight)
            self._ground.follow(self.state(), len(acceleration) * self._sample, most)
        self._known = None
        for along in acceleration:
            set_gravity(-along * x, -along * y, down, client)
            step(client)

    def shake(self, acceleration: Sequence[Sequence[float]]) -> None:
        """Step through samples of the table's acceleration along its x, y and z [m/s^2]."""
        set_gravity, step, client = pybullet.setGravity, pybullet.stepSimulation, self._client
        (cos, sin), weight = self._along, self._weight
        if self._ground is not None:
            most = max(math.hypot(x, y, weight + z) for x, y, z in acceleration)
            self._ground.follow(self.state(), len(acceleration) * self._sample, most)
        self._known = None
        for x, y, z in acceleration:
            set_gravity(sin * y - cos * x, -sin * x - cos * y, -weight - z, client)
            step(client)

    def turn(self, samples: Sequence[Sequence[float]]) -> None:
        """Step through samples of a table that turns, nine numbers each, one step a sample."""
        pace = math.sqrt(self._scale)
        units = [1.0] * 3 + [1.0 / pace] * 3 + [1.0 / self._scale] * 3
        scaled = (np.asarray(samples) * units).tolist()
        self._known = None
        given, self._before = turn(
            self._client,
            self._rock,
            self._moments.tolist(),
            scaled,
            self._sample * pace,
            self._weight,
            self._before,
        )
        self._impulse += given / pace

    def impulse(self) -> float:
        """Upper bound of the growth of sqrt(2 e) by what ``turn`` did so far [m/s]."""
        return self._impulse

    def state(self) -> State:
        """Present state in SI units."""
        if self._known is not None:
            return self._known
        position, quaternion = pybullet.getBasePositionAndOrientation(self._rock, self._client)
        velocity, angular_velocity = pybullet.getBaseVelocity(self._rock, self._client)
        pace = math.sqrt(self._scale)
        self._known = State(
            np.array(position) / self._scale,
            matrix_product(_matrix(quaternion), self._axes.T),
            np.array(velocity) / pace,
            np.array(angular_velocity) * pace,
        )
        return self._known

    def put(self, state: State) -> None:
        """Have the rock go on from a state."""
        self._known = self._before = None
        pace = math.sqrt(self._scale)
        place = state.position * self._scale + self._lift
        pybullet.resetBasePositionAndOrientation(
            self._rock,
            place.tolist(),
            _quaternion(matrix_product(state.rotation, self._axes)),
            self._client,
        )
        pybullet.resetBaseVelocity(
            self._rock,
            (state.velocity * pace).tolist(),
            (state.angular_velocity / pace).tolist(),
            self._client,
        )

    def contacts(self) -> tuple[int, float]:
        """Number of points that bore the rock in the last step; the deepest in the ground [m]."""
        points = pybullet.getContactPoints(self._rock, physicsClientId=self._client)
        deepest = min((point[8] for point in points), default=0.0)
        return sum(point[9] > 0.0 for point in points), max(-deepest, 0.0) / self._scale

    def footing(self) -> tuple[Array, Array]:
        """Points that bore the rock in the last step, and the way the ground pushed there."""
        points = pybullet.getContactPoints(self._rock, physicsClientId=self._client)
        bearing = [point for point in points if point[9] > 0.0]
        places = np.array([point[6] for point in bearing]).reshape(-1, 3) / self._scale
        return places, np.array([point[7] for point in bearing]).reshape(-1, 3)

    def close(self) -> None:
        """End the connection."""
        pybullet.disconnect(self._client)

    def _set_down(self, substeps: int, interval: float) -> None:
        """Lower the rock by ``START_GAP`` on the pedestal, leave it alone for a while, hold it.

        A hull's contacts overlap by 1e-4 in its exact rest pose. Bullet corrects that by a speed,
        the greater the smaller the step, and would start the rock with a kick. On springs, which
        are damped for that, it sinks in.
        """
        above = np.array([0.0, 0.0, START_GAP / self._scale])
        self.put(replace(self._start, position=self._start.position + above))
        quiet = QUIET_TIME
        if self._springs:
            damped = self._springs.damped(MASS)
            damped.under(self._rock, -1, self._client)
            quiet += damped.settling_time
        self.advance([0.0] * math.ceil(max(QUIET_STEPS / substeps, quiet / interval)))
        if self._springs:
            self._springs.under(self._rock, -1, self._client)
        pybullet.resetBaseVelocity(self._rock, [0.0] * 3, [0.0] * 3, self._client)

    def _add_pedestal(self, scene: Scene, kind: Literal["plane", "box", "mesh"]) -> None:
        shape, centre = pedestal_shape(kind, SCALED_RADIUS, self._client)
        body, link = self._pedestal_body(scene, shape, centre)
        leave_to_the_rock(body, link, self._client)
        if self._springs:
            RIGID.under(body, link, self._client)

    def _pedestal_body(self, scene: Scene, shape: int, centre: list[float]) -> tuple[int, int]:
        """Bullet's numbers of a body that stands still and of its link that bears the shape."""
        body = pybullet.createMultiBody(
            0.0,
            shape,
            -1,
            centre,
            useMaximalCoordinates=self._maximal,
            physicsClientId=self._client,
        )
        return int(body), -1

    def _add_rock(self, scene: Scene) -> int:
        rock, contact = scene.rock, scene.contact
        body = pybullet.createMultiBody(
            MASS,
            rock_shape(
                rock, self._scale, HULL_MARGIN, self._client, on_level=scene.terrain is None
            ),
            -1,
            useMaximalCoordinates=self._maximal,
            physicsClientId=self._client,
        )
        pybullet.changeDynamics(
            body,
            -1,
            mass=MASS,  # with the inertia, or Bullet takes it for zero
            lateralFriction=contact.friction,
            restitution=contact.restitution,
            rollingFriction=contact.rolling_friction * self._scale,
            spinningFriction=0.0,
            linearDamping=0.0,
            angularDamping=0.0,
            maxJointVelocity=FASTEST,
            localInertiaDiagonal=(MASS / rock.mass * rock.inertia * self._scale**2).tolist(),
            physicsClientId=self._client,
        )
        return int(body)


def _springs(scene: Scene, scale: float) -> Springs | None:
    """The springs of a scene in Bullet's units; None if its contact is rigid."""
    contact, to_mass = scene.contact, MASS / scene.rock.mass
    if contact.stiffness is None:
        return None
    return Springs(
        contact.stiffness * to_mass / scale, contact.damping * to_mass / math.sqrt(scale)
    )


def _divisible(step: float) -> float:
    """The step to 1e-12 of itself, and so that Bullet finds a sample to be a number of them.

    Bullet counts the substeps of a sample by dividing times that it sums up, and carries the rest
    over, even into the next run. Of 2,000 pairs of step and number 106 lost a step to a rounding.
    """
    mantissa, exponent = math.frexp(step)
    return math.ldexp(round(math.ldexp(mantissa, STEP_BITS)), exponent - STEP_BITS)


def _matrix(q: tuple[float, float, float, float]) -> Array:
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def _quaternion(rotation: Array) -> list[float]:
    """Quaternion x, y, z, w of a rotation matrix."""
    return [float(part) for part in Rotation.from_matrix(rotation).as_quat()]
