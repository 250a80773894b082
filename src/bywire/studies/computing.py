"""What computes chunks of a study: what it is asked for, and what it gives."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from bywire.studies.chunk import Columns, PlacedChunk, computed_chunk, number_of
from bywire.studies.plan import StudyPlan

Chunks = Iterable[int | PlacedChunk]
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

    def __call__(self, chunks: Chunks) -> Iterator[tuple[int, Columns]]:
        """Yield number and columns of each chunk as soon as it is there, in any order."""
        ...

    def beside(self, job: Callable[[], T]) -> Beside[T]:
        """Begin something else: at once, or in a process that then goes on with chunks."""
        ...


@dataclass(frozen=True)
class Apart:
    """Computes chunks by a function, and what stands beside them at once."""

    chunks: Callable[[Chunks], Iterator[tuple[int, Columns]]]

    def __call__(self, chunks: Chunks) -> Iterator[tuple[int, Columns]]:
        """Yield chunks; see `Compute`."""
        return self.chunks(chunks)

    def beside(self, job: Callable[[], T]) -> Beside[T]:
        """Do it at once; see `Compute`."""
        done: Future[tuple[T, list[Warning]]] = Future()
        done.set_result((job(), []))
        return Beside(done)


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


def single(chunk: int | PlacedChunk, plan: StudyPlan) -> tuple[int, Columns]:
    """Return the number and the columns of a chunk, computed on one core."""
    return number_of(chunk), computed_chunk(plan, chunk, threads=1)
