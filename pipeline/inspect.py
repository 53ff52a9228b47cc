"""What would run, what is done, and why: lines of text, nothing changed on disk."""

from __future__ import annotations

import tempfile
from collections import Counter
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

from pipeline import graph
from pipeline.cluster import Cluster
from pipeline.scenes import prepared
from pipeline.stage import Job, stages
from pipeline.store import RUNS, RunRow, RunStore, Store
from vsr_core import GRAVITY

TYPICAL_MS = 6.0
"""CPU time of a run [ms] before any was measured here."""


def why(product: str, job: Job) -> list[str]:
    """Each stage that would be made again, with every reason."""
    lines = []
    for name, identity in graph.identities(product, job.site).items():
        reasons = list(graph.why(stages()[name], identity, job.store))
        if not reasons:
            lines.append(f"{name}: up to date")
        lines += [f"{name}: {reason}" for reason in reasons]
    kept, total = _runs(job)
    if total:
        lines.append(f"runs: {kept} of {total} are stored and stay; {total - kept} to do")
    return lines


def status(product: str, job: Job) -> list[str]:
    """What is done: stages, runs and their outcomes."""
    lines = [f"{job.site.name} in {job.store.folder}"]
    for name, identity in graph.identities(product, job.site).items():
        reasons = list(graph.why(stages()[name], identity, job.store))
        lines.append(f"  {name:<11}{'done' if not reasons else 'to do: ' + reasons[0]}")
    kept, total = _runs(job)
    if total:
        lines.append(f"  {kept} of {total} runs stored")
        counts = _outcomes(job)
        lines += [f"    {number:>7} {outcome}" for outcome, number in counts.most_common()]
    return lines


def plan(product: str, job: Job) -> list[str]:
    """What would run, what it costs, and what is left out of the scene."""
    todo = [
        name
        for name, identity in graph.identities(product, job.site).items()
        if any(graph.why(stages()[name], identity, job.store))
    ]
    lines = [f"stages to make: {', '.join(todo) or 'none'}"]
    config = job.config
    with tempfile.TemporaryDirectory() as temporary:
        store = _with_rock(job, Path(temporary)).store
        case = prepared(config, store, config.yaw[0], config.contact.friction[0])
        lines += _planned_runs(job, store, measured="precision" not in todo)
    lines.append("left out:")
    lines += [f"  {r.what}: {r.why}" for r in case.reductions] or [
        "  nothing (simulation.reduce: off)"
    ]
    return lines


def _planned_runs(job: Job, rock: Store, *, measured: bool) -> list[str]:
    """Runs to do and their cost; which are stored is known once the time step is ``measured``."""
    from pipeline.stages.precision import time_step
    from pipeline.stages.runs import groups

    config = job.config
    cells = [pga for _ in config.motion.pgv_pga for pga in config.motion.pga]
    stored: dict[tuple[float, float], list[bool]] = {}
    for group in groups(config, job.store) if measured else ():
        kept = _stored(job.store, group.keys)
        stored[group.yaw, group.friction] = [key in kept for key in group.keys]
    total = proved = new = 0
    for yaw in config.yaw:
        for friction in config.contact.friction:
            still = prepared(config, rock, yaw, friction).still
            limit = min(-still[0], still[1]) / GRAVITY if config.simulation.reduce else 0.0
            done = stored.get((yaw, friction), [False] * len(cells))
            left = [pga for pga, kept in zip(cells, done, strict=True) if not kept]
            total, new = total + len(cells), new + len(left)
            proved += sum(pga < limit for pga in left)
    frictions = config.contact.friction if measured else ()
    steps = {time_step(config, job.store, friction) for friction in frictions}
    text = ", ".join(f"{1e3 * step:.3g} ms" for step in sorted(steps))
    return [
        f"runs: {total}; {total - new} stored, {new} to do, {proved} of them proved without a step",
        f"time step: {text or 'measured on the scene first, some seconds'}",
        f"cost: {_cost(job, new - proved)}",
    ]


def _cost(job: Job, runs: int) -> str:
    measured = [note for note in job.store.notes("runs") if note["runs"]]
    each = 1e3 * measured[-1]["cpu_seconds"] / measured[-1]["runs"] if measured else TYPICAL_MS
    source = "as measured here" if measured else "typical"
    workers = max(job.cluster.workers, 1)
    seconds = runs * each / 1e3 / workers
    return f"about {seconds:.0f} s on {workers} workers at {each:.1f} ms a run ({source})"


def _with_rock(job: Job, folder: Path) -> Job:
    """The job with its rock at hand: as stored, or made in a temporary folder."""
    if not any(graph.why(stages()["rock"], graph.identities("rock", job.site)["rock"], job.store)):
        return job
    aside = replace(job, store=Store(folder), cluster=Cluster(0), log=lambda line: None)
    aside.store.open()
    graph.make("rock", aside)
    return aside


def _stored(store: Store, keys: Any) -> dict[bytes, RunRow]:
    if not (store.folder / RUNS).is_file():
        return {}
    with closing(RunStore(store.folder)) as runs:
        return runs.get(keys)


def _runs(job: Job) -> tuple[int, int]:
    """Runs stored and wanted; none wanted where the rock or its time step is not made yet."""
    from pipeline.stages.runs import groups

    if any(job.store.manifest(n) is None or job.store.damage(n) for n in ("rock", "precision")):
        return 0, 0
    kept = total = 0
    for group in groups(job.config, job.store):
        kept += len(_stored(job.store, group.keys))
        total += len(group.keys)
    return kept, total


def _outcomes(job: Job) -> Counter[str]:
    from pipeline.stages.runs import groups
    from vsr_core.outcome import Outcome

    counts: Counter[str] = Counter()
    for group in groups(job.config, job.store):
        rows = _stored(job.store, group.keys).values()
        counts.update(Outcome(row.outcome).name.lower() for row in rows)
    return counts
