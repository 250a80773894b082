"""Parallel computation of pieces of work, which stores each piece as soon as it is finished."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, wait
from contextlib import AbstractContextManager
from itertools import islice
from typing import TypeVar

from bywire.core.interrupts import thread_pool
from bywire.core.machine import worker_count

K = TypeVar("K")
T = TypeVar("T")


def complete(
    pieces: Sequence[K],
    kept: Mapping[K, T],
    compute: Callable[[K], T],
    *,
    keep: Callable[[K, T], object],
    progress: Callable[[K, float], object],
    workers: int | None = None,
    pool: Callable[[int], AbstractContextManager[Executor]] = thread_pool,
) -> dict[K, T]:
    """Return the results of all pieces, and compute only missing ones.

    Parameters
    ----------
    pieces
        Keys of the pieces.
    kept
        Results of finished pieces.
    compute
        Function that computes a piece, in a thread or process of the pool, or in this thread if
        one worker is sufficient.
    keep
        Called in this thread with each computed piece and its result.
    progress
        Called in this thread afterwards, with the piece and the finished share, 0 to 1.
    workers
        Number of workers. Default: one per core.
    pool
        Kind of workers: `thread_pool` for work that releases Python's lock, or processes.

    Raises
    ------
    KeyboardInterrupt
        If interrupted. Finished pieces are stored.
    """
    results = {piece: kept[piece] for piece in pieces if piece in kept}
    missing = [piece for piece in pieces if piece not in results]

    def finish(computed: Iterable[tuple[K, T]]) -> None:
        for piece, result in computed:
            results[piece] = result
            keep(piece, result)
            progress(piece, len(results) / len(pieces))

    count = worker_count(workers, len(missing))
    if count == 1:
        finish((piece, compute(piece)) for piece in missing)
    else:
        with pool(count) as opened:
            finish(as_completed(opened, compute, missing))
    return results


def as_completed(
    pool: Executor, compute: Callable[[K], T], pieces: Iterable[K], ahead: int | None = None
) -> Iterator[tuple[K, T]]:
    """Return the results of a pool in the order in which pieces finish.

    If a piece fails, those that have finished by then come first, so that none is lost.

    Parameters
    ----------
    pool
        Pool that computes the pieces; it starts immediately.
    compute
        Function that computes a piece.
    pieces
        The pieces.
    ahead
        Maximum number of submitted unfinished pieces. Default: all.
    """
    left = iter(pieces)
    begun = {pool.submit(compute, piece): piece for piece in islice(left, ahead)}

    def finished() -> Iterator[tuple[K, T]]:
        while begun:
            done, _ = wait(begun, return_when=FIRST_COMPLETED)
            begun.update({pool.submit(compute, piece): piece for piece in islice(left, len(done))})
            for each in sorted(done, key=lambda future: future.exception() is not None):
                yield begun.pop(each), each.result()

    return finished()
