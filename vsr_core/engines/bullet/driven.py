"""A table in Bullet that a servo moves: a slide that bears the pedestal, and the rock free on it.

The servo itself works in SI units. Accelerations are the same inside the engine, so a force on the
pedestal is scaled as the masses are, and gains need no scaling.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

from vsr_core.arrays import Array
from vsr_core.engines.bullet.binding import pybullet
from vsr_core.engines.bullet.world import FASTEST, MASS, BulletWorld
from vsr_core.engines.interface import Solver
from vsr_core.errors import InvalidInput
from vsr_core.scene import Scene, State


class BulletDrivenWorld(BulletWorld):
    """One rock on a pedestal that its servo moves along x, and that the rock pushes back.

    Each sample is a velocity command for one control period. Its force is held over all steps of
    that period: Bullet keeps a torque until the end of the call that steps them.
    """

    def __init__(self, scene: Scene) -> None:
        assert scene.drive is not None
        if scene.pedestal in ("plane", "none"):
            raise InvalidInput(
                f"a servo for a pedestal of kind {scene.pedestal!r}",
                "it moves a body of finite size",
                "use a box or a mesh",
            )
        self._servo = scene.drive
        self._mass_scale = MASS / scene.rock.mass
        super().__init__(scene)

    def rewind(self, time_step: float, substeps: int, solver: Solver) -> None:
        """Put table, servo and rock back to their start."""
        sample, period = substeps * time_step, self._servo.period
        if not math.isclose(sample, period, rel_tol=1e-9):
            raise InvalidInput(
                f"samples of {sample:g} s for a servo that holds its force for {period:g} s",
                "a sample is one control period",
                "divide the period into the substeps",
            )
        pybullet.resetJointState(self._table, 0, 0.0, 0.0, physicsClientId=self._client)
        self._speed = self._integral = self._error = self._force = 0.0
        super().rewind(time_step, substeps, solver)

    def advance(self, velocity: Iterable[float]) -> None:
        """Step through velocity commands [m/s], each for one control period."""
        self._known = None
        servo = self._servo
        hold = servo.period / servo.mass
        pybullet.setGravity(0.0, 0.0, -self._weight, self._client)
        for wanted in velocity:
            error = wanted - self._speed
            self._integral += error * servo.period
            change = (error - self._error) / servo.period
            force = servo.kp * error + servo.ki * self._integral + servo.kd * change
            force = max(-servo.force_limit, min(servo.force_limit, force))
            self._push(force)
            before, self._error, self._force = self._speed, error, force
            self._speed = self.table()[1]
            # What the servo's force did not do, the rock did.
            own = force * hold
            self._impulse += abs(own) + abs(self._speed - before - own)

    def state(self) -> State:
        """Present state in SI units, relative to the table."""
        position, velocity = self.table()
        state = super().state()
        return replace(
            state,
            position=state.position - [position, 0.0, 0.0],
            velocity=state.velocity - [velocity, 0.0, 0.0],
        )

    def footing(self) -> tuple[Array, Array]:
        """Points that bore the rock in the last step, relative to the table, and the pushes.

        Returns
        -------
        tuple of ndarray, shape (k, 3) [m], and ndarray, shape (k, 3)
        """
        places, pushes = super().footing()
        return places - [self.table()[0], 0.0, 0.0], pushes

    def table(self) -> tuple[float, float]:
        """Position [m] and velocity [m/s] of the table along +x."""
        position, velocity, *_ = pybullet.getJointState(self._table, 0, self._client)
        return position / self._scale, velocity / math.sqrt(self._scale)

    def force(self) -> float:
        """The servo's force on the table in the last control period [N]."""
        return self._force

    def impulse(self) -> float:
        """Upper bound of the integral of the table's absolute acceleration so far [m/s].

        Within a control period the servo's force is constant and the rock's push is what remains of
        the change of velocity. Both are counted as if they never cancelled, which is a bound as
        long as the push does not change sign within the period.
        """
        return self._impulse

    def _pedestal_body(self, scene: Scene, shape: int, centre: list[float]) -> tuple[int, int]:
        none = [0.0, 0.0, 0.0]
        level = [0.0, 0.0, 0.0, 1.0]
        self._table = int(
            pybullet.createMultiBody(
                0.0,
                linkMasses=[self._servo.mass * self._mass_scale],
                linkCollisionShapeIndices=[shape],
                linkVisualShapeIndices=[-1],
                linkPositions=[centre],
                linkOrientations=[level],
                linkInertialFramePositions=[none],
                linkInertialFrameOrientations=[level],
                linkParentIndices=[0],
                linkJointTypes=[pybullet.JOINT_PRISMATIC],
                linkJointAxis=[[1.0, 0.0, 0.0]],
                useMaximalCoordinates=0,
                physicsClientId=self._client,
            )
        )
        pybullet.changeDynamics(
            self._table,
            0,
            linearDamping=0.0,
            angularDamping=0.0,
            maxJointVelocity=FASTEST,
            physicsClientId=self._client,
        )
        # Bullet brakes every joint that it is given, until told not to.
        pybullet.setJointMotorControl2(
            self._table, 0, pybullet.VELOCITY_CONTROL, force=0.0, physicsClientId=self._client
        )
        return self._table, 0

    def _push(self, force: float) -> None:
        pybullet.setJointMotorControl2(
            self._table,
            0,
            pybullet.TORQUE_CONTROL,
            force=force * self._mass_scale,
            physicsClientId=self._client,
        )
        pybullet.stepSimulation(self._client)
