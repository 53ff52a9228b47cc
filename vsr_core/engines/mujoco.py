"""MuJoCo, a second opinion that shares no code with Bullet.

Its contacts are springs, as stiff as the step allows, solved together by a convex optimisation;
Bullet's are impulses, solved in turn. As in Bullet, every rock is scaled to one size by similarity,
so that widths and tolerances are the same share of any rock.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Iterable, Sequence
from importlib.metadata import version

import mujoco
import numpy as np

from vsr_core.arrays import Array
from vsr_core.engines.interface import Ladder, Solver
from vsr_core.errors import InvalidInput
from vsr_core.rock.body import Rock
from vsr_core.scene import Scene, State, resting

VERSION = version("mujoco")

SOLVER = Solver(iterations=100, residual=1e-8)
"""MuJoCo's defaults."""

LADDER = Ladder(
    (0.048, 0.032, 0.024, 0.016, 0.012, 0.008, 0.006, 0.004, 0.003, 0.002),
    coarse=0.006,
    reference=0.000375,
    second=0.00055,
    longest=0.006,
)
"""As Bullet's, with which it is compared."""

SLENDER_SHARE = 0.035
"""Longest step of a slender rock, as a share of tan(alpha) sqrt(radius / g): springs give way by an
amount that grows with the step. At 0.04 a block swings back to within 3 % of Housner's."""

SLIDING_SHARE = 0.2
"""Friction, as a share of tan(alpha), from which on to 1 a rock topples that should slide. MuJoCo's
convex law of friction lifts what slides, at any time step: a block of tan(alpha) = 0.5 overturns
from a friction of 0.3 on; at 0.1 it tilts by 0.04 rad at most."""

SPRING_STEPS = 4.0
"""Time constant of a contact in steps. MuJoCo is stable from 2 on, but there the boundary of stocky
blocks wanders by 2 % however small the step; from 4 on it converges."""

DAMPING_RATIO = 2.0
"""Of a contact. An impedance below 1 makes less of it: with a ratio of 1 an impact rebounds by 1 to
2 % of its height at any step, with 2 by less than 1e-4."""

IMPEDANCE = (0.9, 0.95, 0.001)
"""MuJoCo's default impedance of a contact: at first touch, when pressed, and how deep that is, as a
share of the rock's radius."""

GRIP_TIME = 0.006
"""Least time constant of friction, in units of sqrt(radius / 1 m). MuJoCo's convex law couples it
with the normal force: as short as that of a fine step's contact it lifts what slides, and a slab
that cannot tip overturns; at 0.01 a sliding block is 1.5 % off, where it stops."""

GRIP_RATIO = 10.0
"""Stiffness of friction, as a multiple of that of the contact: what stands creeps less."""

WORLDS_KEPT = 2
"""Worlds kept for the next run of the same scene: the reduced one and the complete one."""

_worlds: OrderedDict[Scene, MujocoWorld] = OrderedDict()

# A run that diverges is told by its state; MuJoCo would print it, and into a file where we stand.
mujoco.set_mju_user_warning(lambda message: None)


class MujocoWorld:
    """One rock in a world of its own."""

    def __init__(self, scene: Scene) -> None:
        self._scale = 1.0 / scene.rock.radius
        self._axes = scene.rock.axes
        self._weight = scene.gravity
        start = scene.start or resting(scene)
        pace = math.sqrt(self._scale)
        self._place = start.position * self._scale
        self._turn = _quaternion(start.rotation @ self._axes)
        self._velocity = start.velocity * pace
        turned = start.rotation @ self._axes
        self._angular_velocity = turned.T @ start.angular_velocity / pace
        self._model = _model(scene, self._scale)
        self._data = mujoco.MjData(self._model)
        self._substeps = 1

    def rewind(self, time_step: float, substeps: int, solver: Solver) -> None:
        """Put the rock back to its start, for ``substeps`` steps of ``time_step`` [s] a sample."""
        option = self._model.opt
        option.timestep = time_step * math.sqrt(self._scale)
        option.iterations, option.tolerance = solver.iterations, solver.residual
        spring = SPRING_STEPS * option.timestep
        self._model.pair_solref[:] = spring, DAMPING_RATIO
        self._model.pair_solreffriction[:] = max(GRIP_TIME, spring), DAMPING_RATIO
        self._substeps = substeps
        mujoco.mj_resetData(self._model, self._data)
        self._data.qpos[:3], self._data.qpos[3:] = self._place, self._turn
        self._data.qvel[:3], self._data.qvel[3:] = self._velocity, self._angular_velocity

    def advance(self, acceleration: Iterable[float]) -> None:
        """Step through samples of the table's acceleration along +x [m/s^2]."""
        step, model, data, substeps = mujoco.mj_step, self._model, self._data, self._substeps
        gravity = model.opt.gravity
        gravity[2] = -self._weight
        for along_x in acceleration:
            gravity[0] = -along_x
            step(model, data, substeps)

    def shake(self, acceleration: Sequence[Sequence[float]]) -> None:
        """Step through samples of the table's acceleration along x, y and z [m/s^2]."""
        model, data = self._model, self._data
        for x, y, z in acceleration:
            model.opt.gravity[:] = -x, -y, -self._weight - z
            mujoco.mj_step(model, data, self._substeps)

    def state(self) -> State:
        """Present state in SI units."""
        data, pace = self._data, math.sqrt(self._scale)
        turned = np.empty(9)
        mujoco.mju_quat2Mat(turned, data.qpos[3:] / np.linalg.norm(data.qpos[3:]))
        rotation = turned.reshape(3, 3)
        return State(
            data.qpos[:3] / self._scale,
            rotation @ self._axes.T,
            data.qvel[:3] / pace,
            rotation @ data.qvel[3:] * pace,
        )

    def footing(self) -> tuple[Array, Array]:
        """Points that bore the rock in the last step, and the way the ground pushed there.

        Returns
        -------
        tuple of ndarray, shape (k, 3) [m], and ndarray, shape (k, 3)
        """
        force, data = np.zeros(6), self._data
        bearing = []
        for number, contact in enumerate(data.contact):
            mujoco.mj_contactForce(self._model, data, number, force)
            if force[0] > 0.0:
                bearing.append((contact.pos / self._scale, contact.frame[:3]))
        places, pushes = zip(*bearing, strict=True) if bearing else ((), ())
        return np.array(places).reshape(-1, 3), np.array(pushes).reshape(-1, 3)


