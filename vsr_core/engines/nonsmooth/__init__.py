"""The project's own engine: a rigid rock on rigid ground, all contacts of a step solved together.

See ``docs/engine.md`` for its equations. It is of second order in the time step, compiled, and does
whole runs without the interpreter (``vsr_core.run.compiled_runs``).
"""

from __future__ import annotations

import numba

from vsr_core.engines.interface import Ladder, Solver
from vsr_core.engines.nonsmooth.world import NonsmoothWorld
from vsr_core.errors import InvalidInput
from vsr_core.scene import Scene

VERSION = f"numba {numba.__version__}"

SOLVER = Solver(iterations=8, residual=1e-5)
"""Rounds of sweeps where Newton's method finds no end at once, and the error of a velocity, as a
share of what gravity adds in a step."""

LADDER = Ladder(
    (0.03, 0.02, 0.014, 0.01, 0.007, 0.005),
    coarse=0.02,
    reference=0.0025,
    second=0.0035,
    longest=0.03,
)
"""Of second order: the reference is right to a sixtieth of what the coarse one is."""

SLENDER_SHARE = 0.3
"""Longest step of a slender rock, as a share of tan(alpha) sqrt(radius / g). At it blocks of 1:5 to
1:20 swing back to within 0.2 % of Housner's."""

SLIDING_SHARE = 1.0
"""Friction, as a share of tan(alpha), from which to 1 a rock topples that should slide: never."""


def build(
    scene: Scene, time_step: float, substeps: int = 1, solver: Solver | None = None
) -> NonsmoothWorld:
    """World with the rock at its start.

    Parameters
    ----------
    time_step : float [s]
    substeps : int, steps for which a sample is held

    Raises
    ------
    InvalidInput
        For a drive, springs or rolling friction, which are not built here.
    """
    remedy = "use simulation.engine: bullet"
    if scene.drive is not None:
        rule = "its scenes are in the table's own frame"
        raise InvalidInput("a servo in the engine nonsmooth", rule, remedy)
    if scene.contact.stiffness is not None:
        given = f"a contact stiffness of {scene.contact.stiffness:g} N/m in the engine nonsmooth"
        raise InvalidInput(given, "its contacts are rigid", remedy)
    if scene.contact.rolling_friction > 0.0:
        given = (
            f"a rolling friction of {scene.contact.rolling_friction:g} m in the engine nonsmooth"
        )
        raise InvalidInput(given, "its points of contact do not resist turning", remedy)
    return NonsmoothWorld(scene, time_step, substeps, solver or SOLVER)
