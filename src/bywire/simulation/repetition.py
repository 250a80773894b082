"""Periodic excitation: the same window again and again until the response repeats."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import StepError, not_valid
from bywire.core.interrupts import thread_pool
from bywire.core.machine import worker_count
from bywire.core.typing import Array, Complex
from bywire.simulation.advance import require_finite
from bywire.simulation.case_kernels import lane_kernel
from bywire.simulation.compiler import find_compiler
from bywire.simulation.engine import prepare
from bywire.simulation.native import Request
from bywire.simulation.run import Run, initial_vector, selected
from bywire.simulation.schedule import Layout, Schedule

Stimuli = Callable[[NDArray[np.int64], int, int], Array]
"""``stimuli(cases, first, last)``: these stimulus rows of some cases, (cases, last - first, nu)"""
Advance = Callable[[Array, Array, Array, Array, int], None]
"""``advance(parameters, stimulus, vectors, rows, frames)``: all tasks tick in the first frame"""

CHUNK = 10_000
"""substeps between checks for interrupts: tens of milliseconds with a compiler, a second without"""


def advance_window(
    advance: Advance,
    schedule: Schedule,
    p: Array,
    u: Callable[[int, int], Array],
    vector: Array,
    values: Array,
) -> None:
    """Run one window in parts, which saves memory; update vector and values in place."""
    every, held = schedule.record_frames, schedule.stimulus_frames
    # All tasks tick at the beginning of a part, as at the beginning of a run.
    common = math.lcm(every, *schedule.task_frames)
    size = max(CHUNK // (schedule.substeps * common), 1) * common
    for first in range(0, schedule.frames, size):
        last = min(first + size, schedule.frames)
        part = np.empty((values.shape[0], (last - first) // every, values.shape[2]))
        advance(p, u(first // held, last // held), vector, part, last - first)
        values[:, first // every : last // every] = part


def given_rows(stimuli: Array | Stimuli, count: int, schedule: Schedule) -> Stimuli:
    """Return a function for stimulus rows, which are stored or computed on demand.

    Raises
    ------
    ParameterError
        When the shape is not valid.
    """
    if callable(stimuli):
        return stimuli
    every, rows = stimuli, schedule.frames // schedule.stimulus_frames
    if every.shape[:2] != (count, rows):
        raise not_valid("shape of stimuli", str(every.shape), f"({count}, {rows}, nu)")
    return lambda cases, first, last: every[cases, first:last]


def one_by_one(run: Run, schedule: Schedule, selection: NDArray[np.int32]) -> Advance:
    """Return a slow function that advances one case at a time, without a compiler."""
    engine = prepare(run.model, run.par).engine("auto")

    def advance(p: Array, u: Array, vector: Array, values: Array, frames: int) -> None:
        column = vector[:, 0].copy()
        stimulus = np.ascontiguousarray(u[:, :, 0])
        request = Request(schedule, np.ascontiguousarray(p[:, 0]), stimulus, selection)
        engine.advance(request, column, 0, frames, values[0])
        vector[:, 0] = column

    return advance


# --- Cases in lanes: when a case has ended, the next case starts in its lane


class Lanes:
    """Cases that run side by side, window after window.

    Parameters
    ----------
    queue
        Waiting cases, shared by all threads.
    width
        Number of lanes.
    matrix, starts
        Parameters and initial state vectors of all cases, shapes (parameters, cases) and
        (entries, cases).

    Attributes
    ----------
    columns, vector
        Parameters and state vectors in the lanes, shapes (parameters, lanes) and (entries, lanes).
    case
        Index of the case in each lane, shape (lanes,).
    seen
        Figures of all windows for each lane with an unfinished case. Other lanes also run, because
        vectors have a fixed length, but their results are ignored.
    """

    def __init__(self, queue: deque[int], width: int, matrix: Array, starts: Array) -> None:
        self._queue, self._matrix, self._starts = queue, matrix, starts
        self.columns = np.empty((matrix.shape[0], width))
        self.vector = np.empty((starts.shape[0], width))
        self.case: NDArray[np.int64] = np.zeros(width, dtype=np.int64)
        self.seen: dict[int, list[Complex]] = {}
        for lane in range(width):
            if not self._took(lane) and self.seen:
                self._load(lane, int(self.case[0]))

    def passed(self, figures: Complex, tolerance: float, most: int) -> dict[int, bool]:
        """Add a window's figures; return the lanes whose case has ended, and whether it repeats.

        Parameters
        ----------
        figures
            Shape (lanes, n).
        tolerance, most
            See `repetition.repeat`.
        """
        ended = {}
        for lane, seen in self.seen.items():
            seen.append(figures[lane])
            repeats = len(seen) > 1 and _same(seen[-2], seen[-1], tolerance)
            if repeats or len(seen) == most:
                ended[lane] = repeats
        return ended

    def release(self, lane: int) -> None:
        """Start the next case in a lane whose case has ended."""
        del self.seen[lane]
        self._took(lane)

    def _took(self, lane: int) -> bool:
        try:
            self._load(lane, self._queue.popleft())
        except IndexError:  # another thread may have taken the last case
            return False
        self.seen[lane] = []
        return True

    def _load(self, lane: int, case: int) -> None:
        self.case[lane] = case
        self.columns[:, lane], self.vector[:, lane] = self._matrix[:, case], self._starts[:, case]


def _same(before: Complex, now: Complex, tolerance: float) -> bool:
    """Return whether a window repeats the previous window; constant signals repeat."""
    return bool(np.linalg.norm(now - before) <= tolerance * np.linalg.norm(now))


# --- Repetition

Figures = Callable[[Array], Complex]

KEPT = 8
"""number of last windows for which figures are stored"""


@dataclass(frozen=True)
class Repeated:
    """Last window of each case.

    Parameters
    ----------
    time, values
        Shapes (rows,) and (cases, rows, signals), without a row at the window's end.
    figures
        Figures of the last `KEPT` windows, which are compared, shape (cases, KEPT, n). If a case
        had fewer windows, the first entries are NaN.
    windows
        Number of windows of each case, shape (cases,).
    repeats
        Whether the last window repeated the previous one, shape (cases,).
    unsettled
        Substeps of each case that hit the contact iteration's limit, shape (cases,).
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
) -> Repeated:
    """Run each case, window after window, until it repeats.

    Each case ends independently of all other cases. The next case then starts in its lane.

    Parameters
    ----------
    run
        Run whose duration is one window: a multiple of all sample times and of the recording
        interval. Its stimulus is ignored.
    matrix
        Parameter vectors, shape (parameters, cases); see ``variations.case_matrix``.
    stimuli
        One window of each case, shape (cases, rows, nu), with rows at ``schedule.stimulus_times``
        except the end. A function ``stimuli(cases, first, last)`` avoids storing a long window. It
        returns these rows of some cases, shape (cases, last - first, nu).
    signals
        Outputs to record.
    figures
        ``figures(window) -> complex``, shapes (lanes, rows, signals) and (lanes, n): the figures to
        compare between windows.
    tolerance
        A window repeats the previous window if the norm of the difference of their figures is at
        most this fraction of the norm of the figures.
    most
        Maximum number of windows of a case, >= 2.
    starts
        Initial state and memory of each case. Default: the run's.
    lanes
        If False, run one case after another on one core, like a simulator without ensembles.

    Raises
    ------
    StepError
        When a window is not a multiple of the sample times.
    ParameterError
        When the shapes do not match.
    SolverError
        When a value of a trajectory is infinite or NaN.
    KeyboardInterrupt
        When the user interrupts the run, or stops it in a thread.
    """
    schedule = window_schedule(run)
    count = matrix.shape[1]
    given = given_rows(stimuli, count, schedule)
    prepared = prepare(run.model, run.par)
    selection = selected(tuple(prepared.outputs), signals)
    compiler = find_compiler()
    # Omit the last frame, because a window's end is the start of the next window, where tasks tick.
    open_end = replace(schedule, frames=schedule.frames + 1)
    if compiler is None or not lanes:
        advance, width = one_by_one(run, open_end, selection), 1
    else:
        kernel = lane_kernel(prepared, compiler, tuple(selection.tolist()))
        width = kernel.lanes

        def advance(p: Array, u: Array, vector: Array, values: Array, frames: int) -> None:
            kernel.advance(open_end, p, u, vector, values, frames)

    layout = prepared.engine("auto").layout
    begins = _start_vectors(layout, starts or [(run.state, run.memory)] * count)
    queue = deque(range(count))
    rows, counters = schedule.frames // schedule.record_frames, layout.start["counters"]
    values = np.empty((count, rows, len(signals)))
    done: dict[int, tuple[list[Complex], bool, float]] = {}

    def turns(_: int) -> None:
        taken, now = Lanes(queue, width, matrix, begins), np.empty((width, rows, len(signals)))

        def u(first: int, last: int) -> Array:
            return np.ascontiguousarray(np.moveaxis(given(taken.case, first, last), 0, 2))

        while taken.seen:
            advance_window(advance, schedule, taken.columns, u, taken.vector, now)
            counted = sorted(taken.seen)
            which = ", ".join(str(taken.case[lane]) for lane in counted)
            ends = taken.vector[:, counted]
            require_finite(layout, ends, f"one of cases {which} diverged")
            for lane, repeats in taken.passed(figures(now), tolerance, most).items():
                case, unsettled = int(taken.case[lane]), float(taken.vector[counters, lane])
                values[case], done[case] = now[lane], (taken.seen[lane], repeats, unsettled)
                taken.release(lane)

    workers = worker_count(None if lanes else 1, -(-count // width))
    with thread_pool(workers) as pool:
        try:
            list(pool.map(turns, range(workers)))
        finally:
            queue.clear()  # after a failure, the waiting cases do not start
    seen, repeats, unsettled = zip(*(done[k] for k in range(count)), strict=True)
    return Repeated(
        time=np.asarray(np.arange(rows) * schedule.record_frames * schedule.frame, np.float64),
        values=values,
        figures=np.stack([_padded(each) for each in seen]),
        windows=np.array([len(each) for each in seen]),
        repeats=np.array(repeats),
        unsettled=np.array(unsettled).astype(np.int64),
    )


def _start_vectors(
    layout: Layout, starts: Sequence[tuple[Sequence[float], Sequence[float]]]
) -> Array:
    """Return the initial state vectors of all cases, shape (entries, cases)."""
    return np.stack([initial_vector(layout, *one) for one in starts], axis=1)


def _padded(seen: list[Complex]) -> Complex:
    """Return the figures of a case's last windows, padded to shape (KEPT, n)."""
    last = seen[-KEPT:]
    missing = np.full((KEPT - len(last), *last[0].shape), np.nan, dtype=np.complex128)
    return np.concatenate([missing, np.array(last)])


def window_schedule(run: Run) -> Schedule:
    """Return the plan of one window.

    Raises
    ------
    StepError
        When the window is not a multiple of the sample times and of the recording interval.
    """
    schedule = run.schedule()
    common = math.lcm(schedule.record_frames, *schedule.task_frames)
    if schedule.frames % common or abs(schedule.frames * schedule.frame / run.duration - 1) > 1e-9:
        raise StepError(
            f"a window of {run.duration:g} s is not a multiple of the common interval of all "
            f"sample times, {common * schedule.frame:g} s. Round it to a multiple",
            name="duration",
            value=f"{run.duration:g} s",
            valid=f"a multiple of {common * schedule.frame:g} s",
        )
    return schedule
