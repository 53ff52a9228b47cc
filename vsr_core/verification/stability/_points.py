"""A rock on the points that bear it, in an engine that is not ours."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.engines.mujoco import add_body
from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.rock.body import Rock

SPHERE_SHARE = 1e-4
"""Radius of the sphere that a point is, as a share of the rock's."""

CONTACTS = ((2e-4, 4.0), (4e-4, 4.0), (2e-4, 2.0), (2e-4, 8.0))
"""Time steps in units of sqrt(radius / g), and time constants of the contact in time steps.

The first is the finest and the one to compare with; by the others, its own answer changes.
"""

_STEPS_A_LOOK = 10

_GRIP_RATIO = 100.0  # of friction's stiffness to that of the contact: what bears does not creep


def tilts(
    rock: Rock,
    points: Array,
    upward: Array,
    friction: float,
    motion: GroundMotion,
    rest: float,
    step_share: float,
    spring: float,
) -> Array:
    """Angles from the start [rad], by MuJoCo, one every ten steps.

    Parameters
    ----------
    points, upward : ndarray, shape (k, 3), of the site's frame [m], and unit normals there
    motion : GroundMotion, along +x
    rest : float [s], time after the motion
    step_share : float, time step in units of sqrt(radius / g)
    spring : float, time constant of the contact in time steps
    """
    model = _model(rock, points, upward, friction, step_share, spring)
    data = mujoco.MjData(model)
    data.qpos[:3] = 0.0, 0.0, rock.height / rock.radius
    mujoco.mju_mat2Quat(data.qpos[3:7], rock.axes.ravel())
    start = data.qpos[3:7].copy()
    step = model.opt.timestep * math.sqrt(rock.radius)
    looks = math.ceil((motion.duration + rest) / step / _STEPS_A_LOOK)
    middles = (np.arange(looks) + 0.5) * _STEPS_A_LOOK * step
    cosines = np.empty(looks)
    for look, along_x in enumerate(motion.acceleration(middles).tolist()):
        model.opt.gravity[0] = -along_x
        mujoco.mj_step(model, data, _STEPS_A_LOOK)
        cosines[look] = abs(data.qpos[3:7] @ start)
    return np.asarray(2.0 * np.arccos(np.minimum(cosines, 1.0)))


def _model(
    rock: Rock, points: Array, upward: Array, friction: float, step_share: float, spring: float
) -> mujoco.MjModel:
    """Spheres that touch from below, and the rock, of radius 1 and mass 1."""
    scale = 1.0 / rock.radius
    spec = mujoco.MjSpec()
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = _GRIP_RATIO
    # Contacts at rest are 1e-6 radii deep; MuJoCo's own tolerances are no finer.
    spec.option.ccd_tolerance, spec.option.ccd_iterations = 1e-12, 200
    spec.option.tolerance, spec.option.iterations = 1e-12, 300
    spec.option.timestep = step_share / math.sqrt(GRAVITY)
    spec.option.gravity = [0.0, 0.0, -GRAVITY]
    unpaired = {"contype": 0, "conaffinity": 0}
    body = add_body(spec, rock)
    spec.add_mesh(
        name="rock",
        uservert=(rock.vertices @ rock.axes * scale).ravel().tolist(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX,
    )
    body.add_geom(name="rock", type=mujoco.mjtGeom.mjGEOM_MESH, meshname="rock", **unpaired)
    yielding = [spring * spec.option.timestep, 2.0]
    for k, (point, up) in enumerate(zip(points, upward, strict=True)):
        spec.worldbody.add_geom(
            name=f"point {k}",
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[SPHERE_SHARE, 0.0, 0.0],
            pos=(point * scale - SPHERE_SHARE * up).tolist(),
            **unpaired,
        )
        spec.add_pair(
            geomname1=f"point {k}",
            geomname2="rock",
            friction=[friction] * 2 + [0.0] * 3,
            condim=3,
            solref=yielding,
            solreffriction=yielding,
        )
    return spec.compile()
