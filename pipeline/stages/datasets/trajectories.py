"""Displacement: the stored displacement runs as ragged trajectories, and their statistics."""

from __future__ import annotations

from contextlib import closing
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from pipeline.config.problems import InputError, Problem
from pipeline.stages.datasets.displaced_runs import overturned_runs
from pipeline.stages.motions import shaking
from pipeline.stages.motions.shaking import Shaking
from pipeline.stages.runs.running import groups
from pipeline.stages.runs.trajectory_packing import SAMPLE, unpack
from pipeline.workflow import writers
from pipeline.workflow.datasets import described, netcdf
from pipeline.workflow.stage import Job, Product
from pipeline.workflow.store import RUNS, DisplacementRow, RunStore
from vsr_core.displacement.correlation import correlations, row
from vsr_core.outcome import Outcome

FILE, TABLE = "displacement.nc", "correlation.csv"

COLUMNS = (
    "statistic",
    "regressor",
    "n_groups",
    "n_runs",
    "slope",
    "intercept",
    "r2",
    "p",
    "spearman",
    "spearman_p",
    "spearman_runs",
    "variance_between",
    "variance_within",
)


def make(job: Job) -> Product:
    """Assemble the displacement runs and correlate them."""
    motions = shaking.of_store(job.config, job.store)
    dataset = _dataset(*_displacement_runs(job, motions))
    if motions.dimension == "record":
        every = [motions.rows[cell.row] for cell in shaking.cells(motions)]
        times = dataset.sizes["run"] // len(every)
        dataset = dataset.assign_coords(record=("run", np.array(every * times)))
    dataset.attrs["featureType"] = "trajectory"
    counts = np.bincount(dataset["outcome"].values, minlength=len(Outcome))
    text = ", ".join(f"{counts[o]} {o.name.lower()}" for o in Outcome if counts[o])
    unresolved = int(sum(counts[o] for o in Outcome if o.overturned == -1))
    files = {
        FILE: netcdf(described(dataset, job, "Large displacement")),
        TABLE: writers.table(pd.DataFrame(_correlations(dataset), columns=COLUMNS)),
    }
    return Product(files, f"{text}; {dataset.sizes['sample']} samples", unresolved=unresolved)


def _displacement_runs(
    job: Job, motions: Shaking
) -> tuple[list[tuple[float, ...]], list[DisplacementRow]]:
    """PGA, PGV/PGA, yaw and friction of every run, and its row."""
    cells: list[tuple[float, ...]] = []
    rows: list[DisplacementRow] = []
    with closing(RunStore(job.store.folder, DisplacementRow)) as runs:
        for group in groups(job.config, job.store):
            stored = runs.get(group.keys)
            lost = len(group.keys) - len(stored)
            if lost:
                job.store.forget("displacement_runs")
                raise InputError(
                    Problem(
                        str(job.store.folder / RUNS),
                        "",
                        f"{lost} displacement runs fewer than were done",
                        "no run gets lost",
                        "start again to redo them",
                    )
                )
            cells += [
                (pga, motions.pgv_pga[row], group.yaw, group.friction) for row, pga in group.cells
            ]
            rows += [stored[key] for key in group.keys]
    return cells, rows


def _dataset(cells: list[tuple[float, ...]], rows: list[DisplacementRow]) -> xr.Dataset:
    tracks = [unpack(row.trajectory) if row.trajectory else np.empty(0, SAMPLE) for row in rows]
    samples = np.concatenate(tracks)
    speed = np.linalg.norm(samples["velocity"], axis=1)
    length, largest, distance = np.array([_statistics(track) for track in tracks]).T
    pga, pgv_pga, yaw, friction = np.array(cells).T
    x, y, z = samples["position"].T
    dataset = xr.Dataset(
        {
            "row_size": ("run", np.array([len(track) for track in tracks], np.int32)),
            "outcome": ("run", np.array([row.outcome for row in rows], np.int8)),
            "stop_reason": ("run", np.array([row.stop_reason for row in rows], np.int8)),
            "steps": ("run", np.array([row.steps for row in rows], np.int32)),
            "trajectory_length": ("run", length),
            "largest_speed": ("run", largest),
            "terminal_distance": ("run", distance),
            "quaternion": (("sample", "xyzw"), samples["quaternion"]),
            "velocity": (("sample", "xyz"), samples["velocity"]),
            "angular_velocity": (("sample", "xyz"), samples["angular_velocity"]),
            "speed": ("sample", speed),
            "contact": ("sample", samples["contact"]),
        },
        {
            "run": np.arange(len(rows), dtype=np.int32),
            "pga": ("run", pga),
            "pgv_pga": ("run", pgv_pga),
            "yaw": ("run", yaw),
            "friction": ("run", friction),
            "time": ("sample", samples["time"]),
            "x": ("sample", x),
            "y": ("sample", y),
            "z": ("sample", z),
        },
    )
    dataset["run"].attrs["cf_role"] = "trajectory_id"
    dataset["row_size"].attrs["sample_dimension"] = "sample"
    return dataset


def _statistics(track: np.ndarray) -> tuple[float, float, float]:
    """Length [m], largest speed [m/s] and terminal distance [m] of the samples of a run."""
    if not len(track):
        return np.nan, np.nan, np.nan
    place = track["position"].astype(np.float64)
    length = np.linalg.norm(np.diff(place, axis=0), axis=1).sum()
    speed = np.linalg.norm(track["velocity"].astype(np.float64), axis=1).max()
    return float(length), float(speed), float(np.linalg.norm(place[-1] - place[0]))


def _correlations(dataset: xr.Dataset) -> list[dict[str, Any]]:
    return [row(found) for found in correlations(overturned_runs(dataset))]
