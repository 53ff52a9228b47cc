"""The project's own engine: a rigid rock on rigid ground, all contacts of a step solved at once."""

from __future__ import annotations

from vsr_core.engines.interface import Solver
from vsr_core.engines.nonsmooth.world import NonsmoothWorld
from vsr_core.scene import Scene

VERSION = "1"

SOLVER = Solver(iterations=1, residual=1e-5)

SLENDER_SHARE = 0.2
SLIDING_SHARE = 1.0


def build(
    scene: Scene, time_step: float, substeps: int = 1, solver: Solver | None = None
) -> NonsmoothWorld:
    return NonsmoothWorld(scene, time_step, substeps, solver or SOLVER)
