"""What would run, what is done, and why: nothing changed on disk."""

from __future__ import annotations

import math
import tempfile
from bisect import bisect_left
from collections import Counter
from collections.abc import Iterable
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.config import in_si
from pipeline.config.fragility_schema import FINE
from pipeline.config.motion_schema import PulseGrid
from pipeline.config.schema import COMPILED, Config
from pipeline.inspection import disk
from pipeline.inspection.answers import (
    Beside,
    Made,
    Overview,
    Plan,
    Record,
    Room,
    Runs,
    Status,
    Stored,
    Why,
)
from pipeline.stages.mesh.products import Ground, Standing
from pipeline.stages.motions import motion_grid
from pipeline.stages.motions.motion_grid import Cell, MotionData, Shaking
from pipeline.stages.runs import displacement_runs, overturning_runs
from pipeline.stages.runs.runner import Kind, Run, Wanted, parts
from pipeline.stages.runs.scenes import MOST_RUNS, Group, Scenes, flat_case, left_out
from pipeline.stages.runs.step_choice import stored_steps
from pipeline.stages.runs.study import Study
from pipeline.workflow import graph, site_folder
from pipeline.workflow.cluster import Cluster
from pipeline.workflow.engine_input import find as find_engine
from pipeline.workflow.products import DELIVERABLES
from pipeline.workflow.registry import BY_NAME, upstream
from pipeline.workflow.run_store import RunStore, is_there
from pipeline.workflow.stage import Job
from pipeline.workflow.store import Store
from vsr_core.fragility.bisection import OUTWARD
from vsr_core.outcome import Outcome
from vsr_core.uncertainty import step_error

TYPICAL_MS, TYPICAL_COMPILED_MS, TYPICAL_ON_TERRAIN_MS = 6.0, 0.3, 25.0
"""CPU time of a run [ms] before any was measured here, in the engine that is asked for."""


def why(product: str, job: Job) -> Why:
    """Each stage that would be made again, with every reason."""
    settings = [f"{site_folder.FILE}: {fault}" for fault in site_folder.faults(job)]
    return Why(*_where(job), _stages(product, job), settings, _runs(job, product))


def status(product: str, job: Job) -> Status:
    """What is done: stages, runs and their outcomes."""
    stale = site_folder.told(job.store)
    room = disk.size(job.store.folder), disk.age(job.store.folder)
    others = _others(product, job.store)
    return Status(*_where(job), _stages(product, job), stale, _runs(job, product), *room, others)


def _others(product: str, store: Store) -> list[str]:
    """Products that are there, without those that one of them or the product asked for needs."""
    own = {stage.name for stage in upstream(product)}
    there: dict[str, str] = {}
    for name, wanted in DELIVERABLES.items():
        if name != "study" and wanted.stage not in own and store.manifest(wanted.stage) is not None:
            there.setdefault(wanted.stage, name)
    needed = {above.name for stage in there for above in upstream(stage)[:-1]}
    return [name for stage, name in there.items() if stage not in needed]


def overview(derived: Path) -> Overview:
    """Size and age of all results in a folder."""
    found = disk.folders(derived)
    rooms = [Room(str(one.relative_to(derived)), disk.size(one), disk.age(one)) for one in found]
    return Overview(str(derived), rooms)


def _where(job: Job) -> tuple[str, str]:
    return job.site.name, str(job.store.folder)


def _stages(product: str, job: Job) -> list[Made]:
    return [
        Made(name, list(graph.why(BY_NAME[name], identity, job.store)))
        for name, identity in graph.identities(product, job.site).items()
    ]


