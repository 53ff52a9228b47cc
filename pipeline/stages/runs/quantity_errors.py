"""Errors of tilts, slips and travels at a time step: measured, stored, the step they ask for, told.

A row is one direction and one time step: the errors of a sample of pulses, as
``vsr_core.run.quantities`` measures them. As the rows of the boundary it depends on no direction
and motion of a study.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from pipeline.config import in_si
from pipeline.config.problems import Unfinished
from pipeline.config.schema import COMPILED
from pipeline.stages.runs.scenes import Group, Scenes, flat_case, identity, terrain_case
from pipeline.workflow import keys
from pipeline.workflow.rows import StepRow
from pipeline.workflow.run_store import RunStore
from pipeline.workflow.stage import Work
from pipeline.workflow.workers import Batch
from vsr_core import engines
from vsr_core.arrays import Array
from vsr_core.outcome import OF_TRAVEL, QUANTITIES
from vsr_core.run import quantities
from vsr_core.run import time_step as ladder
from vsr_core.run.cases import Case, Settings, TerrainCase
from vsr_core.run.quantities import Error, summed_up
from vsr_core.source import tracing

ENDS = {"median": "median", "95": "most", "runs": "runs"}
"""Ends of the names of the variables that tell an error, and the fields of an ``Error``."""

FINER_STILL = (0.7, 0.5, 0.35, 0.25)
"""Steps that are tried beyond the ladder of the boundary, in units of its last one."""

LESS = 0.7
"""Share of its median error that a way has left two steps further, unless it is chaotic."""

IN_WORDS = {
    "peak_tilt": "largest tilt",
    "final_tilt": "final tilt",
    "slip": "slip",
    "end_position": "end position",
    "trajectory": "trajectory",
}
"""Quantities for a sentence."""

Measured = Callable[[Scenes, "list[Row]"], list[Array]]
"""From scenes and rows to the errors of the runs of each, in the order of ``QUANTITIES``."""


class Row(NamedTuple):
    """A row before it is measured.

    Attributes
    ----------
    time_step : float [s]
    """

    group: Group
    time_step: float


class Settled(NamedTuple):
    """A time step at which the tolerance holds for what ``simulation.accurate`` names.

    Attributes
    ----------
    time_step : float [s], the finest tried where it holds at none
    errors : dict, of the quantities named
    within : bool, whether it holds for all of them
    """

    time_step: float
    errors: dict[str, Error]
    within: bool


def settled(scenes: Scenes, longest: float, look: Measured) -> Settled:
    """Coarsest step of the ladder, and not longer than ``longest``, at which the tolerance holds.

    Parameters
    ----------
    scenes : Scenes, of one friction
    longest : float [s], at which it holds for the boundary; a step that is given is kept
    """
    simulation = scenes.settings.simulation
    named, tried = simulation.measured, [Settled(longest, {}, within=True)]
    for step in _steps(scenes, longest) if named else ():
        yaws = [in_si.in_degrees(yaw) for yaw in ladder.directions(scenes.level_rock)]
        (friction,) = scenes.settings.contact.friction
        rows = [Row(Group(yaw, friction), step) for yaw in yaws]
        runs = np.concatenate(look(scenes, rows), axis=1)
        errors = {name: summed_up(runs[QUANTITIES.index(name)]) for name in named}
        within = all(error.within(simulation.tolerance) for error in errors.values())
        tried.append(Settled(step, errors, within))
        if within or _hopeless([one.errors for one in tried[1:]]):
            break
    return tried[-1]


def _steps(scenes: Scenes, longest: float) -> list[float]:
    """Time steps to try, longest first [s]."""
    if scenes.settings.simulation.time_step != "auto":
        return [longest]
    shares = engines.load(scenes.settings.engine).LADDER.shares
    shares += tuple(share * shares[-1] for share in FINER_STILL)
    steps = (share * ladder.step_unit(scenes.level_rock) for share in shares)
    return [longest, *(step for step in steps if step < longest * (1.0 - 1e-9))]


def _hopeless(tried: Sequence[dict[str, Error]]) -> bool:
    """Whether a finer step brings nothing: too few runs have a quantity, or a way is chaotic."""
    if any(math.isnan(error.median) for error in tried[-1].values()):
        return True
    ways = [name for name in OF_TRAVEL if name in tried[-1]]
    before = tried[-3] if len(tried) > 2 else {}
    return any(tried[-1][way].median > LESS * before[way].median for way in ways if before)


def variables(found: Sequence[Settled]) -> dict[str, Any]:
    """Errors as variables along the frictions."""
    return {
        f"{name}_error_{end}": (
            "friction",
            [float(getattr(one.errors[name], field)) for one in found],
        )
        for name in (found[0].errors if found else ())
        for end, field in ENDS.items()
    }


def beside(dataset: xr.Dataset, measured: xr.Dataset, names: tuple[str, ...]) -> xr.Dataset:
    """A dataset with the errors of some quantities beside them, as far as they were measured."""
    errors = [f"{name}_error_{end}" for name in names for end in ENDS]
    known = {error: ("friction", measured[error].values) for error in errors if error in measured}
    return dataset.assign(known)


def steps_told(choices: Sequence[ladder.Choice]) -> str:
    """Steps of all frictions in words, with the errors of their boundaries."""
    return "time step " + "; ".join(sorted(set(map(_step_told, choices))))


def _step_told(choice: ladder.Choice) -> str:
    parts = [f"{1e3 * choice.time_step:.3g} ms"]
    if not math.isnan(choice.error):
        worst = f"{choice.worst:.2%} at the worst PGV/PGA level"
        parts.append(f"error of the boundary {choice.error:.2%}, {worst}")
    if choice.error > choice.agreement:
        parts.append(f"outcomes agree from {choice.agreement:.2%} off it")
    if not math.isnan(choice.displaced):
        parts.append(f"error of the boundary of sliding {choice.displaced:.2%}")
    return ", ".join(parts) if len(parts) > 1 else f"{parts[0]}, the finest"


def told(found: Sequence[Settled]) -> str:
    """Errors in words, the largest of all frictions."""
    parts = []
    for name in found[0].errors:
        median, most = (
            max(getattr(one.errors[name], field) for one in found) for field in ("median", "most")
        )
        parts.append(f"{IN_WORDS[name]} {median:.2%} in the median, 95% within {most:.2%}")
    if not parts:
        return ""
    return "; error of " + ", ".join(parts)


def warning(choices: Sequence[ladder.Choice], errors: Sequence[Settled]) -> str:
    """What of the steps is not as it was asked for."""
    if any(math.isnan(one.error) and math.isnan(one.displaced) for one in choices):
        return (
            "the error of the boundary was not measured, as too few of the pulses tried topple or "
            "displace the rock; the finest time step was taken"
        )
    if all([*(one.within for one in choices), *(one.within for one in errors)]):
        return ""
    return "the error is not within simulation.tolerance; time_step.nc states it"


def measured(
    work: Work, database: RunStore[StepRow], scenes: Scenes, rows: list[Row]
) -> list[Array]:
    """Errors of rows, of which those that are not stored are measured."""
    keys_of = dict(zip(rows, _keys(scenes, rows), strict=True))
    stored = database.get(keys_of.values())
    missing = [row for row in rows if keys_of[row] not in stored]
    if missing:
        step = f"{1e3 * missing[0].time_step:.3g} ms"
        work.log(f"time_step: measuring tilts and ways at {step} and a sixteenth of it")
    settings = scenes.settings
    number = _number(scenes)

    def shared(row: Row) -> tuple[Case | TerrainCase, Settings]:
        how = Settings(row.time_step, settings.simulation.reduce, settings.engine)
        return _case(scenes, row.group), how

    cluster = work.cluster.in_process() if len(missing) == 1 else work.cluster
    if settings.engine == COMPILED:
        cluster = cluster.in_threads()
    batches = (Batch(row, (number,)) for row in missing)
    for row, _, errors in cluster.each(measure_sample, batches, shared):
        if errors is None:
            raise Unfinished("a run of the sample for simulation.accurate killed its process")
        numbers = np.asarray(errors, "<f8").tobytes()
        stored[keys_of[row]] = StepRow(keys_of[row], 0, None, numbers)
        database.add([stored[keys_of[row]]])
    return [_unpacked(stored[keys_of[row]]) for row in rows]


def known(database: RunStore[StepRow], scenes: Scenes, rows: list[Row]) -> list[Array]:
    """Errors of stored rows; a KeyError where one is not."""
    keys_of = _keys(scenes, rows)
    stored = database.get(keys_of)
    return [_unpacked(stored[key]) for key in keys_of]


def measure_sample(
    shared: tuple[Case | TerrainCase, Settings], items: tuple[int, ...]
) -> list[Array]:
    """Measure the sample of one direction, friction and time step, on a worker.

    Parameters
    ----------
    items : tuple of int, how many pulses
    """
    return [quantities.measure(*shared, number) for number in items]


def _number(scenes: Scenes) -> int:
    """Pulses of the sample of a direction."""
    whole = quantities.PULSES if scenes.ground is None else quantities.PULSES_ON_TERRAIN
    return whole // len(ladder.directions(scenes.level_rock))


def _case(scenes: Scenes, group: Group) -> Case | TerrainCase:
    return flat_case(scenes, group) if scenes.ground is None else terrain_case(scenes, group)


def _keys(scenes: Scenes, rows: list[Row]) -> list[bytes]:
    """What tells each row from all others."""
    code = keys.digest(tracing.reached(["vsr_core.run.quantities:measure"]))
    shared, number = identity(scenes), _number(scenes)
    return [
        bytes.fromhex(keys.digest([shared, code, number, *row.group, repr(row.time_step)]))
        for row in rows
    ]


def _unpacked(row: StepRow) -> Array:
    return np.frombuffer(row.numbers, "<f8").reshape(len(QUANTITIES), -1)
