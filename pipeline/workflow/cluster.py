"""Where runs are done: in this process, on a local cluster, or on a scheduler that exists."""

from __future__ import annotations

import signal
from collections import deque
from collections.abc import Callable, Hashable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

BATCHES_IN_FLIGHT = 4
"""Batches handed out per worker: enough to keep it busy, few enough to lose."""

_SETTINGS = {
    "distributed.scheduler.allowed-failures": 0,
    "distributed.worker.preload": ["pipeline.workflow.cluster"],
    # Dask makes malloc give memory back at once; with that, rebuilding Bullet's world for each run
    # costs more than its physics.
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": 1 << 28,
    "distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_": 1 << 28,
}


class Batch(NamedTuple):
    """Items that share one object, done together by one worker.

    Attributes
    ----------
    shared : hashable, by which the object is known
    items : tuple
    """

    shared: Hashable
    items: tuple[Any, ...]


class Done(NamedTuple):
    """Results of a batch; None if the worker died on its only item."""

    batch: Batch
    results: Any


@dataclass(frozen=True)
class Cluster:
    """Choice of workers; nothing starts before there is work, and what started stays to the end.

    Attributes
    ----------
    workers : int, local worker processes; 0 does the work in this process
    scheduler, scheduler_file : address or file of a running Dask scheduler
    slurm : whether to start SLURM jobs, as configured for dask-jobqueue
    log : function of one line, for the dashboard's address
    threads : bool, whether the workers are threads of this process, for work that leaves the
        interpreter alone
    """

    workers: int
    scheduler: str | None = None
    scheduler_file: str | None = None
    slurm: bool = False
    log: Callable[[str], None] = print
    threads: bool = False
    _open: ExitStack = field(default_factory=ExitStack, repr=False, compare=False)
    _clients: list[Any] = field(default_factory=list, repr=False, compare=False)

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *error: object) -> None:
        self._clients.clear()
        self._open.close()

    @property
    def local(self) -> bool:
        """Whether the workers are this machine's."""
        return not (self.scheduler or self.scheduler_file or self.slurm)

    @property
    def free(self) -> bool:
        """Whether nothing has started, so that another process may have workers of its own."""
        return self.local and not self._clients

    def in_process(self) -> Cluster:
        """The same without worker processes, for work too small to start them.

        Returns
        -------
        Cluster
        """
        return replace(self, workers=0) if self.local else self

    def in_threads(self) -> Cluster:
        """The same with threads in place of worker processes, which start at once.

        Returns
        -------
        Cluster
        """
        return replace(self, threads=True) if self.local else self

    def run(
        self,
        function: Callable[[Any, tuple[Any, ...]], Any],
        batches: Iterator[Batch],
        shared: Callable[[Any], Any],
    ) -> Iterator[Done]:
        """Do batches of work, handing over their results as they complete.

        A batch whose worker dies is done again, one item at a time; an item that kills its
        worker again comes back alone, with None. Only the batches in flight are held here.

        Parameters
        ----------
        function : callable, from the shared object and the items of a batch to its results
        batches : iterator of Batch
        shared : callable, from what a batch names to the object its items share

        Yields
        ------
        Done
        """
        if self.local and self.workers == 0:
            yield from _in_turn(function, batches, shared)
            return
        if self.threads:
            yield from _in_threads(self.workers, function, batches, shared)
            return
        if not self._clients:
            self._clients.append(self._open.enter_context(self._client()))
        yield from _distributed(self._clients[0], function, batches, shared)

    def each(
        self,
        function: Callable[[Any, tuple[Any, ...]], Sequence[Any]],
        batches: Iterator[Batch],
        shared: Callable[[Any], Any],
    ) -> Iterator[tuple[Any, Any, Any]]:
        """Do batches of work whose results are one for each item.

        Parameters
        ----------
        function, batches, shared : as ``run`` takes them

        Yields
        ------
        (what the item's batch names as shared, item, result or None if it killed its worker)
        """
        for batch, results in self.run(function, batches, shared):
            for item, result in zip(batch.items, results or [None] * len(batch.items), strict=True):
                yield batch.shared, item, result

    @contextmanager
    def _client(self) -> Iterator[Any]:
        import dask
        import distributed

        if not self.local and not self.slurm:
            with distributed.Client(
                address=self.scheduler, scheduler_file=self.scheduler_file
            ) as client:
                self.log(f"dashboard: {client.dashboard_link}")
                yield client
            return
        with dask.config.set(_SETTINGS):
            if self.slurm:
                from dask_jobqueue import SLURMCluster

                cluster: Any = SLURMCluster()
                cluster.scale(max(self.workers, 1))
            else:
                cluster = distributed.LocalCluster(
                    n_workers=self.workers,
                    threads_per_worker=1,
                    dashboard_address="127.0.0.1:0",
                    silence_logs=50,
                )
            with cluster, distributed.Client(cluster) as client:
                self.log(f"dashboard: {client.dashboard_link}")
                yield client


