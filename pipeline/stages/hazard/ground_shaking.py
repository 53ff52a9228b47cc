"""Motions of a table whose PGA and PGV are those of the ground, as a hazard has them."""

from __future__ import annotations

import numpy as np
from scipy.integrate import cumulative_trapezoid

from pipeline.config.layers import Site
from pipeline.config.motion_schema import TableMotionConfig
from pipeline.config.problems import InputError, Problem
from pipeline.stages.motions import motion_grid
from pipeline.stages.motions.motion_grid import Cell
from vsr_core import GRAVITY
from vsr_core.motions.ground_motion import GroundMotion

ALIKE = 0.05
"""Share by which peaks along x or y may differ from those of the row, which count z and tilt."""

_SAMPLES = 10
"""In the shortest time of a motion, as files have them."""


def check_peaks(site: Site) -> None:
    """Refuse motions of a table whose PGA or PGV/PGA is not that of their shaking along x or y.

    Raises
    ------
    InputError
    """
    if not isinstance(site.config.motion, TableMotionConfig):
        return
    shaking = motion_grid.of_site(site)
    for number, (row, ratio) in enumerate(zip(shaking.rows, shaking.pgv_pga, strict=True)):
        pga, pgv_pga = _along_x_or_y(shaking.motion(Cell(number, 1.0)))
        if abs(pga - 1.0) > ALIKE:
            given = f"a peak of {pga:.3g} PGA along x and y"
        elif abs(pgv_pga / ratio - 1.0) > ALIKE:
            given = f"a PGV/PGA of {pgv_pga:.3g} s along x and y"
        else:
            continue
        key = "motion.pulses" if site.config.motion.pulses else "motion.files"
        given += f" (PGV/PGA {row:g} s)" if isinstance(row, float) else f" ({row}: {ratio:.3g} s)"
        rule = "the PGA and PGV of a hazard are those of the larger horizontal component"
        remedy = "change the ratios of the pulses, or give what was recorded as kind: record"
        raise InputError(Problem(site.file_of(key), key, given, rule, remedy))


def _along_x_or_y(motion: GroundMotion) -> tuple[float, float]:
    """PGA [g] and PGV/PGA [s] of the larger of both, of what a rock on the table feels."""
    times = np.arange(0.0, motion.duration, motion.shortest_time / _SAMPLES)
    level = motion.acceleration(times).reshape(len(times), -1)[:, :2]
    pga = float(np.abs(level).max())
    pgv = float(np.abs(cumulative_trapezoid(level, times, axis=0)).max())
    return pga / GRAVITY, pgv / pga if pga else 0.0
