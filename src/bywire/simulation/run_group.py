"""Runs of one model that differ in numbers alone, side by side in lanes and on all cores.

An ensemble varies parameters of one run. Here every run has initial values and a stimulus of its
own as well, as the cases of a bench have whose equilibrium or set point follows what is varied.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import overload

import numpy as np
from numpy.typing import NDArray

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

# Pieces of a run, between which progress is shown and an interrupt is heeded: at most so many, and
# not of fewer substeps, of which a piece costs a hundred.
_CHUNKS, _SUBSTEPS = 20, 20_000


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


@dataclass(frozen=True)
class RunGroup(Sequence[Trajectory]):
    """What runs gave side by side: a sequence of their trajectories, kept together.

    Parameters
    ----------
    runs
        What was computed.
    time
        Times of the rows [s], shape (rows,).
    values
        Signals, each of all runs in one piece, shape (signals, runs, rows).
    names
        Signals, in the order of the first axis.
    vectors
        State vectors at the end, shape (entries, runs).
    kernel
        What computed them.
    """

    runs: tuple[Run, ...]
    time: Array
    values: Array
    names: tuple[str, ...]
    vectors: Array
    kernel: LaneKernel

    @property
    def unsettled(self) -> NDArray[np.int64]:
        """Substeps of each run that hit the cap of the contact iteration, shape (runs,)."""
        return np.asarray(self.vectors[self.kernel.layout.start["counters"]], dtype=np.int64)

    def __len__(self) -> int:
        return len(self.runs)

    @overload
    def __getitem__(self, k: int) -> Trajectory: ...

    @overload
    def __getitem__(self, k: slice) -> tuple[Trajectory, ...]: ...

    def __getitem__(self, k: int | slice) -> Trajectory | tuple[Trajectory, ...]:
        if isinstance(k, slice):
            return tuple(self)[k]
        unsettled, repeated = (
            int(n) for n in self.vectors[self.kernel.layout.start["counters"] :, k][:2]
        )
        return Trajectory(
            run=self.runs[k],
            time=self.time,
            values=self.values[:, k].T,
            names=self.names,
            status="unsettled" if unsettled else "done",
            unsettled=unsettled,
            repeated=repeated,
            engine=self.kernel.label,
            vector=self.vectors[:, k].copy(),
        )


def simulate_group(
    runs: Sequence[Run],
    signals: Sequence[str] | None = None,
    threads: int | None = None,
    progress: Callable[[float], None] | None = None,
    first: int = 0,
) -> RunGroup:
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
    first
        Rows at the beginning that are not recorded, for instance those of a settling time.

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
    edges = _edges(schedule, first)
    watch = _Watch(-(-len(runs) // kernel.lanes) * (len(edges) - 1), progress)
    values = np.empty((len(wanted), len(runs), schedule.rows - first))

    def computed(begin: int) -> Array:
        cases = slice(begin, begin + kernel.lanes)
        return _advanced(kernel, schedule, runs[cases], values[:, cases], edges, first, watch)

    with ThreadPoolExecutor(threads or os.cpu_count() or 1) as pool:
        try:
            vectors = list(pool.map(computed, range(0, len(runs), kernel.lanes)))
        except BaseException:
            watch.stop.set()
            raise
    vector = np.concatenate(vectors, axis=1)[:, : len(runs)]
    return RunGroup(tuple(runs), schedule.record_times[first:], values, wanted, vector, kernel)


def _edges(schedule: Schedule, first: int) -> list[int]:
    """Return the frames at which pieces of a run begin and end; one at the first row recorded."""
    every = schedule.record_frames
    pieces = min(_CHUNKS, schedule.frames * schedule.substeps // _SUBSTEPS + 1)
    edges = {*np.linspace(0, schedule.frames // every, pieces + 1).astype(int).tolist(), first}
    return [each * every for each in sorted(edges)]


class _Watch:
    """Progress of several threads, and whether they shall stop."""

    def __init__(self, pieces: int, progress: Callable[[float], None] | None) -> None:
        self.stop = threading.Event()
        self._pieces, self._done = pieces, 0
        self._progress, self._lock = progress, threading.Lock()

    def piece(self) -> None:
        with self._lock:
            self._done += 1
            if self._progress is not None:
                self._progress(self._done / self._pieces)


def _advanced(
    kernel: LaneKernel, schedule: Schedule, group: Sequence[Run], values: Array,
    edges: Sequence[int], skipped: int, watch: _Watch,
) -> Array:  # fmt: skip
    """Carry a group to the end of its runs; fill ``values``, return the state vectors."""
    filled = [*group, *[group[-1]] * (kernel.lanes - len(group))]  # idle lanes repeat the last
    parameters = np.array([list(run.par.leaves().values()) for run in filled]).T.copy()
    vector = np.array([initial_vector(kernel.layout, r.state, r.memory) for r in filled]).T.copy()
    each = [sampled_stimulus(run, schedule) for run in group]
    stimulus = each[0]
    if any(not np.array_equal(rows, stimulus) for rows in each[1:]):
        stimulus = np.empty((*stimulus.shape, kernel.lanes))
        for lane in range(kernel.lanes):
            stimulus[:, :, lane] = each[min(lane, len(each) - 1)]
    every = schedule.record_frames
    silent = replace(schedule, record_frames=schedule.frames + 1)  # but for the very first row
    for begin, end in pairwise(edges):
        if watch.stop.is_set():
            break
        first = begin // every - skipped
        last = (schedule.rows if end == schedule.frames else end // every) - skipped
        recorded = first >= 0
        rows = np.empty((kernel.lanes, last - first if recorded else 1, values.shape[0]))
        plan = schedule if recorded else silent
        kernel.advance(plan, parameters, stimulus, vector, rows, end, begin)
        if recorded:  # a kernel fills a block: here the rows of a signal come into one piece
            values[:, :, first:last] = rows[: len(group)].transpose(2, 0, 1)
        require_finite(kernel.layout, vector, f"one of {len(group)} runs left the numbers before "
                       f"t = {end * schedule.frame:g} s")  # fmt: skip
        watch.piece()
    return vector
