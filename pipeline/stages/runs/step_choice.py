"""The time step of each friction, chosen from the error that the scene itself shows.

The step does not depend on the directions and motions of a study: a wider grid or another yaw keeps
it, and with it every run that is stored.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
import xarray as xr

from pipeline.config import in_si
from pipeline.config.layers import Site
from pipeline.config.schema import COMPILED, Config
from pipeline.stages.runs.scenes import (
    Group,
    Scenes,
    check_scenes,
    flat_case,
    identity,
    load_scenes,
)
from pipeline.workflow import keys
from pipeline.workflow.batches import Batch
from pipeline.workflow.datasets import described, netcdf, read
from pipeline.workflow.grammar import counted
from pipeline.workflow.stage import Job, Product
from pipeline.workflow.store import Store
from vsr_core import engines
from vsr_core.rock.body import Rock
from vsr_core.run import time_step as ladder
from vsr_core.run.cases import Case, Settings
from vsr_core.run.time_step import (
    Boundary,
    Choice,
    Front,
    Place,
    Row,
    longest,
    step_unit,
)
from vsr_core.scene import Contact, Scene
from vsr_core.source import tracing

FILE = "time_step.nc"

FEW = 4
"""Rows up to this number are measured without starting worker processes."""


class Rows(NamedTuple):
    """What the rows of one direction and friction share."""

    group: Group
    boundary: Boundary


def load_engine(site: Site) -> None:
    """Load the machine code of the engine that a site names, by the world of a block."""
    corners = np.array(list(product((-1.0, 1.0), repeat=3)))
    block = Rock("hull", corners, 1.0, np.ones(3), np.eye(3))
    engines.load(site.config.engine).build(Scene(block, Contact(1.0)), 1e-3, 1)


def time_steps(config: Config, store: Store) -> dict[float, float]:
    """Look up the time steps of a configuration.

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
    """Measure the scene, or take the step that is given, and choose."""
    scenes, simulation = load_scenes(job.config, job.store, level=True), job.config.simulation
    check_scenes(job.site, scenes)
    frictions = job.config.contact.friction
    if simulation.time_step != "auto":
        known = {name: ("friction", np.full(len(frictions), math.nan)) for name in _CHOSEN}
        known["time_step"] = ("friction", np.full(len(frictions), simulation.time_step))
        dataset = xr.Dataset(known, {"friction": list(frictions)})
        note = f"time step {1e3 * simulation.time_step:.4g} ms as given; its error was not measured"
        return Product({FILE: netcdf(described(dataset, job, "Time step"))}, note)
    dataset = _measured(job, scenes)
    dataset.attrs["step_unit_s"] = step_unit(scenes.level_rock)
    dataset.attrs["longest_step_s"] = longest(scenes.level_rock, job.config.engine)
    choices = [
        _choice(dataset.isel(friction=at), simulation.tolerance) for at in range(len(frictions))
    ]
    for name, field in _CHOSEN.items():
        dataset[name] = ("friction", [float(getattr(choice, field)) for choice in choices])
    return Product({FILE: netcdf(described(dataset, job, "Time step"))}, _summary(choices))


_CHOSEN = {
    "time_step": "time_step",
    "boundary_error": "error",
    "boundary_error_worst": "worst",
    "displaced_error": "displaced",
    "within_tolerance": "within",
}
"""Variables of what is chosen, and what they are in a ``Choice``."""


def kept(measured: xr.Dataset, boundary: Boundary) -> tuple[int, int]:
    """Count the rows that keep to the error stated for the step chosen, and those measured.

    Parameters
    ----------
    measured : Dataset
        As in ``time_step.nc``, of one friction.
    """
    stated = measured["displaced_error" if boundary is Boundary.DISPLACED else "boundary_error"]
    errors = measured["row_error"].values[measured["row_displaced"].values == boundary]
    errors = errors[np.isfinite(errors).all(axis=1)]
    steps = measured["step_share"].values * measured.attrs["step_unit_s"]
    at = int(np.abs(steps - float(measured["time_step"])).argmin())
    return int((errors[:, at] <= float(stated)).sum()), len(errors)


def measure_rows(shared: tuple[Case, Settings, Boundary], items: tuple[float, ...]) -> list[Row]:
    """Measure rows of one direction, friction and boundary, on a worker.

    Parameters
    ----------
    items : tuple of float, PGV/PGA [s]
    """
    case, settings, boundary = shared
    return [ladder.measure(case, pgv_pga, settings, boundary) for pgv_pga in items]


def _measured(job: Job, scenes: Scenes) -> xr.Dataset:
    """What was measured for each friction, now or before."""
    names, before = _names(scenes), _measured_before(job.store)
    frictions = job.config.contact.friction
    shares = engines.load(job.config.engine).LADDER.shares
    new = _measure(job, scenes, [f for f in frictions if names[f] not in before])
    parts = [
        before[names[friction]]
        if names[friction] in before
        else _rows(names[friction], new[friction], shares)
        for friction in frictions
    ]
    return xr.concat(
        parts, xr.IndexVariable("friction", list(frictions)), coords="minimal", combine_attrs="drop"
    ).drop_encoding()


