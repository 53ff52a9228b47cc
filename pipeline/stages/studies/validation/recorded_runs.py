"""Runs of shake-table tests: those not stored yet are done where the workers are."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

from pipeline.stages.studies.validation.recorded_tests import Tests, accelerations
from pipeline.workflow import keys
from pipeline.workflow.cluster import Batch
from pipeline.workflow.code_roots import VALIDATION_CODE
from pipeline.workflow.progress import Progress
from pipeline.workflow.stage import Job
from pipeline.workflow.store import RunRow, RunStore
from vsr_core import engines
from vsr_core.outcome import DecidedBy, Outcome
from vsr_core.run.cases import Case
from vsr_core.validation.priors import Member
from vsr_core.validation.recorded_test import shaken, standing_case
from vsr_core.validation.specimen import Form, drawn

BATCH = 8
"""Tests handed to a worker at once, about half a second of work."""


class Draw(NamedTuple):
    """A member of an ensemble for one specimen."""

    specimen: int
    member: Member


class Shared(NamedTuple):
    """What the tests of one draw share on a worker."""

    folder: Path
    variable: str | None
    interval: float
    amplitude: float
    case: Case


def run_tests(shared: Shared, numbers: tuple[int, ...]) -> list[tuple[Any, ...]]:
    """Values of a row after its key for the tests of these numbers, and the CPU time used [s]."""
    start = time.process_time()
    records = accelerations(shared.folder, shared.variable)
    rows: list[tuple[Any, ...]] = []
    for number in numbers:
        found = shaken(shared.case, records[number], shared.interval, shared.amplitude)
        rows.append(
            (
                int(found.outcome),
                int(found.decided_by),
                found.peak_tilt,
                found.final_tilt,
                found.slip,
                found.steps,
            )
        )
    return [*rows, (time.process_time() - start,)]


def outcomes(
    job: Job,
    tests: Tests,
    forms: dict[int, Form],
    draws: dict[str, Draw],
    wanted: dict[str, tuple[int, ...]],
) -> dict[str, dict[int, RunRow]]:
    """Rows of the wanted tests of each draw, by the draw's name and the test's number.

    Parameters
    ----------
    job : Job, whose store keeps the runs
    tests : Tests
    forms : dict from specimen to its form
    draws : dict of Draw by name
    wanted : dict from a draw's name to numbers of tests
    """
    identity = _identities(job, tests, forms, draws, wanted)
    with closing(RunStore(job.store.folder, RunRow)) as runs:
        missing = {
            name: tuple(
                number
                for number in numbers
                if stored.get(identity[name, number], Outcome.CRASHED) == Outcome.CRASHED
            )
            for name, numbers in wanted.items()
            for stored in [runs.outcomes(identity[name, number] for number in numbers)]
        }
        _run(job, tests, forms, draws, missing, identity, runs)
        found = {}
        for name, numbers in wanted.items():
            rows = runs.get(identity[name, number] for number in numbers)
            found[name] = {number: rows[identity[name, number]] for number in numbers}
    return found


def _run(
    job: Job,
    tests: Tests,
    forms: dict[int, Form],
    draws: dict[str, Draw],
    missing: dict[str, tuple[int, ...]],
    identity: dict[tuple[str, int], bytes],
    runs: RunStore[RunRow],
) -> None:
    start, cpu = time.monotonic(), 0.0
    total = sum(map(len, missing.values()))

    def batches() -> Iterator[Batch]:
        for name, numbers in missing.items():
            for first in range(0, len(numbers), BATCH):
                yield Batch(name, name, numbers[first : first + BATCH])

    def shared(name: str) -> Shared:
        specimen, member = draws[name]
        rock = drawn(forms[specimen], member, tests.config.density)
        case = standing_case(rock, member)
        variable = tests.config.acceleration
        return Shared(job.site.folder, variable, tests.interval, member.amplitude, case)

    with Progress(total, job.log) as progress:
        for batch, results in job.cluster.run(run_tests, batches(), shared):
            rows = _rows(batch, results, identity)
            cpu += results[-1][0] if results is not None else 0.0
            runs.add(rows)
            progress.add([row.outcome for row in rows])
    if total:
        seconds = time.monotonic() - start
        job.store.note("validation", runs=total, seconds=seconds, cpu_seconds=cpu)
        job.log(f"{total} tests in {seconds:.0f} s, {1e3 * cpu / total:.0f} ms of CPU each")


def _rows(batch: Batch, results: Any, identity: dict[tuple[str, int], bytes]) -> list[RunRow]:
    names = [identity[batch.tag, number] for number in batch.items]
    if results is None:
        nan, crashed = float("nan"), int(Outcome.CRASHED)
        by = int(DecidedBy.SIMULATION)
        return [RunRow(name, crashed, by, nan, nan, nan, 0) for name in names]
    return [RunRow(name, *row) for name, row in zip(names, results[:-1], strict=True)]


def _identities(
    job: Job,
    tests: Tests,
    forms: dict[int, Form],
    draws: dict[str, Draw],
    wanted: dict[str, tuple[int, ...]],
) -> dict[tuple[str, int], bytes]:
    """Key of each run: scan, member, record, engine and the code that it reaches."""
    records = accelerations(job.site.folder, tests.config.acceleration)
    digests = {number: keys.digest_bytes(row.tobytes()) for number, row in records.items()}
    code = keys.digest(keys.code(VALIDATION_CODE))
    version = engines.load("bullet").VERSION
    shapes = {
        specimen: keys.digest_bytes(
            *(part.tobytes() for part in (form.vertices, form.normals, form.faces, form.other)),
            repr(form.spread).encode(),
        )
        for specimen, form in forms.items()
    }
    found = {}
    for name, (specimen, member) in draws.items():
        facts = {key: _plain(value) for key, value in vars(member).items()}
        common = [shapes[specimen], facts, repr(tests.config.density), tests.interval]
        scene = keys.digest([*common, code, version])
        for number in wanted.get(name, ()):
            found[name, number] = bytes.fromhex(keys.digest([scene, digests[number]]))[:16]
    return found


def _plain(value: Any) -> Any:
    return repr(value.tolist() if hasattr(value, "tolist") else value)
