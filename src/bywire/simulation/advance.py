"""Carry a run forward, chunk by chunk, and refuse what leaves the numbers."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from bywire.core.errors import SolverError, WorkLimitError
from bywire.core.interrupts import interrupt_heard
from bywire.core.typing import Array
from bywire.simulation.engine import Engine
from bywire.simulation.layout import Layout
from bywire.simulation.native import CHUNK, Request
from bywire.simulation.schedule import Schedule

Progress = Callable[[float], None]

_CHUNK_SECONDS = 0.1
_PART = 8.0  # ordinary substeps that a part of one takes about as long as


def advance_all(
    engine: Engine,
    request: Request,
    vector: Array,
    values: Array,
    progress: Progress | None,
    begin: int = 0,
    last: int | None = None,
    most: float = math.inf,
) -> int:
    """Advance in chunks that leave room for progress and interrupts; return frames done.

    Parameters
    ----------
    engine, request
        What computes, and what of.
    vector
        State vector of the engine, renewed in place; where an interrupt ends the run it holds
        the state after the frames that are done.
    values
        Recorded rows from the first frame on, filled in place, shape (rows, signals).
    progress
        Called with the finished share, 0 to 1, after every chunk.
    begin, last
        First frame, and the one at which to end; the run's by default.
    most
        Work after which to fail; see `work_of`.

    Raises
    ------
    SolverError
        When the trajectory leaves the numbers.
    WorkLimitError
        When it takes more work than it may.
    """
    schedule = request.schedule
    first = -(-begin // schedule.record_frames)
    last = schedule.frames if last is None else last
    size = min(16 * schedule.record_frames, max(CHUNK // schedule.substeps, 1))
    while begin < last:
        end = min(begin + size, last)
        started, saved = time.perf_counter(), vector.copy()
        row = -(-begin // schedule.record_frames) - first
        try:
            engine.advance(request, vector, begin, end, values[row:])
        except KeyboardInterrupt:
            interrupt_heard()
            vector[:] = saved
            return begin
        require_finite(
            engine.layout, vector, f"the run left the numbers before t = {end * schedule.frame:g} s"
        )
        begin = end
        require_work(work_of(schedule, engine.layout, begin, vector), most)
        try:
            if progress is not None:
                progress(end / schedule.frames)
        except KeyboardInterrupt:
            interrupt_heard()
            return begin
        elapsed = max(time.perf_counter() - started, 1e-9)
        factor = min(max(_CHUNK_SECONDS / elapsed, 0.5), 8.0)
        size = max(int(size * factor), 1)
    return begin


def work_of(schedule: Schedule, layout: Layout, frames: int, vector: Array) -> Any:
    """Return the work that runs took up to a frame, in ordinary substeps, of each of them.

    Parts of substeps that are tried are computed alone, without what ordinary ones have in common.
    """
    tries = vector[layout.start["counters"] + 2]
    return frames * schedule.substeps + _PART * tries


def require_work(work: Any, most: Any) -> None:
    """Raise ``WorkLimitError`` where runs took more work than they may."""
    if np.any(work > most):
        raise WorkLimitError(
            f"the run takes more than {np.min(most):.3g} substeps' work: contacts or frictions "
            "hardly settle; look for a parameter that is extreme"
        )


def require_finite(layout: Layout, vector: Array, what: str) -> None:
    """Raise ``SolverError`` unless all that a run, or several, carry on are numbers.

    Not the states alone: a friction whose force is no number would pass for one that sticks.
    """
    if not np.all(np.isfinite(vector[: layout.start["counters"]])):
        raise SolverError(
            f"{what}: look for a parameter far from its usual magnitude, or take a smaller step"
        )
