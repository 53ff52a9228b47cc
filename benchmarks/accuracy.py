"""Error of the overturning boundary against Housner's block, over time step and solver."""

from __future__ import annotations

import math
import time

import numpy as np

from vsr_core import GRAVITY, bounds, solid
from vsr_core.motion import CosinePulse
from vsr_core.outcome import Outcome
from vsr_core.rocking import Block, first_overturning_pga
from vsr_core.scene import Contact, Scene
from vsr_core.simulate import Case, Settings, automatic_time_step, prepare, simulate

# Blocks and PGV/PGA [s] at which fewer than four impacts decide (else the response is chaotic).
CASES = (
    ((1.0, 1.0, 2.0), (0.15, 0.2, 0.25)),
    ((0.5, 0.5, 1.0), (0.1, 0.15)),
    ((1.0, 1.0, 3.0), (0.15, 0.2, 0.25)),
    ((0.11, 0.11, 0.55), (0.1,)),
)

TOLERANCES = (0.03, 0.01, 0.005)

Row = tuple[str, str, str]


def blocks() -> list[Row]:
    """Largest error of the boundary and CPU per run, for several tolerances."""
    rows = []
    for tolerance in TOLERANCES:
        worst, seconds, number = 0.0, 0.0, 0
        for size, ratios in CASES:
            case, block = _case(size)
            settings = Settings(automatic_time_step(case.full.rock, tolerance))
            for ratio in ratios:
                exact = first_overturning_pga(block, ratio, 1.6 * GRAVITY, 0.002 * GRAVITY)
                start = time.process_time()
                found, tried = _first(case, settings, ratio, exact)
                seconds, number = seconds + time.process_time() - start, number + tried
                worst = max(worst, abs(found / exact - 1.0))
        text = f"{100 * worst:.2f} %, {1e3 * seconds / number:.1f} ms"
        rows.append(
            (f"Housner's block, tolerance {tolerance:.1%}: worst error, CPU a run", text, "")
        )
    return rows


def _case(size: tuple[float, float, float]) -> tuple[Case, Block]:
    rock = solid.box(size, 2110.0).rock
    case = prepare(Scene(rock, Contact(10.0)), bounds.barrier(rock), reduce=True)
    return case, Block(size[0] / 2, size[2] / 2)


def _first(case: Case, settings: Settings, ratio: float, near: float) -> tuple[float, int]:
    """First overturning PGA [m/s^2] on a grid of 0.2 % around ``near``, and the runs it took."""
    grid = near * np.linspace(0.94, 1.06, 61)
    for number, pga in enumerate(grid, 1):
        response = simulate(case, CosinePulse(float(pga), ratio), settings)
        if response.outcome is Outcome.OVERTURNED:
            return float(pga), number
    return math.inf, len(grid)