def _rows(name: str, rows: dict[Place, Row], shares: Sequence[float]) -> xr.Dataset:
    """Rows of one friction."""
    yaws, ratios, boundaries = zip(*rows, strict=True)
    known = rows.values()
    return xr.Dataset(
        {
            "measurement": name,
            "row_reference": ("row", [in_si.in_g(row.reference) for row in known]),
            "row_error": (("row", "step_share"), [row.error for row in known]),
            "row_steps": (("row", "step_share"), [row.steps for row in known]),
        },
        {
            "row_yaw": ("row", [in_si.in_degrees(yaw) for yaw in yaws]),
            "row_pgv_pga": ("row", list(ratios)),
            "row_displaced": ("row", np.array(boundaries, "i1")),
            "step_share": list(shares),
        },
    )


def _measure(job: Job, scenes: Scenes, frictions: Sequence[float]) -> dict[float, dict[Place, Row]]:
    """All rows of each friction; nan in those not needed, or that killed their worker."""
    shares = engines.load(job.config.engine).LADDER.shares
    unknown = np.full(len(shares), math.nan)
    found: dict[float, dict[Place, Row]] = {friction: {} for friction in frictions}
    for lot in ladder.lots(scenes.level_rock):
        wanting = [f for f in frictions if not ladder.enough(list(found[f].values()))]
        if wanting:
            of_sliding = " of sliding" * (lot[0].boundary is Boundary.DISPLACED)
            boundaries = counted(len(lot), "boundary", "boundaries") + of_sliding
            told = f"{boundaries} at {counted(len(shares), 'time step')}"
            job.log(f"time_step: measuring {told}")
        known = _measure_lot(job, scenes, wanting, lot)
        for friction in frictions:
            for place in lot:
                found[friction][place] = known.get((friction, place)) or Row(
                    place.pgv_pga, math.nan, False, unknown, unknown
                )
    return found


def _measure_lot(
    job: Job, scenes: Scenes, frictions: Sequence[float], lot: Sequence[Place]
) -> dict[tuple[float, Place], Row | None]:
    """Rows of a lot by friction and place; None for one that killed its worker."""

    def shared(rows: Rows) -> tuple[Case, Settings, Boundary]:
        settings = Settings(math.nan, job.config.simulation.reduce, job.config.engine)
        return flat_case(scenes, rows.group), settings, rows.boundary

    wanted = {
        (Rows(Group(in_si.in_degrees(place.yaw), f), place.boundary), place.pgv_pga): (f, place)
        for f in frictions
        for place in lot
    }
    batches = [Batch(rows, (pgv_pga,)) for rows, pgv_pga in wanted]
    cluster = job.cluster.in_process() if len(batches) <= FEW else job.cluster
    if job.config.engine == COMPILED:
        cluster = cluster.in_threads()
    done = cluster.each(measure_rows, iter(batches), shared)
    return {wanted[rows, pgv_pga]: row for rows, pgv_pga, row in done}


def _names(scenes: Scenes) -> dict[float, str]:
    """Identity of what is measured for each friction, on a flat pedestal whatever the site's is."""
    assert scenes.ground is None
    parts = ("measure", "lots", "enough")
    roots = [f"vsr_core.run.time_step:{part}" for part in parts]
    code = keys.digest(tracing.reached(roots))
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
    rows = old[["measurement", "row_reference", "row_error", "row_steps"]]
    names = old["measurement"].values.tolist()
    return {name: rows.isel(friction=at, drop=True) for at, name in enumerate(names)}


def _choice(dataset: xr.Dataset, tolerance: float) -> Choice:
    """Choice from what was measured for one friction."""
    shares = dataset["step_share"].values.tolist()

    def front(boundary: Boundary) -> Front:
        rows = dataset.isel(row=dataset["row_displaced"].values == boundary)
        return ladder.front(shares, rows["row_error"].values, rows["row_steps"].values)

    unit, most = (float(dataset.attrs[name]) for name in ("step_unit_s", "longest_step_s"))
    toppled, displaced = map(front, (Boundary.TOPPLED, Boundary.DISPLACED))
    return ladder.choose(toppled, displaced, tolerance, unit, most)


def _summary(choices: Sequence[Choice]) -> str:
    return "time step " + "; ".join(sorted({_told(choice) for choice in choices}))


def _told(choice: Choice) -> str:
    parts = [f"{1e3 * choice.time_step:.3g} ms"]
    if not math.isnan(choice.error):
        worst = f"{choice.worst:.2%} at the worst PGV/PGA level"
        parts.append(f"error of the boundary {choice.error:.2%}, {worst}")
    if not math.isnan(choice.displaced):
        parts.append(f"error of the boundary of sliding {choice.displaced:.2%}")
    if len(parts) == 1:
        why = "too few of the pulses tried topple or displace the rock"
        return f"{parts[0]}, the finest; its error was NOT MEASURED: {why}"
    return ", ".join(parts) + ("" if choice.within else ": NOT within the tolerance at any step")
