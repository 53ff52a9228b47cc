"""The time step of each friction, chosen from the error that the scene itself shows.

The step does not depend on the directions and motions of a study: a wider grid or another yaw keeps
it, and with it every run that is stored.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import xarray as xr

from pipeline.config import in_si
from pipeline.config.schema import Config
from pipeline.stages.runs.scenes import (
    Group,
    Scenes,
    check_scenes,
    flat_case,
    identity,
    load_scenes,
)
from pipeline.workflow import keys
from pipeline.workflow.cluster import Batch
from pipeline.workflow.datasets import described, netcdf, read
from pipeline.workflow.stage import Job, Product
from pipeline.workflow.store import Store
from vsr_core.rock.body import Rock
from vsr_core.run.cases import Case, Settings
from vsr_core.verification import time_step as ladder
from vsr_core.verification.time_step import Choice, Row, longest, step_unit

FILE = "time_step.nc"

FEW = 4
"""Rows up to this number are measured without starting worker processes."""

Place = tuple[float, float]
"""Yaw [degree] and PGV/PGA [s] of a row."""


def time_steps(config: Config, store: Store) -> dict[float, float]:
    """Look up the time steps of a configuration.

    Parameters
    ----------
    config : Config
    store : Store, which holds the rock

    Returns
    -------
    dict, from friction to its time step [s]; nan where it has to be measured first
    """
    simulation, frictions = config.simulation, config.contact.friction
    if simulation.time_step != "auto":
        return dict.fromkeys(frictions, simulation.time_step)
    names, before = _names(load_scenes(config, store, level=True)), _measured_before(store)
    return {
        friction: _choice(before[name], simulation.tolerance).time_step
        if (name := names[friction]) in before
        else math.nan
        for friction in frictions
    }


def make(job: Job) -> Product:
    """Measure the scene, or take the step that is given, and choose.

    Parameters
    ----------
    job : Job

    Returns
    -------
    Product
    """
    scenes, simulation = load_scenes(job.config, job.store, level=True), job.config.simulation
    check_scenes(job.site, scenes)
    frictions = job.config.contact.friction
    if simulation.time_step != "auto":
        dataset = _dataset(frictions, simulation.time_step)
        note = f"time step {1e3 * simulation.time_step:.4g} ms as given; its error was not measured"
        return Product({FILE: netcdf(described(dataset, job, "Time step"))}, note)
    dataset = _measured(job, scenes)
    dataset.attrs["step_unit_s"] = step_unit(scenes.level_rock)
    dataset.attrs["longest_step_s"] = longest(scenes.level_rock, simulation.engine, 0.01)
    choices = [
        _choice(dataset.isel(friction=at), simulation.tolerance) for at in range(len(frictions))
    ]
    for name in ("time_step", "error", "worst", "within"):
        chosen = [float(getattr(choice, name)) for choice in choices]
        dataset[_NAMES.get(name, name)] = ("friction", chosen)
    return Product({FILE: netcdf(described(dataset, job, "Time step"))}, _summary(choices))


_NAMES = {"error": "boundary_error", "worst": "boundary_error_worst", "within": "within_tolerance"}


def rows_of(rock: Rock) -> tuple[Place, ...]:
    """List the rows on which the boundary of a rock is measured.

    Parameters
    ----------
    rock : Rock

    Returns
    -------
    tuple of (yaw [degree], PGV/PGA [s])
    """
    yaws = [in_si.in_degrees(yaw) for yaw in ladder.directions(rock)]
    return tuple((yaw, period) for yaw in yaws for period in ladder.periods(rock))


def measure_rows(shared: tuple[Case, Settings], items: tuple[float, ...]) -> list[Row]:
    """Measure rows of one direction and friction, on a worker.

    Parameters
    ----------
    shared : Case and Settings
    items : tuple of float, PGV/PGA [s]

    Returns
    -------
    list of Row
    """
    case, settings = shared
    return [ladder.measure(case, pgv_pga, settings) for pgv_pga in items]


def _measured(job: Job, scenes: Scenes) -> xr.Dataset:
    """What was measured for each friction, now or before."""
    places, names, before = rows_of(scenes.level_rock), _names(scenes), _measured_before(job.store)
    frictions = job.config.contact.friction
    new = _measure(job, scenes, [f for f in frictions if names[f] not in before], places)
    shape = (len(frictions), len(places), len(ladder.SHARES))
    error, steps = np.full(shape, np.nan), np.full(shape, np.nan)
    reference = np.full(shape[:2], np.nan)
    for at, friction in enumerate(frictions):
        old = before.get(names[friction])
        if old is not None:
            error[at], steps[at] = old["row_error"].values, old["row_steps"].values
            reference[at] = old["row_reference"].values
            continue
        for number, (yaw, pgv_pga) in enumerate(places):
            row = new[Group(yaw, friction), pgv_pga]
            if row is not None:
                error[at, number], steps[at, number] = row.error, row.steps
                reference[at, number] = in_si.in_g(row.reference)
    dataset = _dataset(frictions, math.nan)
    dataset["measurement"] = ("friction", [names[friction] for friction in frictions])
    dataset["row_yaw"] = ("row", [yaw for yaw, _ in places])
    dataset["row_pgv_pga"] = ("row", [pgv_pga for _, pgv_pga in places])
    dataset["row_reference"] = (("friction", "row"), reference)
    dataset["row_error"] = (("friction", "row", "step_share"), error)
    dataset["row_steps"] = (("friction", "row", "step_share"), steps)
    return dataset.assign_coords(step_share=list(ladder.SHARES))


def _measure(
    job: Job, scenes: Scenes, frictions: Sequence[float], places: Sequence[Place]
) -> dict[tuple[Group, float], Row | None]:
    """Rows by group and PGV/PGA; None for one that killed its worker."""
    simulation = job.config.simulation

    def shared(group: Group) -> tuple[Case, Settings]:
        return flat_case(scenes, group), Settings(math.nan, simulation.reduce, simulation.engine)

    if frictions:
        tried = f"{len(places)} boundaries at {len(ladder.SHARES)} time steps"
        job.log(f"time_step: measuring {tried}")
    batches = [Batch(Group(yaw, f), (pgv_pga,)) for f in frictions for yaw, pgv_pga in places]
    cluster = job.cluster.in_process() if len(batches) <= FEW else job.cluster
    done = cluster.each(measure_rows, iter(batches), shared)
    return {(group, pgv_pga): row for group, pgv_pga, row in done}


def _names(scenes: Scenes) -> dict[float, str]:
    """Identity of what is measured for each friction, on a flat pedestal whatever the site's is."""
    assert scenes.ground is None
    code = keys.digest(keys.code(("vsr_core.verification.time_step:measure",)))
    common = identity(scenes)
    frictions = scenes.config.contact.friction
    return {friction: keys.digest([common, friction, code]) for friction in frictions}


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


def _dataset(frictions: Sequence[float], step: float) -> xr.Dataset:
    unknown = np.full(len(frictions), np.nan)
    return xr.Dataset(
        {
            "time_step": ("friction", np.full(len(frictions), step)),
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
