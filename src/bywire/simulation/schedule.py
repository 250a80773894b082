"""Steps, sample times and recording intervals: how they divide each other."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import StepError

_TOLERANCE = 1e-9


@dataclass(frozen=True)
class Schedule:
    """Integer plan of a run.

    A frame is the longest interval that divides all sample times and the recording interval; it
    is cut into ``substeps`` equal steps.

    Parameters
    ----------
    step
        Length of a substep [s].
    substeps
        Substeps per frame.
    frames
        Frames of the run.
    task_frames
        Frames per tick of each task, in the tasks' order.
    record_frames
        Frames per recorded row.
    """

    step: float
    substeps: int
    frames: int
    task_frames: tuple[int, ...]
    record_frames: int

    @property
    def stimulus_frames(self) -> int:
        """Frames per row of the stimulus: what divides the intervals of all tasks."""
        return math.gcd(*self.task_frames)

    @property
    def stimulus_rows(self) -> int:
        """Rows that the stimulus needs, the end included."""
        return self.frames // self.stimulus_frames + 1

    @property
    def rows(self) -> int:
        """Recorded rows, start and end included."""
        return self.frames // self.record_frames + 1

    @property
    def frame(self) -> float:
        """Length of a frame [s]."""
        return self.step * self.substeps

    @property
    def stimulus_times(self) -> NDArray[np.float64]:
        """Times of the stimulus' rows [s]."""
        interval = self.stimulus_frames * self.frame
        return np.arange(self.stimulus_rows, dtype=np.float64) * interval

    @property
    def record_times(self) -> NDArray[np.float64]:
        """Times of the recorded rows [s]."""
        return np.arange(self.rows, dtype=np.float64) * (self.record_frames * self.frame)


def plan(duration: float, step: float, periods: Mapping[str, float], record: float) -> Schedule:
    """Divide a run into frames.

    Parameters
    ----------
    duration
        Length of the run [s]; rounded up to a whole recording interval.
    step
        Substep [s].
    periods
        Sample time [s] of each task.
    record
        Recording interval [s].

    Raises
    ------
    StepError
        When the step does not divide a sample time or the recording interval.
    """
    if not (math.isfinite(step) and step > 0):
        raise StepError(f"step = {step:g} s is not admissible: it must be > 0 s, usually 20 us")
    if not (math.isfinite(duration) and duration > 0):
        raise StepError(f"duration = {duration:g} s is not admissible: it must be > 0 s")
    counts = {name: _whole(period, step, name) for name, period in periods.items()}
    recorded = _whole(record, step, "recording")
    frame = math.gcd(recorded, *counts.values())
    rows = math.ceil(duration / record - _TOLERANCE)
    return Schedule(
        step=step,
        substeps=frame,
        frames=rows * (recorded // frame),
        task_frames=tuple(count // frame for count in counts.values()),
        record_frames=recorded // frame,
    )


def _whole(period: float, step: float, name: str) -> int:
    count = round(period / step)
    if count < 1 or abs(count * step - period) > _TOLERANCE * period:
        raise StepError(
            f"step = {step * 1e6:g} us does not divide the {name} interval of {period * 1e6:g} us: "
            f"take for instance {_divisor(period, step):.12g} us"
        )
    return count


def _divisor(period: float, step: float) -> float:
    """Return a step [us] that divides a period, at most the given one and short to write."""
    least = max(math.ceil(period / step - _TOLERANCE), 1)
    for count in range(least, 8 * least + 8):
        candidate = period / count * 1e6
        if abs(candidate - round(candidate, 3)) <= 1e-12 * candidate:
            return round(candidate, 3)
    return period / least * 1e6
