"""Who computes the chunks of a study: this process, a pool of processes, or a Dask cluster."""

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

from bywire.cases.runner import as_completed
from bywire.core.arguments import whole_number
from bywire.core.brake import load_brakes, loaded_files
from bywire.core.callers import heard_warnings, option
from bywire.core.copies import may_copy, processes_with_brakes
from bywire.core.errors import ParameterError, RunError
from bywire.core.libraries import allow_dask
from bywire.core.machine import worker_count
from bywire.data.file_format import library
from bywire.simulation.engine import CUDA
from bywire.studies.plan import StudyPlan
from bywire.studies.store import Columns, PlacedChunk, computed_chunk, computed_chunks, number_of

_Chunks = Iterable[int | PlacedChunk]
T = TypeVar("T")


class Beside(Generic[T]):
    """What is computed beside chunks.

    ``future``: gives its value, and what was warned of meanwhile in another process.
    """

    def __init__(self, future: Future[tuple[T, list[Warning]]]) -> None:
        self._future = future

    def check(self) -> None:
        """Raise what it raised, if it did so by now."""
        if self._future.done():
            self._future.result()

    def result(self) -> T:
        """Wait for its value, and warn of what was warned of."""
        value, said = self._future.result()
        for each in said:
            warnings.warn(each, stacklevel=2)
        return value


class Compute(Protocol):
    """What computes chunks batch by batch."""

    def __call__(self, chunks: _Chunks) -> Iterator[tuple[int, Columns]]:
        """Yield number and columns of each chunk as soon as it is there, in any order."""
        ...

    def beside(self, job: Callable[[], T]) -> Beside[T]:
        """Begin something else: at once, or in a process that then goes on with chunks."""
        ...


@dataclass(frozen=True)
class Apart:
    """Computes chunks by a function, and what stands beside them at once."""

    chunks: Callable[[_Chunks], Iterator[tuple[int, Columns]]]

    def __call__(self, chunks: _Chunks) -> Iterator[tuple[int, Columns]]:
        """Yield chunks; see `Compute`."""
        return self.chunks(chunks)

    def beside(self, job: Callable[[], T]) -> Beside[T]:
        """Do it at once; see `Compute`."""
        done: Future[tuple[T, list[Warning]]] = Future()
        done.set_result((job(), []))
        return Beside(done)


class Executor(Protocol):
    """Computes chunks, in any order."""

    def opened(self, plan: StudyPlan) -> AbstractContextManager[Compute]:
        """Return what computes chunks batch by batch, each one whole before the next.

        Raises
        ------
        RunError
            When workers are lost and none is left.
        """
        ...


def single(chunk: int | PlacedChunk, plan: StudyPlan) -> tuple[int, Columns]:
    """Return the number and the columns of a chunk, computed on one core."""
    return number_of(chunk), computed_chunk(plan, chunk, threads=1)


# --- On a cluster of dask.distributed

_AHEAD = 2  # tasks in flight for each worker, so that none waits for us
_SECONDS = 10.0  # to reach a cluster
_TASK = 0.5  # s that a task of a cluster is to take
# What Dask does by the clock: stacks sampled every 10 ms, ticks of 20 ms, memory looked at every
# 100 ms. A core's worker, scheduler and client take 8 % of a core with it, and 1.4 % with these.
CLUSTER_SETTINGS = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.worker.memory.monitor-interval": "1s",
}
"""configuration of Dask with which scheduler and workers are best started"""
# Dask has its workers give memory back at once, which the next chunk takes again page by page: an
# eighth of its time.
CLUSTER_MEMORY = {"MALLOC_TRIM_THRESHOLD_": 1 << 28, "MALLOC_MMAP_THRESHOLD_": 1 << 25}
"""environment with which workers are best started where the C library is glibc [byte]"""

_LOST = "the cluster lost its workers ({}): resume the study when some are there"
_GONE = "the cluster's scheduler is gone: resume the study when it is there again, or elsewhere"
_WHAT = ("studies on a cluster", "cluster")


_Task = tuple[float, list[tuple[int, Columns]]]
"""what a task of a cluster gives: time [s], and its chunks"""


class Cluster:
    """A cluster of dask.distributed.

    Parameters
    ----------
    address
        Of its scheduler, for instance ``tcp://host:8786``.
    """

    def __init__(self, address: str) -> None:
        self.address = address

    @contextmanager
    def opened(self, plan: StudyPlan) -> Iterator[Compute]:
        """Return what computes; see `Executor`."""
        with _client(self.address) as client:
            workers = len(client.scheduler_info()["workers"])
            if not workers:
                raise RunError(f"the cluster at {self.address} has no workers: start some first")
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
            f"no cluster answers at {address!r} ({error}): start one with 'dask scheduler' and "
            "'dask worker', and give the address that the scheduler prints"
        ) from None
    log = logging.getLogger("distributed.client")  # it would print how a connection is lost
    before = log.level
    log.setLevel(logging.CRITICAL)
    try:
        yield client
    finally:
        client.close()
        log.setLevel(before)


def _timed(chunks: Sequence[int | PlacedChunk], plan: StudyPlan) -> _Task:
    """Return chunks one after the other, and the time that they took."""
    begin = time.perf_counter()
    given = [single(chunk, plan) for chunk in chunks]
    return time.perf_counter() - begin, given


