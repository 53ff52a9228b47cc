"""The published set-up rebuilt: PyBullet, and a heavy table that a PID drives along a joint.

A prismatic joint carries a triangulated pedestal, whose velocity is controlled in every step; the
rock is the convex hull of all its vertices. Nothing ends a run early. Steps above 2 ms are no use:
the sampled loop is stable only for ``GAIN_P`` times the step below twice ``TABLE_MASS``.

On the 1x1x2 m block the boundary is right to 1-2 %, but a few pulses up to 6 % below it overturn
the block too, at every step and differently for other triangles: landings keep 0.75 of the angular
velocity in one case tried, where Housner's block keeps 0.70.

References
----------
Chen et al. (2024), Seismica 3(1), and their public scripts and models.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from vsr_core.arrays import Array
from vsr_core.engines.bullet.binding import pybullet
from vsr_core.engines.bullet.collision_shapes import level_sheet
from vsr_core.motions.pulses import CosinePulse
from vsr_core.scene import Scene, resting
from vsr_core.verification.other_engines import AFTER, Setting, Test, largest_tilt

LABEL = "published set-up (PyBullet, servo)"
NEEDS = ("pybullet",)
SWEEP = ({"time_step": 1e-3}, {"time_step": 5e-4}, {"time_step": 2.5e-4}, {"time_step": 1.25e-4})

REST = 0.5
"""Time at rest before the pulse [s]; the public scripts take 2 s."""

TABLE_MASS = 50_000.0
"""Mass of the pedestal [kg], of the public models, as are the gains."""

GAIN_P = 5e7
"""Force per velocity error [N s/m]."""

GAIN_I = 5e7
"""Force per integrated velocity error [N/m]."""

ITERATIONS = 200
"""Solver iterations a step, of the public scripts."""

HALF_WIDTH = 5.0
"""Of the square pedestal [m]."""

CELLS = 25
"""Squares along the pedestal, of two triangles each, coarser than any scan. A block that slides
trips over their borders: at a friction of 0.36 the 1x1x2 m block overturns in a cell or does not as
the squares are wider or narrower, in few cells on one wide square, and it falls off a narrow one.
The rock of 1230 vertices costs 44 us a step on two triangles, 280 us on these, 830 us on squares
half as wide."""

MARGIN = 0.001
"""Bullet's collision margin [m], around the hull and again around the triangles."""


@dataclass(frozen=True)
class Coefficients:
    """What Bullet is told of the rock and of the table.

    It multiplies the frictions and the restitutions of two bodies, and takes as rolling friction, a
    length in metres, the sum of each body's times the other's friction.

    Attributes
    ----------
    friction, restitution, rolling : (float, float), of the rock and of the table
    """

    friction: tuple[float, float]
    restitution: tuple[float, float] = (0.0, 0.0)
    rolling: tuple[float, float] = (0.0, 0.0)


def build(scene: Scene, setting: Setting, coefficients: Coefficients | None = None) -> Test:
    """Test with the table's velocity controlled in every step; a new world for every run.

    Parameters
    ----------
    setting : dict of float, one of ``SWEEP``; perhaps ``cells`` and ``half_width`` in place of
        ``CELLS`` and ``HALF_WIDTH``
    coefficients : Coefficients or None, for the friction of the scene's pair and no rebound
    """
    time_step = setting["time_step"]
    told = coefficients or Coefficients((scene.contact.friction, 1.0))
    table = setting.get("half_width", HALF_WIDTH), int(setting.get("cells", CELLS))

    def test(pulse: CosinePulse) -> float:
        steps = math.ceil((REST + pulse.duration + AFTER) / time_step)
        times: Array = time_step * np.arange(steps, dtype=np.float64) - REST
        desired = pulse.velocity(times)
        world = _World(scene, time_step, told, table)
        try:
            return largest_tilt(world.advance, world.tilt, desired, until=math.inf)
        finally:
            world.close()

    return test


