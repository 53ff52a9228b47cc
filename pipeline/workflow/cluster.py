"""Where runs are done: in this process, on a local cluster, or on a scheduler that exists."""

from __future__ import annotations

import errno
import logging
import multiprocessing
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Hashable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from multiprocessing import resource_tracker
from pathlib import Path
from types import FrameType
from typing import Any, cast

from pipeline.config.outside import held
from pipeline.config.problems import InputError, Problem
from pipeline.workflow.dispatch import Dispatch
from pipeline.workflow.outside_settings import MEND_DASK, dask_is_set, unread
from pipeline.workflow.workers import BATCHES_IN_FLIGHT, Batch, Done
from vsr_core.errors import InvalidInput

WALLTIME_SHARE = 0.1
"""Part of the walltime by which a worker ends early, and by which others end earlier still."""

JOBS_EVERY = 10.0
"""Time [s] between looks for jobs that have ended."""


@dataclass
class Jobs:
    """SLURM jobs that serve as workers."""

    cluster: Any
    workers: int
    _looked: float = 0.0
    _served: set[str] = field(default_factory=set)

    def renew(self) -> None:
        """Ask for a new job in place of each whose workers have all left."""
        if time.monotonic() - self._looked < JOBS_EVERY:
            return
        self._looked = time.monotonic()
        self.cluster.sync(self._renew)

    async def _renew(self) -> None:
        serving = self._serving()
        for job in self._served - serving:
            self.cluster.workers.pop(job, None)
        self._served = serving
        self.cluster.scale(self.workers)

    def _serving(self) -> set[str]:
        """Jobs with a worker; those of a job with several are numbered after its name."""
        names = {str(one["name"]) for one in self.cluster.scheduler_info["workers"].values()}
        jobs = {str(job) for job in self.cluster.workers}
        return jobs & (names | {name.rpartition("-")[0] for name in names})


@contextmanager
def slurm_jobs(workers: int) -> Iterator[Jobs]:
    """Start jobs as dask-jobqueue is configured to, each of its workers with one thread."""
    import dask

    try:
        from dask_jobqueue.slurm import SLURMCluster

        settings = dask.config.get("jobqueue.slurm")
        seconds = _seconds(str(settings["walltime"]))
        lifetime = ["--lifetime", f"{(1.0 - 2.0 * WALLTIME_SHARE) * seconds:.0f}s"]
        stagger = ["--lifetime-stagger", f"{WALLTIME_SHARE * seconds:.0f}s"]
        preload = ["--preload", "pipeline.workflow.workers"]
        cluster = SLURMCluster(
            processes=settings["cores"],
            worker_extra_args=[*settings["worker-extra-args"], *lifetime, *stagger, *preload],
        )
    except (ImportError, ValueError, TypeError, OSError) as error:
        rule = "dask-jobqueue is installed, with cores, memory and walltime of a job configured"
        remedy = (
            "install it with .venv/bin/pip install -e '.[slurm]'; see ~/.config/dask/jobqueue.yaml"
        )
        given = f"slurm ({str(error).splitlines()[0]})"
        raise InputError(Problem("--cluster", "", given, rule, remedy)) from None
    with cluster:
        cluster.scale(workers)
        yield Jobs(cluster, workers)


def _seconds(walltime: str) -> float:
    """Seconds of a walltime as SLURM writes it.

    >>> [_seconds(text) for text in ("30", "30:00", "01:00:00", "2-00:00:00", "1-12")]
    [1800.0, 1800.0, 3600.0, 172800.0, 129600.0]
    """
    days, _, clock = walltime.rpartition("-")
    parts = [float(part) for part in clock.split(":")]
    if days:  # days-hours[:minutes[:seconds]]
        hours, minutes, seconds = (*parts, 0.0, 0.0)[:3]
    elif len(parts) == 1:
        hours, minutes, seconds = 0.0, parts[0], 0.0
    else:
        hours, minutes, seconds = (0.0, *parts)[-3:]
    return 86400.0 * float(days or 0) + 3600.0 * hours + 60.0 * minutes + seconds


