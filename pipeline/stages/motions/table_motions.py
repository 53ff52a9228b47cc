"""Motions of a table in several axes: from their files to `motions.nc`, and back from there."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from pipeline.config import in_si
from pipeline.config.layers import Origin
from pipeline.config.motion_schema import AxisPulseConfig
from pipeline.stages.motions import record_inputs, table_files
from pipeline.workflow.datasets import split
from vsr_core.errors import InvalidInput
from vsr_core.motions.sampled import SampledMotion

Loaded = tuple[tuple[str, ...], tuple["SampledMotion", ...], tuple[float, ...]]
"""Names, motions and their PGV/PGA [s], by ascending PGV/PGA."""


def of_files(origin: Origin, paths: list[Path]) -> Loaded:
    """The motions in files of a site."""
    file = origin.file_of("motion.files")
    motions = record_inputs.each(file, paths, lambda path: _moving(table_files.load(path)))
    found = dict(zip((path.stem for path in paths), motions, strict=True))
    ratios = {name: one.peak_velocity / one.peak_acceleration for name, one in found.items()}
    names = tuple(sorted(found, key=lambda name: (ratios[name], name)))
    return names, tuple(found[name] for name in names), tuple(ratios[name] for name in names)


def dataset(loaded: Loaded, pga: tuple[float, ...]) -> tuple[xr.Dataset, str]:
    """The motions as they are in the files, and their peaks."""
    names, motions, ratios = loaded
    samples = np.concatenate([one.samples for one in motions])
    data = xr.Dataset(
        {
            "record_size": ("record", np.array([len(one.time) for one in motions], np.int32)),
            "table_time": ("sample", np.concatenate([one.time for one in motions])),
            "table_position": (("sample", "xyz"), samples[:, :3]),
            "table_angle": (("sample", "angle"), samples[:, 3:]),
        },
        {
            "record": list(names),
            "pgv_pga": ("record", list(ratios)),
            "record_pga": ("record", [in_si.in_g(one.peak_acceleration) for one in motions]),
            "record_pgv": ("record", [one.peak_velocity for one in motions]),
        },
    )
    data["record_size"].attrs["sample_dimension"] = "sample"
    turning = sum(one.turns for one in motions)
    shaking = len(pga) * sum(one.duration for one in motions)
    summary = f"{len(names)} motions of a table x {len(pga)} PGA, {shaking:.0f} s of shaking"
    return data, summary + (f"; {turning} of them turn it" if turning else "")


def of_dataset(data: Any) -> Loaded:
    """The motions from the product."""
    motions = tuple(
        SampledMotion(
            one["table_time"].values,
            np.hstack([one["table_position"].values, one["table_angle"].values]),
        )
        for one in split(data, "record_size")
    )
    names = tuple(str(name) for name in data["record"].values)
    return names, motions, tuple(float(ratio) for ratio in data["pgv_pga"].values)


def named(pulses: tuple[AxisPulseConfig, ...]) -> str:
    """Pulses on axes in words.

    Returns
    -------
    str, e.g. "x, 0.5 z of 0.2 s"
    """
    words = []
    for pulse in pulses:
        share = "" if pulse.pga_ratio == 1.0 else f"{pulse.pga_ratio:g} "
        own = "" if pulse.pgv_pga is None else f" of {pulse.pgv_pga:g} s"
        words.append(f"{share}{pulse.axis}{own}")
    return ", ".join(words)


def _moving(motion: SampledMotion) -> SampledMotion:
    if motion.peak_acceleration == 0.0:
        raise InvalidInput("a table that never moves", "it is scaled to each PGA", "leave it out")
    return motion
