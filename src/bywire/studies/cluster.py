"""The chunks of a study on a cluster of dask.distributed."""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

from bywire.core.brake import load_brakes, loaded_files
from bywire.core.errors import RunError
from bywire.core.unneeded import allow_dask
from bywire.data.file_format import library
from bywire.studies.chunk import Columns, PlacedChunk
from bywire.studies.computing import Apart, Chunks, Compute, single
from bywire.studies.plan import StudyPlan

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
    given = [single(chunk, plan) for chunk in chunks]
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
