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
    from pipeline.stages.runs import groups, prepared, time_step

    todo = [
        name
        for name, identity in graph.identities(product, job.site).items()
        if any(graph.why(stages()[name], identity, job.store))
    ]
    lines = [f"stages to make: {', '.join(todo) or 'none'}"]
    with tempfile.TemporaryDirectory() as temporary:
        rock = _with_rock(job, Path(temporary))
        config = job.config
        case = prepared(config, rock.store, config.yaw[0], config.contact.friction[0])
        kept = done = total = proved = 0
        for group in groups(config, rock.store):
            stored = _stored(job.store, group.keys)
            still = prepared(config, rock.store, group.yaw, group.friction).still
            limit = min(-still[0], still[1]) / GRAVITY if config.simulation.reduce else 0.0
            new = [
                cell for cell, key in zip(group.cells, group.keys, strict=True) if key not in stored
            ]
            done, total = done + len(stored), total + len(group.keys)
            proved += sum(pga < limit for _, pga in new)
            kept += len(new)
        lines.append(
            f"runs: {total}; {done} stored, {kept} to do, {proved} of them proved without a step"
        )
        lines.append(f"time step: {1e3 * time_step(config, case.full.rock):.3g} ms")
        lines.append(f"cost: {_cost(job, kept - proved)}")
    lines.append("left out:")
    lines += [f"  {r.what}: {r.why}" for r in case.reductions] or [
        "  nothing (simulation.reduce: off)"
    ]
    return lines


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
    """Runs stored and wanted; zero wanted where the rock is not made yet."""
    from pipeline.stages.runs import groups

    if job.store.manifest("rock") is None or job.store.damage("rock"):
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
