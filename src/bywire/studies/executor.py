"""Who computes the chunks of a study: this process, a pool of processes, or a Dask cluster."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import islice
from typing import Any

from bywire.core.arguments import whole_number
from bywire.core.callers import option
from bywire.core.copies import may_copy, processes_with_brakes
from bywire.core.errors import ParameterError
from bywire.core.heard_warnings import heard_warnings
from bywire.simulation.engine import CUDA
from bywire.studies.chunk import Columns, PlacedChunk, computed_chunks
from bywire.studies.cluster import Cluster
from bywire.studies.computing import (
    Apart,
    Beside,
    Chunks,
    Compute,
    Executor,
    T,
    single,
)
from bywire.studies.plan import StudyPlan

# Chunks that a graphics processor is given at once: 4,096 cases, of hard braking 2 GB of this
# machine's memory for stimuli and rows.
_TOGETHER = 64
_MOST_WORKERS = 1024
_AHEAD = 2  # chunks in flight for each worker, so that none waits for us
# Chunks from which on processes are worth their start; those that load all anew take a second.
_WORTH_COPIES, _WORTH = 2, 8


@dataclass(frozen=True)
class _InPool:
    """Computes chunks, and what stands beside them, in the processes of a pool."""

    pool: ProcessPoolExecutor
    ahead: int

    def __call__(self, chunks: Chunks) -> Iterator[tuple[int, Columns]]:
        return _as_completed(self.pool, self.ahead, chunks)

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

    def computed(self, plan: StudyPlan, chunks: Chunks) -> Iterator[tuple[int, Columns]]:
        """Yield each chunk; see `Executor`."""
        left = iter(chunks)
        while several := list(islice(left, self.together)):
            yield from computed_chunks(plan, several)

    @contextmanager
    def opened(self, plan: StudyPlan) -> Iterator[Compute]:
        """Return what computes; see `Executor`."""
        yield Apart(partial(self.computed, plan))


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
    count = min(workers or os.cpu_count() or 1, together or chunks)
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
            f"{option('cluster' if cluster else 'workers')}"
        )
    if cluster and workers is not None:
        raise ParameterError("workers of a cluster are the cluster's own: leave one out")


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


def _as_completed(
    pool: ProcessPoolExecutor, ahead: int, chunks: Chunks
) -> Iterator[tuple[int, Columns]]:
    """Return what a pool finishes, with few jobs in flight; the first ones are begun at once."""
    left = iter(chunks)
    running: set[Future[Any]] = {pool.submit(_computed, chunk) for chunk in islice(left, ahead)}

    def finished(running: set[Future[Any]]) -> Iterator[tuple[int, Columns]]:
        while running:
            done, running = wait(running, return_when=FIRST_COMPLETED)
            running |= {pool.submit(_computed, chunk) for chunk in islice(left, len(done))}
            for each in done:
                yield each.result()

    return finished(running)