def plan(product: str, job: Job) -> Plan:
    """What would run, what it costs, and what is left out of the scene."""
    todo = [
        name
        for name, identity in graph.identities(product, job.site, to_make=False).items()
        if any(graph.why(BY_NAME[name], identity, job.store))
    ]
    if not _runs_a_grid(product):
        return Plan(*_where(job), todo)
    with tempfile.TemporaryDirectory() as temporary:
        study = _study(job, Path(temporary))
        assert study is not None
        runs = _planned_runs(job, study, *_asked(product, study))
    beside = [_planned_between(job.config, study)] if "boundary" in todo else []
    beside += [_planned_draws(job.config, study.motions)] if "uncertainty" in todo else []
    case = flat_case(study.scenes, study.groups[0])
    one_way = motion_grid.one_way(study.motions)
    dropped = left_out(study.settings, case, one_way=one_way)
    contact = str(study.scenes.standing.contact) if job.config.on_terrain else ""
    off = ["what is proved of shaking along one axis, as there are several"]
    off *= study.settings.simulation.reduce and not one_way
    return Plan(*_where(job), todo, runs, beside, contact, [str(one) for one in dropped], off)


def _runs_a_grid(product: str) -> bool:
    return bool({"runs", "displacement_runs"} & {stage.name for stage in upstream(product)})


def _asked(product: str, study: Study) -> tuple[Kind[Any], Wanted[Group]]:
    """Displacement runs, or runs whose outcome alone is wanted."""
    if "displacement_runs" in {stage.name for stage in upstream(product)}:
        return displacement_runs.KIND, study.wanted
    return overturning_runs.grid_runs(study)


def _study(job: Job, aside: Path | None) -> Study | None:
    """The study of a job; None where what it is made from is not fresh, and nothing may be made.

    Parameters
    ----------
    aside : Path, of a folder in which rock, ground and records are made where they are not fresh
    """
    config, known = job.config, is_there(job.store.runs)
    wanted = ["rock"]
    if config.on_terrain and known:  # else no run is stored, whose key would tell of it
        wanted.append("terrain")
    if not isinstance(config.motion, PulseGrid):
        wanted.append("motions")
    at = job
    if any(_is_stale(name, job) for name in wanted):
        if aside is None:
            return None
        quiet = replace(job, log=lambda line: None, shows=False)
        at = replace(quiet, store=Store(aside), cluster=Cluster(0))
        with at.store:
            for name in wanted:
                graph.make(name, at)
    ground = graph.built(Ground, at) if "terrain" in wanted else None
    scenes = Scenes(config.scene, graph.built(Standing, at), ground)
    steps = stored_steps(scenes, job.store.runs)
    engine = find_engine(config.engine, job.site)
    return Study(scenes, engine, config.yaw, config.motion, MotionData(at.store.folder), steps)


def _planned_runs(job: Job, study: Study, kind: Kind[Any], wanted: Wanted[Group]) -> Runs:
    """Runs to do and their cost; which are stored is known once the time step is measured."""
    settings, motions = study.settings, study.motions
    proves = settings.simulation.reduce and not settings.on_terrain and motion_grid.one_way(motions)
    total = proved = new = 0
    for group in study.groups:
        limit = 0.0
        if proves:
            still = flat_case(study.scenes, group).static_limits
            limit = in_si.in_g(min(-still[0], still[1]))
        total += (each := motion_grid.count(motions))
        known = not math.isnan(study.time_step(group)) and is_there(job.store.runs)
        if known and each <= MOST_RUNS:
            own = wanted(group)
            kept = _stored(job.store, own, kind)
            left = [run.item for run in own if run.key not in kept]
            new += len(left) * kind.cells
            weak = bisect_left(motions.pga, limit)
            proved += sum(one.pga < limit if isinstance(one, Cell) else weak for one in left)
        else:
            new += each
            proved += len(motions.rows) * bisect_left(motions.pga, limit)
    steps = sorted({step for step in study.steps.steps if not math.isnan(step)})
    return Runs(
        total,
        total - new,
        new,
        proved,
        steps,
        *_cost(job, new - proved, kind),
        _records(motions),
        len(motions.pga),
        job.config.with_vertical,
    )


