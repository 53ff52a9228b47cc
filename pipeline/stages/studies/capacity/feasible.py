"""Which part of a grid of motions a shake table can do, and its commands for that part."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from pipeline.config.layers import load_table
from pipeline.config.motion_schema import PulseConfig
from pipeline.config.problems import InputError, Problem
from pipeline.config.schema import TableConfig
from pipeline.drawing.style import pictures
from pipeline.stages.datasets.responses import FILE as RESPONSES
from pipeline.stages.mesh.products import load_rock
from pipeline.stages.studies.capacity.feasible_figure import feasible_grid
from pipeline.workflow import graph, keys, writers
from pipeline.workflow.datasets import described, netcdf, read
from pipeline.workflow.stage import Job
from pipeline.workflow.store import writing
from vsr_core import GRAVITY
from vsr_core.motions.cosine_pulse import CosinePulse
from vsr_core.table.capacity import LIMITS, Table, binding, commands, largest_pga, loads

FILE, TABLE, PICTURE = "feasible.nc", "feasible.csv", "feasible"

_BINDING = ("none", *LIMITS)
"""What limits a motion, by its code."""

_COLUMNS = {
    "pgv_pga": "pgv_pga_s",
    "pga": "pga_g",
    "feasible": "feasible",
    "binding": "binding",
    "pgv": "pgv_m_per_s",
    "stroke": "stroke_m",
}
"""Columns of the table by their variables."""


def make(job: Job, name: str, export: Path | None) -> list[str]:
    """Write the products, and the commands if wanted."""
    config, file = load_table(name)
    motion = job.config.motion
    if not isinstance(motion, PulseConfig):
        rule, remedy = "the grid is one of cosine pulses", "use a site or study of cosine pulses"
        file = job.site.file_of("motion.kind")
        raise InputError(Problem(file, "motion.kind", repr(motion.kind), rule, remedy))
    graph.make("rock", job)
    rock, _ = load_rock(job.store)
    label = Path(file).stem
    facts = {"table": config.model_dump(mode="json"), "motion": motion.model_dump(mode="json")}
    job = replace(job, key=keys.digest(facts))
    dataset = _dataset(motion, config.table(), rock.mass)
    dataset.attrs |= {"table": label, "unchecked": ", ".join(config.unstated)}
    dataset = described(dataset, job, f"What {label} can do")
    dataset["binding"].attrs |= {
        "flag_values": list(range(len(_BINDING))),
        "flag_meanings": " ".join(_BINDING),
    }
    figure = feasible_grid(dataset, _boundaries(job))
    files = {FILE: netcdf(dataset), TABLE: writers.table(_table(dataset))}
    manifest = {"key": job.key, "facts": facts, "unresolved": 0, "retry": 0}
    job.store.publish(PICTURE, manifest, files | pictures(PICTURE, figure))
    lines = _told(dataset, config, rock.mass)
    if export is not None:
        number = _export(dataset, config.table(), export)
        lines.append(f"commands of {number} motions -> {export}")
    return lines


def _dataset(motion: PulseConfig, table: Table, mass: float) -> xr.Dataset:
    """What each motion asks of the table, and the limit that it goes beyond furthest."""
    cells = pd.MultiIndex.from_product([motion.pgv_pga, motion.pga], names=["pgv_pga", "pga"])
    pulses = [CosinePulse.from_g(pga, ratio) for ratio, pga in cells]
    asked = [loads(pulse, mass) for pulse in pulses]
    binds = [_BINDING.index(binding(table, pulse, mass) or "none") for pulse in pulses]
    grid = pd.DataFrame(
        {
            "feasible": np.equal(binds, 0).astype(np.int8),
            "binding": np.array(binds, np.int8),
            "pgv": [load["velocity"] for load in asked],
            "stroke": [load["stroke"] for load in asked],
        },
        cells,
    ).to_xarray()
    ends = pd.DataFrame([largest_pga(table, ratio) for ratio in motion.pgv_pga]) / GRAVITY
    limits = {f"{name}_pga": ("pgv_pga", values) for name, values in ends.items()}
    return grid.assign(limits).assign_attrs(mass_kg=mass)


def _boundaries(job: Job) -> xr.Dataset | None:
    """The site's responses, if they are there and of cosine pulses."""
    path = job.path(RESPONSES)
    if not path.is_file():
        return None
    responses = read(path)
    return responses if "pgv_pga" in responses.dims else None


def _table(dataset: xr.Dataset) -> pd.DataFrame:
    """A row a motion."""
    table = dataset[["feasible", "binding", "pgv", "stroke"]].to_dataframe().reset_index()
    table["binding"] = [_BINDING[code] for code in table["binding"]]
    return table[list(_COLUMNS)].rename(columns=_COLUMNS)


def _told(dataset: xr.Dataset, config: TableConfig, mass: float) -> list[str]:
    limit = dataset["binding"].values
    name = dataset.attrs["table"]
    lines = [
        f"{name}: {int((limit == 0).sum())} of {limit.size} motions can be done",
        f"{'binding':<14}{'limit':<12}{'motions':>7}",
    ]
    units = {"acceleration": "g", "velocity": "m/s", "stroke": "m", "payload": "kg"}
    for code, what in enumerate(LIMITS, 1):
        given = getattr(config, what)
        shown = "not stated" if given is None else f"{given:g} {units[what]}"
        lines.append(f"{what:<14}{shown:<12}{int((limit == code).sum()):>7}")
    if config.payload is not None and mass > config.payload:
        lines.append(
            f"the rock weighs {mass:.4g} kg: a model of it at "
            f"{(config.payload / mass) ** (1.0 / 3.0):.3g} of its size would be light enough"
        )
    if config.unstated:
        lines.append(f"not stated for this table, so not checked: {', '.join(config.unstated)}")
    return lines


def _export(dataset: xr.Dataset, table: Table, folder: Path) -> int:
    """Write the commands of each motion that can be done; returns their number."""
    places = np.argwhere(dataset["feasible"].values == 1)
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for i, k in places.tolist():
            ratio, pga = float(dataset["pgv_pga"][i]), float(dataset["pga"][k])
            sent = commands(table, CosinePulse.from_g(pga, ratio))
            frame = pd.DataFrame({"time_s": sent.time, "velocity_m_per_s": sent.velocity})
            if sent.steps is not None:
                frame["motor_step"] = sent.steps
            file = folder / f"pgv_pga_{ratio:g}_pga_{pga:g}.csv"
            frame.to_csv(file, index=False, lineterminator="\r\n")
    return len(places)
