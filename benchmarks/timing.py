"""Times of functions, measured in turn, and of one call of a compiled kernel."""

from __future__ import annotations

import time
from collections.abc import Callable
from statistics import median

import numpy as np

from bywire.simulation.engine import prepare
from bywire.simulation.run import Run, initial_vector, request_for

Work = Callable[[], float]


def interleaved(works: dict[str, Work], rounds: int) -> dict[str, list[float]]:
    """Run functions in turn and return their times [s], which they return themselves."""
    for work in works.values():
        work()  # warm-up
    seconds: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(rounds):
        for name, work in works.items():
            seconds[name].append(work())
    return seconds


def ratio(seconds: dict[str, list[float]], over: str, under: str) -> float:
    """Return the median ratio of neighboring times, in which drift of the machine cancels."""
    return median(a / b for a, b in zip(seconds[over], seconds[under], strict=True))


def least_ratio(seconds: dict[str, list[float]], over: str, under: str) -> float:
    """Return the ratio of the minimum times, which other processes affect least."""
    return min(seconds[over]) / min(seconds[under])


def timed(work: Callable[[], object]) -> Work:
    """Return a function that returns its run time [s]."""

    def measured() -> float:
        begin = time.perf_counter()
        work()
        return time.perf_counter() - begin

    return measured


def processor_timed(work: Callable[[], object]) -> Work:
    """Return a function that returns its processor time [s], summed over all threads."""

    def measured() -> float:
        begin = time.process_time()
        work()
        return time.process_time() - begin

    return measured


def kernel(run: Run) -> Work:
    """Return the processor time of a call of the kernel, prepared as the hand-written C is."""
    engine = prepare(run.model, run.par).engine("compiled")
    request = request_for(run)
    rows = np.empty((request.schedule.rows, request.selection.size))
    start = initial_vector(engine.layout, run.state, run.memory)

    def work() -> float:
        vector = start.copy()
        begin = time.process_time()
        engine.advance(request, vector, 0, request.schedule.frames, rows)
        return time.process_time() - begin

    return work
