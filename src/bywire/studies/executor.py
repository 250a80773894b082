"""Who computes the chunks of a study: this process, a pool of processes, or a Dask cluster."""

from __future__ import annotations

import logging
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from itertools import islice
from multiprocessing import active_children, get_context, parent_process
from typing import Any, Protocol

from bywire.core.brake import load_system, loaded_files
from bywire.core.errors import ParameterError, RunError
from bywire.core.unneeded import allow_dask
from bywire.data.file_format import library
from bywire.simulation.engine import CUDA
from bywire.studies.chunk import (
    Columns,
    PlacedChunk,
    computed_chunk,
    computed_chunks,
    number_of,
)
from bywire.studies.plan import StudyPlan

# Chunks that a graphics processor is given at once: 4,096 cases, of hard braking 2 GB of this
# machine's memory for stimuli and rows.
_TOGETHER = 64
_AHEAD = 2  # chunks, or tasks of a cluster, in flight for each worker, so that none waits for us
_SECONDS = 10.0  # to reach a cluster
_TASK = 0.5  # s that a task of a cluster is to take
_WORTH = 8  # chunks from which on processes are worth their start
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
_WHAT = ("studies on a cluster", "cluster")


Chunks = Iterable[int | PlacedChunk]
Compute = Callable[[Chunks], Iterator[tuple[int, Columns]]]
"""yields the number and the columns of each chunk as soon as it is there, in any order"""
_Task = tuple[float, list[tuple[int, Columns]]]
"""what a task of a cluster gives: time [s], and its chunks"""


class Executor(Protocol):
    """Computes chunks, in any order."""

    def computed(self, plan: StudyPlan, chunks: Chunks) -> Iterator[tuple[int, Columns]]:
        """Yield the number and the columns of each chunk as soon as it is there.

        Raises
        ------
        RunError
            When workers are lost and none is left.
        """
        ...

    def opened(self, plan: StudyPlan) -> AbstractContextManager[Compute]:
        """Return what computes chunks batch by batch, each one whole before the next."""
        ...


class InProcess:
    """The process itself, with lanes on all cores, or a graphics processor.

    Parameters
    ----------
    together
        How many chunks are computed as one.
    """

    def __init__(self, together: int = 1) -> None:
        self.together = together

    def computed(self, plan: StudyPlan, chunks: Chunks) -> Iterator[tuple[int, Columns]]:
        """Yield each chunk; see `Executor`."""
        left = iter(chunks)
        while several := list(islice(left, self.together)):
            yield from computed_chunks(plan, several)

    @contextmanager
    def opened(self, plan: StudyPlan) -> Iterator[Compute]:
        """Return what computes; see `Executor`."""
        yield partial(self.computed, plan)


class Pool:
    """Processes of this machine, a core each.

    Parameters
    ----------
    workers
        How many, >= 1.
    """

    def __init__(self, workers: int) -> None:
        self.workers = workers

    def computed(self, plan: StudyPlan, chunks: Chunks) -> Iterator[tuple[int, Columns]]:
        """Yield each chunk; see `Executor`."""
        with self.opened(plan) as compute:
            yield from compute(chunks)

    @contextmanager
    def opened(self, plan: StudyPlan) -> Iterator[Compute]:
        """Return what computes; see `Executor`."""
        others = active_children()
        pool = ProcessPoolExecutor(
            self.workers, get_context("spawn"), initializer=_begin, initargs=(loaded_files(), plan)
        )
        try:
            yield partial(_as_completed, pool, _AHEAD * self.workers)
        except BrokenProcessPool:
            raise RunError(
                "a process of the study was killed, most likely for want of memory: resume it, "
                "with fewer --workers"
            ) from None
        finally:  # at once, also after Ctrl-C: nobody waits for what they are at
            for process in set(active_children()).difference(others):
                process.terminate()
            pool.shutdown(wait=False, cancel_futures=True)