def build(
    scene: Scene, time_step: float, substeps: int = 1, solver: Solver | None = None
) -> MujocoWorld:
    """World with the rock at its start.

    The world of an earlier call with the same scene is rewound and no longer valid itself.

    Parameters
    ----------
    time_step : float [s]
    substeps : int, steps for which a sample is held

    Raises
    ------
    InvalidInput
        For a contact that bounces: MuJoCo knows springs and dampers, no coefficient of restitution.
        For springs of a given stiffness, and for a drive, which is not built here.
    """
    if scene.drive is not None:
        raise InvalidInput(
            "a servo in MuJoCo",
            "its scenes are in the table's own frame",
            "use simulation.engine: bullet, or drive: table_frame",
        )
    if scene.contact.stiffness is not None:
        raise InvalidInput(
            f"a contact stiffness of {scene.contact.stiffness:g} N/m in MuJoCo",
            "its springs are relative to the mass that a point of contact feels, not in N/m",
            "use simulation.engine: bullet, or a rigid contact",
        )
    if scene.contact.restitution > 0.0:
        raise InvalidInput(
            f"a restitution of {scene.contact.restitution:g} in MuJoCo",
            "its contacts are springs and have no coefficient of restitution",
            "set contact.restitution: 0, or simulation.engine: bullet",
        )
    world = _worlds.pop(scene, None) or MujocoWorld(scene)
    _worlds[scene] = world
    while len(_worlds) > WORLDS_KEPT:
        _worlds.popitem(last=False)
    world.rewind(time_step, substeps, solver or SOLVER)
    return world


def _model(scene: Scene, scale: float) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = GRIP_RATIO
    # A state that is not finite must be seen, not quietly replaced by the initial one.
    spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_AUTORESET
    rock, contact = scene.rock, scene.contact
    unpaired = {"contype": 0, "conaffinity": 0}
    if scene.pedestal == "plane":
        size = [0.0, 0.0, 1.0]
        spec.worldbody.add_geom(
            name="ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=size, **unpaired
        )
    elif scene.pedestal == "box":
        spec.worldbody.add_geom(
            name="ground",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[20.0, 20.0, 1.0],
            pos=[0.0, 0.0, -1.0],
            **unpaired,
        )
    elif scene.pedestal == "mesh":
        raise InvalidInput(
            "a triangulated pedestal in MuJoCo",
            "it takes the convex hull of any mesh",
            "use simulation.engine: bullet",
        )
    body = add_body(spec, rock)
    body.add_geom(name="rock", **_shape(spec, rock, scale), **unpaired)
    if scene.pedestal != "none":
        rolling = contact.rolling_friction * scale
        spec.add_pair(
            geomname1="ground",
            geomname2="rock",
            friction=[contact.friction] * 2 + [0.0] + [rolling] * 2,
            condim=6 if rolling > 0.0 else 3,
            solimp=[*IMPEDANCE, 0.5, 2.0],
        )
    return spec.compile()


def add_body(spec: mujoco.MjSpec, rock: Rock) -> mujoco.MjsBody:
    """A free body with a rock's inertia, in units of its radius and mass, without a shape."""
    body = spec.worldbody.add_body(
        mass=1.0,
        inertia=(rock.inertia / rock.mass * (1.0 / rock.radius) ** 2).tolist(),
        explicitinertial=True,
        ipos=[0.0, 0.0, 0.0],
    )
    body.add_freejoint()
    return body


def _shape(spec: mujoco.MjSpec, rock: Rock, scale: float) -> dict[str, object]:
    if rock.shape == "box":
        half = np.abs(rock.vertices).max(axis=0) * scale
        return {"type": mujoco.mjtGeom.mjGEOM_BOX, "size": half.tolist()}
    if rock.shape == "sphere":
        return {"type": mujoco.mjtGeom.mjGEOM_SPHERE, "size": [1.0, 0.0, 0.0]}
    corners = rock.vertices @ rock.axes * scale
    spec.add_mesh(
        name="rock",
        uservert=corners.ravel().tolist(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX,
    )
    return {"type": mujoco.mjtGeom.mjGEOM_MESH, "meshname": "rock"}


def _quaternion(rotation: Array) -> Array:
    """Quaternion w, x, y, z, as MuJoCo orders it, of a rotation matrix."""
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, rotation.ravel())
    return quaternion
