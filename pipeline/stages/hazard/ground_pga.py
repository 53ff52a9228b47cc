"""Motions of a table whose PGA is that of the ground, as a hazard has it."""

from __future__ import annotations

import numpy as np

from pipeline.config.layers import Site
from pipeline.config.motion_schema import TableMotionConfig
from pipeline.config.problems import InputError, Problem
from pipeline.stages.motions import motion_grid
from pipeline.stages.motions.motion_grid import Cell
from vsr_core import GRAVITY

ALIKE = 0.05
"""Share by which the peak along x or y may differ from the PGA: of tables it counts z and tilt."""

_SAMPLES = 10
"""In the shortest time of a motion, as files have them."""


def check_pga(site: Site) -> None:
    """Refuse motions of a table whose PGA is not their peak along x or y.

    Raises
    ------
    InputError
    """
    if not isinstance(site.config.motion, TableMotionConfig):
        return
    shaking = motion_grid.of_site(site)
    for number, row in enumerate(shaking.rows):
        motion = shaking.motion(Cell(number, 1.0))
        times = np.arange(0.0, motion.duration, motion.shortest_time / _SAMPLES)
        level = motion.acceleration(times).reshape(len(times), -1)[:, :2]
        peak = float(np.abs(level).max()) / GRAVITY
        if abs(peak - 1.0) > ALIKE:
            key = "motion.pulses" if site.config.motion.pulses else "motion.files"
            what = f"PGV/PGA {row:g} s" if isinstance(row, float) else str(row)
            given = f"a peak of {peak:.3g} PGA along x and y ({what})"
            rule = "the PGA of a hazard is that of the larger horizontal component"
            remedy = "change the ratios of the pulses, or give what was recorded as kind: record"
            raise InputError(Problem(site.file_of(key), key, given, rule, remedy))
