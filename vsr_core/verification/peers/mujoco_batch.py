"""MuJoCo's batch of simulations, stepped in native code, with contacts as stiff as the step allows.

The same model as ``mujoco_stiff`` and the same outcomes: the table's acceleration is a force on
the centre of mass, for gravity is no input of a rollout (it can be set for each simulation between
two calls). A batch of one, as here, costs a tenth more than a loop in Python. In a batch of 64
pulses a step costs about a tenth less, and several cores are filled without further processes.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from vsr_core.motions.cosine_pulse import CosinePulse
from vsr_core.scene import Scene
from vsr_core.verification.peers import Setting, Test, accelerations, largest_tilt, tilt_of
from vsr_core.verification.peers.mujoco_default import NEEDS as NEEDS
from vsr_core.verification.peers.mujoco_default import SWEEP as SWEEP
from vsr_core.verification.peers.mujoco_default import model_of
from vsr_core.verification.peers.mujoco_stiff import SPRING_STEPS

LABEL = "MuJoCo, batch"

FORCE_X = 6
"""Force along x on the rock among the forces and torques on all bodies, the world's first."""


def build(scene: Scene, setting: Setting) -> Test:
    """Test in a batch of one simulation, on the thread of the caller.

    Parameters
    ----------
    scene : Scene
    setting : dict of float, one of ``SWEEP``

    Returns
    -------
    Test
    """
    import mujoco
    from mujoco.batch import Batch

    time_step, mass = setting["time_step"], scene.rock.mass
    batch = Batch(model_of(scene, time_step, SPRING_STEPS * time_step), nsim=1, nthread=1)
    quaternion = batch.bind("qpos")[0, 3:]
    forces = int(mujoco.mjtState.mjSTATE_XFRC_APPLIED)

    def advance(values: Iterable[float]) -> None:
        along_x = np.array(list(values))
        control = np.zeros((1, len(along_x), 12))
        control[0, :, FORCE_X] = -mass * along_x
        batch.rollout(len(along_x), control, forces, record=())

    def tilt() -> float:
        return tilt_of(quaternion.tolist())

    def test(pulse: CosinePulse) -> float:
        batch.reset()
        return largest_tilt(advance, tilt, accelerations(pulse, time_step))

    return test
