"""Batches handed to Dask's workers, as many as there is room for, until each has its result.

A batch whose worker died is suspect, although most often the worker was killed from outside. It is
done again among the others, item by item in a process of its own; so an item that kills its
process is found without another worker lost. A suspect whose workers die time and again is parted,
and an item whose workers do is the culprit, too.
"""

from __future__ import annotations

import time
from collections import OrderedDict, deque
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from pipeline.config.problems import STAYS, InputError, Problem, Unfinished
from pipeline.workflow import provenance, workers
from pipeline.workflow.log import complain
from pipeline.workflow.provenance import Provenance
from pipeline.workflow.workers import BATCHES_IN_FLIGHT, Batch, Done, Task, Work

DEATHS = 3
"""How many workers a suspect may lose before it is parted, or is the culprit if it is one item."""

LOOK = 1.0
"""Time [s] after which the workers that there are are counted anew."""

FETCHING = 10.0
"""Time [s] that a result has to come, before it is looked at again whether it still is there."""

LONELY = 120.0
"""Time [s] without any worker after which that is said."""

KEPT = 3
"""Shared objects that the workers keep: of the batches on their way, and the one before."""


class Suspect(NamedTuple):
    """A batch and how many of its workers died."""

    batch: Batch
    deaths: int


@dataclass
class Dispatch:
    """Batches on their way to the workers of a client and back.

    Attributes
    ----------
    together : bool, whether a process may do several batches at once
    upkeep : callable, asked now and then, to replace workers that have ended
    """

    client: Any
    function: Work
    batches: Iterator[Batch]
    shared: Callable[[Any], Any]
    together: bool
    upkeep: Callable[[], None]
    _told: bool = False
    _flying: dict[str, Suspect] = field(default_factory=dict)
    _again: deque[Suspect] = field(default_factory=deque)
    _sent: OrderedDict[Hashable, Any] = field(default_factory=OrderedDict)

    def results(self) -> Iterator[Done]:
        """Results of all batches, as they complete."""
        from distributed import as_completed

        # Without results, which it would wait for no more once a worker took one along.
        self._completed = as_completed()
        room = _Room(self)
        while len(self._flying) < room.now() and self._submit():
            pass
        while self._flying:
            arrived = _next(self._completed, LOOK)
            if arrived is not None:
                yield from self._landed(arrived)
            while len(self._flying) < room.now() and self._submit():
                pass

    def _submit(self) -> bool:
        if self._again:
            suspect = self._again.popleft()
        elif (batch := next(self.batches, None)) is not None:
            suspect = Suspect(batch, 0)
        else:
            return False
        batch = suspect.batch
        task = Task(self.function, batch.items, self.together, apart=suspect.deaths > 0)
        shared, client = self._thing(batch.shared), provenance.here().key
        future = self.client.submit(workers.door(), _pickled(task), shared, client, pure=False)
        self._flying[future.key] = suspect
        self._completed.add(future)
        return True

    def _thing(self, name: Hashable) -> Any:
        """What a batch shares, on its way to the workers or there."""
        if name not in self._sent:
            # A task, not scattered data: the scheduler makes it anew where a worker took it along.
            thing = _pickled(self.shared(name))
            self._sent[name] = self.client.submit(lambda thing: thing, thing, pure=False)
            if len(self._sent) > KEPT:
                self._sent.popitem(last=False)
        return self._sent[name]

    def _landed(self, future: Any) -> Iterator[Done]:
        ended, result = _result(future)
        if not ended:
            self._completed.add(future)
            return
        batch, deaths = self._flying.pop(future.key)
        if future.status == "finished":
            future.release()
            accepted, result = result
            if not accepted:
                raise InputError(_refusal(result))
            if deaths:
                for item, one in zip(batch.items, result, strict=True):
                    yield Done(batch._replace(items=(item,)), one)
            else:
                yield Done(batch, result)
            return
        self._sent.clear()  # what was shared may have failed with the worker
        _raise_what_is_no_death(future)
        if deaths + 1 <= DEATHS:
            self._again.append(Suspect(batch, deaths + 1))
        elif len(batch.items) > 1:
            parts = (batch._replace(items=(item,)) for item in batch.items)
            self._again.extend(Suspect(part, 1) for part in parts)
        else:
            yield Done(batch, None)

    def count(self) -> tuple[int, int]:
        """Processes that do batches, and batches on their way."""
        try:
            threads = self.client.nthreads().values()
        except OSError:
            raise Unfinished(LOST) from None
        if sum(threads) > len(threads) and not (self.together or self._told):
            self._told = True
            complain(
                f"vsr: warning: {len(threads)} workers have {sum(threads)} threads, and these runs "
                "use one each: start workers with --nthreads 1"
            )
        return sum(threads) if self.together else len(threads), len(self._flying)