def _planned_between(config: Config, study: Study) -> Beside:
    """Runs that part the intervals of the first overturning, one of them in each level."""
    pga, asked = np.array(study.motions.pga), config.fragility.resolution
    # of an even grid the gap at a fifth of its range, where boundaries are
    gap = float(np.quantile(np.diff(np.log(pga)), 0.8)) if len(pga) > 1 else np.log(OUTWARD)
    width = np.log1p(FINE if asked == "auto" else asked)
    each = math.ceil(math.log2(max(gap / width, 1.0)))
    levels = len(study.groups) * len(study.motions.rows)
    return Beside(levels * each, each, levels)


def _planned_draws(config: Config, motions: Shaking) -> Beside:
    """The runs that an ensemble takes as a rule, near its boundaries, and for its time step."""
    levels, members = len(config.yaw) * len(motions.rows), config.uncertainty.members
    chosen = config.simulation.time_step == "auto"
    measuring = step_error.planned(members, levels, chosen=chosen)
    return Beside(3 * members * levels + measuring, 3, levels, members)


def _records(motions: Shaking) -> list[Record]:
    """Each record, with its length and PGV/PGA; nothing of pulses."""
    if motions.dimension != "record":
        return []
    lengths = [
        motions.motion(Cell(row, motions.pga[-1])).duration for row in range(len(motions.rows))
    ]
    rows = zip(motions.rows, lengths, motions.pgv_pga, strict=True)
    return [Record(str(name), float(length), float(ratio)) for name, length, ratio in rows]


def _cost(job: Job, runs: int, kind: Kind[Any]) -> tuple[float, int, float, bool]:
    """Time of all runs [s], number of workers, time of a run [ms], whether it was measured."""
    engine = job.config.engine
    notes = job.store.notes(kind.stage)
    measured = [note for note in notes if note["runs"] and note["engine"] == engine]
    typical = TYPICAL_COMPILED_MS if engine == COMPILED else TYPICAL_MS
    typical = TYPICAL_ON_TERRAIN_MS if job.config.on_terrain else typical
    each = 1e3 * measured[-1]["cpu_seconds"] / measured[-1]["runs"] if measured else typical
    workers = max(job.cluster.workers, 1)
    return runs * each / 1e3 / workers, workers, each, bool(measured)


def _is_stale(name: str, job: Job) -> bool:
    return any(graph.why(BY_NAME[name], graph.identities(name, job.site)[name], job.store))


def _stored(store: Store, runs: Iterable[Run], kind: Kind[Any]) -> dict[bytes, int]:
    """Outcomes of those of the runs, or lines of them, that are stored."""
    if not is_there(store.runs):
        return {}
    with closing(RunStore(store.runs, kind.row, reads=True)) as database:
        return database.outcomes(run.key for run in runs)


def _tallied(store: Store, runs: Iterable[Run], kind: Kind[Any]) -> Counter[int]:
    """How many of the runs are stored, by outcome."""
    counts: Counter[int] = Counter()
    if is_there(store.runs):
        with closing(RunStore(store.runs, kind.row, reads=True)) as database:
            for part in parts(runs, kind.cells, kind.cells):
                rows = database.get(run.key for run in part).values()
                counts.update(code for row in rows for code in kind.outcomes(row[1:]))
    return counts


def _runs(job: Job, product: str) -> Stored | None:
    """Runs that are wanted and stored; None where there are none, or no key is known yet."""
    if not (isinstance(job.site.settings, Config) and _runs_a_grid(product)):
        return None
    study = _study(job, None)
    if study is None or any(map(math.isnan, study.steps.steps)):
        return None
    counts: Counter[int] = Counter()
    kind, asked = _asked(product, study)
    for group in study.groups:
        counts += _tallied(job.store, asked(group), kind)
    wanted = len(study.groups) * motion_grid.count(study.motions)
    outcomes = {Outcome(code).name.lower(): number for code, number in counts.most_common()}
    return Stored(wanted, counts.total(), outcomes) if wanted else None
