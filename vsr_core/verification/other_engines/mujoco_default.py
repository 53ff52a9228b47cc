"""MuJoCo with its default soft contact, in the table's own frame."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from vsr_core.motions.pulses import CosinePulse
from vsr_core.scene import Scene, resting
from vsr_core.verification.other_engines import (
    Setting,
    Test,
    accelerations,
    inertia,
    largest_tilt,
    tilt_of,
)

if TYPE_CHECKING:
    import mujoco

LABEL = "MuJoCo, default contact"
NEEDS = ("mujoco",)
SWEEP = tuple({"time_step": step} for step in (1.6e-2, 8e-3, 4e-3, 2e-3, 1e-3, 5e-4))

TIME_CONSTANT = 0.02
"""MuJoCo's default time constant of a contact [s]."""


def build(scene: Scene, setting: Setting) -> Test:
    """Test with contacts that yield over ``TIME_CONSTANT``, whatever the step."""
    return with_contact(scene, setting["time_step"], TIME_CONSTANT)


def with_contact(scene: Scene, time_step: float, time_constant: float) -> Test:
    """Test with critically damped contacts of a ``time_constant`` [s].

    Parameters
    ----------
    time_step : float [s]
    time_constant : float [s], of the contacts
    """
    import mujoco

    model = model_of(scene, time_step, time_constant)
    data = mujoco.MjData(model)
    gravity, quaternion, step = model.opt.gravity, data.qpos[3:], mujoco.mj_step

    def advance(values: Iterable[float]) -> None:
        for along_x in values:
            gravity[0] = -along_x
            step(model, data)

    def tilt() -> float:
        return tilt_of(quaternion.tolist())

    def test(pulse: CosinePulse) -> float:
        mujoco.mj_resetData(model, data)
        return largest_tilt(advance, tilt, accelerations(pulse, time_step))

    return test


def model_of(scene: Scene, time_step: float, time_constant: float) -> mujoco.MjModel:
    """Model of a rock at rest on a plane, with critically damped contacts.

    Parameters
    ----------
    time_step : float [s]
    time_constant : float [s], of the contacts
    """
    import mujoco

    spec, rock, start = mujoco.MjSpec(), scene.rock, resting(scene)
    spec.option.timestep = time_step
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.gravity = [0.0, 0.0, -scene.gravity]
    # A state that is not finite must be seen, not quietly replaced by the initial one, nor printed.
    spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_AUTORESET
    mujoco.set_mju_user_warning(lambda message: None)
    contact = {
        "friction": [scene.contact.friction, 0.0, 0.0],
        "condim": 3,
        "solref": [time_constant, 1.0],
    }
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0], **contact)
    moments = inertia(rock)
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, start.rotation.ravel())
    body = spec.worldbody.add_body(
        pos=start.position,
        quat=quaternion,
        mass=rock.mass,
        ipos=[0.0, 0.0, 0.0],
        fullinertia=[*moments.diagonal(), moments[0, 1], moments[0, 2], moments[1, 2]],
        explicitinertial=True,
    )
    body.add_freejoint()
    if rock.shape == "box":
        half = np.abs(rock.vertices).max(axis=0)
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=half, **contact)
    else:
        spec.add_mesh(name="rock", uservert=rock.vertices.ravel())
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="rock", **contact)
    return spec.compile()
