"""Runs that are not stored yet, done where the workers are and stored one by one.

Grids of outcomes, displacement runs and recorded shake-table tests are all run by this module. A
run is known by its key; runs that share something, such as a scene, form a group.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import dataclass
from functools import partial
from itertools import compress, islice
from operator import attrgetter, itemgetter
from pathlib import Path
from typing import Any, Generic, NamedTuple, Self, TypeVar

from pipeline.config.problems import Problem, Unfinished
from pipeline.config.schema import COMPILED
from pipeline.workflow.progress import Progress
from pipeline.workflow.rows import Row
from pipeline.workflow.run_store import RUNS, RunsLost, RunStore
from pipeline.workflow.stage import Work
from pipeline.workflow.store import Store
from pipeline.workflow.workers import Batch
from vsr_core.outcome import Outcome

SMALL = 200
"""Below this many runs no worker process is started."""

QUICK = 200_000
"""Runs of a compiled engine, up to this many, are done in threads: they mostly take less time than
worker processes take to start."""

G = TypeVar("G", bound=Hashable)
Item = TypeVar("Item")


class Run(NamedTuple):
    """A run that is wanted: its key, and what its function takes, such as a cell of a grid."""

    key: bytes
    item: Any


Wanted = Callable[[G], Iterable[Run]]
"""From a group to its runs, which it may be asked for again and again."""

AT_ONCE = 65_536
"""Runs whose keys are held at once, whatever their number: some 20 MB."""

BATCH_SECONDS, LARGEST_BATCH = 0.3, 1000
"""CPU time [s] for which batches are sized, and the runs that one has at most."""


@dataclass(frozen=True)
class Kind(Generic[Row]):
    """A kind of run, and how its results are kept.

    Attributes
    ----------
    function : run on a worker, from what the runs of a group share and the items of some of them,
        to the values of a row after its key, for each
    batch : int, runs handed to a worker at once until it is known how long they take
    cells : int, runs that one item stands for
    outcomes : from the fields of a row but its key to the outcomes of its runs
    """

    stage: str
    what: str
    row: type[Row]
    function: Callable[[Any, tuple[Any, ...]], list[tuple[Any, ...]]]
    batch: int
    cells: int = 1
    outcomes: Callable[[Sequence[Any]], Sequence[int]] = itemgetter(slice(1))


@dataclass(frozen=True)
class Tally:
    """What was done."""

    summary: str
    runs: int
    crashed: int


def run_missing(
    work: Work,
    kind: Kind[Row],
    groups: Sequence[G],
    wanted: Wanted[G],
    shared: Callable[[G], Any],
    store: RunStore[Row] | None = None,
) -> Tally:
    """Do those of the wanted runs that are not stored; crashed ones are tried again.

    Parameters
    ----------
    wanted : Wanted, asked twice for each group, so that no group is held
    store : RunStore, where the caller holds it open for many calls
    """
    start, cpu = time.monotonic(), 0.0
    opened: AbstractContextManager[RunStore[Row]] = (
        nullcontext(store) if store else closing(RunStore(work.runs, kind.row))
    )
    with opened as runs:
        todo = [missing(wanted(group), runs) for group in groups]
        total = sum(map(sum, todo)) * kind.cells
        compiled = work.engine == COMPILED
        shares = compiled and (total <= QUICK or not work.cluster.local)
        cluster = work.cluster.in_threads() if shares else work.cluster
        cluster = work.cluster.in_process() if total < SMALL else cluster
        planned = 0

        def size() -> int:
            each = cpu / max(progress.outcomes.total(), 1)
            number = min(int(BATCH_SECONDS / each), LARGEST_BATCH) if each else kind.batch
            return max(number // kind.cells, 1)

        def batches() -> Iterator[Batch]:
            nonlocal planned
            for group, marks in zip(groups, todo, strict=True):
                for items in _batches(compress(wanted(group), marks), size) if any(marks) else ():
                    planned += len(items) * kind.cells
                    yield Batch(group, items)

        with Progress(total, work.log) as progress:
            for batch, done in cluster.run(partial(_timed, kind.function), batches(), shared):
                values, used = done or ([(int(Outcome.CRASHED),)] * len(batch.items), 0.0)
                rows = [kind.row(r.key, *v) for r, v in zip(batch.items, values, strict=True)]
                runs.add(rows)
                cpu += used
                progress.add([int(code) for one in values for code in kind.outcomes(one)])
    total = progress.outcomes.total()
    if total != planned:
        given = f"{total} of {planned} {kind.what} came back"
        raise Unfinished(f"{given}; the same command does the others")
    seconds = time.monotonic() - start
    workers = cluster.workers if cluster.local else -1
    spent = {"runs": total, "seconds": seconds, "cpu_seconds": cpu}
    work.note(engine=work.engine, **spent, workers=workers)
    rate = f" in {seconds:.1f} s, {1e3 * cpu / total:.1f} ms of CPU each" if total else ""
    crashed = progress.outcomes[Outcome.CRASHED]
    lost = f", {crashed} of them crashed" if crashed else ""
    return Tally(f"{total} {kind.what} done{rate}{lost}", total, crashed)


def stored(
    database: Path, kind: Kind[Row], groups: Sequence[G], wanted: Wanted[G], whole: int = 1
) -> Iterator[tuple[G, list[Row]]]:
    """Read the wanted runs of each group, in their order and in parts.

    Parameters
    ----------
    database : Path, of its folder
    whole : int, of how many runs a part has a multiple

    Yields
    ------
    (group, list of rows), one group after the other, as many rows at a time as ``at_once`` says
    """
    with closing(RunStore(database, kind.row, reads=True)) as runs:
        for group in groups:
            for part in parts(wanted(group), whole, kind.cells):
                found = runs.get(run.key for run in part)
                lost = sum(run.key not in found for run in part)
                if lost:
                    given = f"{lost} {kind.what} fewer than were done"
                    rule, remedy = "every run that was done is kept", "start again to redo them"
                    raise RunsLost(Problem(str(database / RUNS), "", given, rule, remedy))
                yield group, [found[run.key] for run in part]


@dataclass(frozen=True)
class StoredRuns:
    """Runs as the product of a stage: rows of the database in a folder."""

    database: Path

    @classmethod
    def load(cls, store: Store) -> Self:
        """The runs of a site."""
        return cls(store.runs)


def missing(wanted: Iterable[Run], runs: RunStore[Any]) -> bytes:
    """Mark the wanted runs that are not stored, or crashed."""
    marks, crashed = bytearray(), int(Outcome.CRASHED)
    for part in parts(wanted):
        known = runs.outcomes(run.key for run in part)
        marks.extend(known.get(run.key, crashed) == crashed for run in part)
    return bytes(marks)


def at_once(whole: int = 1) -> int:
    """Runs or rows that are held: the largest multiple of ``whole`` up to ``AT_ONCE``, or one."""
    return max(AT_ONCE // whole, 1) * whole


def parts(items: Iterable[Item], whole: int = 1, cells: int = 1) -> Iterator[list[Item]]:
    """Runs or rows, ``at_once`` of them at a time, of which an item stands for some."""
    left = iter(items)
    while part := list(islice(left, max(at_once(whole) // cells, 1))):
        yield part


def _batches(runs: Iterable[Run], size: Callable[[], int]) -> Iterator[tuple[Run, ...]]:
    """Runs of about one cost a batch, whose rows are neighbours in the database."""
    for part in parts(runs):
        part.sort(key=attrgetter("key"))
        start = 0
        while start < len(part):
            batch = tuple(part[start : start + size()])
            start += len(batch)
            yield batch


def _timed(
    function: Callable[[Any, tuple[Any, ...]], list[tuple[Any, ...]]],
    shared: Any,
    runs: tuple[Run, ...],
) -> tuple[list[tuple[Any, ...]], float]:
    """Results of a batch and the CPU time used [s], on a worker."""
    start = time.thread_time()
    rows = function(shared, tuple(run.item for run in runs))
    return rows, time.thread_time() - start
