"""One window of a periodic excitation, run in parts that leave room for an interrupt."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.simulation.engine import prepare
from bywire.simulation.native import Request
from bywire.simulation.run import Run
from bywire.simulation.schedule import Schedule

Stimuli = Callable[[NDArray[np.int64], int, int], Array]
"""``stimuli(cases, first, last)``: these rows of some cases, shape (cases, last - first, nu)"""
Advance = Callable[[Array, Array, Array, Array, int], None]
"""``advance(parameters, stimulus, vectors, rows, frames)``: all tasks run at the first instant"""

CHUNK = 10_000
"""substeps after which an interrupt is looked for: tens of milliseconds compiled, a second without
a compiler"""


def advance_window(
    advance: Advance,
    schedule: Schedule,
    p: Array,
    u: Callable[[int, int], Array],
    vector: Array,
    values: Array,
) -> None:
    """Run one window in parts, which take little memory; renews vector and values in place."""
    every, held = schedule.record_frames, schedule.stimulus_frames
    # All tasks run at the beginning of a part, as at the beginning of a run.
    common = math.lcm(every, *schedule.task_frames)
    size = max(CHUNK // (schedule.substeps * common), 1) * common
    for first in range(0, schedule.frames, size):
        last = min(first + size, schedule.frames)
        part = np.empty((values.shape[0], (last - first) // every, values.shape[2]))
        advance(p, u(first // held, last // held), vector, part, last - first)
        values[:, first // every : last // every] = part


def given_rows(stimuli: Array | Stimuli, count: int, schedule: Schedule) -> Stimuli:
    """Return what gives rows of the stimulus, whether they exist or are made.

    Raises
    ------
    ParameterError
        When the shape does not fit.
    """
    if callable(stimuli):
        return stimuli
    every, rows = stimuli, schedule.frames // schedule.stimulus_frames
    if every.shape[:2] != (count, rows):
        raise ParameterError(f"stimuli: shape ({count}, {rows}, nu) is wanted, got {every.shape}")
    return lambda cases, first, last: every[cases, first:last]


def one_by_one(run: Run, schedule: Schedule, selection: NDArray[np.int32]) -> Advance:
    """Serve without a compiler: one lane, slowly."""
    engine = prepare(run.model, run.par).engine("auto")

    def advance(p: Array, u: Array, vector: Array, values: Array, frames: int) -> None:
        column = vector[:, 0].copy()
        stimulus = np.ascontiguousarray(u[:, :, 0])
        request = Request(schedule, np.ascontiguousarray(p[:, 0]), stimulus, selection)
        engine.advance(request, column, 0, frames, values[0])
        vector[:, 0] = column

    return advance