_LOCAL = {
    "distributed.scheduler.allowed-failures": 0,
    "distributed.scheduler.idle-timeout": None,
    "distributed.scheduler.blocked-handlers": [],
    "distributed.scheduler.pickle": True,
    "distributed.worker.lifetime.duration": None,
    "distributed.worker.preload": ["pipeline.workflow.workers"],
}
"""Dask's settings of workers of this machine, whatever others say."""

LOGS = "distributed", "distributed.client", "asyncio", "tornado.application"
"""Logs that are silenced: what matters of them is said in a line here."""

CONNECTING = 5.0
"""Time [s] that a scheduler has to answer."""

CLOSING = 5.0
"""Time [s] that it has to say goodbye."""


@dataclass(frozen=True)
class Cluster:
    """Choice of workers; nothing starts before there is work, and what started stays to the end.

    Attributes
    ----------
    workers : int, local worker processes; 0 does the work in this process
    together : bool, whether the work leaves the interpreter alone and shares no state, so that
        one process does several batches at once
    """

    workers: int
    scheduler: str | None = None
    scheduler_file: str | None = None
    slurm: bool = False
    log: Callable[[str], None] = print
    together: bool = False
    _open: ExitStack = field(default_factory=ExitStack, repr=False, compare=False)
    _clients: list[Any] = field(default_factory=list, repr=False, compare=False)

    def __enter__(self) -> Cluster:
        if self.scheduler or self.scheduler_file:
            self._start()  # one that does not answer is told before any work
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
        """The same without worker processes, for work too small to start them."""
        return replace(self, workers=0) if self.local else self

    def in_threads(self) -> Cluster:
        """The same for work that shares a process; here that is threads, which start at once."""
        return replace(self, together=True)

    def run(
        self,
        function: Callable[[Any, tuple[Any, ...]], Any],
        batches: Iterator[Batch],
        shared: Callable[[Any], Any],
    ) -> Iterator[Done]:
        """Do batches of work, handing over their results as they complete.

        Only the batches in flight are held here. An item that kills its process time and again
        comes back alone, with None.

        Parameters
        ----------
        function : callable, from the shared object and the items of a batch to its results
        """
        if self.local and self.workers == 0:
            yield from _in_turn(function, batches, shared)
        elif self.local and self.together:
            yield from _in_threads(self.workers, function, batches, shared)
        else:
            client, upkeep = self._start()
            dispatch = Dispatch(client, function, batches, shared, self.together, upkeep)
            yield from dispatch.results()

    def each(
        self,
        function: Callable[[Any, tuple[Any, ...]], Sequence[Any]],
        batches: Iterator[Batch],
        shared: Callable[[Any], Any],
    ) -> Iterator[tuple[Any, Any, Any]]:
        """Do batches of work whose results are one for each item."""
        for batch, results in self.run(function, batches, shared):
            for item, result in zip(batch.items, results or [None] * len(batch.items), strict=True):
                yield batch.shared, item, result

    def _start(self) -> tuple[Any, Callable[[], None]]:
        """What ``_client`` yields, once."""
        if not self._clients:
            self._clients.append(self._open.enter_context(self._client()))
        client, upkeep = self._clients[0]
        return client, upkeep

    @contextmanager
    def _client(self) -> Iterator[tuple[Any, Callable[[], None]]]:
        """Dask's client, and what replaces workers that have ended."""
        import dask
        import distributed  # noqa: F401 (before its settings are changed)

        for name in LOGS:
            logging.getLogger(name).setLevel(logging.CRITICAL)
        with ExitStack() as stack:
            upkeep: Callable[[], None] = _nothing
            if self.local:
                stack.enter_context(dask.config.set(_LOCAL))
                cluster = _local_cluster(self.workers)
                upkeep, address = partial(_renew, cluster), stack.enter_context(cluster)
            elif self.slurm:
                jobs = stack.enter_context(slurm_jobs(self.workers))
                upkeep, address = jobs.renew, jobs.cluster
            else:
                address = self.scheduler
            connected = _connected(address, self.scheduler_file)
            try:
                client = stack.enter_context(connected)
                link = client.dashboard_link
            except (KeyError, ImportError) as error:
                raise unread("Dask", error, MEND_DASK) from None
            self.log(f"dashboard: the workers, in a browser at {link}")
            yield client, upkeep


