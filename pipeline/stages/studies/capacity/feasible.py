"""Which part of a grid of motions a shake table can do, and its commands for that part."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from pipeline.config.motion_schema import PulseConfig
from pipeline.config.problems import InputError, Problem
from pipeline.drawing.style import pictures
from pipeline.stages.datasets.responses import FILE as RESPONSES
from pipeline.stages.mesh.products import load_rock
from pipeline.stages.studies.capacity import table_limits
from pipeline.stages.studies.capacity.feasible_figure import feasible_grid
from pipeline.stages.studies.capacity.table_limits import TableConfig
from pipeline.workflow import graph, keys
from pipeline.workflow.datasets import described, netcdf, read
from pipeline.workflow.stage import Job
from pipeline.workflow.store import writing
from pipeline.workflow.writers import table as as_csv
from vsr_core import GRAVITY
from vsr_core.motions.cosine_pulse import CosinePulse
from vsr_core.table.capacity import LIMITS, Table, binding, commands, largest_pga, loads

FILE, TABLE, PICTURE = "feasible.nc", "feasible.csv", "feasible"

COLUMNS = ("pgv_pga_s", "pga_g", "feasible", "binding", "pgv_m_per_s", "stroke_m")


def make(job: Job, name: str, export: Path | None) -> list[str]:
    """Write the products, and the commands if wanted; returns what to tell the user.

    Raises
    ------
    InputError
        For a table that is not known or wrong, and for motions that are no pulses.
    """
    config, file = table_limits.load(name)
    motion = job.config.motion
    if not isinstance(motion, PulseConfig):
        rule, remedy = "the grid is one of cosine pulses", "use a site or study of cosine pulses"
        raise InputError(Problem(job.site.file, "motion.kind", repr(motion.kind), rule, remedy))
    graph.make("rock", job)
    rock, _ = load_rock(job.store)
    label = Path(file).stem
    facts = {"table": config.model_dump(mode="json"), "motion": motion.model_dump(mode="json")}
    job = replace(job, key=keys.digest(facts))
    dataset = _dataset(motion, config.table(), rock.mass)
    dataset.attrs |= {"table": label, "unchecked": ", ".join(config.unstated)}
    dataset = _flagged(described(dataset, job, f"What {label} can do"))
    figure = feasible_grid(dataset, _boundaries(job))
    job.store.publish(
        PICTURE,
        {"key": job.key, "facts": facts, "unresolved": 0, "retry": 0},
        {
            FILE: netcdf(dataset),
            TABLE: as_csv(COLUMNS, _records(dataset)),
            **pictures(PICTURE, figure),
        },
    )
    lines = _told(dataset, config, rock.mass)
    if export is not None:
        number = _export(dataset, config.table(), export)
        lines.append(f"commands of {number} motions -> {export}")
    return lines


def _dataset(motion: PulseConfig, table: Table, mass: float) -> xr.Dataset:
    ratios, peaks = np.array(motion.pgv_pga), np.array(motion.pga)
    limit = np.zeros((ratios.size, peaks.size), np.int8)
    asked = np.zeros((2, *limit.shape))
    for i, k in np.ndindex(*limit.shape):
        pulse = CosinePulse.from_g(float(peaks[k]), float(ratios[i]))
        limit[i, k] = ("", *LIMITS).index(binding(table, pulse, mass))
        load = loads(pulse, mass)
        asked[:, i, k] = load["velocity"], load["stroke"]
    cell = ("pgv_pga", "pga")
    ends = [largest_pga(table, ratio) for ratio in ratios.tolist()]
    return xr.Dataset(
        {
            "feasible": (cell, (limit == 0).astype(np.int8)),
            "binding": (cell, limit),
            "pgv": (cell, asked[0]),
            "stroke": (cell, asked[1]),
            **{
                f"{name}_pga": ("pgv_pga", np.array([end[name] / GRAVITY for end in ends]))
                for name in ends[0]
            },
        },
        {"pga": peaks, "pgv_pga": ratios},
        {"mass_kg": mass},
    )


def _flagged(dataset: xr.Dataset) -> xr.Dataset:
    names = ("none", *LIMITS)
    dataset["binding"].attrs |= {
        "flag_values": list(range(len(names))),
        "flag_meanings": " ".join(names),
    }
    return dataset


def _names(dataset: xr.Dataset) -> list[str]:
    return str(dataset["binding"].attrs["flag_meanings"]).split()


def _boundaries(job: Job) -> xr.Dataset | None:
    """The site's responses, if they are there and of cosine pulses."""
    path = job.path(RESPONSES)
    if not path.is_file():
        return None
    responses = read(path)
    return responses if "pgv_pga" in responses.dims else None


def _records(dataset: xr.Dataset) -> list[dict[str, Any]]:
    names = _names(dataset)
    return [
        {
            "pgv_pga_s": float(dataset["pgv_pga"][i]),
            "pga_g": float(dataset["pga"][k]),
            "feasible": int(dataset["feasible"].values[i, k]),
            "binding": names[dataset["binding"].values[i, k]],
            "pgv_m_per_s": float(dataset["pgv"].values[i, k]),
            "stroke_m": float(dataset["stroke"].values[i, k]),
        }
        for i, k in np.ndindex(*dataset["binding"].shape)
    ]


def _told(dataset: xr.Dataset, config: TableConfig, mass: float) -> list[str]:
    limit = dataset["binding"].values
    name = dataset.attrs["table"]
    lines = [
        f"{name}: {int((limit == 0).sum())} of {limit.size} motions can be done",
        f"{'binding':<14}{'limit':<12}{'motions':>7}",
    ]
    units = {"acceleration": "g", "velocity": "m/s", "stroke": "m", "payload": "kg"}
    for code, what in enumerate(_names(dataset)[1:], 1):
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
            columns: dict[str, Any] = {"time_s": sent.time, "velocity_m_per_s": sent.velocity}
            if sent.steps is not None:
                columns["motor_step"] = sent.steps
            with (folder / f"pgv_pga_{ratio:g}_pga_{pga:g}.csv").open("w", newline="") as file:
                out = csv.writer(file)
                out.writerow(columns)
                out.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))
    return len(places)