class _World:
    """A rock at rest on a table that can be driven."""

    def __init__(
        self, scene: Scene, time_step: float, told: Coefficients, table: tuple[float, int]
    ) -> None:
        self._client = int(pybullet.connect(pybullet.DIRECT))
        self._time_step = time_step
        self._up = scene.rock.axes[2]
        self._integral = 0.0
        pybullet.setTimeStep(time_step, self._client)
        pybullet.setGravity(0.0, 0.0, -scene.gravity, self._client)
        pybullet.setPhysicsEngineParameter(
            numSolverIterations=ITERATIONS, physicsClientId=self._client
        )
        self._table = self._add_table(told, *table)
        self._rock = self._add_rock(scene, told)

    def advance(self, desired: Iterable[float]) -> None:
        """Step through desired velocities of the table [m/s]."""
        client, table = self._client, self._table
        for velocity in desired:
            error = velocity - pybullet.getJointState(table, 0, client)[1]
            self._integral += error * self._time_step
            pybullet.setJointMotorControl2(
                table,
                0,
                pybullet.TORQUE_CONTROL,
                force=GAIN_P * error + GAIN_I * self._integral,
                physicsClientId=client,
            )
            pybullet.stepSimulation(client)

    def tilt(self) -> float:
        """Present tilt of the rock [rad]."""
        quaternion = pybullet.getBasePositionAndOrientation(self._rock, self._client)[1]
        upright = float(self._up @ pybullet.getMatrixFromQuaternion(quaternion)[6:])
        return math.acos(max(-1.0, min(1.0, upright))) if math.isfinite(upright) else math.nan

    def close(self) -> None:
        """End the connection."""
        pybullet.disconnect(self._client)

    def _add_table(self, told: Coefficients, half_width: float, cells: int) -> int:
        client = self._client
        shape = level_sheet(half_width, cells, client)
        table = pybullet.createMultiBody(
            linkMasses=[TABLE_MASS],
            linkCollisionShapeIndices=[shape],
            linkVisualShapeIndices=[-1],
            linkPositions=[[0.0] * 3],
            linkOrientations=[[0.0, 0.0, 0.0, 1.0]],
            linkInertialFramePositions=[[0.0] * 3],
            linkInertialFrameOrientations=[[0.0, 0.0, 0.0, 1.0]],
            linkParentIndices=[0],
            linkJointTypes=[pybullet.JOINT_PRISMATIC],
            linkJointAxis=[[1.0, 0.0, 0.0]],
            physicsClientId=client,
        )
        # A new joint has a motor that holds it.
        pybullet.setJointMotorControl2(
            table, 0, pybullet.VELOCITY_CONTROL, force=0.0, physicsClientId=client
        )
        pybullet.changeDynamics(
            table,
            0,
            lateralFriction=told.friction[1],
            restitution=told.restitution[1],
            rollingFriction=told.rolling[1],
            linearDamping=0.0,
            angularDamping=0.0,
            jointDamping=0.0,
            physicsClientId=client,
        )
        return int(table)

    def _add_rock(self, scene: Scene, told: Coefficients) -> int:
        client, rock, start = self._client, scene.rock, resting(scene)
        shape = pybullet.createCollisionShape(
            pybullet.GEOM_MESH,
            vertices=(rock.vertices @ rock.axes).tolist(),
            physicsClientId=client,
        )
        body = pybullet.createMultiBody(
            rock.mass,
            shape,
            basePosition=[0.0, 0.0, rock.height + 2.0 * MARGIN],
            baseOrientation=Rotation.from_matrix(start.rotation @ rock.axes).as_quat(),
            physicsClientId=client,
        )
        pybullet.changeDynamics(
            body,
            -1,
            lateralFriction=told.friction[0],
            restitution=told.restitution[0],
            rollingFriction=told.rolling[0],
            linearDamping=0.0,
            angularDamping=0.0,
            localInertiaDiagonal=rock.inertia.tolist(),
            physicsClientId=client,
        )
        return int(body)
