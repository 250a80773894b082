"""Periodic excitation: the same window again and again, until the response repeats itself."""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import StepError
from bywire.core.typing import Array
from bywire.simulation.advance import require_finite
from bywire.simulation.compiler import find_compiler
from bywire.simulation.engine import prepare
from bywire.simulation.ensemble import lane_kernel
from bywire.simulation.layout import Layout
from bywire.simulation.run import Run, initial_vector, selected
from bywire.simulation.schedule import Schedule
from bywire.simulation.window import Stimuli, advance_window, given_rows, one_by_one

Complex = NDArray[np.complex128]
Figures = Callable[[Array], Complex]

KEPT = 8
"""windows whose figures are kept: the last ones"""


@dataclass(frozen=True)
class Repeated:
    """The last window of every case.

    Parameters
    ----------
    time, values
        Shapes (rows,) and (cases, rows, signals); the window's end is not among the rows.
    figures
        What `repeat` was asked to compare, of the last `KEPT` windows, shape (cases, KEPT, n); NaN
        in front where a case took fewer.
    windows
        Windows that each case took, shape (cases,).
    repeats
        Whether the last window repeated the one before, shape (cases,).
    unsettled
        Substeps of each case that hit the cap of the contact iteration, shape (cases,).
    """

    time: Array
    values: Array
    figures: Complex
    windows: NDArray[np.int64]
    repeats: NDArray[np.bool_]
    unsettled: NDArray[np.int64]


def repeat(
    run: Run,
    matrix: Array,
    stimuli: Array | Stimuli,
    signals: Sequence[str],
    figures: Figures,
    tolerance: float,
    most: int,
    *,
    starts: Sequence[tuple[Sequence[float], Sequence[float]]] | None = None,
    lanes: bool = True,
    stop: threading.Event | None = None,
) -> Repeated:
    """Run every case window after window until all cases of its group of lanes repeat.

    Parameters
    ----------
    run
        Its duration is one window: whole sample times and recording intervals. Its own stimulus
        is not used.
    matrix
        Parameter vectors, shape (parameters, cases); see ``variations.case_matrix``.
    stimuli
        One window of each case, shape (cases, rows, nu), rows at ``schedule.stimulus_times``
        without the end. Or ``stimuli(cases, first, last)``, which returns these rows of some
        cases, shape (cases, last - first, nu): a long window never lies in memory as a whole.
    signals
        Outputs to record.
    figures
        ``figures(window) -> complex``, shapes (lanes, rows, signals) and (lanes, n): what a window
        is judged by.
    tolerance
        A window repeats the one before when the norm of the difference of their figures is at
        most this share of the norm of the figures.
    most
        Windows after which a case is given up, >= 2.
    starts
        State and memory that each case starts from; by default those of the run.
    lanes
        False: one case after another on one core, as in a simulator without ensembles.
    stop
        Once it is set, from another thread, what runs ends within a moment.

    Raises
    ------
    StepError
        When a window holds no whole number of sample times.
    ParameterError
        When the shapes do not fit.
    SolverError
        When a trajectory leaves the numbers.
    KeyboardInterrupt
        When ``stop`` was set.
    """
    schedule = window_schedule(run)
    count = matrix.shape[1]
    given = given_rows(stimuli, count, schedule)
    prepared = prepare(run.model, run.par)
    selection = selected(tuple(prepared.outputs), signals)
    compiler = find_compiler()
    # One frame too many: the end of a window is the beginning of the next, and ticks only there.
    open_end = replace(schedule, frames=schedule.frames + 1)
    if compiler is None or not lanes:
        advance, width = one_by_one(run, open_end, selection), 1
    else:
        kernel = lane_kernel(prepared, compiler, tuple(selection.tolist()))
        width = kernel.lanes

        def advance(p: Array, u: Array, vector: Array, values: Array, frames: int) -> None:
            kernel.advance(open_end, p, u, vector, values, frames)

    layout = prepared.engine("auto").layout
    start = _start_vectors(layout, starts or [(run.state, run.memory)] * count)
    stopped = threading.Event() if stop is None else stop

    def group(first: int) -> tuple[Array, Complex, int, NDArray[np.bool_], Array]:
        lane = np.minimum(np.arange(first, first + width), count - 1)
        columns = np.ascontiguousarray(matrix[:, lane])
        vector = np.ascontiguousarray(start[:, lane])

        def u(begin: int, end: int) -> Array:
            return np.ascontiguousarray(np.moveaxis(given(lane, begin, end), 0, 2))

        shape = (width, schedule.frames // schedule.record_frames, len(signals))
        now, seen = np.empty(shape), list[Complex]()
        same = np.zeros(width, dtype=bool)
        windows = 0
        while windows < most and not same.all():
            advance_window(advance, schedule, stopped, columns, u, vector, now)
            require_finite(layout, vector, f"one of cases {first} to {lane[-1]} left the numbers")
            windows += 1
            seen = [*seen[1 - KEPT :], figures(now)]
            if windows > 1:
                same = _same(seen[-2], seen[-1], tolerance)
        return now, _padded(seen), windows, same, vector[layout.start["counters"]]

    pool = ThreadPoolExecutor((os.cpu_count() or 1) if lanes else 1)
    try:
        done = list(pool.map(group, range(0, count, width)))
    except KeyboardInterrupt:
        stopped.set()
        raise
    finally:
        pool.shutdown(cancel_futures=True)
    times = np.arange(schedule.frames // schedule.record_frames) * schedule.record_frames
    return Repeated(
        time=np.asarray(times * schedule.frame, dtype=np.float64),
        values=np.concatenate([values for values, *_ in done])[:count],
        figures=np.concatenate([seen for _, seen, *_ in done])[:count],
        windows=np.repeat([windows for _, _, windows, *_ in done], width)[:count],
        repeats=np.concatenate([same for *_, same, _ in done])[:count],
        unsettled=np.concatenate([counters for *_, counters in done])[:count].astype(np.int64),
    )


def _start_vectors(
    layout: Layout, starts: Sequence[tuple[Sequence[float], Sequence[float]]]
) -> Array:
    """Return the state vectors of all cases at the start, shape (entries, cases)."""
    return np.stack([initial_vector(layout, *one) for one in starts], axis=1)


def _same(before: Complex, now: Complex, tolerance: float) -> NDArray[np.bool_]:
    """Return which lanes repeat; what does not move at all repeats."""
    apart, size = (np.linalg.norm(one, axis=1) for one in (now - before, now))
    return np.asarray(apart <= tolerance * size)


def _padded(seen: list[Complex]) -> Complex:
    """Return the figures of the last windows, shape (lanes, KEPT, n)."""
    missing = np.full((KEPT - len(seen), *seen[0].shape), np.nan, dtype=np.complex128)
    return np.moveaxis(np.concatenate([missing, np.array(seen)]), 0, 1)


def window_schedule(run: Run) -> Schedule:
    """Return the plan of one window.

    Raises
    ------
    StepError
        When the window holds no whole number of sample times and recording intervals.
    """
    schedule = run.schedule()
    common = math.lcm(schedule.record_frames, *schedule.task_frames)
    if schedule.frames % common or abs(schedule.frames * schedule.frame / run.duration - 1) > 1e-9:
        raise StepError(
            f"a window of {run.duration:g} s holds no whole number of the common interval of all "
            f"sample times, {common * schedule.frame:g} s: round it to one"
        )
    return schedule
