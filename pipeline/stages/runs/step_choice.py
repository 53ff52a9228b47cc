"""The time step of each friction, chosen, from the error that the scene itself shows.

The step does not depend on the directions and motions of a study: a wider grid or another yaw keeps
it, and with it every run that is stored.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
import xarray as xr

from pipeline.config.schema import Config
from pipeline.stages.runs.scenes import check_scene, identity, prepared
from pipeline.workflow import keys
from pipeline.workflow.cluster import Batch
from pipeline.workflow.datasets import described, netcdf, read
from pipeline.workflow.stage import Job, Product
from pipeline.workflow.store import Store
from vsr_core import GRAVITY
from vsr_core.rock.body import Rock
from vsr_core.run.cases import Case, Settings
from vsr_core.verification import time_step as ladder
from vsr_core.verification.time_step import Choice, Row, longest, step_unit

FILE = "time_step.nc"

FEW = 4
"""Rows up to this number are measured without starting worker processes."""

Place = tuple[float, float]  # yaw [degree], PGV/PGA [s]


def time_step(config: Config, store: Store, friction: float) -> float:
    """Time step [s] of a friction; nan where it has to be measured first."""
    given = config.simulation.time_step
    if given != "auto":
        return given
    old = _measured_before(store).get(_name(config, store, friction))
    if old is None:
        return math.nan
    return _choice(old, config.simulation.tolerance).time_step


def make(job: Job) -> Product:
    """Measure the scene, or take the step that is given, and choose."""
    frictions = job.config.contact.friction
    rock = check_scene(job.site, job.store).full.rock
    given = job.config.simulation.time_step
    if given != "auto":
        dataset = _dataset(frictions, [given] * len(frictions))
        note = f"time step {1e3 * given:.4g} ms as given; its error was not measured"
        return Product({FILE: netcdf(described(dataset, job, "Time step"))}, note)
    places = rows_of(rock)
    before = _measured_before(job.store)
    names = {friction: _name(job.config, job.store, friction) for friction in frictions}
    wanted = [friction for friction in frictions if names[friction] not in before]
    rows = _measure(job, wanted, places) if wanted else {}
    dataset = _measured(job.config, places, names, rows, before)
    simulation = job.config.simulation
    dataset.attrs["step_unit_s"] = step_unit(rock)
    dataset.attrs["longest_step_s"] = longest(rock, simulation.engine, 0.01)
    choices = [
        _choice(dataset.isel(friction=at), simulation.tolerance) for at in range(len(frictions))
    ]
    for name in ("time_step", "error", "worst", "within"):
        values = [float(getattr(choice, name)) for choice in choices]
        dataset[_NAMES.get(name, name)] = ("friction", values)
    return Product({FILE: netcdf(described(dataset, job, "Time step"))}, _summary(choices))


_NAMES = {"error": "boundary_error", "worst": "boundary_error_worst", "within": "within_tolerance"}


def rows_of(rock: Rock) -> tuple[Place, ...]:
    """Yaw [degree] and PGV/PGA [s] of the rows of a rock."""
    yaws = [math.degrees(yaw) for yaw in ladder.directions(rock)]
    return tuple((yaw, period) for yaw in yaws for period in ladder.periods(rock))


def measure_rows(shared: tuple[Case, Settings], items: tuple[float, ...]) -> list[Row]:
    """Rows of one direction and friction, on a worker; ``items`` are PGV/PGA [s]."""
    case, settings = shared
    return [ladder.measure(case, pgv_pga, settings) for pgv_pga in items]


def _measure(
    job: Job, frictions: Sequence[float], places: Sequence[Place]
) -> dict[tuple[float, Place], Row]:
    def batches() -> Iterator[Batch]:
        for friction in frictions:
            for place in places:
                yield Batch((friction, place), f"{place[0]}/{friction}", (place[1],))

    job.log(f"time_step: measuring {len(places)} boundaries at {len(ladder.SHARES)} time steps")
    few = len(frictions) * len(places) <= FEW
    cluster = job.cluster.in_process() if few else job.cluster
    return {
        batch.tag: results[0]
        for batch, results in cluster.run(measure_rows, batches(), partial(_shared, job))
        if results is not None
    }


def _shared(job: Job, name: str) -> tuple[Case, Settings]:
    yaw, friction = map(float, name.split("/"))
    simulation = job.config.simulation
    case = prepared(job.config, job.store, yaw, friction)
    return case, Settings(math.nan, simulation.reduce, simulation.engine)


def _name(config: Config, store: Store, friction: float) -> str:
    """Identity of what is measured for one friction."""
    measured = keys.digest(keys.code(("vsr_core.verification.time_step:measure",)))
    return keys.digest([identity(config, store), friction, measured])


def _measured_before(store: Store) -> dict[str, xr.Dataset]:
    """What the product measured for each friction, by its identity."""
    if store.manifest("time_step") is None or store.damage("time_step"):
        return {}
    old = read(store.folder / FILE)
    if "measurement" not in old:
        return {}
    return {
        str(old["measurement"].values[i]): old.isel(friction=i) for i in range(old.friction.size)
    }


def _measured(
    config: Config,
    places: Sequence[Place],
    names: dict[float, str],
    rows: dict[tuple[float, Place], Row],
    before: dict[str, xr.Dataset],
) -> xr.Dataset:
    frictions = config.contact.friction
    shape = (len(frictions), len(places), len(ladder.SHARES))
    error, steps = np.full(shape, np.nan), np.full(shape, np.nan)
    reference = np.full(shape[:2], np.nan)
    for at, friction in enumerate(frictions):
        old = before.get(names[friction])
        if old is not None:
            error[at], steps[at] = old["row_error"].values, old["row_steps"].values
            reference[at] = old["row_reference"].values
            continue
        for number, place in enumerate(places):
            row = rows.get((friction, place))
            if row is not None:
                error[at, number], steps[at, number] = row.error, row.steps
                reference[at, number] = row.reference / GRAVITY
    dataset = _dataset(frictions, [math.nan] * len(frictions))
    dataset["measurement"] = ("friction", [names[friction] for friction in frictions])
    dataset["row_yaw"] = ("row", [yaw for yaw, _ in places])
    dataset["row_pgv_pga"] = ("row", [pgv_pga for _, pgv_pga in places])
    dataset["row_reference"] = (("friction", "row"), reference)
    dataset["row_error"] = (("friction", "row", "step_share"), error)
    dataset["row_steps"] = (("friction", "row", "step_share"), steps)
    return dataset.assign_coords(step_share=list(ladder.SHARES))


def _dataset(frictions: Sequence[float], steps: Sequence[float]) -> xr.Dataset:
    unknown = np.full(len(frictions), np.nan)
    return xr.Dataset(
        {
            "time_step": ("friction", list(steps)),
            "boundary_error": ("friction", unknown),
            "boundary_error_worst": ("friction", unknown.copy()),
            "within_tolerance": ("friction", unknown.copy()),
        },
        {"friction": list(frictions)},
    )


def _choice(dataset: xr.Dataset, tolerance: float) -> Choice:
    """Choice from what was measured for one friction."""
    measured = ladder.front(dataset["row_error"].values, dataset["row_steps"].values)
    unit, most = (float(dataset.attrs[name]) for name in ("step_unit_s", "longest_step_s"))
    return ladder.choose(measured, tolerance, unit, most * tolerance / 0.01)


def _summary(choices: Sequence[Choice]) -> str:
    texts = {
        f"{1e3 * choice.time_step:.3g} ms"
        + (f", boundary right to {choice.error:.2%}" if choice.error == choice.error else "")
        + ("" if choice.within else ": NOT within the tolerance at any step tried")
        for choice in choices
    }
    return "time step " + "; ".join(sorted(texts))
