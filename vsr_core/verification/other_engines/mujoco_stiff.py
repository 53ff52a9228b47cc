"""MuJoCo with contacts as stiff as the step allows, in the table's own frame."""

from __future__ import annotations

from vsr_core.scene import Scene
from vsr_core.verification.other_engines import Setting, Test
from vsr_core.verification.other_engines.mujoco_default import NEEDS as NEEDS
from vsr_core.verification.other_engines.mujoco_default import SWEEP as SWEEP
from vsr_core.verification.other_engines.mujoco_default import with_contact

LABEL = "MuJoCo, stiff contact"

SPRING_STEPS = 2.0
"""Time constant of a contact in steps; MuJoCo takes no less."""


def build(scene: Scene, setting: Setting) -> Test:
    """Test with contacts whose time constant follows the step."""
    time_step = setting["time_step"]
    return with_contact(scene, time_step, SPRING_STEPS * time_step)