def _local_cluster(workers: int) -> Any:
    import distributed

    if multiprocessing.current_process().daemon:
        given, rule = f"{workers} in a process of a pool", "such a process has none of its own"
        raise InputError(Problem("worker processes", "", given, rule, "give workers=0"))
    try:
        with held_back():  # Dask cannot end workers that are half started
            return distributed.LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                dashboard_address="127.0.0.1:0",
                silence_logs=50,
            )
    except Exception as error:  # noqa: BLE001 (whatever a setting brings up)
        raise _of_a_setting(error) from None


def _of_a_setting(error: Exception) -> Exception:
    """What Dask meets when it first uses a setting that it cannot; else the same error."""
    causes: list[BaseException] = [error]
    while further := causes[-1].__cause__ or causes[-1].__context__:
        causes.append(further)  # where a worker's nanny met it
    for cause in causes:
        if isinstance(cause, MemoryError) or getattr(cause, "errno", None) in _TOO_LITTLE:
            return cast(Exception, cause)
    cause = next((one for one in causes if isinstance(one, _OF_A_SETTING)), causes[-1])
    if isinstance(cause, _OF_A_SETTING) or dask_is_set():
        return unread("Dask", cause, MEND_DASK)
    if isinstance(error, RuntimeError):
        given, remedy = f"those that end as they start ({error})", "write it so, or give workers=0"
        return InputError(Problem("worker processes", "", given, GUARDED, remedy))
    return error


_TOO_LITTLE = errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.ENOSPC  # told wherever they are met

GUARDED = (
    'each imports the script that starts them, which has its calls below if __name__ == "__main__":'
)


_OF_A_SETTING = ImportError, KeyError, TypeError, ValueError


def _renew(cluster: Any) -> None:
    """Start workers anew that have ended, or that Dask gave up as they took long to come back."""
    cluster.scale(len(cluster.worker_spec))


_LARGEST_FILE = 1024**2
"""Bytes of the file in which a scheduler says where it is."""


def _check_scheduler_file(path: Path) -> None:
    """Refuse what Dask would wait for, or read without an end."""
    try:
        held(path, _LARGEST_FILE)
    except InvalidInput as error:
        raise OSError(error.given) from None


@contextmanager
def _connected(address: Any, file: str | None) -> Iterator[Any]:
    import distributed
    from distributed.comm.addressing import parse_address
    from distributed.comm.registry import get_backend

    try:
        if file:
            _check_scheduler_file(Path(file))
        if isinstance(address, str):  # else a client is left behind half made
            get_backend(parse_address(address)[0])
        client = distributed.Client(address=address, scheduler_file=file, timeout=CONNECTING)
    except (OSError, ValueError) as error:
        if not (file or isinstance(address, str)):  # our own workers
            raise _of_a_setting(error) from None
        given, rule = f"{address or file} ({error})", "a Dask scheduler answers there"
        remedy = "start one with `dask scheduler`, or leave the option out"
        key = "--scheduler-file" if file else "--scheduler"
        raise InputError(Problem(key, "", given, rule, remedy)) from None
    try:
        yield client
    finally:
        with suppress(OSError, TimeoutError):  # where the scheduler is gone
            client.close(timeout=CLOSING)


def _nothing() -> None:
    pass


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
    with ThreadPoolExecutor(workers) as pool, ExitStack() as left:
        left.callback(pool.shutdown, wait=False, cancel_futures=True)
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


@contextmanager
def held_back() -> Iterator[None]:
    """Let Ctrl-C and SIGTERM wait until something is whole, such as a cluster that starts.

    Processes that start meanwhile never hear Ctrl-C, which a terminal sends to all of them: this
    one ends them.
    """
    came: list[int] = []

    def note(number: int, frame: FrameType | None) -> None:
        came.append(number)

    resource_tracker.ensure_running()  # which unblocks Ctrl-C when it starts
    if threading.current_thread() is not threading.main_thread():  # which alone hears of signals
        yield
        return
    before = signal.signal(signal.SIGTERM, note)  # where held by the mask, children could not end
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        if came:
            signal.raise_signal(signal.SIGTERM)
