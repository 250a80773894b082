"""Runs of one model that differ in numbers alone, side by side in lanes and on all cores.

An ensemble varies parameters of one run. Here every run has initial values and a stimulus of its
own as well, as the cases of a bench have whose equilibrium or set point follows what is varied.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np

from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.simulation.advance import require_finite
from bywire.simulation.compiler import find_compiler
from bywire.simulation.engine import prepare, structure_of
from bywire.simulation.ensemble import LaneKernel, lane_kernel
from bywire.simulation.run import (
    Run,
    Trajectory,
    initial_vector,
    sampled_stimulus,
    selected,
)
from bywire.simulation.schedule import Schedule

_CHUNKS = 20  # pieces of a run between which progress is shown and an interrupt is heeded


def fit_lanes(runs: Sequence[Run]) -> bool:
    """Return whether runs can be computed side by side: a compiler, one structure, one plan."""
    if find_compiler() is None or not runs:
        return False
    first, *others = runs
    structure, schedule = structure_of(first.model, first.par), first.schedule()
    return all(
        structure_of(run.model, run.par) == structure and run.schedule() == schedule
        for run in others
    )


def simulate_group(
    runs: Sequence[Run],
    signals: Sequence[str] | None = None,
    threads: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> tuple[Trajectory, ...]:
    """Compute runs that `fit_lanes`, each with its parameters, initial values and stimulus.

    Parameters
    ----------
    runs
        Runs of one model, of one duration, step, recording interval and set of sample times.
    signals
        Outputs to record; all by default.
    threads
        Threads to use, >= 1; all cores by default.
    progress
        Called with the finished share, 0 to 1, now and then.

    Raises
    ------
    ParameterError
        When the runs do not fit, or a stimulus is not finite.
    UnknownNameError
        When a signal is unknown.
    SolverError
        When a trajectory leaves the numbers.
    """
    if threads is not None and threads < 1:
        raise ParameterError(f"threads = {threads} is not admissible: it must be >= 1")
    if not fit_lanes(runs):
        raise ParameterError(
            "these runs cannot be computed side by side: that takes a C compiler, and one model, "
            "structure, duration, step, recording interval and set of sample times"
        )
    compiler = find_compiler()
    assert compiler is not None
    prepared = prepare(runs[0].model, runs[0].par)
    names = tuple(prepared.outputs)
    wanted = names if signals is None else tuple(signals)
    kernel = lane_kernel(prepared, compiler, tuple(selected(names, wanted).tolist()))
    schedule = runs[0].schedule()
    shape = (kernel.lanes, schedule.rows, len(wanted))
    groups = [runs[k : k + kernel.lanes] for k in range(0, len(runs), kernel.lanes)]
    watch = _Watch(len(groups), progress)

    def computed(group: Sequence[Run]) -> tuple[Array, Array]:
        values = np.empty(shape)
        return values, _advanced(kernel, schedule, group, values, watch)

    with ThreadPoolExecutor(threads or os.cpu_count() or 1) as pool:
        try:
            results = list(pool.map(computed, groups))
        except BaseException:
            watch.stop.set()
            raise
    return tuple(
        _trajectory(run, schedule, kernel, wanted, values[lane], vector[:, lane])
        for group, (values, vector) in zip(groups, results, strict=True)
        for lane, run in enumerate(group)
    )


class _Watch:
    """Progress of several threads, and whether they shall stop."""

    def __init__(self, groups: int, progress: Callable[[float], None] | None) -> None:
        self.stop = threading.Event()
        self._pieces, self._done = groups * _CHUNKS, 0
        self._progress, self._lock = progress, threading.Lock()

    def piece(self) -> None:
        with self._lock:
            self._done += 1
            if self._progress is not None:
                self._progress(self._done / self._pieces)


def _advanced(
    kernel: LaneKernel, schedule: Schedule, group: Sequence[Run], values: Array, watch: _Watch
) -> Array:
    """Carry a group to the end of its runs; fill ``values``, return the state vectors."""
    filled = [*group, *[group[-1]] * (kernel.lanes - len(group))]  # idle lanes repeat the last
    parameters = np.array([list(run.par.leaves().values()) for run in filled]).T.copy()
    vector = np.array([initial_vector(kernel.layout, r.state, r.memory) for r in filled]).T.copy()
    each = [sampled_stimulus(run, schedule) for run in group]
    stimulus = each[0]
    if any(not np.array_equal(rows, stimulus) for rows in each[1:]):
        stimulus = np.stack([*each, *[each[-1]] * (kernel.lanes - len(group))], axis=2)
    every = schedule.record_frames
    edges = np.unique(np.linspace(0, schedule.frames // every, _CHUNKS + 1).astype(int)) * every
    edges[-1] = schedule.frames
    for begin, end in pairwise(edges):
        if watch.stop.is_set():
            break
        first = int(begin) // every
        last = schedule.rows if end == schedule.frames else int(end) // every
        rows = np.empty((kernel.lanes, last - first, values.shape[2]))  # a kernel fills a block
        kernel.advance(schedule, parameters, stimulus, vector, rows, int(end), int(begin))
        values[:, first:last] = rows
        require_finite(kernel.layout, vector, f"one of {len(group)} runs left the numbers before "
                       f"t = {end * schedule.frame:g} s")  # fmt: skip
        watch.piece()
    return vector


def _trajectory(
    run: Run, schedule: Schedule, kernel: LaneKernel, names: tuple[str, ...], values: Array,
    vector: Array,
) -> Trajectory:  # fmt: skip
    unsettled, repeated = (int(n) for n in vector[kernel.layout.start["counters"] :][:2])
    return Trajectory(
        run=run,
        time=schedule.record_times,
        values=values,
        names=names,
        status="unsettled" if unsettled else "done",
        unsettled=unsettled,
        repeated=repeated,
        engine=kernel.label,
        vector=vector.copy(),
    )
