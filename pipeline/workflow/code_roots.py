"""Roots of the code that decides results which are reached through a variable or on a worker."""

from __future__ import annotations

RUN_CODE = (
    "vsr_core.run.cases:prepare",
    "vsr_core.run.overturning:simulate",
    "vsr_core.judge.proofs:barrier",
    "vsr_core.motions.pulses:CosinePulse",
)
"""What determines a run on a flat pedestal, besides its engine and its kind of motion."""

TERRAIN_CODE = (
    *RUN_CODE,
    "vsr_core.run.displacement:displace",
    "vsr_core.run.movement:air_share",
    "pipeline.stages.runs.scenes:terrain_case",
)
"""The same on a terrain."""

ENGINES = ("vsr_core.engines.bullet", "vsr_core.engines.mujoco", "vsr_core.engines.nonsmooth")
"""Modules of all engines, which are found by name only."""

RECORD_CODE = ("vsr_core.motions.records.trace:RecordedMotion",)
TABLE_CODE = ("vsr_core.motions.sampled:SampledMotion",)
AXIS_CODE = ("vsr_core.motions.six_axes:AxisPulses", "vsr_core.motions.six_axes:AxisPulse")
VALIDATION_CODE = (
    "vsr_core.validation.specimen:standing_case",
    "vsr_core.validation.specimen:shaken",
    "vsr_core.validation.specimen:drawn",
    "vsr_core.engines.nonsmooth:build",
)
"""What determines the runs of recorded shake-table tests."""
