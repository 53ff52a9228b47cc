"""Similar blocks under similar pulses move alike: lengths times s go with times times sqrt(s).

Reference
---------
Housner (1963), Bull. Seismol. Soc. Am. 53(2), 403-417: the equation holds size in p^2 = 3 g / (4 R)
alone.
"""

from __future__ import annotations

import math
from functools import cache

from vsr_core.judge.proofs import barrier
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import Response
from vsr_core.run.cases import Case, Settings, prepare
from vsr_core.run.overturning import simulate
from vsr_core.scene import Contact, Scene
from vsr_core.verification.reference import case
from vsr_core.verification.rocks import box

FRICTION = 0.6
"""That of the paper."""

PULSES = ((0.6, 0.15), (0.8, 0.2), (1.1, 0.2), (0.65, 0.3), (1.3, 0.3), (0.7, 0.4))
"""PGA [g] and PGV/PGA [s] of the pulses on the larger block; some overturn it."""


@cache
def _case(width: float) -> Case:
    scene = Scene(box(width, width, 2.0 * width), Contact(FRICTION))
    return prepare(scene, barrier(scene.rock), reduce=True)


def _shaken(width: float, pulse: CosinePulse, engine: str, time_step: float) -> Response:
    return simulate(_case(width), pulse, Settings(time_step, engine=engine))


def _similarity(engine: str, time_step: float) -> float:
    """Largest difference of the peak tilts of two blocks, relative to alpha; 1 if outcomes differ.

    The step is that of the larger block.
    """
    alpha, half = math.atan(0.5), math.sqrt(0.5)
    apart = []
    for pga, pgv_pga in PULSES:
        large = _shaken(1.0, CosinePulse.from_g(pga, pgv_pga), engine, time_step)
        small = _shaken(0.5, CosinePulse.from_g(pga, half * pgv_pga), engine, half * time_step)
        if large.outcome is not small.outcome:
            return 1.0
        apart.append(abs(large.peak_tilt - small.peak_tilt) / alpha)
    return max(apart)


ANSWER = "1x1x2 m at PGV/PGA = x moves as 0.5x0.5x1 m at x / sqrt(2): dimensional analysis"

CASES = (case("similar blocks", ANSWER, 1e-6, _similarity),)
