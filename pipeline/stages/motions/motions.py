"""Motions: the grid of pulses as the table would be driven, or the records as processed."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from pipeline.config import in_si
from pipeline.config.motion_schema import MotionConfig, PulseGrid, RecordConfig, TableMotionConfig
from pipeline.stages.motions import table_motions
from pipeline.stages.motions.motion_grid import SHAPES, MotionData, MotionFiles
from pipeline.stages.motions.record_inputs import Ready, unread
from pipeline.workflow.datasets import described, netcdf
from pipeline.workflow.grammar import counted
from pipeline.workflow.stage import Product, Work
from vsr_core.motions.records.trace import Trace, spectrum

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
"""Variables of the intensity measures, by their names in `vsr_core.motions.records.trace`."""

_IN_G = ("record_pga", "sa_1hz", "sa_2hz")

_OSCILLATORS = 90
"""Frequencies of the response spectrum, evenly in their logarithm from 0.1 to 50 Hz."""


def make(work: Work, motion: MotionConfig, files: MotionFiles | None) -> Product:
    """Make the motions of the configuration's kind."""
    if isinstance(motion, PulseGrid):
        dataset, summary = _pulses(motion.pgv_pga, motion.pga, motion.kind)
    elif isinstance(motion, TableMotionConfig) and motion.pulses:
        assert motion.pgv_pga is not None
        dataset, summary = _pulses(motion.pgv_pga, motion.pga, "cosine_pulse")
        axes = table_motions.named(motion.pulses)
        dataset.attrs["axes"] = axes
        summary += f" of {axes}"
        own = (one.pgv_pga for one in motion.pulses if one.pgv_pga is not None)
        longest = max((SHAPES["cosine_pulse"](1.0, one).duration for one in own), default=0.0)
        dataset["duration"] = np.maximum(dataset["duration"], longest)
        for name in ("frequency", "amplitude", "pgv"):
            dataset[name].attrs["comment"] = "of an axis with pga_ratio 1 and the grid's PGV/PGA"
    else:
        assert files is not None
        dataset, summary = _given(work, motion, files)
    dataset = described(dataset, work, "Ground motions")
    if "velocity" in dataset:  # in the catalogue it is that of a rock
        dataset["velocity"].attrs["long_name"] = "ground velocity"
    made = {MotionData.FILE: netcdf(dataset)}
    return Product(made, summary)


def _given(
    work: Work, motion: RecordConfig | TableMotionConfig, files: MotionFiles
) -> tuple[xr.Dataset, str]:
    """The motions in files, and in the log what is in doubt of them."""
    for line in unread(work.origin, motion.files or ()):
        work.log(f"motions: {line}")
    if files.tables is None:
        for one in files.records:
            for doubt in one.doubts:
                work.log(f"motions: {one.file}: {doubt}")
        return _records(files.records, motion.pga)
    dataset, summary = table_motions.dataset(files.tables, motion.pga)
    for name, doubt in zip(dataset["record"].values, dataset["repairs"].values, strict=True):
        if doubt:
            work.log(f"motions: {name}: {doubt}")
    return dataset, summary


def _pulses(
    ratios: tuple[float, ...], peaks: tuple[float, ...], kind: str
) -> tuple[xr.Dataset, str]:
    """Frequency, amplitude, PGV and duration of every pulse (paper's Eqs 8-10)."""
    pga, pgv_pga = np.array(peaks), np.array(ratios)
    pulses = [SHAPES[kind](1.0, ratio) for ratio in ratios]
    duration = np.array([pulse.duration for pulse in pulses])
    radian = np.array([pulse.shortest_time for pulse in pulses])
    ways = [pulse.displacement(np.array([0.0, 0.5, 1.0]) * pulse.duration) for pulse in pulses]
    amplitude = 0.5 * np.ptp(ways, axis=1)
    dataset = xr.Dataset(
        {
            "frequency": ("pgv_pga", 0.5 / (np.pi * radian)),
            "duration": ("pgv_pga", duration),
            "amplitude": (("pgv_pga", "pga"), np.outer(amplitude, in_si.acceleration(pga))),
            "pgv": (("pgv_pga", "pga"), np.outer(pgv_pga, in_si.acceleration(pga))),
        },
        {"pga": pga, "pgv_pga": pgv_pga},
    )
    shaking = pga.size * float(duration.sum())
    name = kind.replace("_", " ")
    return dataset, f"{pgv_pga.size} x {pga.size} {name}s, {shaking:.0f} s of shaking"


def _records(ready: tuple[Ready, ...], pga: tuple[float, ...]) -> tuple[xr.Dataset, str]:
    """Every record as processed, its measures, and what it was before."""
    frequency = np.geomspace(0.1, 50.0, _OSCILLATORS)
    table = pd.DataFrame([_facts(one) for one in ready]).set_index("record")
    sizes = dict.fromkeys(("record_size", "raw_size"), np.int32)
    dataset = table.astype(sizes).to_xarray().set_coords(list(MEASURES.values()))
    for name in ("acceleration", "velocity", "displacement"):
        dataset[name] = ("sample", np.concatenate([getattr(one.trace, name) for one in ready]))
    along = [one.components for one in ready if one.components is not None]
    if along:
        samples = np.concatenate([one.acceleration for one in along])
        dataset["component_acceleration"] = (("sample", "xyz"), samples)
        dataset["azimuth"] = ("record", [round(in_si.in_degrees(one.azimuth), 9) for one in along])
        dataset["components"] = ("record", [one.told for one in ready])
    raw = [Trace(one.record.acceleration, one.record.interval) for one in ready]
    dataset["raw_acceleration"] = ("raw_sample", np.concatenate([r.acceleration for r in raw]))
    dataset["oscillator_frequency"] = frequency
    for name, traces in (
        ("spectral_acceleration", [one.trace for one in ready]),
        ("raw_spectral_acceleration", raw),
    ):
        spectra = np.array([in_si.in_g(spectrum(trace, frequency)) for trace in traces])
        dataset[name] = (("record", "oscillator_frequency"), spectra)
    dataset["record_size"].attrs["sample_dimension"] = "sample"
    dataset["raw_size"].attrs["sample_dimension"] = "raw_sample"
    repaired = sum(bool(one.record.repairs) for one in ready)
    shaking = len(pga) * sum(one.trace.duration for one in ready)
    summary = f"{counted(len(ready), 'record')} x {len(pga)} PGA, {shaking:.0f} s of shaking"
    return dataset, summary + (f"; {counted(repaired, 'record')} repaired" if repaired else "")


def _facts(one: Ready) -> dict[str, Any]:
    """What is known of a record, by the names of the variables."""
    record, trace, measures = one.record, one.trace, asdict(one.measures)
    longer = trace.duration - (len(record.acceleration) - 1) * record.interval
    return {
        "record": one.name,
        "record_digest": one.digest,
        "record_size": len(trace.times),
        "interval": trace.interval,
        "raw_size": len(record.acceleration),
        "raw_interval": record.interval,
        # the first sample as recorded, since the start of the processed motion
        "raw_start": max(0.0, 0.5 * longer) if longer > trace.interval else 0.0,
        "station": record.station,
        "channel": record.channels[0],
        "record_source": record.source,
        "record_unit": record.unit,
        "repairs": "; ".join((*one.doubts, *record.repairs)),
        **{
            name: in_si.in_g(measures[own]) if name in _IN_G else measures[own]
            for own, name in MEASURES.items()
        },
    }
