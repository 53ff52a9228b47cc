"""Motions: the grid of cosine pulses as the table would be driven, or the records as processed."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
import xarray as xr

from pipeline.config.layers import Site
from pipeline.config.motion_schema import PulseConfig, RecordConfig, TableMotionConfig
from pipeline.stages.motions import record_inputs, table_motions
from pipeline.stages.motions.record_inputs import Ready
from pipeline.stages.motions.shaking import FILE
from pipeline.workflow.datasets import described, netcdf
from pipeline.workflow.stage import Job, Product
from vsr_core import GRAVITY
from vsr_core.motions.records.measures import spectrum
from vsr_core.motions.records.trace import Trace

MEASURES = {
    "pga": "record_pga",
    "pgv": "record_pgv",
    "pgd": "record_pgd",
    "pgv_pga": "pgv_pga",
    "sa_1hz": "sa_1hz",
    "sa_2hz": "sa_2hz",
    "arias": "arias",
    "cav": "cav",
    "significant_duration": "significant_duration",
}
"""Variables of the intensity measures, by their names in `vsr_core.motions.records.measures`."""

IN_G = ("record_pga", "sa_1hz", "sa_2hz")

OSCILLATORS = 90
"""Frequencies of the response spectrum, evenly in their logarithm from 0.1 to 50 Hz."""


def make(job: Job) -> Product:
    """The motions of the configuration's kind."""
    motion = job.config.motion
    if isinstance(motion, PulseConfig):
        dataset, summary = _pulses(motion.pgv_pga, motion.pga)
    elif isinstance(motion, TableMotionConfig) and motion.pulses:
        assert motion.pgv_pga is not None
        dataset, summary = _pulses(motion.pgv_pga, motion.pga)
        axes = table_motions.named(motion.pulses)
        dataset.attrs["axes"] = axes
        summary += f" of {axes}"
    elif isinstance(motion, TableMotionConfig):
        dataset, summary = table_motions.dataset(job, motion)
    else:
        dataset, summary = _records(job, motion)
    return Product({FILE: netcdf(described(dataset, job, "Ground motions"))}, summary)


def _pulses(ratios: tuple[float, ...], peaks: tuple[float, ...]) -> tuple[xr.Dataset, str]:
    """Frequency, amplitude, PGV and duration of every pulse (paper's Eqs 8-10)."""
    pga, pgv_pga = np.array(peaks), np.array(ratios)
    frequency = 1.0 / (2.0 * np.pi * pgv_pga)
    dataset = xr.Dataset(
        {
            "frequency": ("pgv_pga", frequency),
            "duration": ("pgv_pga", 1.0 / frequency),
            "amplitude": (("pgv_pga", "pga"), np.outer(pgv_pga**2, GRAVITY * pga)),
            "pgv": (("pgv_pga", "pga"), np.outer(pgv_pga, GRAVITY * pga)),
        },
        {"pga": pga, "pgv_pga": pgv_pga},
    )
    shaking = pga.size * float((1.0 / frequency).sum())
    return dataset, f"{pgv_pga.size} x {pga.size} cosine pulses, {shaking:.0f} s of shaking"


def _records(job: Job, motion: RecordConfig) -> tuple[xr.Dataset, str]:
    """Every record as processed, its measures, and what it was before."""
    ready = record_inputs.load(job.site, motion)
    frequency = np.geomspace(0.1, 50.0, OSCILLATORS)
    dataset = xr.Dataset(
        {
            "record_size": ("record", np.array([len(r.trace.times) for r in ready], np.int32)),
            "interval": ("record", [r.trace.interval for r in ready]),
            "raw_size": ("record", np.array([len(r.record.acceleration) for r in ready], np.int32)),
            "raw_interval": ("record", [r.record.interval for r in ready]),
            "raw_start": ("record", [_start(r) for r in ready]),
            **{
                name: ("sample", np.concatenate([getattr(r.trace, name) for r in ready]))
                for name in ("acceleration", "velocity", "displacement")
            },
            "raw_acceleration": ("raw_sample", _joined(ready)),
            **_spectra(ready, frequency),
            **{name: ("record", words) for name, words in _words(ready).items()},
        },
        {
            "record": [r.name for r in ready],
            **{name: ("record", values) for name, values in measured(ready).items()},
            "oscillator_frequency": frequency,
        },
    )
    dataset["record_size"].attrs["sample_dimension"] = "sample"
    dataset["raw_size"].attrs["sample_dimension"] = "raw_sample"
    repaired = sum(bool(r.record.repairs) for r in ready)
    shaking = len(motion.pga) * sum(r.trace.duration for r in ready)
    summary = f"{len(ready)} records x {len(motion.pga)} PGA, {shaking:.0f} s of shaking"
    return dataset, summary + (f"; {repaired} records were repaired" if repaired else "")


def measured(ready: tuple[Ready, ...]) -> dict[str, list[float]]:
    """Intensity measures of each record, by the names of their variables."""
    rows = [asdict(r.measures) for r in ready]
    return {
        name: [row[own] / (GRAVITY if name in IN_G else 1.0) for row in rows]
        for own, name in MEASURES.items()
    }


def _start(one: Ready) -> float:
    """Time of the first sample as recorded, since the start of the processed motion [s]."""
    longer = one.trace.duration - (len(one.record.acceleration) - 1) * one.record.interval
    return max(0.0, 0.5 * longer) if longer > one.trace.interval else 0.0


def _joined(ready: tuple[Ready, ...]) -> Any:
    return np.concatenate([r.record.acceleration for r in ready])


def _spectra(ready: tuple[Ready, ...], frequency: Any) -> dict[str, Any]:
    raw = [Trace(r.record.acceleration, r.record.interval) for r in ready]
    return {
        name: (
            ("record", "oscillator_frequency"),
            np.array([spectrum(trace, frequency) / GRAVITY for trace in traces]),
        )
        for name, traces in (
            ("spectral_acceleration", [r.trace for r in ready]),
            ("raw_spectral_acceleration", raw),
        )
    }


def _words(ready: tuple[Ready, ...]) -> dict[str, list[str]]:
    return {
        "station": [r.record.station for r in ready],
        "channel": [r.record.channels[0] for r in ready],
        "record_source": [r.record.source for r in ready],
        "record_unit": [r.record.unit for r in ready],
        "repairs": ["; ".join(r.record.repairs) for r in ready],
    }


def inputs(site: Site) -> dict[str, str]:
    """Digests of the files of the motions, whatever their kind."""
    return record_inputs.digests(site) | table_motions.digests(site)