LOST = f"the scheduler cannot be reached any more; {STAYS}"


class _Room:
    """How many batches may be on their way: that follows the workers that there are."""

    def __init__(self, dispatch: Dispatch) -> None:
        self._dispatch, self._room = dispatch, 0
        self._looked = -LOOK
        self._alone_since = time.monotonic()

    def now(self) -> int:
        """Room at present."""
        time_now = time.monotonic()
        if time_now - self._looked >= LOOK:
            self._dispatch.upkeep()
            processes, waiting = self._dispatch.count()
            self._room = BATCHES_IN_FLIGHT * max(processes, 1)
            self._looked = time_now
            if processes:
                self._alone_since = time_now
            elif time_now - self._alone_since > LONELY:
                self._alone_since = time_now
                self._say(waiting)
        return self._room

    def _say(self, waiting: int) -> None:
        address = self._dispatch.client.scheduler.address
        complain(
            f"vsr: warning: no worker for {LONELY / 60:.0f} minutes; {waiting} batches wait for "
            f"one: see to your jobs, or start one with `dask worker {address} --nthreads 1`; "
            f"Ctrl-C stops; {STAYS}"
        )


def _next(completed: Any, seconds: float) -> Any | None:
    """A future that is done; None if there is none in that time."""
    with completed.thread_condition:
        if not completed.has_ready():
            completed.thread_condition.wait(seconds)
    return next(completed) if completed.has_ready() else None


def _result(future: Any) -> tuple[bool, Any]:
    """Whether a future has ended for good, and what it gave if it ended well.

    A result may go with its worker before it is here; then it is made again.
    """
    if future.status == "finished":
        try:
            return True, future.result(timeout=FETCHING)
        except TimeoutError:
            return False, None
        except Exception:
            if future.status == "finished":
                raise
    return future.status != "pending", None


def _pickled(thing: Any) -> bytes:
    from distributed.protocol.pickle import dumps  # which takes functions of any place

    return bytes(dumps(thing))


def _raise_what_is_no_death(future: Any) -> None:
    """Raise why a batch failed, unless its worker died, or another with what is shared."""
    from distributed import KilledWorker

    if future.status == "cancelled":
        raise Unfinished(LOST)
    if future.status != "error":
        return
    error = future.exception()
    if isinstance(error, KilledWorker):
        return
    raise error


def _refusal(reason: tuple[dict[str, str], dict[str, str]] | str) -> Problem:
    """Why a worker's results would not be this command's."""
    if isinstance(reason, str):
        given = f"a worker without this program ({reason})"
    else:
        differences = provenance.here().differences(Provenance(*reason))
        more = f" and {len(differences) - 3} more" if len(differences) > 3 else ""
        given = f"a worker with other code or libraries ({', '.join(differences[:3])}{more})"
    rule = "all workers compute with what this command computes with"
    remedy = "end it, and start it again from this folder and its .venv"
    return Problem("--scheduler", "", given, rule, remedy)
