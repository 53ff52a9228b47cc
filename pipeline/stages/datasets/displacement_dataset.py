"""Displacement: the stored displacement runs as ragged trajectories, and their statistics."""

from __future__ import annotations

import numpy as np
import pandas as pd
import xarray as xr

from pipeline.stages.datasets.displaced_runs import overturned_runs
from pipeline.stages.datasets.stored_runs import moved, stored, tally, ways
from pipeline.stages.datasets.vertical import VARIABLE, without
from pipeline.stages.mesh.products import RockData
from pipeline.stages.runs.displacement_runs import KIND, SAMPLE, Journeys, unpack
from pipeline.stages.runs.overturning_runs import LevelRuns
from pipeline.stages.runs.quantity_errors import beside
from pipeline.stages.runs.step_choice import StepData
from pipeline.stages.runs.study import Study
from pipeline.workflow import writers
from pipeline.workflow.datasets import Stored, catalogue, described, netcdf
from pipeline.workflow.stage import Product, Work
from vsr_core.displacement.correlation import Correlation, correlations, row
from vsr_core.outcome import OF_TRAVEL, Outcome
from vsr_core.run.movement import air_share

TABLE = "correlation.csv"


class Displacement(Stored):
    """Every displacement run with its trajectory."""

    FILE = "displacement.nc"


def make(
    work: Work,
    study: Study,
    journeys: Journeys,
    level: LevelRuns | None,
    rock: RockData,
    measured: StepData,
) -> Product:
    """Assemble the displacement runs and correlate them."""
    runs = stored(journeys.database, KIND, study)
    dataset = _dataset(rock, runs, study)
    errors = beside(xr.Dataset(), measured.data, OF_TRAVEL)
    order = measured.data["friction"].values.tolist()
    at = [order.index(friction) for friction in runs["friction"]]
    dataset = dataset.assign({name: ("run", errors[name].values[at]) for name in errors})
    if level is not None:
        dataset[VARIABLE] = ("run", without(level, study))
        dataset[VARIABLE].encoding["_FillValue"] = np.int8(-1)
    found = correlations(overturned_runs(dataset))
    counts = ways(dataset["outcome"].values, dataset["movement"].values)
    moved_so = {f"n_{way.name.lower()}": count for way, count in counts.items()}
    text, unresolved = tally(np.bincount(runs["outcome"], minlength=len(Outcome)))
    files = {
        Displacement.FILE: netcdf(described(dataset, work, "Large displacement")),
        TABLE: writers.table(pd.DataFrame([row(one) | _units(one) | moved_so for one in found])),
    }
    return Product(files, f"{text}; {dataset.sizes['sample']} samples", unresolved=unresolved)


def _units(found: Correlation) -> dict[str, str]:
    """Units of a row's line, which differ between the rows."""
    ours, theirs = (catalogue()[name]["units"] for name in (found.statistic, found.regressor))
    return {"slope_unit": f"{ours} {theirs}-1", "intercept_unit": ours}


def _dataset(rock: RockData, runs: pd.DataFrame, study: Study) -> xr.Dataset:
    """Every run, then the samples of their trajectories one after the other."""
    tracks = [unpack(packed) if packed else np.empty(0, SAMPLE) for packed in runs["trajectory"]]
    samples = np.concatenate(tracks)
    speed = np.linalg.norm(samples["velocity"], axis=1)
    length, largest, distance = np.array([_statistics(track) for track in tracks]).T
    motions, radius = study.motions, study.scenes.rock.radius
    in_air = [air_share(track["position"][:, 2], track["contact"], radius) for track in tracks]
    number = runs["motion"].to_numpy()
    dataset = xr.Dataset(
        {
            "row_size": ("run", np.array([len(track) for track in tracks], np.int32)),
            "outcome": ("run", runs["outcome"].to_numpy(np.int8)),
            "movement": ("run", moved(rock, runs, np.array(in_air)).astype(np.int8)),
            "largest_tilt": ("run", runs["peak_tilt"].to_numpy(float)),
            "air_share": ("run", np.array(in_air)),
            "stop_reason": ("run", runs["stop_reason"].to_numpy(np.int8)),
            "steps": ("run", runs["steps"].to_numpy(np.int32)),
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
            "run": np.arange(len(runs), dtype=np.int32),
            "pgv_pga": ("run", np.array(motions.pgv_pga)[number]),
            **{name: ("run", runs[name].to_numpy()) for name in ("pga", "yaw", "friction")},
            "time": ("sample", samples["time"]),
            **{axis: ("sample", samples["position"][:, k]) for k, axis in enumerate("xyz")},
        },
        {"featureType": "trajectory"},
    )
    if motions.dimension == "record":
        dataset = dataset.assign_coords(record=("run", np.array(motions.rows)[number]))
    dataset["run"].attrs["cf_role"] = "trajectory_id"
    dataset["row_size"].attrs["sample_dimension"] = "sample"
    dataset["movement"].encoding["_FillValue"] = np.int8(-1)
    return dataset


def _statistics(track: np.ndarray) -> tuple[float, float, float]:
    """Length [m], largest speed [m/s] and terminal distance [m] of the samples of a run."""
    if not len(track):
        return np.nan, np.nan, np.nan
    place = track["position"].astype(np.float64)
    length = np.linalg.norm(np.diff(place, axis=0), axis=1).sum()
    speed = np.linalg.norm(track["velocity"].astype(np.float64), axis=1).max()
    return float(length), float(speed), float(np.linalg.norm(place[-1] - place[0]))
