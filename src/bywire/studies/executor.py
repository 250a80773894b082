"""Execution of the chunks of a study: in this process, a process pool, or a Dask cluster."""

from __future__ import annotations

import logging
import time
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import islice
from typing import Any, Generic, Protocol, TypeVar

from bywire.bench.ensemble import numbers_per_case
from bywire.cases.runner import as_completed
from bywire.core.arguments import whole_number
from bywire.core.brake import load_brakes, loaded_files
from bywire.core.callers import collected_warnings, option
from bywire.core.copies import may_copy, processes_with_brakes
from bywire.core.errors import ParameterError, RunError
from bywire.core.libraries import allow_dask
from bywire.core.machine import machine_memory, worker_count
from bywire.data.file_format import library
from bywire.simulation.engine import CUDA
from bywire.studies.plan import CHUNK, StudyPlan
from bywire.studies.store import Columns, PlacedChunk, computed_chunks

_Chunks = Iterable[int | PlacedChunk]
T = TypeVar("T")


class Beside(Generic[T]):
    """Computation that runs in parallel with the chunks.

    ``future``: provides its value, and the warnings from another process.
    """

    def __init__(self, future: Future[tuple[T, list[Warning]]]) -> None:
        self._future = future

    def check(self) -> None:
        """Raise its exception if it has failed by now."""
        if self._future.done():
            self._future.result()

    def result(self) -> T:
        """Wait for its value, and repeat its warnings."""
        value, issued = self._future.result()
        for each in issued:
            warnings.warn(each, stacklevel=2)
        return value


class Compute(Protocol):
    """Computation of chunks, batch by batch."""

    def __call__(self, chunks: _Chunks) -> Iterator[tuple[int, Columns]]:
        """Yield number and columns of each chunk as soon as it is computed, in any order."""
        ...

    def beside(self, job: Callable[[], T]) -> Beside[T]:
        """Start another computation: now, or in a process that then continues with chunks."""
        ...


@dataclass(frozen=True)
class Apart:
    """Computation of chunks by a function, and of other tasks immediately."""

    chunks: Callable[[_Chunks], Iterator[tuple[int, Columns]]]

    def __call__(self, chunks: _Chunks) -> Iterator[tuple[int, Columns]]:
        """Yield chunks; see `Compute`."""
        return self.chunks(chunks)

    def beside(self, job: Callable[[], T]) -> Beside[T]:
        """Run it immediately; see `Compute`."""
        done: Future[tuple[T, list[Warning]]] = Future()
        done.set_result((job(), []))
        return Beside(done)


class Executor(Protocol):
    """Executor of chunks, in any order."""

    def opened(self, plan: StudyPlan) -> AbstractContextManager[Compute]:
        """Return the computation of chunks batch by batch; each is complete before the next one.

        Raises
        ------
        RunError
            If all workers are lost.
        """
        ...


def batched(chunks: _Chunks, size: int) -> Iterator[list[int | PlacedChunk]]:
    """Yield batches of chunks."""
    left = iter(chunks)
    while several := list(islice(left, size)):
        yield several


_AHEAD = 2  # tasks in flight for each worker, so that no worker is idle
# Chunks that are computed together share their setup, but all of their rows need memory.
_MOST = 4

_Task = tuple[float, list[tuple[int, Columns]]]
"""result of a task: processor time [s], and its chunks"""


class _Tasks:
    """Tasks of several chunks, which take about the same time until few chunks are left.

    Parameters
    ----------
    chunks
        The chunks.
    workers
        Number of workers that share them.
    seconds
        Target processor time of a task [s].
    most
        Maximum number of chunks in a task.
    """

    def __init__(
        self, chunks: _Chunks, workers: int, seconds: float, most: int | None = None
    ) -> None:
        self._left, self._workers = deque(chunks), workers
        self._seconds, self._most, self._size = seconds, most, 1

    def __iter__(self) -> Iterator[list[int | PlacedChunk]]:
        while task := self.next():
            yield task

    def next(self) -> list[int | PlacedChunk]:
        """Return the chunks of the next task; none if all are in tasks."""
        share = -(-len(self._left) // (_AHEAD * self._workers))
        return [self._left.popleft() for _ in range(min(self._size, share))]

    def measured(self, task: _Task) -> list[tuple[int, Columns]]:
        """Return the chunks of a finished task, whose time determines the size of the next ones."""
        seconds, given = task
        size = max(1, round(self._seconds * len(given) / max(seconds, 1e-9)))
        self._size = size if self._most is None else min(size, self._most)
        return given


def _timed(chunks: Sequence[int | PlacedChunk], plan: StudyPlan, threads: int | None = 1) -> _Task:
    """Return chunks, of which several are computed together, and their processor time."""
    begin = time.process_time()  # does not depend on other programs, unlike the elapsed time
    batches = (computed_chunks(plan, batch, threads) for batch in batched(chunks, _MOST))
    given = [computed for batch in batches for computed in batch]
    return time.process_time() - begin, given


# --- On a cluster of dask.distributed

_SECONDS = 10.0  # time limit to reach a cluster
_TASK = 0.5  # s: target processor time of a task of a cluster
# Dask works periodically: stack samples every 10 ms, ticks every 20 ms, memory checks every 100 ms.
# A core's worker, scheduler and client use 8 % of a core for this, or 1.4 % with these settings.
CLUSTER_SETTINGS = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.worker.memory.monitor-interval": "1s",
}
"""recommended configuration of Dask for scheduler and workers"""
# By default, Dask's workers return freed memory, and the next chunk requests it again page by page,
# which takes an eighth of its time.
CLUSTER_MEMORY = {"MALLOC_TRIM_THRESHOLD_": 1 << 28, "MALLOC_MMAP_THRESHOLD_": 1 << 25}
"""recommended environment of workers with glibc as C library [byte]"""