def _of_cluster(
    client: Any, plan: StudyPlan, workers: int, chunks: _Chunks
) -> Iterator[tuple[int, Columns]]:
    """Yield what a cluster has finished, with few tasks in flight.

    A task goes through scheduler and network, which takes as long as some cases: it is as many
    chunks as take about `_TASK`, but near the end no more than each worker's share.
    """
    distributed = library("distributed", *_WHAT)
    # Once to every worker, where it stays: with each task its bench would be made anew.
    kept = client.scatter(plan, broadcast=True, hash=False)
    left, size = deque(chunks), 1
    with client.as_current():
        tasks = distributed.as_completed(with_results=True)

    def submit() -> None:
        share = -(-len(left) // (_AHEAD * workers))
        task = [left.popleft() for _ in range(min(size, share))]
        if task:
            tasks.add(client.submit(_timed, task, plan=kept, pure=False))

    try:
        for _ in range(_AHEAD * workers):
            submit()
        for _, answer in tasks:
            if isinstance(answer, BaseException):  # a task that was cancelled gives why
                raise RunError(_lost(client, answer))
            seconds, given = answer
            size = max(1, round(_TASK * len(given) / seconds))
            submit()
            yield from given
    except distributed.KilledWorker as error:
        raise RunError(_lost(client, error)) from None


def _lost(client: Any, error: BaseException) -> str:
    """Return who is gone: the scheduler, or workers alone, with what else is known."""
    reason = str(getattr(error, "reason", error))
    if client.status != "running" or "scheduler" in reason:
        return _GONE
    # Tasks are forgotten where workers took the study, which they were given once, with them.
    return _LOST.format("all of them" if "forgotten" in reason else reason)


# --- Who computes

# Chunks that a graphics processor is given at once: 4,096 cases, of hard braking 2 GB of this
# machine's memory for stimuli and rows.
_TOGETHER = 64
_MOST_WORKERS = 1024
# Chunks from which on processes are worth their start; those that load all anew take a second.
_WORTH_COPIES, _WORTH = 2, 8


@dataclass(frozen=True)
class _InPool:
    """Computes chunks, and what stands beside them, in the processes of a pool."""

    pool: ProcessPoolExecutor
    ahead: int

    def __call__(self, chunks: _Chunks) -> Iterator[tuple[int, Columns]]:
        begun = as_completed(self.pool, _computed, chunks, self.ahead)
        return (computed for _, computed in begun)

    def beside(self, job: Callable[[], T]) -> Beside[T]:
        return Beside(self.pool.submit(_told, job))


class InProcess:
    """The process itself, with lanes on all cores, or a graphics processor.

    Parameters
    ----------
    together
        How many chunks are computed as one.
    """

    def __init__(self, together: int = 1) -> None:
        self.together = together

    def _computed(self, plan: StudyPlan, chunks: _Chunks) -> Iterator[tuple[int, Columns]]:
        left = iter(chunks)
        while several := list(islice(left, self.together)):
            yield from computed_chunks(plan, several)

    @contextmanager
    def opened(self, plan: StudyPlan) -> Iterator[Compute]:
        """Return what computes; see `Executor`."""
        yield Apart(partial(self._computed, plan))


class Pool:
    """Processes of this machine, a core each.

    Parameters
    ----------
    workers
        How many, >= 1.
    """

    def __init__(self, workers: int) -> None:
        self.workers = workers

    @contextmanager
    def opened(self, plan: StudyPlan) -> Iterator[Compute]:
        """Return what computes; see `Executor`."""
        fewer = f"resume it, with fewer {option('workers')}"
        with processes_with_brakes(self.workers, fewer, _give, plan) as pool:
            yield _InPool(pool, _AHEAD * self.workers)


def executor_of(
    workers: int | None,
    cluster: str,
    chunks: int,
    together: int | None = None,
    engine: str = "auto",
) -> Executor:
    """Return who computes: a cluster if one is named, else so many processes.

    Parameters
    ----------
    workers
        Processes; None for one a core where the work is worth their start.
    cluster
        Address of a Dask scheduler; empty for this machine.
    chunks
        How many chunks are left.
    together
        How many can be computed at once; all by default.
    engine
        What computes the bench: a graphics processor is given many chunks at once, by one process.

    Raises
    ------
    ParameterError
        As `require_workers`.
    """
    require_workers(workers, cluster, engine)
    if engine == CUDA:
        return InProcess(_TOGETHER)
    if cluster:
        return Cluster(cluster)
    count = worker_count(workers, together or chunks)
    is_worth = workers is not None or chunks >= (_WORTH_COPIES if may_copy() else _WORTH)
    return Pool(count) if count > 1 and is_worth else InProcess()


def require_workers(workers: int | None, cluster: str, engine: str) -> None:
    """Refuse workers that cannot be; see `executor_of`.

    Raises
    ------
    ParameterError
        For no workers or too many, for both at once, and for either beside a graphics processor.
    """
    if workers is not None:
        whole_number("workers", workers, 1, _MOST_WORKERS)
    if engine == CUDA and (workers is not None or cluster):
        raise ParameterError(
            "engine = 'cuda' computes all cases on one graphics processor: leave out "
            f"{option('cluster' if cluster else 'workers')}",
            name=option("cluster" if cluster else "workers"),
        )
    if cluster and workers is not None:
        raise ParameterError(
            f"a cluster has its own workers: leave out {option('workers')} or {option('cluster')}",
            name=option("workers"),
        )


# What a process of a pool computes: given once, and not with every job.
_given: list[StudyPlan] = []


def _give(plan: StudyPlan) -> None:
    _given[:] = [plan]


def _told(job: Callable[[], T]) -> tuple[T, list[Warning]]:
    """Return what a job gives, and what it warns of: here nobody would hear it."""
    with heard_warnings() as caught:
        value = job()
    return value, [each.message for each in caught if isinstance(each.message, Warning)]


def _computed(chunk: int | PlacedChunk) -> tuple[int, Columns]:
    return single(chunk, _given[0])