class Cluster:
    """A cluster of dask.distributed.

    Parameters
    ----------
    address
        Of its scheduler, for instance ``tcp://host:8786``.
    """

    def __init__(self, address: str) -> None:
        self.address = address

    def computed(self, plan: StudyPlan, chunks: Chunks) -> Iterator[tuple[int, Columns]]:
        """Yield each chunk; see `Executor`."""
        with self.opened(plan) as compute:
            yield from compute(chunks)

    @contextmanager
    def opened(self, plan: StudyPlan) -> Iterator[Compute]:
        """Return what computes; see `Executor`."""
        with _client(self.address) as client:
            workers = len(client.scheduler_info()["workers"])
            if not workers:
                raise RunError(f"the cluster at {self.address} has no workers: start some first")
            client.run(_load, loaded_files())
            yield partial(_of_cluster, client, plan, workers)


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
        For no workers, for both at once, and for either beside a graphics processor.
    """
    if workers is not None and workers < 1:
        raise ParameterError(f"workers = {workers} is not admissible: it must be >= 1")
    if engine == CUDA:
        if workers is not None or cluster:
            raise ParameterError(
                "engine = 'cuda' computes all cases on one graphics processor: leave out "
                f"{'--cluster' if cluster else '--workers'}"
            )
        return InProcess(_TOGETHER)
    if cluster:
        if workers is not None:
            raise ParameterError("workers of a cluster are the cluster's own: leave one out")
        return Cluster(cluster)
    count = min(workers or os.cpu_count() or 1, together or chunks)
    is_worth = workers is not None or chunks >= _WORTH
    return Pool(count) if count > 1 and is_worth else InProcess()


# What a process of a pool computes: given once, and not with every job.
_given: list[StudyPlan] = []


def _begin(files: tuple[str, ...], plan: StudyPlan) -> None:
    """Prepare a process of a pool: Ctrl-C is for the one that asked, with which it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _load(files)
    _given[:] = [plan]


def _end_with_parent() -> None:
    """End this process when the one that asked is killed: a pool's would wait for jobs forever."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _computed(chunk: int | PlacedChunk) -> tuple[int, Columns]:
    return _single(chunk, _given[0])


def _load(files: tuple[str, ...]) -> None:
    """Load the brakes that were loaded by path."""
    for file in files:
        load_system(file)


def _single(chunk: int | PlacedChunk, plan: StudyPlan) -> tuple[int, Columns]:
    return number_of(chunk), computed_chunk(plan, chunk, threads=1)


def _as_completed(
    pool: ProcessPoolExecutor, ahead: int, chunks: Chunks
) -> Iterator[tuple[int, Columns]]:
    """Yield what a pool has finished, with few jobs in flight."""
    left = iter(chunks)
    running: set[Future[Any]] = set()
    while True:
        for chunk in left:
            running.add(pool.submit(_computed, chunk))
            if len(running) >= ahead:
                break
        if not running:
            return
        done, running = wait(running, return_when=FIRST_COMPLETED)
        for each in done:
            yield each.result()


@contextmanager
def _client(address: str) -> Iterator[Any]:
    allow_dask()
    distributed = library("distributed", *_WHAT)
    try:
        client = distributed.Client(address, timeout=_SECONDS, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise RunError(
            f"no cluster answers at {address!r} ({error}): start one with 'dask scheduler' and "
            "'dask worker', and give the address that the scheduler says"
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
    given = [_single(chunk, plan) for chunk in chunks]
    return time.perf_counter() - begin, given


def _of_cluster(
    client: Any, plan: StudyPlan, workers: int, chunks: Chunks
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
                raise RunError(_LOST.format(getattr(answer, "reason", answer)))
            seconds, given = answer
            size = max(1, round(_TASK * len(given) / seconds))
            submit()
            yield from given
    except distributed.KilledWorker as error:
        raise RunError(_LOST.format(error)) from None