_LOST = "the cluster lost its workers ({}). Resume the study when workers are available again"
_GONE = "the cluster's scheduler is gone. Restart it, or use other workers, and resume the study"
_WHAT = ("studies on a cluster", "cluster")


class Cluster:
    """A cluster of dask.distributed.

    Parameters
    ----------
    address
        Address of its scheduler, for example ``tcp://host:8786``.
    """

    def __init__(self, address: str) -> None:
        self.address = address

    @contextmanager
    def opened(self, plan: StudyPlan) -> Iterator[Compute]:
        """Return the computation; see `Executor`."""
        with _client(self.address) as client:
            workers = len(client.scheduler_info()["workers"])
            if not workers:
                raise RunError(
                    f"the cluster at {self.address} has no workers. Start some with 'dask worker'",
                    name=option("cluster"),
                    value=self.address,
                )
            client.run(load_brakes, loaded_files())
            yield Apart(partial(_of_cluster, client, plan, workers))


@contextmanager
def _client(address: str) -> Iterator[Any]:
    allow_dask()
    distributed = library("distributed", *_WHAT)
    try:
        client = distributed.Client(address, timeout=_SECONDS, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise RunError(
            f"no cluster responds at {address!r} ({error}). Start one with 'dask scheduler' and "
            f"'dask worker', and pass the scheduler's address to {option('cluster')}",
            name=option("cluster"),
            value=repr(address),
        ) from None
    log = logging.getLogger("distributed.client")  # would print each lost connection
    before = log.level
    log.setLevel(logging.CRITICAL)
    try:
        yield client
    finally:
        client.close()
        log.setLevel(before)


def _of_cluster(
    client: Any, plan: StudyPlan, workers: int, chunks: _Chunks
) -> Iterator[tuple[int, Columns]]:
    """Yield the finished chunks of a cluster, with few tasks in flight.

    The overhead of a task equals some cases, so that a task should take about `_TASK`.
    """
    distributed = library("distributed", *_WHAT)
    # Send the plan once to every worker; otherwise each task would set up the bench again.
    kept = client.scatter(plan, broadcast=True, hash=False)
    tasks = _Tasks(chunks, workers, _TASK)
    with client.as_current():
        begun = distributed.as_completed(with_results=True)

    def submit() -> None:
        if task := tasks.next():
            begun.add(client.submit(_timed, task, plan=kept, pure=False))

    try:
        for _ in range(_AHEAD * workers):
            submit()
        for _, answer in begun:
            if isinstance(answer, BaseException):  # a canceled task provides the reason
                raise RunError(_lost(client, answer))
            given = tasks.measured(answer)
            submit()
            yield from given
    except distributed.KilledWorker as error:
        raise RunError(_lost(client, error)) from None


def _lost(client: Any, error: BaseException) -> str:
    """Return the lost part, the scheduler or only workers, with details."""
    reason = str(getattr(error, "reason", error))
    if client.status != "running" or "scheduler" in reason:
        return _GONE
    # Dask forgets a task if all workers with the study are lost.
    return _LOST.format("all of them" if "forgotten" in reason else reason)


# --- Choice of the executor

_POOLED = 0.2  # s: target processor time of a task in a pool; a killed study loses its tasks
# Chunks in one batch on a graphics processor. Up to 8,192 cases, a kernel takes as long as for one
# case, and processes take turns. So a batch has at least 2,048 cases if there are that many, and at
# most as many as the largest processors hold.
_LEAST_TOGETHER, _TOGETHER = 32, 512
_SHARE = 0.5  # of this machine's memory for the stimuli and rows of the batches of all processes
_MOST_WORKERS = 1024
# Minimum number of chunks that justify processes; a process that loads everything takes a second.
_WORTH_COPIES, _WORTH = 2, 8


@dataclass(frozen=True)
class _InPool:
    """Computation of chunks, and other tasks, in the processes of a pool."""

    pool: ProcessPoolExecutor
    workers: int
    together: int

    def __call__(self, chunks: _Chunks) -> Iterator[tuple[int, Columns]]:
        ahead = _AHEAD * self.workers
        if self.together == 1:
            tasks = _Tasks(chunks, self.workers, _POOLED, _MOST)
            begun = as_completed(self.pool, _computed, (tuple(task) for task in tasks), ahead)
            return (computed for _, task in begun for computed in tasks.measured(task))
        batches = as_completed(self.pool, _computed_together, batched(chunks, self.together), ahead)
        return (computed for _, batch in batches for computed in batch)

    def beside(self, job: Callable[[], T]) -> Beside[T]:
        return Beside(self.pool.submit(_told, job))


class InProcess:
    """The current process, with lanes on all cores, or a graphics processor.

    Parameters
    ----------
    together
        Number of chunks per batch.
    """

    def __init__(self, together: int = 1) -> None:
        self.together = together

    def _computed(self, plan: StudyPlan, chunks: _Chunks) -> Iterator[tuple[int, Columns]]:
        if self.together > 1:
            for several in batched(chunks, _fitting(plan, self.together, 1)):
                yield from computed_chunks(plan, several)
            return
        tasks = _Tasks(chunks, 1, _POOLED, _MOST)
        for task in tasks:
            yield from tasks.measured(_timed(task, plan, threads=None))

    @contextmanager
    def opened(self, plan: StudyPlan) -> Iterator[Compute]:
        """Return the computation; see `Executor`."""
        yield Apart(partial(self._computed, plan))


class Pool:
    """Processes on this machine, one per core.

    Parameters
    ----------
    workers
        Number of processes, >= 1.
    together
        Number of chunks per batch, more than 1 for a graphics processor, which the processes share:
        while it computes the batch of one process, the others prepare and judge cases.
    """

    def __init__(self, workers: int, together: int = 1) -> None:
        self.workers, self.together = workers, together

    @contextmanager
    def opened(self, plan: StudyPlan) -> Iterator[Compute]:
        """Return the computation; see `Executor`."""
        fewer = f"resume it with fewer {option('workers')}"
        with processes_with_brakes(self.workers, fewer, _give, plan) as pool:
            together = _fitting(plan, self.together, self.workers)
            yield _InPool(pool, self.workers, together)


def executor_of(
    workers: int | None,
    cluster: str,
    chunks: int,
    together: int | None = None,
    engine: str = "auto",
) -> Executor:
    """Return the executor: a cluster if its address is specified, otherwise processes.

    Parameters
    ----------
    workers
        Number of processes. None for one per core if the work justifies starting them.
    cluster
        Address of a Dask scheduler. Empty for this machine.
    chunks
        Number of remaining chunks.
    together
        Maximum number of chunks per batch. Default: all.
    engine
        Engine of the bench. A graphics processor computes many chunks per batch.

    Raises
    ------
    ParameterError
        As `require_workers`.
    """
    require_workers(workers, cluster, engine)
    if cluster:
        return Cluster(cluster)
    at_once = together or chunks
    if engine == CUDA:
        count = workers_on_device(workers, at_once)
        rounds = -(-at_once // (count * _TOGETHER))
        batch = -(-at_once // (count * rounds))
        return Pool(count, batch) if count > 1 else InProcess(batch)
    count = worker_count(workers, at_once)
    is_worth = workers is not None or chunks >= (_WORTH_COPIES if may_copy() else _WORTH)
    return Pool(count) if count > 1 and is_worth else InProcess()


def workers_on_device(workers: int | None, chunks: int) -> int:
    """Return the number of processes for a number of chunks on a graphics processor."""
    return worker_count(workers, max(chunks if workers else chunks // _LEAST_TOGETHER, 1))


def _fitting(plan: StudyPlan, together: int, workers: int) -> int:
    """Return the number of chunks per batch, split evenly if they exceed this machine's memory."""
    if together == 1:
        return 1
    size = 8 * CHUNK * numbers_per_case(plan.bench)
    most = max(int(_SHARE * machine_memory() / workers / size), 1)
    return -(-together // -(-together // most))


def require_workers(workers: int | None, cluster: str, engine: str) -> None:
    """Reject an invalid number of workers; see `executor_of`.

    Raises
    ------
    ParameterError
        For zero or too many workers, and for a cluster together with workers or a graphics
        processor.
    """
    if workers is not None:
        whole_number("workers", workers, 1, _MOST_WORKERS)
    if engine == CUDA and cluster:
        raise ParameterError(
            "engine = 'cuda' computes all cases on one graphics processor. Remove "
            f"{option('cluster')}",
            name=option("cluster"),
        )
    if cluster and workers is not None:
        raise ParameterError(
            f"a cluster has its own workers. Remove {option('workers')} or {option('cluster')}",
            name=option("workers"),
            value=str(workers),
        )


# Data of each process of a pool, which is sent once and not with every job.
_given: list[StudyPlan] = []


def _give(plan: StudyPlan) -> None:
    _given[:] = [plan]


def _told(job: Callable[[], T]) -> tuple[T, list[Warning]]:
    """Return the result of a job and its warnings, which its own process would not show."""
    with collected_warnings() as caught:
        value = job()
    return value, [each.message for each in caught if isinstance(each.message, Warning)]


def _computed(chunks: Sequence[int | PlacedChunk]) -> _Task:
    return _timed(chunks, _given[0])


def _computed_together(chunks: Sequence[int | PlacedChunk]) -> list[tuple[int, Columns]]:
    return computed_chunks(_given[0], chunks, threads=1)