def _in_turn(
    function: Callable[[Any, tuple[Any, ...]], Any],
    batches: Iterator[Batch],
    shared: Callable[[Any], Any],
) -> Iterator[Done]:
    last: Batch | None = None
    for batch in batches:
        if last is None or batch.shared != last.shared:
            last, thing = batch, shared(batch.shared)
        yield Done(batch, function(thing, batch.items))


def _in_threads(
    workers: int,
    function: Callable[[Any, tuple[Any, ...]], Any],
    batches: Iterator[Batch],
    shared: Callable[[Any], Any],
) -> Iterator[Done]:
    """Do batches in threads, a few at a time, and hand their results over in order."""
    things: dict[Hashable, Any] = {}
    with ThreadPoolExecutor(workers) as pool:
        flying: deque[tuple[Batch, Future[Any]]] = deque()
        for batch in batches:
            if batch.shared not in things:
                things = {batch.shared: shared(batch.shared)}
            flying.append((batch, pool.submit(function, things[batch.shared], batch.items)))
            if len(flying) > BATCHES_IN_FLIGHT * workers:
                done, future = flying.popleft()
                yield Done(done, future.result())
        for done, future in flying:
            yield Done(done, future.result())


def _distributed(
    client: Any,
    function: Callable[[Any, tuple[Any, ...]], Any],
    batches: Iterator[Batch],
    shared: Callable[[Any], Any],
) -> Iterator[Done]:
    from distributed import as_completed

    sent: dict[Hashable, Any] = {}
    flying: dict[str, tuple[Batch, bool]] = {}
    again: list[Batch] = []
    completed = as_completed(with_results=True, raise_errors=False)

    def submit() -> bool:
        if again and flying:
            return False  # a suspect runs alone: with its worker dies all that waits there
        suspect = bool(again)
        batch = again.pop() if suspect else next(batches, None)
        if batch is None:
            return False
        if batch.shared not in sent:
            # A task, not scattered data: the scheduler makes it anew where a worker took it along.
            sent[batch.shared] = client.submit(_same, shared(batch.shared), pure=False)
        future = client.submit(function, sent[batch.shared], batch.items, pure=False)
        flying[future.key] = batch, suspect
        completed.add(future)
        return True

    room = BATCHES_IN_FLIGHT * max(1, sum(client.nthreads().values()))
    while len(flying) < room and submit():
        pass
    for future, result in completed:
        batch, alone = flying.pop(future.key)
        if future.status == "finished":
            yield Done(batch, result)
        else:
            sent.clear()  # what was shared may have failed with the worker
            _raise_its_own_error(future, result)
            if alone:
                yield Done(batch, None)
            else:
                again += [batch._replace(items=(item,)) for item in batch.items]
        future.release()
        while len(flying) < room and submit():
            pass


def _same(thing: Any) -> Any:
    return thing


def _raise_its_own_error(future: Any, result: Any) -> None:
    """Raise an error of the function; not that its worker died, or another with what is shared."""
    from distributed import KilledWorker

    killed = isinstance(result[1] if isinstance(result, tuple) else result, KilledWorker)
    if future.status == "error" and not killed:
        future.result()


def dask_setup(worker: Any) -> None:
    """Dask calls this in each local worker: Ctrl-C is for the client, which ends its workers.

    Parameters
    ----------
    worker : the Dask worker
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
