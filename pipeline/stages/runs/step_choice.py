"""The time step of each friction, chosen from the error that the scene itself shows.

The step does not depend on the directions and motions of a study: a wider grid or another yaw keeps
it, and with it every run that is stored. On terrain it is measured on the seat. What was measured
is stored as runs are, row by row.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from pipeline.config import in_si
from pipeline.config.schema import COMPILED, SceneSettings
from pipeline.stages.mesh.products import Ground, Standing
from pipeline.stages.runs.quantity_errors import (
    Measured,
    Settled,
    known,
    measured,
    settled,
    steps_told,
    told,
    variables,
    warning,
)
from pipeline.stages.runs.scenes import (
    Group,
    Scenes,
    alone_at,
    flat_case,
    identity,
    refuse_engine,
    terrain_case,
)
from pipeline.workflow import keys
from pipeline.workflow.datasets import Stored, described, netcdf
from pipeline.workflow.engine_input import Engine
from pipeline.workflow.grammar import counted
from pipeline.workflow.progress import Steps
from pipeline.workflow.rows import StepRow
from pipeline.workflow.run_store import RunStore, is_there
from pipeline.workflow.stage import Product, Work
from pipeline.workflow.store import Store
from pipeline.workflow.workers import Batch
from vsr_core import engines
from vsr_core.run import time_step as ladder
from vsr_core.run.cases import Case, Settings, TerrainCase
from vsr_core.run.time_step import Boundary, Choice, Front, Place, Row, longest, unit_of
from vsr_core.source import tracing

FEW = 4
"""Rows up to this number are measured without starting worker processes."""


class StepData(Stored):
    """The time step of each friction, and what was measured for it."""

    FILE = "time_step.nc"


@dataclass(frozen=True)
class TimeSteps:
    """Time steps in the order of the frictions [s]; nan where one has to be measured first."""

    steps: tuple[float, ...]

    @classmethod
    def load(cls, store: Store) -> TimeSteps:
        """The time steps of a folder."""
        return cls(tuple(StepData.load(store).data["time_step"].values.tolist()))


class Rows(NamedTuple):
    """What the rows of one direction and friction share."""

    group: Group
    boundary: Boundary


class Wanted(NamedTuple):
    """A row of a lot: number of its friction, and its place."""

    friction: int
    place: Place


def make(
    work: Work, settings: SceneSettings, standing: Standing, ground: Ground | None, engine: Engine
) -> Product:
    """Measure the scene, or take the step that is given, and choose."""
    scenes, simulation = _tried(Scenes(settings, standing, ground)), settings.simulation
    refuse_engine(scenes, work.origin)
    if simulation.time_step != "auto":
        return _given(work, scenes, simulation.time_step)

    with closing(RunStore(work.runs, StepRow)) as database:
        found = _lots(scenes, partial(_measured, work, scenes, database))
        dataset = _dataset(scenes, found)
        choices, errors = _settled(scenes, dataset, partial(measured, work, database))
    for name, field in _CHOSEN.items():
        dataset[name] = ("friction", [float(getattr(choice, field)) for choice in choices])
    dataset["within_tolerance"] *= np.array([one.within for one in errors])
    dataset = dataset.assign(variables(errors))
    files = {StepData.FILE: netcdf(described(dataset, work, "Time step"))}
    summary = steps_told(choices) + told(errors)
    return Product(files, summary, warning=warning(choices, errors))


def _given(work: Work, scenes: Scenes, time_step: float) -> Product:
    """A step that is given, whose error of the boundary is not measured."""
    frictions = scenes.settings.contact.friction
    unknown = ("friction", np.full(len(frictions), math.nan))
    chosen = dict.fromkeys(_CHOSEN, unknown)
    chosen["time_step"] = ("friction", np.full(len(frictions), time_step))
    with closing(RunStore(work.runs, StepRow)) as database:
        look = partial(measured, work, database)
        errors = [settled(alone_at(scenes, at), time_step, look) for at in range(len(frictions))]
    dataset = xr.Dataset(chosen | variables(errors), {"friction": list(frictions)})
    note = f"time step {1e3 * time_step:.4g} ms as given; its error was not measured"
    files = {StepData.FILE: netcdf(described(dataset, work, "Time step"))}
    return Product(files, note + told(errors), warning=warning([], errors))


def _settled(
    scenes: Scenes, dataset: xr.Dataset, look: Measured
) -> tuple[list[Choice], list[Settled]]:
    """Steps at which the tolerance holds for the boundary, and for what else is named."""
    tolerance, choices, errors = scenes.settings.simulation.tolerance, [], []
    for at in range(dataset.sizes["friction"]):
        own = dataset.isel(friction=at)
        choice = _choice(own, tolerance)
        found = settled(alone_at(scenes, at), choice.time_step, look)
        if found.time_step < choice.time_step:
            finest = float(own["step_share"][-1]) * own.attrs["step_unit_s"]
            choice = _choice(own, tolerance, max(found.time_step, finest))
        choices.append(replace(choice, time_step=found.time_step))
        errors.append(found)
    return choices, errors


def stored_steps(scenes: Scenes, database: Path) -> TimeSteps:
    """Time steps as far as they are known without a measurement.

    Parameters
    ----------
    database : Path, of its folder
    """
    simulation, frictions = scenes.settings.simulation, scenes.settings.contact.friction
    if simulation.time_step != "auto":
        return TimeSteps((simulation.time_step,) * len(frictions))
    if not is_there(database):
        return TimeSteps((math.nan,) * len(frictions))
    with closing(RunStore(database, StepRow, reads=True)) as rows:
        steps = []
        for at in range(len(frictions)):
            alone = alone_at(_tried(scenes), at)
            try:
                found = _lots(alone, partial(_known, alone, rows))
                (choice,), _ = _settled(alone, _dataset(alone, found), partial(known, rows))
            except KeyError:
                steps.append(math.nan)
                continue
            steps.append(choice.time_step)
    return TimeSteps(tuple(steps))


_CHOSEN = {
    "time_step": "time_step",
    "boundary_error": "error",
    "boundary_agreement": "agreement",
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
    agreement, shift = measured["row_error"].values, measured["row_shift"].values
    own = (measured["row_displaced"].values == boundary) & np.isfinite(agreement).all(axis=1)
    errors = np.fmax(agreement, shift)[own]
    steps = measured["step_share"].values * measured.attrs["step_unit_s"]
    chosen = np.abs(steps - float(measured["time_step"])).argmin()
    return int((errors[:, chosen] <= float(stated)).sum()), len(errors)


def front(measured: xr.Dataset, boundary: Boundary) -> Front:
    """Error of a boundary against the time step.

    Parameters
    ----------
    measured : Dataset
        As in ``time_step.nc``, of one friction.
    """
    rows = measured.isel(row=measured["row_displaced"].values == boundary)
    columns = (rows[f"row_{name}"].values for name in ("error", "shift", "steps"))
    return ladder.front(measured["step_share"].values.tolist(), *columns)


def step_for(measured: xr.Dataset, agreement: float) -> float | None:
    """Longest step [s], shorter than the one chosen, from which on outcomes agree so near, if any.

    Parameters
    ----------
    measured : Dataset
        As in ``time_step.nc``, of one friction.
    """
    toppled = front(measured, Boundary.TOPPLED)
    largest = np.maximum.accumulate(toppled.agreement[::-1])[::-1]
    steps = toppled.shares[largest <= agreement] * measured.attrs["step_unit_s"]
    finer = steps[steps < float(measured["time_step"])]
    return float(finer.max()) if finer.size else None


def measure_rows(
    shared: tuple[Case | TerrainCase, Settings, Boundary], items: tuple[float, ...]
) -> list[Row]:
    """Measure rows of one direction, friction and boundary, on a worker.

    Parameters
    ----------
    items : tuple of float, PGV/PGA [s]
    """
    case, settings, boundary = shared
    if isinstance(case, TerrainCase):
        return [ladder.measure_on_seat(case, pgv_pga, settings, boundary) for pgv_pga in items]
    return [ladder.measure(case, pgv_pga, settings, boundary) for pgv_pga in items]


def _lots(
    scenes: Scenes, measured: Callable[[list[Wanted]], dict[Wanted, Row]]
) -> list[dict[Place, Row]]:
    """All rows of each friction, lot after lot until there are enough; nan in those not needed."""
    unknown = np.full(len(_shares(scenes)), math.nan)
    found: list[dict[Place, Row]] = [{} for _ in scenes.settings.contact.friction]
    for lot in ladder.lots(scenes.level_rock):
        few = [at for at, rows in enumerate(found) if not ladder.enough(list(rows.values()))]
        known = measured([Wanted(at, place) for at in few for place in lot]) if few else {}
        for at, rows in enumerate(found):
            for place in lot:
                nothing = Row(place.pgv_pga, math.nan, False, unknown, unknown, unknown)
                rows[place] = known.get(Wanted(at, place), nothing)
    return found


def _measured(
    work: Work, scenes: Scenes, database: RunStore[StepRow], wanted: list[Wanted]
) -> dict[Wanted, Row]:
    """Rows of a lot, of which those that are not stored are measured; none that died."""
    settings = scenes.settings
    keys_of = _keys(scenes, wanted)
    stored = database.get(keys_of.values())
    missing = [one for one in wanted if keys_of[one] not in stored]

    def shared(rows: Rows) -> tuple[Case | TerrainCase, Settings, Boundary]:
        how = Settings(math.nan, settings.simulation.reduce, settings.engine)
        return _case(scenes, rows.group), how, rows.boundary

    items = {(_rows_of(scenes, one), one.place.pgv_pga): one for one in missing}
    batches = [Batch(rows, (pgv_pga,)) for rows, pgv_pga in items]
    cluster = work.cluster.in_process() if len(batches) <= FEW else work.cluster
    if settings.engine == COMPILED:
        cluster = cluster.in_threads()
    with Steps("time_step", work.log) as steps:
        if missing:
            sliding = " of sliding" * (missing[0].place.boundary is Boundary.DISPLACED)
            boundaries = counted(len(missing), "boundary", "boundaries") + sliding
            what = f"measuring {boundaries} at {counted(len(_shares(scenes)), 'time step')}"
            work.log(f"time_step: {what}")
            steps.tell(what)
        for rows, pgv_pga, row in cluster.each(measure_rows, iter(batches), shared):
            if row is not None:
                own = keys_of[items[rows, pgv_pga]]
                stored[own] = _packed(own, row)
                database.add([stored[own]])
    return {one: _unpacked(one, stored[own]) for one, own in keys_of.items() if own in stored}


def _known(scenes: Scenes, database: RunStore[StepRow], wanted: list[Wanted]) -> dict[Wanted, Row]:
    """Stored rows; a KeyError where one is not."""
    keys_of = _keys(scenes, wanted)
    stored = database.get(keys_of.values())
    return {one: _unpacked(one, stored[own]) for one, own in keys_of.items()}


def _rows_of(scenes: Scenes, wanted: Wanted) -> Rows:
    friction = scenes.settings.contact.friction[wanted.friction]
    return Rows(Group(in_si.in_degrees(wanted.place.yaw), friction), wanted.place.boundary)


def _tried(scenes: Scenes) -> Scenes:
    """What is measured: with an engine whose runs on terrain take seconds, on level ground."""
    return scenes if scenes.settings.engine == COMPILED else replace(scenes, ground=None)


def _case(scenes: Scenes, group: Group) -> Case | TerrainCase:
    """The rock on what it stands on."""
    return flat_case(scenes, group) if scenes.ground is None else terrain_case(scenes, group)


def _keys(scenes: Scenes, wanted: list[Wanted]) -> dict[Wanted, bytes]:
    """What tells each row from all others."""
    root = "measure" if scenes.ground is None else "measure_on_seat"
    code = keys.digest(tracing.reached([f"vsr_core.run.time_step:{root}"]))
    alone = {at: identity(alone_at(scenes, at)) for at in {one.friction for one in wanted}}
    shares = list(_shares(scenes))
    return {
        one: bytes.fromhex(
            keys.digest(
                [alone[one.friction], code, shares, *_rows_of(scenes, one), one.place.pgv_pga]
            )
        )
        for one in wanted
    }


def _shares(scenes: Scenes) -> Sequence[float]:
    """Steps of the ladder, in units of sqrt(radius / g)."""
    return engines.load(scenes.settings.engine).LADDER.shares


def _packed(key: bytes, row: Row) -> StepRow:
    numbers = np.concatenate([row.error, row.shift, row.steps]).astype("<f8").tobytes()
    return StepRow(key, int(row.exact), row.reference, numbers)


def _unpacked(wanted: Wanted, row: StepRow) -> Row:
    error, shift, steps = np.frombuffer(row.numbers, "<f8").reshape(3, -1)
    reference = math.nan if row.reference is None else row.reference
    return Row(wanted.place.pgv_pga, reference, bool(row.exact), error, shift, steps)


def _dataset(scenes: Scenes, found: list[dict[Place, Row]]) -> xr.Dataset:
    """What was measured for each friction."""
    yaws, ratios, boundaries = zip(*found[0], strict=True)
    rows = [list(of_friction.values()) for of_friction in found]
    table: dict[str, Any] = {
        "row_reference": [[in_si.in_g(row.reference) for row in own] for own in rows],
        "row_error": [[row.error for row in own] for own in rows],
        "row_shift": [[row.shift for row in own] for own in rows],
        "row_steps": [[row.steps for row in own] for own in rows],
    }
    dims = ("friction", "row", "step_share")
    first = Group(0.0, scenes.settings.contact.friction[0])
    most = longest(scenes.level_rock, scenes.settings.engine)
    return xr.Dataset(
        {name: (dims[: np.ndim(values)], np.array(values)) for name, values in table.items()},
        {
            "friction": list(scenes.settings.contact.friction),
            "row_yaw": ("row", [in_si.in_degrees(yaw) for yaw in yaws]),
            "row_pgv_pga": ("row", list(ratios)),
            "row_displaced": ("row", np.array(boundaries, "i1")),
            "step_share": list(_shares(scenes)),
        },
        {
            "step_unit_s": unit_of(_case(scenes, first)),
            "longest_step_s": most,
            "measured_on": "a flat pedestal" if scenes.ground is None else "its seat",
        },
    )


def _choice(dataset: xr.Dataset, tolerance: float, most: float = math.inf) -> Choice:
    """Choice from what was measured for one friction.

    Parameters
    ----------
    most : float [s], no longer step
    """
    unit, longest = (float(dataset.attrs[name]) for name in ("step_unit_s", "longest_step_s"))
    toppled, displaced = (front(dataset, boundary) for boundary in Boundary)
    return ladder.choose(toppled, displaced, tolerance, unit, min(longest, most * 0.01 / tolerance))
