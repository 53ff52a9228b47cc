"""The published set-up rebuilt, told the paper's coefficients in the ways they can be read."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
import xarray as xr

from pipeline.config.motion_schema import MotionConfig, PulseConfig
from pipeline.config.problems import InputError, Problem
from pipeline.config.schema import SceneSettings
from pipeline.config.sections import Key
from pipeline.stages.mesh.products import Standing
from pipeline.stages.runs.scenes import Group, Scenes, flat_scene
from pipeline.workflow.datasets import described, netcdf
from pipeline.workflow.grammar import counted
from pipeline.workflow.progress import telling
from pipeline.workflow.stage import Product, Work
from pipeline.workflow.workers import Batch
from vsr_core.motions.pulses import CosinePulse
from vsr_core.scene import Scene
from vsr_core.verification.other_engines.published_setup import Coefficients, build

FILE = "as_printed.nc"

FRICTION, RESTITUTION, ROLLING = 0.6, 0.38, 0.6
"""Coefficients that the paper prints for rock on rock."""

TIME_STEP = 1e-3
"""Of the public scripts [s]."""

WIDE = "friction on both, wide table"
"""On two triangles: hardly a border to trip over, and no edge within reach of a sliding block."""

WIDE_TABLE = {"cells": 1.0, "half_width": 40.0}

SETTINGS = {
    "of the pair": Coefficients((FRICTION, 1.0)),
    "friction on both": Coefficients((FRICTION, FRICTION)),
    WIDE: Coefficients((FRICTION, FRICTION)),
    "restitution on both": Coefficients((FRICTION, 1.0), (RESTITUTION, RESTITUTION)),
    "rolling on both": Coefficients((FRICTION, 1.0), rolling=(ROLLING, ROLLING)),
    "all on both": Coefficients(
        (FRICTION, FRICTION), (RESTITUTION, RESTITUTION), (ROLLING, ROLLING)
    ),
}
"""What Bullet is told, by name."""

CELLS = 7
"""Values of PGA and of PGV/PGA, from the site's: a run takes some tenths of a second."""

OVERTURNED = 1.0
"""Largest tilt from which the public scripts call a rock toppled [rad]."""


def make(
    work: Work,
    settings: SceneSettings,
    yaw: Annotated[tuple[float, ...], Key("yaw")],
    motion: MotionConfig,
    standing: Standing,
) -> Product:
    """Run a thin grid of pulses with each setting."""
    if not isinstance(motion, PulseConfig):
        rule, remedy = "the grid is one of cosine pulses", "use a site or study of cosine pulses"
        file = work.origin.file_of("motion.kind")
        raise InputError(Problem(file, "motion.kind", repr(motion.kind), rule, remedy))
    pga, ratios = thinned(motion.pga), thinned(motion.pgv_pga)
    group = Group(yaw[0], settings.contact.friction[0])
    scene = flat_scene(Scenes(settings, standing), group)
    batches = (Batch(name, ((ratio, level),)) for name in SETTINGS for ratio in ratios
               for level in pga)  # fmt: skip
    runs = counted(len(SETTINGS) * len(ratios) * len(pga), "run")
    with telling(work.stage, f"{runs} with {len(SETTINGS)} settings", work.log):
        verdicts = work.cluster.each(run_cells, batches, lambda name: (name, scene))
        done = {(name, *cell): verdict for name, cell, verdict in verdicts}
    outcomes = np.array(
        [[[done[name, ratio, level] for level in pga] for ratio in ratios] for name in SETTINGS],
        float,
    )
    outcomes = np.where(np.isnan(outcomes), -1, outcomes).astype("i1")
    dataset = xr.Dataset(
        {"overturned": (("setting", "pgv_pga", "pga"), outcomes)},
        {"setting": list(SETTINGS), "pgv_pga": list(ratios), "pga": list(pga)},
    )
    shares = ", ".join(f"{name} {100 * (grid == 1).mean():.0f} %"
                       for name, grid in zip(SETTINGS, outcomes, strict=True))  # fmt: skip
    return Product({FILE: netcdf(described(dataset, work, "As printed"))}, f"toppled: {shares}")


def thinned(values: tuple[float, ...]) -> tuple[float, ...]:
    """Some of many values, evenly spaced, from after the first to the last.

    Examples
    --------
    >>> thinned(tuple(range(15)))
    (2, 5, 8, 11, 14)
    """
    every = -(-len(values) // CELLS)
    return values[::-1][::every][:CELLS][::-1]


def run_cells(
    shared: tuple[str, Scene], cells: tuple[tuple[float, float], ...]
) -> list[float | None]:
    """Run pulses in a setting, on a worker.

    Parameters
    ----------
    cells : tuple of PGV/PGA [s] and PGA [g]
    """
    name, scene = shared
    table = WIDE_TABLE if name == WIDE else {}
    test = build(scene, {"time_step": TIME_STEP, **table}, SETTINGS[name])
    tilts = [test(CosinePulse.from_g(pga, ratio)) for ratio, pga in cells]
    return [None if math.isnan(tilt) else float(tilt > OVERTURNED) for tilt in tilts]
